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


def check_leans(
    n: int, lean_deg: float | Sequence[float], azimuth_deg: float | Sequence[float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the angles of n stems, or refuse them; one may stand for all.

    Raises
    ------
    InputError
        If there are not as many as trees, or one is out of range.
    """
    angles = []
    for key, value, low, high in (
        ("lean_deg", lean_deg, 0.0, 85.0),
        ("lean_azimuth_deg", azimuth_deg, -360.0, 360.0),
    ):
        angle = np.asarray(value, np.float64)
        if angle.shape not in ((), (n,)) or not ((angle >= low) & (angle <= high)).all():
            raise InputError(
                f"{key} = {value}",
                where="Stand.plant",
                expected=f"{low:g} to {high:g} degrees, one for all trees or one for each",
            )
        angles.append(np.broadcast_to(angle, n))
    return angles[0], angles[1]


def headings(
    lean_deg: NDArray[np.float64], azimuth_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Give the directions of stems that lean.

    Parameters
    ----------
    lean_deg : float64 (n,)
        Angle to the vertical.
    azimuth_deg : float64 (n,)
        Direction towards which they lean, from x to y.

    Returns
    -------
    float64 (n, 3)
        Unit vectors.
    """
    lean, azimuth = np.radians(lean_deg), np.radians(azimuth_deg)
    side = np.sin(lean)
    return np.stack((side * np.cos(azimuth), side * np.sin(azimuth), np.cos(lean)), axis=1)


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
