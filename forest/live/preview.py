"""What a tree will look like when the acts that wait have been done."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from forest.management.plan import YearOfActs
from forest.trees.metamers import Arena
from forest.trees.pruning import cut_branches, still_there
from forest.trees.skeleton import Skeleton, skeleton_of
from forest.trees.table import Trees

if TYPE_CHECKING:
    from forest.stand import Stand


def one_tree(arena: Arena, trees: Trees, row: int) -> tuple[Arena, Trees]:
    """Copy one tree out of the arena and the table."""
    place = arena.alone(int(trees.start[row]), int(trees.size[row]))
    columns: list[Any] = [column[row : row + 1].copy() for column in trees]
    tree = Trees(*columns)
    tree.start[:] = 0
    tree.room[:] = tree.size
    return place, tree


def preview(stand: Stand, tree_id: int, plan: YearOfActs | None) -> Skeleton:
    """Give the shape of a living tree as a plan will leave it; the stand stays as it is."""
    row = stand.row_of(tree_id)
    place, tree = one_tree(stand.arena, stand.rows, row)
    kind = int(tree.species[0])
    for cuts in plan.prunings.values() if plan is not None else ():
        left = still_there(place.metamers, tree, 0, cuts.get(tree_id, ()))
        if len(left):
            cut_branches(place, tree, 0, left, 1.0)
    return skeleton_of(
        place.metamers,
        tree,
        0,
        species=stand.species_names[kind],
        pipe_exponent=float(stand.pipe_exponent[kind]),
        start_year=stand.scenario.start_year - 1,
    )
