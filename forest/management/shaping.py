"""Marks, obstacles that come and go, and branches that are bent: what they do to a stand."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from forest.environment.obstacles import Solid, solid_places
from forest.errors import InputError
from forest.mechanics.arranging import bend_axis
from forest.scenario.model import Obstacle
from forest.scenario.shaping import Bending
from forest.trees.metamers import Arena
from forest.trees.pruning import cut_branches, still_there
from forest.trees.table import Trees, have_grown, row_of

if TYPE_CHECKING:
    from forest.stand import Stand

Cuts = dict[int, NDArray[np.int32]]
_OBSTACLES: TypeAdapter[Any] = TypeAdapter(tuple[Obstacle, ...])


class Marks:
    """The words with which trees are marked; part of every checkpoint."""

    def __init__(self) -> None:
        self._of: dict[str, set[int]] = {}

    def put(self, word: str, tree_ids: Iterable[int]) -> None:
        """Mark trees."""
        self._of.setdefault(word, set()).update(tree_ids)

    def bearing(self, word: str) -> list[int]:
        """List the trees that bear a mark, those that are gone as well."""
        return sorted(self._of.get(word, ()))

    def of_tree(self, tree_id: int) -> list[str]:
        """List the marks of a tree."""
        return sorted(word for word, ids in self._of.items() if tree_id in ids)

    def state(self) -> dict[str, NDArray[Any]]:
        """Give all marks, for a checkpoint."""
        return {f"of_{word}": np.array(sorted(ids), np.int64) for word, ids in self._of.items()}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""
        start = "of_"
        self._of = {k[len(start) :]: set(v.tolist()) for k, v in arrays.items()}


class Obstacles:
    """The obstacles that stand now; part of every checkpoint.

    Attributes
    ----------
    now : tuple of Box or Mesh
        As a scenario says them.
    """

    def __init__(self, stand: Stand) -> None:
        self._stand = stand
        self.now: tuple[Obstacle, ...] = stand.scenario.obstacles

    def become(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Let these obstacles stand, in place of all that stood."""
        self.now = obstacles
        around = self._stand.surroundings
        around.build(obstacles)
        if self._stand.regeneration is not None and around.canopy is not None:
            self._stand.regeneration.move_under(around.canopy)

    def state(self) -> dict[str, NDArray[Any]]:
        """Give them as JSON, for a checkpoint; nothing if they are those of the scenario."""
        if self.now == self._stand.scenario.obstacles:
            return {}
        text = json.dumps([o.model_dump() for o in self.now])
        return {"json": np.frombuffer(text.encode(), np.uint8)}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""
        if "json" in arrays:
            self.become(_OBSTACLES.validate_json(arrays["json"].tobytes()))


class Change(NamedTuple):
    """Obstacles as they are after an act, and what it cuts off trees."""

    obstacles: tuple[Obstacle, ...]
    cuts: Cuts


def cuts_inside(stand: Stand, solid: Solid, standing: NDArray[np.bool_], *, where: str) -> Cuts:
    """Find the metamers of standing trees that would come to lie in obstacles.

    Raises
    ------
    InputError
        If a tree's foot lies there.
    """
    cuts: Cuts = {}
    if solid.mask.size == 1:
        return cuts
    rows, voxel_m = stand.rows, stand.surroundings.voxel_m
    for row in np.flatnonzero(standing & (rows.size > 0)).tolist():
        here = slice(int(rows.start[row]), int(rows.start[row]) + int(rows.size[row]))
        offset = rows.base_offset[row].astype(np.float64)
        tip = offset + stand.arena.metamers.tip[here]
        inside = solid_places(solid, rows.base_voxel[row], np.vstack((offset, tip)), voxel_m)
        if inside[:2].any():
            raise InputError(
                f"tree {rows.tree_id[row]} stands there",
                where=where,
                expected="a place without a stem, or the tree felled before",
            )
        if inside.any():
            cuts[int(rows.tree_id[row])] = stand.arena.metamers.serial[here][inside[1:]]
    return cuts


def one_tree(arena: Arena, trees: Trees, row: int) -> tuple[Arena, Trees]:
    """Copy one tree out of the arena and the table."""
    place = arena.alone(int(trees.start[row]), int(trees.size[row]))
    columns: list[Any] = [column[row : row + 1].copy() for column in trees]
    tree = Trees(*columns)
    tree.start[:] = 0
    tree.room[:] = tree.size
    return place, tree


def bend(
    stand: Stand, arena: Arena, trees: Trees, row: int, act: Bending, solid: Solid, where: str
) -> float:
    """Bend an axis of a tree; give the distance from the target that is left, m.

    Parameters
    ----------
    stand : Stand
        Where it stands.
    arena, trees, row : Arena, Trees, int
        The tree, or a copy of it; changed in place.
    act : Bending
    solid : Solid
        Voxels that obstacles fill.
    where : str
        Names a key of the act in messages.

    Raises
    ------
    InputError
        If there is no such metamer, or something would come to lie below the ground or in an
        obstacle.
    """
    kind = int(trees.species[row])
    here = slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))
    before = arena.metamers.tip[here].copy()
    left, moved = bend_axis(
        arena,
        trees,
        row,
        act.metamer,
        np.asarray(act.to_m, np.float64) - [trees.x[row], trees.y[row], 0.0],
        float(stand.pipe_exponent[kind]),
        bool(have_grown(trees, arena.metamers, stand.steps)[row]),
        where=where.format("metamer"),
    )
    tip = arena.metamers.tip[here]
    offset, voxel = trees.base_offset[row].astype(np.float64), trees.base_voxel[row]
    voxel_m = stand.surroundings.voxel_m

    def inside(places: NDArray[np.float32]) -> NDArray[np.bool_]:
        return solid_places(solid, voxel, offset + places, voxel_m)

    sunk = moved & (tip[:, 2] < 0.0) & (before[:, 2] >= 0.0)
    stuck = moved & inside(tip) & ~inside(before)
    if sunk.any() or stuck.any():
        what = "below the ground" if sunk.any() else "in an obstacle"
        raise InputError(
            f"a part of tree {trees.tree_id[row]} would come to lie {what}",
            where=where.format("to_m"),
            expected="a place that keeps the branch and all that it carries out of it",
        )
    return left


def shape_to_come(
    stand: Stand,
    tree_id: int,
    cuts: Sequence[Mapping[int, NDArray[np.int32]]],
    bendings: Sequence[tuple[Bending, str]],
    solid: Solid,
) -> tuple[Arena, Trees]:
    """Give a copy of a tree as cuts and then bendings leave it; raises as `bend` does.

    A metamer that the cuts take is not bent.
    """
    row = row_of(stand.rows, tree_id, where="Stand")
    place, tree = one_tree(stand.arena, stand.rows, row)
    for each in cuts:
        left = still_there(place.metamers, tree, 0, each.get(tree_id, ()))
        if len(left):
            cut_branches(place, tree, 0, left, 1.0)
    for act, where in bendings:
        was_there = len(still_there(stand.arena.metamers, stand.rows, row, [act.metamer]))
        if not was_there or len(still_there(place.metamers, tree, 0, [act.metamer])):
            bend(stand, place, tree, 0, act, solid, where)
    return place, tree
