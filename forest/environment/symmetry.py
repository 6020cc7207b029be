"""Symmetric brushes: positions multiplied in space (Palubicki et al. 2009, section 5, Fig. 17).

Markers lie on whole multiples of 2^-20 m, and so do centres and shifts once they are rounded. What
is made of them by sign, exchange of x and y, and addition is therefore exact, and the set of
markers is its own image, number by number, under

* a mirror whose normal points along x, along y, or between them (multiples of 45 degrees);
* quarter turns where the rotation is by a number that 4 divides, half turns where it is even;
* the shifts of a tiling, inside it.

Under other turns and mirrors every marker has its image to within two micrometres. Ground is
symmetric; obstacles, and the edges of a periodic plot, need not be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from forest.environment.brush import first_of_each, on_grid

Places = NDArray[np.float64]
_EIGHTH = 45.0


def mirror(points: Places, x_m: float, y_m: float, normal_deg: float) -> Places:
    """Reflect points at the upright plane through a place whose normal has an azimuth."""
    cx, cy = on_grid(np.array([x_m, y_m]))
    dx, dy = points[:, 0] - cx, points[:, 1] - cy
    eighths = (normal_deg / _EIGHTH) % 4.0
    if eighths == 0.0:
        dx = -dx
    elif eighths == 1.0:
        dx, dy = -dy, -dx
    elif eighths == 2.0:
        dy = -dy
    elif eighths == 3.0:
        dx, dy = dy, dx
    else:
        angle = 2.0 * math.radians(normal_deg)
        c, s = math.cos(angle), math.sin(angle)
        dx, dy = on_grid(-c * dx - s * dy), on_grid(-s * dx + c * dy)
    return np.column_stack((cx + dx, cy + dy, points[:, 2]))


def turn(points: Places, x_m: float, y_m: float, times: int, k: int) -> Places:
    """Turn points by k of `times` equal parts of a full turn about an upright axis.

    Quarter and half turns are taken out of the angle and done exactly.
    """
    exact = 4 if times % 4 == 0 else 2 if times % 2 == 0 else 1
    big, rest = divmod(k, times // exact)
    quarters = big * 4 // exact
    cx, cy = on_grid(np.array([x_m, y_m]))
    dx, dy = points[:, 0] - cx, points[:, 1] - cy
    if rest:
        angle = 2.0 * math.pi * rest / times
        c, s = math.cos(angle), math.sin(angle)
        dx, dy = on_grid(c * dx - s * dy), on_grid(s * dx + c * dy)
    for _ in range(quarters):
        dx, dy = -dy, dx
    return np.column_stack((cx + dx, cy + dy, points[:, 2]))


def shifts_of(shifts_m: Sequence[Sequence[float]], counts: Sequence[int]) -> Places:
    """List the shifts of a tiling: all sums of 0 to count - 1 times each vector; (copies, 3)."""
    vectors = on_grid(np.array(shifts_m, np.float64).reshape(-1, 3))
    steps = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), -1)
    return np.asarray(steps.reshape(-1, len(counts)).astype(np.float64) @ vectors, np.float64)


def unite(copies: Sequence[Places], part: NDArray[np.int64]) -> tuple[Places, NDArray[np.int64]]:
    """Put copies into one set: of markers on the same place the one laid first stays.

    Parameters
    ----------
    copies : sequence of float64 (n, 3)
    part : int64 (n,)
        When each marker is laid, the same in all copies.
    """
    points, parts = np.concatenate(copies), np.tile(part, len(copies))
    order = np.argsort(parts, kind="stable")
    points, parts = points[order], parts[order]
    kept = first_of_each(points)
    return points[kept], parts[kept]
