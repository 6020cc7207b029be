"""Which trees stand inside a shape on the plot."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.measure.stand import Plot
from forest.scenario.regions import reach_m

if TYPE_CHECKING:
    from forest.scenario.regions import Region

Points = NDArray[np.float64]


def inside(region: Region, x: Points, y: Points, plot: Plot) -> NDArray[np.bool_]:
    """Tell which places lie inside a region or on its edge.

    On a periodic plot whatever of it leaves at one edge comes in at the opposite one; a strip goes
    once across.

    Parameters
    ----------
    region : Region
        A shape of a scenario.
    x, y : float64 (n,)
        Places on the plot, m.
    plot : Plot

    Returns
    -------
    bool (n,)
    """
    if not plot.periodic:
        return _holds(region, x, y)
    width, depth = plot.size_m
    if region.kind == "strip":
        dx = (x - region.x_m + 0.5 * width) % width - 0.5 * width
        dy = (y - region.y_m + 0.5 * depth) % depth - 0.5 * depth
        return _holds(region, region.x_m + dx, region.y_m + dy)
    found = np.zeros(len(x), np.bool_)
    low_x, low_y, high_x, high_y = reach_m(region)
    for i in range(math.floor(low_x / width), math.ceil(high_x / width)):
        for j in range(math.floor(low_y / depth), math.ceil(high_y / depth)):
            found |= _holds(region, x + i * width, y + j * depth)
    return found


def _holds(region: Region, x: Points, y: Points) -> NDArray[np.bool_]:
    if region.kind == "polygon":
        return _in_polygon(np.array(region.points_m, np.float64), x, y)
    dx, dy = x - region.x_m, y - region.y_m
    if region.kind == "circle":
        return np.asarray(dx * dx + dy * dy <= region.radius_m**2)
    azimuth = math.radians(region.azimuth_deg)
    along = dx * math.cos(azimuth) + dy * math.sin(azimuth)
    across = dy * math.cos(azimuth) - dx * math.sin(azimuth)
    if region.kind == "strip":
        return np.asarray(np.abs(across) <= 0.5 * region.width_m)
    first, second = 0.5 * region.size_m[0], 0.5 * region.size_m[1]
    if region.kind == "ellipse":
        return np.asarray((along / first) ** 2 + (across / second) ** 2 <= 1.0)
    return np.asarray((np.abs(along) <= first) & (np.abs(across) <= second))


def _in_polygon(corners: Points, x: Points, y: Points) -> NDArray[np.bool_]:
    """Count the edges that a ray towards growing x crosses: an odd number from inside."""
    found = np.zeros(len(x), np.bool_)
    for (x1, y1), (x2, y2) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if y1 == y2:
            continue
        crosses = (y1 > y) != (y2 > y)
        found ^= crosses & (x < x1 + (y - y1) / (y2 - y1) * (x2 - x1))
    return found
