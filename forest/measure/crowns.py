"""Crowns: base, reach in eight directions, projection and volume, from the leaf-bearing tips.

A crown is seen from the vertical line through the stem base. Its *radii* are the farthest tips in
eight sectors of 45 degrees, the first from x towards y; its *projection* is the convex hull of the
tips on the ground. For its *volume* the crown is cut into slices of equal height; each slice is a
prism over the octagon of its own eight radii, but in no direction is a slice narrower than both the
widest slice above it and the widest below it: gaps between whorls are filled, as an outline drawn
from outside fills them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest._threads import in_threads
from forest.measure.trees import octagon
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.skeleton import Skeleton
from forest.trees.table import Trees

#: Slices of a crown's volume.
SLICES = 16

_BINS = 32  # fixed, so that results do not depend on the number of threads
_SECTORS = (0, 1, 3, 2, 6, 7, 5, 4)  # by azimuth; see `octagon`
_NAN = np.nan


class Crowns(NamedTuple):
    """Crowns of n trees; NaN for a tree without a leaf-bearing tip, but for radii, areas, volume.

    These are 0 then.
    """

    base_m: NDArray[np.float64]  # (n,) height of the lowest leaf-bearing tip
    top_m: NDArray[np.float64]  # (n,) height of the highest one
    radius_m: NDArray[np.float64]  # (n, 8) reach in each sector, from the stem base
    projection_m2: NDArray[np.float64]  # (n,) area of the convex hull on the ground
    volume_m3: NDArray[np.float64]  # (n,) of the stack of octagonal slices


@njit
def _turn(points: Any, a: Any, b: Any, c: Any) -> Any:
    """Give twice the signed area of the triangle a b c."""
    ax = points[a, 0]
    ay = points[a, 1]
    return (points[b, 0] - ax) * (points[c, 1] - ay) - (points[b, 1] - ay) * (points[c, 0] - ax)


@njit
def _farthest(points: Any, candidates: Any) -> Any:
    """Choose the candidates farthest along eight directions, counterclockwise."""
    best = np.full(8, -np.inf)
    far = np.zeros(8, np.int64)
    for i in candidates:
        x = points[i, 0]
        y = points[i, 1]
        for k, reach in enumerate((x, x + y, y, y - x, -x, -x - y, -y, x - y)):
            if reach > best[k]:
                best[k] = reach
                far[k] = i
    return far


@njit
def _outside(points: Any, candidates: Any) -> Any:
    """Choose the candidates that are not strictly inside the polygon of the farthest ones."""
    far = _farthest(points, candidates)
    corner = np.empty((8, 4))
    edges = 0
    for k in range(8):
        a = far[k]
        b = far[(k + 1) % 8]
        if a != b:
            corner[edges, 0] = points[a, 0]
            corner[edges, 1] = points[a, 1]
            corner[edges, 2] = points[b, 0] - points[a, 0]
            corner[edges, 3] = points[b, 1] - points[a, 1]
            edges += 1
    left = np.empty(len(candidates), np.int64)
    n = 0
    for i in candidates:
        inside = edges > 2
        for k in range(edges):
            side = corner[k, 2] * (points[i, 1] - corner[k, 1]) - corner[k, 3] * (
                points[i, 0] - corner[k, 0]
            )
            if side <= 0.0:
                inside = False
                break
        if not inside:
            left[n] = i
            n += 1
    return left[:n]


@njit
def _sort(points: Any, order: Any) -> None:
    """Sort a few points by x, then y, by insertion."""
    for k in range(1, len(order)):
        point = order[k]
        x = points[point, 0]
        y = points[point, 1]
        place = k
        while place > 0:
            before = order[place - 1]
            if (points[before, 0], points[before, 1]) <= (x, y):
                break
            order[place] = before
            place -= 1
        order[place] = point


@njit
def _chain(points: Any, order: Any) -> Any:
    """Give the convex hull of the points named, counterclockwise (Andrew's monotone chain, 1979).

    `order` is sorted by `_sort`.
    """
    n = len(order)
    corners = np.empty(2 * n + 1, np.int64)
    count = 0
    for way in range(2):
        begin = count + 1
        for k in range(n):
            point = order[k] if way == 0 else order[n - 1 - k]
            while (
                count > begin and _turn(points, corners[count - 2], corners[count - 1], point) <= 0
            ):
                count -= 1
            corners[count] = point
            count += 1
        count -= 1
    return corners[: max(count, 1)]


@njit
def _inner_circle(points: Any, some: Any) -> Any:
    """Give a circle inside the hull of some of the points: its centre and squared radius."""
    _sort(points, some)
    corners = _chain(points, some)
    n = len(corners)
    x = points[corners, 0].sum() / n
    y = points[corners, 1].sum() / n
    radius = np.inf
    for k in range(n):
        a = corners[k]
        b = corners[(k + 1) % n]
        dx = points[b, 0] - points[a, 0]
        dy = points[b, 1] - points[a, 1]
        cross = dx * (y - points[a, 1]) - dy * (x - points[a, 0])
        radius = min(radius, cross * cross / (dx * dx + dy * dy)) if n > 2 else 0.0
    return x, y, radius * (1.0 - 1e-9)  # less a rounding error, so that no corner is lost


@njit
def _hull(points: Any, some: Any) -> Any:
    """List the corners of the convex hull, counterclockwise.

    The points inside a circle in the hull of `some` of them, far out, need not be looked at; nor
    do most others.
    """
    x, y, square = _inner_circle(points, some)
    order = np.empty(len(points) + 1, np.int64)
    n = 0
    for i in range(len(points)):  # see `_tips`
        order[n] = i
        n += int((points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 >= square)
    order = _outside(points, order[:n])
    _sort(points, order)
    return _chain(points, order)


@njit
def _hull_area(points: Any, some: Any) -> Any:
    corners = _hull(points, some)
    area = 0.0
    for k in range(1, len(corners) - 1):
        area += _turn(points, corners[0], corners[k], corners[k + 1])
    return 0.5 * area


@njit
def _fill(reach: Any) -> None:
    """Widen each slice to the lesser of the widest above and the widest below it."""
    for sector in range(8):
        below = np.zeros(len(reach))
        widest = 0.0
        for k in range(len(reach)):
            widest = max(widest, reach[k, sector])
            below[k] = widest
        widest = 0.0
        for k in range(len(reach) - 1, -1, -1):
            widest = max(widest, reach[k, sector])
            reach[k, sector] = min(widest, below[k])


@njit
def _measure_crown(tips: Any, slices: Any, t: Any, out: Any) -> None:
    """Measure one crown from its tips, relative to the stem base."""
    low = np.inf
    high = -np.inf
    for i in range(len(tips)):
        low = min(low, tips[i, 2])
        high = max(high, tips[i, 2])
    out.base_m[t] = low if len(tips) else _NAN
    out.top_m[t] = high if len(tips) else _NAN
    out.radius_m[t] = 0.0
    out.projection_m2[t] = 0.0
    out.volume_m3[t] = 0.0
    if not len(tips):
        return
    reach = np.zeros((slices, 8))
    longest = np.full(8, -1.0)
    far = np.zeros(8, np.int64)
    scale = slices / (high - low) if high > low else 0.0
    for i in range(len(tips)):
        x = tips[i, 0]
        y = tips[i, 1]
        k = min(int((tips[i, 2] - low) * scale), slices - 1)
        sector = int(abs(y) > abs(x)) + 2 * int(x < 0.0) + 4 * int(y < 0.0)
        square = x * x + y * y
        reach[k, sector] = max(reach[k, sector], square)
        if square > longest[sector]:
            longest[sector] = square
            far[sector] = i
    for k in range(8):
        out.radius_m[t, k] = np.sqrt(max(longest[_SECTORS[k]], 0.0))
    out.projection_m2[t] = _hull_area(tips, far)
    _fill(reach)
    for k in range(slices):
        out.volume_m3[t] += octagon(reach[k])[1] * (high - low) / slices


@njit
def _tips(metamers: Any, begin: Any, size: Any) -> Any:
    """Gather a tree's leaf-bearing tips."""
    state = metamers.state[begin : begin + size]
    tip = metamers.tip[begin : begin + size]
    leafy = np.empty(size + 1, np.int32)
    n = 0
    for i in range(size):  # writes always and counts some: a branch here would cost more
        leafy[n] = i
        n += int((state[i] & (TERMINAL | LATERAL)) != 0)
    tips = np.empty((n, 3))
    for k in range(n):
        for axis in range(3):
            tips[k, axis] = tip[leafy[k], axis]
    return tips


@njit  # not `driver`: what it calls makes arrays, and that took twice as long there
def _measure_all(
    first: Any, step: Any, metamers: Any, trees: Any, by_size: Any, slices: Any, out: Any
) -> None:
    """Measure all crowns; trees are dealt to bins from the largest to the smallest."""
    for b in range(first, _BINS, step):
        for k in range(b, len(by_size), _BINS):
            t = by_size[k]
            _measure_crown(_tips(metamers, trees.start[t], trees.size[t]), slices, t, out)


def crowns_of(metamers: Metamers, trees: Trees) -> Crowns:
    """Measure the crowns of all trees of the table.

    Parameters
    ----------
    metamers : Metamers
        The arena.
    trees : Trees
        The tree table, n rows.
    """
    out = _nothing(len(trees.tree_id))
    by_size = np.argsort(-trees.size, kind="stable")
    in_threads(_measure_all, metamers, trees, by_size, SLICES, out)
    return out


def crown_of(skeleton: Skeleton) -> Crowns:
    """Measure the crown of a single tree; arrays of one entry."""
    out = _nothing(1)
    _measure_crown(leafy_tips(skeleton), SLICES, 0, out)
    return out


def leafy_tips(skeleton: Skeleton) -> NDArray[np.float64]:
    """Give the upper ends of a tree's leaf-bearing internodes, from its base, m, (k, 3)."""
    return np.ascontiguousarray(skeleton.end[skeleton.leafy] - skeleton.start[:1])


def crown_polygon(skeleton: Skeleton) -> NDArray[np.float64]:
    """Give the crown's projection: the convex hull of its leaf-bearing tips.

    Returns
    -------
    float64 (k, 2)
        Corners counterclockwise, m, in the plot's coordinates, as shapely's `Polygon` takes them;
        fewer than three if the crown has no area.
    """
    tips = leafy_tips(skeleton)
    if not len(tips):
        return np.empty((0, 2))
    return np.asarray(tips[_hull(tips, np.zeros(1, np.int64)), :2] + skeleton.start[0, :2])


def _nothing(n: int) -> Crowns:
    return Crowns(np.empty(n), np.empty(n), np.empty((n, 8)), np.empty(n), np.empty(n))
