"""The procedural brush in plain Python, straight from Palubicki et al. 2009, section 5."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tests.reference.markers import Point, philox

STREAM_BRUSH = 35
PER_METRE = 2**20


def marker_of_cell(seed: int, number: int, cell: Sequence[int], spacing: float) -> Point:
    """The one marker of a cell of a stroke's grid, on whole multiples of 2^-20 m."""
    key = philox((number, number >> 32, 0, STREAM_BRUSH), (seed, seed >> 32))[:2]
    words = philox((*cell, STREAM_BRUSH), key)[:3]
    x, y, z = (
        math.floor((i + (w + 0.5) / 2**32) * spacing * PER_METRE + 0.5) / PER_METRE
        for i, w in zip(cell, words, strict=True)
    )
    return (x, y, z)


def distance_beyond(point: Point, path: Sequence[Point], radius: Sequence[float], n: int) -> float:
    """How far a point lies outside of many spheres along the path, n on each line; inside < 0."""
    path, radius = [*path, path[-1]], [*radius, radius[-1]]
    spheres = []
    for s in range(len(path) - 1):
        for k in range(n + 1):
            t = k / n
            centre = [p + t * (q - p) for p, q in zip(path[s], path[s + 1], strict=True)]
            wide = radius[s] + t * (radius[s + 1] - radius[s])
            spheres.append(math.dist(point, centre) - wide)
    return min(spheres)


def dormant(buds: Sequence[dict], parents: Sequence[int], main: Sequence[bool], serials, hold):
    """Tell of each bud of one tree whether it is dormant: walk down until the held metamer."""
    serial, bud = hold
    answer = []
    for one in buds:
        here, came_by = one["metamer"], {0: "terminal", 1: "lateral"}[one["kind"]]
        free = False
        while here >= 0:
            if serials[here] == serial:
                free = bud in (None, came_by)
                break
            came_by = "terminal" if main[here] else "lateral"
            here = parents[here]
        answer.append(not free)
    return answer
