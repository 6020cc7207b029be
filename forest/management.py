"""What people do to a stand between two years; what goes is noted for the record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.acts import acts_of
from forest.dynamics.snags import is_left
from forest.errors import InputError, nearest
from forest.record.schema import CAUSES
from forest.scenario.acts import Branches
from forest.trees import table
from forest.trees.pruning import choose_branches, cut_branches, find_cuts
from forest.yearbook import Event, Loss

if TYPE_CHECKING:
    import pandas as pd

    from forest.stand import Stand


def check_due(stand: Stand) -> None:
    """Refuse the scenario's acts of the next year if they cannot be done now."""
    acts_of(stand, stand.year + 1)


def act(stand: Stand, branch_pipe: NDArray[Any]) -> None:
    """Do the scenario's acts of the next year; see `forest.dynamics.acts.acts_of`."""
    due = acts_of(stand, stand.year + 1)
    cut(stand, due.cuts, branch_pipe)
    for tree_ids, cause in due.fellings:
        fell(stand, tree_ids, cause)
    for x, y, species in due.plantings:
        stand.plant(x, y, species)


def prune(
    stand: Stand,
    tree_id: int,
    metamer: int | Sequence[int] | None,
    branches: Mapping[str, float],
    branch_pipe: NDArray[Any],
) -> int:
    """Cut parts off one tree; see `forest.Stand.prune`."""
    row, arena = stand.row_of(tree_id), stand.arena.metamers
    if metamer is None:
        choice = Branches.of("Stand.prune", **branches)
        return cut(stand, {tree_id: choose_branches(arena, stand.rows, row, choice)}, branch_pipe)
    if branches:
        raise InputError(
            f"metamer and {min(branches)} exclude each other",
            where="Stand.prune",
            expected="one of them",
        )
    find_cuts(arena, stand.rows, row, metamer, where="Stand.prune")
    return cut(stand, {tree_id: np.atleast_1d(metamer)}, branch_pipe)


def cut(stand: Stand, cuts: Mapping[int, NDArray[Any]], branch_pipe: NDArray[Any]) -> int:
    """Cut trees at metamers that are there.

    Parameters
    ----------
    stand : Stand
    cuts : mapping of tree id to array of int
        Serial numbers of the lowest metamers that go; a tree with none is left alone.
    branch_pipe : array (species,)
        Thickness of a pipe along branches relative to the stem.

    Returns
    -------
    int
        Metamers removed.
    """
    cuts = {tree_id: serials for tree_id, serials in cuts.items() if len(serials)}
    if not cuts:
        return 0
    measures = stand.measure()  # once for all trees: it measures the whole stand
    removed = 0
    for tree_id, serials in cuts.items():
        row = stand.row_of(tree_id)
        kappa = float(branch_pipe[stand.rows.species[row]])
        gone = cut_branches(stand.arena, stand.rows, row, serials, kappa)
        stand.pending.append(Event.of(stand, row, "pruned", "none", measures))
        _note_loss(stand, row, gone)
        removed += len(gone)
    return removed


def fell(stand: Stand, tree_ids: Sequence[int], cause: str) -> None:
    """Fell trees; see `forest.Stand.fell`."""
    if cause not in CAUSES:
        raise InputError(f"unknown cause '{cause}', {nearest(cause, CAUSES)}", where="Stand.fell")
    rows = [stand.row_of(tree_id) for tree_id in tree_ids]
    take_out(stand, rows, "felled", cause)


def blow(stand: Stand, speed_m_s: float, direction_deg: float) -> list[int]:
    """Let a storm break and uproot trees between two years.

    Their events, and the rows of `/storms`, come with the next year's record.

    Parameters
    ----------
    stand : Stand
    speed_m_s : float
        Mean wind at the height of the canopy's top over open land, m/s.
    direction_deg : float
        Azimuth towards which it blows, from x towards y.

    Returns
    -------
    list of int
        Ids of the trees that fell.

    Raises
    ------
    InputError
        If there is no such storm.
    """
    fallen = stand.storms.blow(stand, speed_m_s, direction_deg)
    ids: list[int] = stand.rows.tree_id[fallen].tolist()
    take_out(stand, fallen.tolist(), "windthrown", "wind")
    return ids


def critical_wind(stand: Stand, direction_deg: float) -> pd.DataFrame:
    """Tell the storms of a direction that the trees would not withstand; none falls.

    Returns
    -------
    pandas.DataFrame
        A row per tree of at least `wind.from_height_m`, with the columns of `/storms` that need
        no storm.
    """
    import pandas as pd

    return pd.DataFrame(stand.storms.critical(stand, direction_deg))


def take_out(stand: Stand, rows: Sequence[int], kind: str, cause: str) -> None:
    """Take trees out of the table between two years, with an event each.

    Parameters
    ----------
    stand : Stand
    rows : sequence of int
        Rows of the table; one named twice goes once.
    kind, cause : str
        As in `/events`.
    """
    measures = stand.measure()
    if stand.regeneration is not None and kind == "felled":
        stand.regeneration.note_stumps(stand.rows, rows, measures)
    alive = np.ones(len(stand.rows.tree_id), np.bool_)
    if stand.dead_wood is not None and is_left(kind, cause):
        stand.dead_wood.leave(stand, list(dict.fromkeys(rows)), measures)
    for row in rows:
        if alive[row]:
            stand.pending.append(Event.of(stand, row, kind, cause, measures))
            start, size = int(stand.rows.start[row]), int(stand.rows.size[row])
            _note_loss(stand, row, stand.arena.metamers.serial[start : start + size])
        alive[row] = False
    stand.rows = table.keep(stand.rows, alive)


def _note_loss(stand: Stand, row: int, serials: NDArray[np.int32]) -> None:
    """Keep what a sample tree loses, for the year's record."""
    rows, tree_id = stand.rows, int(stand.rows.tree_id[row])
    if tree_id in stand.sample_ids:
        new = Loss(int(rows.species[row]), float(rows.x[row]), float(rows.y[row]), [])
        stand.losses.setdefault(tree_id, new).serials.extend(serials.tolist())
