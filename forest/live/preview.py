"""What a tree will look like when the acts that wait have been done."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forest.management.plan import YearOfActs
from forest.management.shaping import one_tree
from forest.trees.skeleton import Skeleton, skeleton_of

if TYPE_CHECKING:
    from forest.stand import Stand


def preview(stand: Stand, tree_id: int, plan: YearOfActs | None) -> Skeleton:
    """Give the shape of a living tree as a plan will leave it; the stand stays as it is."""
    if plan is None:
        place, tree = one_tree(stand.arena, stand.rows, stand.row_of(tree_id))
    else:
        place, tree = plan.shape_of(stand, tree_id)
    kind = int(tree.species[0])
    return skeleton_of(
        place.metamers,
        tree,
        0,
        species=stand.species_names[kind],
        pipe_exponent=float(stand.pipe_exponent[kind]),
        start_year=stand.scenario.start_year - 1,
    )
