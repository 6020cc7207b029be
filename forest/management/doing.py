"""Acts are done: branches and trees go, trees come; events, losses and treatments are noted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest import establishment
from forest.dynamics.snags import is_left
from forest.errors import InputError, nearest
from forest.management import shaping
from forest.management.brushing import Drawn
from forest.management.plan import Felling, Marked, Places, plan_year
from forest.management.shaping import Change
from forest.management.treatments import stand_now
from forest.measure.trees import TreeMeasures
from forest.record.schema import CAUSES
from forest.scenario.shaping import Bending
from forest.trees import table
from forest.trees.pruning import cut_branches, still_there
from forest.yearbook import Event, Loss

if TYPE_CHECKING:
    from forest.growth.parameters import SpeciesTraits
    from forest.stand import Stand


def check_due(stand: Stand) -> None:
    """Refuse the scenario's acts of the next year if they cannot be done now."""
    plan_year(stand, stand.year + 1)


def act(stand: Stand, traits: SpeciesTraits) -> None:
    """Do the scenario's acts of the next year; see `forest.management.plan.plan_year`."""
    plan = plan_year(stand, stand.year + 1)
    if plan is None:
        return
    for number in plan.triggers:
        stand.treatments.fire(number, stand.year + 1)
    measures, kappa = plan.measures, traits.of["branch_pipe"]
    for number, marked in plan.markings.items():
        mark(stand, number, marked, measures)
    for number, change in plan.changes.items():
        measures = change_obstacle(stand, number, change, kappa, measures)
    for number, cuts in plan.prunings.items():
        measures, _ = cut(stand, number, cuts, kappa, measures)
    for number, bending in plan.bendings.items():
        measures, _ = bend(stand, number, bending, measures)
    for number, tree_id in plan.cracks.items():
        crack(stand, number, tree_id, measures)
    for number, felling in plan.fellings.items():
        measures = fell(stand, number, felling, measures)
    for number, places in plan.plantings.items():
        measures, _ = plant(stand, number, places, (0.0, 0.0), traits, measures)
    for number, drawn in plan.strokes.items():
        stroke(stand, number, drawn, measures)


def cut(
    stand: Stand,
    act: int,
    cuts: Mapping[int, NDArray[Any]],
    branch_pipe: NDArray[Any],
    measures: TreeMeasures,
    kind: str = "prune",
) -> tuple[TreeMeasures, int]:
    """Cut trees at metamers that are there, or were until an act of the same year.

    Parameters
    ----------
    stand : Stand
    act : int
        Number of the act in the scenario, or `BY_HAND`.
    cuts : mapping of tree id to array of int
        Serial numbers of the lowest metamers that go.
    branch_pipe : array (species,)
        Thickness of a pipe along branches relative to the stem.
    measures : TreeMeasures
        Of the stand as it is.
    kind : str
        Of the act.

    Returns
    -------
    TreeMeasures
        Of the stand that is left.
    int
        Metamers removed.
    """
    before = after = stand_now(stand, measures)
    removed = 0
    for tree_id, serials in cuts.items():
        row = stand.row_of(tree_id)
        left = still_there(stand.arena.metamers, stand.rows, row, serials)
        if not len(left):
            continue
        kappa = float(branch_pipe[stand.rows.species[row]])
        gone = cut_branches(stand.arena, stand.rows, row, left, kappa)
        stand.pending.append(Event.of(stand, row, "pruned", "none", measures))
        _note_loss(stand, row, gone)
        removed += len(gone)
    if removed:
        measures = stand.measure()
        after = stand_now(stand, measures)
    stand.treatments.note(act, kind, before, after)
    return measures, removed


def mark(stand: Stand, act: int, marked: Marked, measures: TreeMeasures) -> None:
    """Mark trees that live, with an event each; see `cut` for parameters."""
    stand.marks.put(marked.word, marked.tree_ids)
    for tree_id in marked.tree_ids:
        stand.pending.append(Event.of(stand, stand.row_of(tree_id), "marked", "none", measures))
    here = stand_now(stand, measures)
    stand.treatments.note(act, "mark", here, here)


def change_obstacle(
    stand: Stand, act: int, change: Change, branch_pipe: NDArray[Any], measures: TreeMeasures
) -> TreeMeasures:
    """Let obstacles come, move or go, and cut off what is in their way; see `cut`."""
    stand.obstacles.become(change.obstacles)
    return cut(stand, act, change.cuts, branch_pipe, measures, "obstacle")[0]


def bend(
    stand: Stand, act: int, bending: Bending, measures: TreeMeasures, where: str = "acts[].{}"
) -> tuple[TreeMeasures, float]:
    """Bend an axis of a tree, if the metamer was not cut in the same year.

    See `cut` for parameters; gives the distance from the target that is left, m, as well.
    """
    row = stand.row_of(bending.tree_id)
    before = after = stand_now(stand, measures)
    left = float("nan")
    if len(still_there(stand.arena.metamers, stand.rows, row, [bending.metamer])):
        solid = stand.surroundings.solid
        left = shaping.bend(stand, stand.arena, stand.rows, row, bending, solid, where)
        stand.pending.append(Event.of(stand, row, "bent", "none", measures))
        measures = stand.measure()
        after = stand_now(stand, measures)
    stand.treatments.note(act, "bend", before, after)
    return measures, left


def crack(stand: Stand, act: int, tree_id: int, measures: TreeMeasures) -> None:
    """Note that a tree's bark is torn, which whoever draws its bark does; see `cut`."""
    stand.pending.append(Event.of(stand, stand.row_of(tree_id), "cracked", "none", measures))
    here = stand_now(stand, measures)
    stand.treatments.note(act, "crack", here, here)


def fell(stand: Stand, act: int, felling: Felling, measures: TreeMeasures) -> TreeMeasures:
    """Fell trees that live; see `cut` for parameters and result."""
    alive = np.ones(len(stand.rows.tree_id), np.bool_)
    rows = np.searchsorted(stand.rows.tree_id, felling.tree_ids)
    alive[rows] = False
    before = stand_now(stand, measures)
    after = stand_now(stand, measures, alive, rows)
    if stand.regeneration is not None:
        stand.regeneration.note_stumps(stand.rows, rows.tolist(), measures)
    left = take_out(stand, rows, "felled", felling.cause, measures)
    for name in felling.residual:
        stand.residual.fell(stand.residual.row_of(name, "fell"), stand.steps + 1)
    stand.treatments.note(act, felling.kind, before, after)
    return left


def take_out(
    stand: Stand, rows: NDArray[np.int64], kind: str, cause: str, measures: TreeMeasures
) -> TreeMeasures:
    """Take trees out of the table between two years, with an event each.

    Parameters
    ----------
    stand : Stand
    rows : int64 array
        Rows of the table, each once.
    kind, cause : str
        As in `/events`.
    measures : TreeMeasures
        Of all living trees.

    Returns
    -------
    TreeMeasures
        Of those that are left.
    """
    alive = np.ones(len(stand.rows.tree_id), np.bool_)
    alive[rows] = False
    if stand.dead_wood is not None and is_left(kind, cause):
        stand.dead_wood.leave(stand, rows.tolist(), measures)
    for row in rows.tolist():
        stand.pending.append(Event.of(stand, row, kind, cause, measures))
        start, size = int(stand.rows.start[row]), int(stand.rows.size[row])
        _note_loss(stand, row, stand.arena.metamers.serial[start : start + size])
    stand.rows = table.keep(stand.rows, alive)
    left: dict[str, Any] = {name: column[alive] for name, column in measures._asdict().items()}
    return TreeMeasures(**left)


def plant(
    stand: Stand,
    act: int,
    places: Places,
    leans: tuple[float | Sequence[float], float | Sequence[float]],
    traits: SpeciesTraits,
    measures: TreeMeasures,
) -> tuple[TreeMeasures, list[int]]:
    """Plant seedlings; see `cut` for parameters and result, with their ids."""
    before = after = stand_now(stand, measures)
    ids: list[int] = []
    if len(places.x):
        ids = establishment.plant(stand, *places, *leans, traits)
        measures = stand.measure()
        after = stand_now(stand, measures)
    stand.treatments.note(act, "plant", before, after)
    return measures, ids


def stroke(stand: Stand, act: int, drawn: Drawn, measures: TreeMeasures) -> int:
    """Lay a stroke, see `cut` for parameters; give its number."""
    number = stand.brush.lay(stand, drawn)
    here = stand_now(stand, measures)
    stand.treatments.note(act, "stroke", here, here)
    return number


def felling_by_hand(stand: Stand, tree_ids: Sequence[int], cause: str) -> Felling:
    """Check trees and cause that were given in Python."""
    if cause not in CAUSES:
        raise InputError(f"unknown cause '{cause}', {nearest(cause, CAUSES)}", where="Stand.fell")
    ids = whole_ids(tree_ids, "Stand.fell")
    for tree_id in ids:
        table.row_of(stand.rows, tree_id, where="Stand.fell")
    return Felling("fell", list(dict.fromkeys(ids)), cause)


def whole_ids(tree_ids: Iterable[int], where: str) -> list[int]:
    """Check a list of tree ids that was given in Python; `where` names it in messages."""
    if isinstance(tree_ids, str) or not isinstance(tree_ids, Iterable):
        raise InputError(
            f"{tree_ids!r} is no list", where=where, expected="a list of ids of living trees"
        )
    ids = list(tree_ids)
    for one in ids:
        if not isinstance(one, int | np.integer) or isinstance(one, bool):
            raise InputError(
                f"{one!r} is no tree id", where=where, expected="whole numbers, as stand.trees has"
            )
    return [int(one) for one in ids]


def _note_loss(stand: Stand, row: int, serials: NDArray[np.int32]) -> None:
    """Keep what a sample tree loses, for the year's record."""
    rows, tree_id = stand.rows, int(stand.rows.tree_id[row])
    if tree_id in stand.sample_ids:
        new = Loss(int(rows.species[row]), float(rows.x[row]), float(rows.y[row]), [])
        stand.losses.setdefault(tree_id, new).serials.extend(serials.tolist())
