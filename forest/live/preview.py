"""What a tree will look like when the acts that wait have been done."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.management.brushing import markers_of, outside
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


def markers_to_come(stand: Stand, plan: YearOfActs | None) -> NDArray[np.float64]:
    """Give the places of all markers that the strokes of a plan lay, float64 (n, 3), m."""
    found = [np.zeros((0, 3))]
    spec, around = stand.scenario.environment.markers, stand.surroundings
    if plan is not None and spec is not None:
        number = len(stand.strokes) + 1
        for k, drawn in enumerate(plan.strokes.values()):
            points, _ = markers_of(drawn, spec.spacing_m, stand.scenario.seed, number + k)
            found.append(points[outside(around.solid, points, around.voxel_m)])
    return np.concatenate(found)
