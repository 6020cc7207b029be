"""Exposure to a wind of one direction: what edges, gaps and spacing upwind leave of its load.

Gusts bend a tree at the windward edge of a stand about four times as much as one far within. The
load falls from the edge inwards, and an edge behind a short gap gets part of it only (wind
tunnel: Stacey et al. 1994; Gardiner et al. 1997; as ForestGALES has them, Hale et al. 2015):

    m = (2.7193 s - 0.061) + (0.9701 - 1.273 s) E,   E = (1.1127 s + 0.0311)^x (g / 10)^0.3467

with the spacing s, the distance x from the edge and the gap's length g, all in heights of the
canopy. Here the wind is followed along its way to each tree, so that E falls where trees
stand and rises again where none do; behind one gap and one edge it is the formula above.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.mechanics.shelter import Plot

#: How far upwind trees and gaps matter, in heights of the canopy: a gap of 10, a stand of 10.
FETCH = 20.0
#: Stretches into which the way is cut, each so long, in heights of the canopy.
STRETCH = 0.25
#: Half the width of the way that the wind takes to a tree, in heights of the canopy.
HALF_WIDTH = 0.5
#: Spacings, in heights of the canopy, between which the wind tunnel's formulae hold.
CLOSEST, WIDEST = 0.075, 0.45
#: A gap that exposes an edge fully, in heights of the canopy, and how shorter ones do.
FULL_GAP, GAP_POWER = 10.0, 0.3467

_BINS = 32  # fixed, so that results do not depend on the number of threads
_STRETCHES = round(FETCH / STRETCH)


class Ways(NamedTuple):
    """Trees, and on a periodic plot their images, in the strips along which a wind blows.

    Attributes
    ----------
    canopy_height : float
        m; the measure of all lengths.
    along, across : float64 (n,)
        Places of the trees, m, in the wind's direction and to its left.
    low : float
        Where the first strip begins, m across; strips are half as wide as the way.
    first : int64 (strips + 1,)
        Into the rest.
    other_along, other_across : float64
        Places of trees and images by strip, ordered along the wind.
    other : int64
        Their rows.
    """

    canopy_height: float
    along: NDArray[np.float64]
    across: NDArray[np.float64]
    low: float
    first: NDArray[np.int64]
    other_along: NDArray[np.float64]
    other_across: NDArray[np.float64]
    other: NDArray[np.int64]


class Exposure(NamedTuple):
    """How a wind of one direction comes to trees: float64 arrays of one entry per row.

    Attributes
    ----------
    spacing : of the trees around, m; no more than `WIDEST` canopy heights
    edge : E, 0 (far within a stand) to 1 (at an edge behind a long gap)
    gusts : moment of gusts, m, per that of a tree as far from others and far within a stand
    """

    spacing: NDArray[np.float64]
    edge: NDArray[np.float64]
    gusts: NDArray[np.float64]


def heading(direction_deg: float) -> tuple[float, float]:
    """Unit vector of an azimuth from x towards y; exact along the axes."""
    angle = np.radians(direction_deg)
    x, y = (0.0 if abs(c) < 1e-12 else float(c) for c in (np.cos(angle), np.sin(angle)))
    return x, y


def lay_ways(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    canopy_height: float,
    direction_deg: float,
    plot: Plot,
) -> Ways:
    """Sort trees into strips along a wind.

    Parameters
    ----------
    x, y : float64 (n,)
        Stem bases, m.
    canopy_height : float
        m, above 0.
    direction_deg : float
        Azimuth towards which the wind blows, from x towards y.
    plot : Plot
        Beyond an open one there is open land; a periodic one goes on.
    """
    to_x, to_y = heading(direction_deg)
    x, y = x.astype(np.float64), y.astype(np.float64)
    along, across = x * to_x + y * to_y, y * to_x - x * to_y
    width = HALF_WIDTH * canopy_height
    low, high = (across.min() - width, across.max() + width) if len(x) else (0.0, 0.0)
    near, far = (along.min(), along.max()) if len(x) else (0.0, 0.0)
    first_u, last_u = near - FETCH * canopy_height, far + width
    reach = ((first_u - far, last_u - near), (low - high, high - low))
    shift_x, shift_y = _images((to_x, to_y), *reach, canopy_height, plot)
    all_u = along + (shift_x * to_x + shift_y * to_y)[:, None]
    all_v = across + (shift_y * to_x - shift_x * to_y)[:, None]
    seen = (all_v >= low) & (all_v <= high) & (all_u >= first_u) & (all_u <= last_u)
    u, v, rows = all_u[seen], all_v[seen], np.nonzero(seen)[1]
    strip = ((v - low) / width).astype(np.int64)
    order = np.lexsort((rows, u, strip))
    strips = int((high - low) / width) + 1
    first = np.searchsorted(strip[order], np.arange(strips + 1)).astype(np.int64)
    return Ways(canopy_height, along, across, float(low), first, u[order], v[order], rows[order])


def _images(
    to: tuple[float, float],
    along: tuple[float, float],
    across: tuple[float, float],
    canopy_height: float,
    plot: Plot,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shifts, m, of a plot's images, at least of those that meet the strips along a wind.

    `along` and `across` are the least and greatest shift, m, that brings a tree into them. On a
    small plot under tall trees they meet one image in a hundred of those within reach.
    """
    if not plot.periodic:
        return np.zeros(1), np.zeros(1)
    reach = (FETCH + HALF_WIDTH) * canopy_height
    columns = int(np.ceil(reach / plot.width)) + 1
    lines = int(np.ceil(reach / plot.depth)) + 1
    column = np.arange(-columns, columns + 1)
    first, last = np.full(len(column), -float(lines)), np.full(len(column), float(lines))
    sides = (
        (along, plot.width * to[0], plot.depth * to[1]),
        (across, -plot.width * to[1], plot.depth * to[0]),
    )
    for (low, high), by_column, by_line in sides:
        ends = np.array([[low], [high]]) - column * by_column
        if abs(by_line) * lines < 1e-6:  # the images of a column lie beside one another
            last[(ends[0] > 1e-5) | (ends[1] < -1e-5)] = -np.inf
            continue
        ends /= by_line
        first = np.maximum(first, np.floor(ends.min(axis=0)) - 1.0)
        last = np.minimum(last, np.ceil(ends.max(axis=0)) + 1.0)
    count = np.maximum(last - first + 1.0, 0.0).astype(np.int64)
    line = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - first, count)
    shift_x, shift_y = np.repeat(column, count) * plot.width, line * plot.depth
    return np.asarray(shift_x, np.float64), np.asarray(shift_y, np.float64)


@njit
def first_from(values, low, high, least):  # type: ignore[no-untyped-def]
    """The first of ascending values[low:high] that is at least `least`."""
    while low < high:
        middle = (low + high) // 2
        if values[middle] < least:
            low = middle + 1
        else:
            high = middle
    return low


@njit
def _counts(other_height, height):  # type: ignore[no-untyped-def]
    """How much a tree counts as shelter of another: in full if as tall, not if half as tall."""
    return min(max(2.0 * other_height / height - 1.0, 0.0), 1.0)


@njit
def _space_of(row, height, standing, ways):  # type: ignore[no-untyped-def]
    """The spacing of the trees around one of them, on the side where more of them stand.

    So trees at an edge are as close as those behind them.
    """
    reach = HALF_WIDTH * ways.canopy_height
    u = ways.along[row]
    v = ways.across[row]
    strip = int((v - ways.low) / reach)
    ahead = 0.0
    behind = 0.0
    beside = 0.0
    for at in range(max(strip - 1, 0), min(strip + 2, len(ways.first) - 1)):
        end = ways.first[at + 1]
        for k in range(first_from(ways.other_along, ways.first[at], end, u - reach), end):
            du = ways.other_along[k] - u
            dv = ways.other_across[k] - v
            if du > reach:
                break
            square = du * du + dv * dv
            if standing[ways.other[k]] and 0.0 < square <= reach * reach:
                one = _counts(height[ways.other[k]], height[row])
                if du > 0.0:
                    ahead += one
                elif du < 0.0:
                    behind += one
                else:
                    beside += one
    trees = 1.0 + beside + 2.0 * max(ahead, behind)
    return min(reach * np.sqrt(np.pi / trees), WIDEST * ways.canopy_height)


@njit
def _gather(row, height, standing, spacing, ways, cover, decay):  # type: ignore[no-untyped-def]
    """Add up what covers each stretch of the way to a tree, m, and the logarithm of its E.

    A tree counts in the two stretches whose middles are nearest.
    """
    canopy = ways.canopy_height
    reach = HALF_WIDTH * canopy
    u = ways.along[row]
    v = ways.across[row]
    strip = int((v - ways.low) / reach)
    for at in range(max(strip - 1, 0), min(strip + 2, len(ways.first) - 1)):
        end = ways.first[at + 1]
        for k in range(first_from(ways.other_along, ways.first[at], end, u - FETCH * canopy), end):
            distance = u - ways.other_along[k]
            if distance <= 0.0:
                break
            other = ways.other[k]
            if not standing[other] or abs(ways.other_across[k] - v) > reach:
                continue
            length = _counts(height[other], height[row]) * spacing[other] ** 2 / (2.0 * reach)
            close = max(spacing[other] / canopy, CLOSEST)
            rate = np.log(1.1127 * close + 0.0311) / canopy
            middle = min(max(distance / (STRETCH * canopy) - 0.5, 0.0), _STRETCHES - 1.0)
            b = min(int(middle), _STRETCHES - 2)
            farther = middle - b
            cover[b] += (1.0 - farther) * length
            cover[b + 1] += farther * length
            decay[b] += (1.0 - farther) * length * rate
            decay[b + 1] += farther * length * rate


@njit
def _edge_of(canopy, cover, decay):  # type: ignore[no-untyped-def]
    """Follow E along the way to a tree, from open land.

    A stretch is open as far as less than half of it is covered: random gaps between trees are none.
    """
    edge = 1.0
    for b in range(_STRETCHES - 1, -1, -1):
        covered = cover[b] / (STRETCH * canopy)
        gap = STRETCH * (1.0 - 2.0 * covered)
        if gap > 0.0:
            gap += FULL_GAP * edge ** (1.0 / GAP_POWER)
            edge = min(gap / FULL_GAP, 1.0) ** GAP_POWER
        edge *= np.exp(decay[b] / max(covered, 1.0))
    return edge


@njit
def gust_load(spacing, edge):  # type: ignore[no-untyped-def]
    """The moment m of gusts on a tree (Gardiner et al. 1997), about 1 at an edge.

    `spacing` in heights of the canopy.
    """
    s = min(max(spacing, CLOSEST), WIDEST)
    return 2.7193 * s - 0.061 + (0.9701 - 1.273 * s) * edge


@driver
def _space(first, step, height, standing, ways, spacing):  # type: ignore[no-untyped-def]
    n = len(height)
    for b in range(first, _BINS, step):
        for row in range(b * n // _BINS, (b + 1) * n // _BINS):
            if standing[row]:
                spacing[row] = _space_of(row, height, standing, ways)


@driver
def _follow(first, step, height, standing, ways, scratch, out):  # type: ignore[no-untyped-def]
    n = len(height)
    canopy = ways.canopy_height
    for b in range(first, _BINS, step):
        for row in range(b * n // _BINS, (b + 1) * n // _BINS):
            if not standing[row]:
                continue
            scratch[b] = 0.0
            _gather(row, height, standing, out.spacing, ways, scratch[b, 0], scratch[b, 1])
            edge = _edge_of(canopy, scratch[b, 0], scratch[b, 1])
            space = out.spacing[row] / canopy
            out.edge[row] = edge
            out.gusts[row] = gust_load(space, edge) / gust_load(space, 0.0)


def expose(height: NDArray[np.float64], standing: NDArray[np.bool_], ways: Ways) -> Exposure:
    """Follow a wind to each standing tree.

    Parameters
    ----------
    height : float64 (n,)
        Of the trees, m.
    standing : bool (n,)
        Which of them stand; the rest give no shelter, and their exposure is NaN.
    ways : Ways
        Of the same trees.

    Returns
    -------
    Exposure
        n entries each.

    Notes
    -----
    A tree's spacing s is that of the trees within half a canopy height before or behind it,
    whichever are closer, and each covers s^2 of the
    ground of the way, which is one canopy height wide. A tree upwind counts in full if it is
    at least as tall, not at all if half as tall or less, linearly between.
    """
    n = len(height)
    out = Exposure(*(np.full(n, np.nan) for _ in Exposure._fields))
    in_threads(_space, height, standing, ways, out.spacing)
    scratch = np.zeros((_BINS, 2, _STRETCHES))
    in_threads(_follow, height, standing, ways, scratch, out)
    return out
