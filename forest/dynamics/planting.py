"""New trees: whether they can be planted, and their rows of the tree table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.random import STREAM_VIGOUR, normals
from forest.trees.table import Trees, empty

#: Vigour is drawn from a normal distribution cut at this many standard deviations.
_CUT = 2.5


def seedlings(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    species: NDArray[Any],
    *,
    first_id: int,
    step: int,
    seed: int,
    voxel_m: float,
    vigour_sd: NDArray[np.float64],
    seed_reserve_kg: NDArray[np.float64],
) -> Trees:
    """Make table rows of seedlings that have no metamer yet.

    Parameters
    ----------
    x, y : float64 (n,)
        Places, m.
    species : int (n,)
        Indices into the scenario's species.
    first_id : int
        Number of the first tree; the others follow.
    step : int
        Step in which they start.
    seed : int
        Seed of the scenario.
    voxel_m : float
        Edge of the near-field voxels, m.
    vigour_sd, seed_reserve_kg : float64 (species,)
        Spread of the lasting vigour between trees; reserve of a seedling, kg.
    """
    n = len(x)
    trees = empty(n)
    trees.tree_id[:] = np.arange(first_id, first_id + n)
    trees.species[:] = species
    trees.x[:] = x
    trees.y[:] = y
    trees.birth[:] = step
    trees.breast_serial[:] = -1
    trees.disc_serial[:] = -1
    for axis, place in enumerate((x, y)):
        voxel = np.floor(np.asarray(place) / voxel_m)
        trees.base_voxel[:, axis] = voxel
        trees.base_offset[:, axis] = place - voxel * voxel_m
    trees.reserve[:] = seed_reserve_kg[trees.species]
    for row in range(n):
        draw, _ = normals(seed, STREAM_VIGOUR, int(trees.tree_id[row]), 0, 0)
        cut = min(max(float(draw), -_CUT), _CUT)
        trees.vigour[row] = 1.0 + vigour_sd[trees.species[row]] * cut
    return trees


def check_planting(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    names: Sequence[str],
    size_m: tuple[float, float],
    known: Sequence[str],
) -> None:
    """Refuse trees that cannot be planted: outside the plot, or of an unknown species."""
    if not len(x) == len(y) == len(names):
        raise InputError(
            f"{len(x)} x, {len(y)} y and {len(names)} species",
            where="Stand.plant",
            expected="as many of each",
        )
    for name in names:
        if name not in known:
            raise InputError(
                f"species '{name}' is not in this stand",
                where="Stand.plant",
                expected="one of " + ", ".join(known),
            )
    width, depth = size_m
    inside = (x >= 0) & (x <= width) & (y >= 0) & (y <= depth)
    if not inside.all():
        k = int(np.flatnonzero(~inside)[0])
        raise InputError(
            f"({x[k]}, {y[k]}) is outside the plot",
            where="Stand.plant",
            expected=f"0 to {width} and 0 to {depth} m",
        )
