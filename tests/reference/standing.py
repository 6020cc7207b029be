"""What standing trees shade and take, leaf by leaf and point by point, in plain Python."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np

from tests.reference.shadow import Voxel


def leaves_by_voxel(place: np.ndarray, area: np.ndarray, voxel_m: float) -> dict[Voxel, float]:
    """Leaf area of each near-field voxel, m2."""
    found: dict[Voxel, float] = defaultdict(float)
    for (x, y, z), one in zip(place, area, strict=True):
        found[(math.floor(x / voxel_m), math.floor(y / voxel_m), math.floor(z / voxel_m))] += one
    return found


def shade_sources(leaves: dict[Voxel, float], buds_per_m2: float) -> list[tuple[Voxel, float]]:
    """What each voxel's leaves weigh beside a bud of shade factor 1, kept to 1/16."""
    return [(voxel, round(16.0 * area * buds_per_m2) / 16.0) for voxel, area in leaves.items()]


def points_along(start: np.ndarray, end: np.ndarray, half: float) -> list[np.ndarray]:
    """Points along internodes, no farther apart than `half`, their upper ends included."""
    points = []
    for a, b in zip(start, end, strict=True):
        pieces = max(math.ceil(float(np.linalg.norm(b - a)) / half), 1)
        points += [a + (k + 1) / pieces * (b - a) for k in range(pieces)]
    return points
