"""The procedural brush in a stand: strokes are laid, and while they last they hold trees.

Palubicki et al. 2009, section 5. A stroke lays markers in parts, one before each of its steps; with
a metamer it lets only the buds of that metamer, and what comes of them, grow while it lasts, and
the tree sheds nothing then: the form of the rest is to be preserved.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.environment.brush import cut_path, lay_markers
from forest.environment.dormant import (
    BOTH,
    LATERAL_ALONE,
    TERMINAL_ALONE,
    Hold,
    find_metamer,
)
from forest.environment.obstacles import Solid, solid_places
from forest.environment.symmetry import mirror, shifts_of, turn, unite
from forest.errors import InputError
from forest.scenario.strokes import Stroking, check_stroke
from forest.species.schema import Refusal
from forest.species.text import input_error
from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, TERMINAL, Arena
from forest.trees.table import Trees, row_of

if TYPE_CHECKING:
    from forest.stand import Stand

_NO_TREE = -1


class Drawn(NamedTuple):
    """A stroke as it is drawn in a stand.

    Attributes
    ----------
    stroke : Stroking
    path : float64 (n, 3)
        Places of the brush, m, the one at its first metamer included.
    radius : float64 (n,)
        Its radius there, m.
    hold : Hold or None
        What grows alone while it lasts.
    """

    stroke: Stroking
    path: NDArray[np.float64]
    radius: NDArray[np.float64]
    hold: Hold | None


class _Record(NamedTuple):
    """A stroke that was laid; `end` is the number of markers of all strokes up to it."""

    first_step: int
    steps: int
    hold_steps: int
    tree_id: int
    metamer: int
    bud: int
    end: int


def draw(stroke: Stroking, stand: Stand, arena: Arena, trees: Trees, where: str) -> Drawn:
    """Find where a stroke runs and what it holds; changes nothing.

    Parameters
    ----------
    stroke : Stroking
    stand : Stand
    arena, trees : Arena, Trees
        Where its tree is, as it is before the stroke.
    where : str
        Names a key of it in messages.

    Raises
    ------
    InputError
        If there is no such tree, metamer or bud, or if it would lay too many markers.
    """
    path = np.array(stroke.points_m, np.float64).reshape(-1, 3)
    hold = None
    if stroke.tree_id is not None:
        row = row_of(trees, stroke.tree_id, where=where.format("tree_id"))
        if stroke.from_metamer is not None:
            k = _metamer(stroke, "from_metamer", arena, trees, row, where)
            foot = np.array([trees.x[row], trees.y[row], 0.0])
            tip = arena.metamers.tip[k].astype(np.float64)
            path = np.concatenate(((foot + tip)[None], path))
        if stroke.metamer is not None:
            k = _metamer(stroke, "metamer", arena, trees, row, where)
            hold = _hold(stroke, int(arena.metamers.state[k]), where)
    radius = np.array(stroke.radius_m)
    if len(radius) == 1:
        radius = np.repeat(radius, len(path))
    elif len(radius) < len(path):
        radius = np.concatenate((radius[:1], radius))
    try:
        whole = [(x, y, z) for x, y, z in path.tolist()]
        check_stroke(stroke, "", stand.scenario.environment, stand.scenario.plot, whole)
    except Refusal as refused:
        place = where.format(refused.key)
        raise input_error(refused.what, where=place, expected=refused.expected) from None
    return Drawn(stroke, path, radius, hold)


def _metamer(stroke: Stroking, key: str, arena: Arena, trees: Trees, row: int, where: str) -> int:
    """Give the place in the arena of the metamer that a key names."""
    serial = getattr(stroke, key)
    place = find_metamer(arena.metamers, trees, row, serial)
    if place < 0:
        raise InputError(
            f"tree {stroke.tree_id} has no metamer {serial}",
            where=where.format(key),
            expected="a serial number of the tree's skeleton",
        )
    return int(trees.start[row]) + place


def _hold(stroke: Stroking, state: int, where: str) -> Hold:
    assert stroke.tree_id is not None and stroke.metamer is not None
    if stroke.bud is None:
        return Hold(stroke.tree_id, stroke.metamer, BOTH)
    terminal = stroke.bud == "terminal"
    if not state & int((TERMINAL | CONTINUED) if terminal else (LATERAL | BRANCHED)):
        other = "lateral" if terminal else "terminal"
        raise InputError(
            f"metamer {stroke.metamer} has no {stroke.bud} bud",
            where=where.format("bud"),
            expected=f"{other}, or a metamer with a living {stroke.bud} bud",
        )
    alone = TERMINAL_ALONE if terminal else LATERAL_ALONE
    return Hold(stroke.tree_id, stroke.metamer, alone)


def markers_of(
    drawn: Drawn, spacing_m: float, seed: int, number: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give the markers of a stroke with all its copies, and the part that lays each.

    Parameters
    ----------
    drawn : Drawn
    spacing_m : float
        Edge of a cell where the stroke does not say.
    seed, number : int
        Seed of the run, and number of the stroke in it.
    """
    stroke = drawn.stroke
    cell = stroke.cell_m(spacing_m)
    points, part = lay_markers(
        cut_path(drawn.path, drawn.radius, stroke.steps, cell), cell, seed, number
    )
    if stroke.copies == 1:
        return points, part
    if stroke.mirror is not None:
        m = stroke.mirror
        points, part = unite([points, mirror(points, m.x_m, m.y_m, m.normal_deg)], part)
    if stroke.rotation is not None:
        r = stroke.rotation
        turned = [turn(points, r.x_m, r.y_m, r.times, k) for k in range(r.times)]
        points, part = unite(turned, part)
    if stroke.tiling is not None:
        shifts = shifts_of(stroke.tiling.shifts_m, stroke.tiling.counts)
        points, part = unite([points + shift for shift in shifts], part)
    return points, part


def outside(solid: Solid, points: NDArray[np.float64], voxel_m: float) -> NDArray[np.bool_]:
    """Tell which points lie above the ground and in no obstacle."""
    no_voxel = np.zeros(3, np.int64)
    free: NDArray[np.bool_] = points[:, 2] >= 0.0
    return free & ~solid_places(solid, no_voxel, points, voxel_m)


class Brush:
    """The strokes of a stand so far; part of every checkpoint."""

    def __init__(self) -> None:
        self._records: list[_Record] = []

    def lay(self, stand: Stand, drawn: Drawn) -> int:
        """Lay a stroke whose first step is the stand's next; give its number, from 1."""
        spec, around = stand.scenario.environment.markers, stand.surroundings
        assert spec is not None and around.markers is not None
        number, first = len(self._records) + 1, stand.steps + 1
        points, part = markers_of(drawn, spec.spacing_m, stand.scenario.seed, number)
        free = outside(around.solid, points, around.voxel_m)
        around.markers.lay(points[free], (first + part[free]).astype(np.int32))
        stroke, hold = drawn.stroke, drawn.hold or Hold(_NO_TREE, 0)
        end = (self._records[-1].end if self._records else 0) + int(free.sum())
        record = _Record(first, stroke.steps, stroke.hold_steps, *hold, end)
        self._records.append(record)
        return number

    def holds(self, stand: Stand) -> list[Hold]:
        """List what alone may grow of trees in the current step.

        A stroke whose tree or metamer is gone holds nothing.
        """
        found = []
        for r in self._records:
            if r.tree_id == _NO_TREE:
                continue
            if not r.first_step <= stand.steps < r.first_step + r.steps + r.hold_steps:
                continue
            row = int(np.searchsorted(stand.rows.tree_id, r.tree_id))
            if row == len(stand.rows.tree_id) or stand.rows.tree_id[row] != r.tree_id:
                continue
            if find_metamer(stand.arena.metamers, stand.rows, row, r.metamer) >= 0:
                found.append(Hold(r.tree_id, r.metamer, r.bud))
        return found

    def columns(self, stand: Stand) -> dict[str, Any]:
        """Tell of each stroke when it was laid, what it holds and what became of its markers.

        `markers` counts those of all its parts, `laid` those of the parts so far, `colonised` the
        laid ones that are taken for good: they lay in the occupancy zone of a bud. Where markers
        are released nothing is taken for good, and counted are those that lie in one now.
        """
        space, start = stand.surroundings.markers, stand.scenario.start_year
        rows = self._records
        columns: dict[str, Any] = {
            "stroke": np.arange(1, len(rows) + 1),
            "year": [start + r.first_step - 1 for r in rows],
            "steps": [r.steps for r in rows],
            "hold_steps": [r.hold_steps for r in rows],
            "tree_id": [r.tree_id for r in rows],
            "metamer": [r.metamer if r.tree_id != _NO_TREE else -1 for r in rows],
        }
        ends = [0, *(r.end for r in rows)]
        spans = [slice(a, b) for a, b in pairwise(ends)]
        columns["markers"] = [span.stop - span.start for span in spans]
        columns["laid"] = columns["colonised"] = []
        if space is not None:
            laid = space.laid
            there = laid.due <= stand.steps
            taken = laid.gone
            if space.release:
                taken = there & stand.surroundings.occupied(
                    laid.point, stand.arena.metamers, stand.rows
                )
            columns["laid"] = [int(there[span].sum()) for span in spans]
            columns["colonised"] = [int(taken[span].sum()) for span in spans]
        return columns

    def state(self) -> dict[str, NDArray[Any]]:
        """Give all that it remembers, for a checkpoint."""
        return {"records": np.array(self._records, np.int64).reshape(-1, len(_Record._fields))}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take back what `state` gave; files of before there were strokes have nothing."""
        records = arrays.get("records")
        self._records = [] if records is None else [_Record(*row) for row in records.tolist()]
