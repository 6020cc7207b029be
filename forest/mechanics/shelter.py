"""Shelter: what the trees upwind leave of the wind at a tree's top.

Roughness elements share the wind's stress with what lies behind them: it falls as
1 / (1 + beta lambda), with lambda the frontal area upwind (drag partition, Raupach 1992). Here
lambda is counted for each tree in eight sectors, so that whoever stands at an open edge is exposed
from that side. On a periodic plot the trees go on beyond its borders.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.mechanics.stress import ATTENUATION, PROJECTION
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees

#: Directions from which the wind blows.
SECTORS = 8
#: How far upwind trees give shelter, in heights of the sheltered tree.
REACH = 5.0
#: beta. Within a closed stand (crowns of 7.5 times the section of the air up to the tree's top on
#: these five heights: leaf area index 3) the wind is then 0.47 of that at a fresh edge, the ratio
#: of the critical speeds of spruce, 9.6 and 20.4 m/s (Gardiner et al. 2000).
PARTITION = 0.5

_ARC = 2.0 * np.pi / SECTORS
_HALF_ARC = np.tan(0.5 * _ARC)
_BINS = 32  # fixed, so that results do not depend on the number of threads
_TREES_PER_CELL = 4.0


class Plot(NamedTuple):
    """The plot as the wind knows it."""

    width: float  # along x, m
    depth: float  # along y, m
    periodic: bool


class Silhouettes(NamedTuple):
    """What trees show to the wind: float64 arrays of one entry per row of the table."""

    height: NDArray[np.float64]  # of the highest tip, m
    frontal: NDArray[np.float64]  # leaf area projected against the wind, m2


class Cells(NamedTuple):
    """Trees by the cell of a grid in which they stand."""

    across: int  # cells along x
    along: int  # along y
    edge_x: float  # m
    edge_y: float
    first: NDArray[np.int64]  # (cells + 1,) into `rows`
    rows: NDArray[np.int64]


@driver
def _draw_silhouettes(first, step, arena, trees, leaf_area, out):  # type: ignore[no-untyped-def]
    n = len(trees.size)
    for b in range(first, _BINS, step):
        for row in range(b * n // _BINS, (b + 1) * n // _BINS):
            top = 0.0
            sites = 0
            for i in range(trees.start[row], trees.start[row] + np.int64(trees.size[row])):
                top = max(top, np.float64(arena.tip[i, 2]))
                state = arena.state[i]
                sites += (1 if state & TERMINAL else 0) + (1 if state & LATERAL else 0)
            out.height[row] = top
            out.frontal[row] = PROJECTION * leaf_area[trees.species[row]] * sites


def silhouettes(metamers: Metamers, trees: Trees, leaf_area: NDArray[np.float64]) -> Silhouettes:
    """Measure what each tree shows to the wind; `leaf_area` is that of a site by species, m2."""
    n = len(trees.tree_id)
    out = Silhouettes(np.zeros(n), np.zeros(n))
    in_threads(_draw_silhouettes, metamers, trees, leaf_area, out)
    return out


@njit
def _sector(dx, dy):  # type: ignore[no-untyped-def]
    """The sector in which a place lies: 0 around +x, then on towards +y."""
    if abs(dy) < _HALF_ARC * abs(dx):
        return 0 if dx > 0.0 else 4
    if abs(dx) < _HALF_ARC * abs(dy):
        return 2 if dy > 0.0 else 6
    if dy > 0.0:
        return 1 if dx > 0.0 else 3
    return 7 if dx > 0.0 else 5


@njit
def _look_around(row, x, y, seen, cells, plot, depth):  # type: ignore[no-untyped-def]
    """Add up what stands in each sector around a tree."""
    height = seen.height[row]
    reach = REACH * height
    i0 = int(np.floor((x[row] - reach) / cells.edge_x))
    i1 = int(np.floor((x[row] + reach) / cells.edge_x))
    j0 = int(np.floor((y[row] - reach) / cells.edge_y))
    j1 = int(np.floor((y[row] + reach) / cells.edge_y))
    if not plot.periodic:
        i0, i1 = max(i0, 0), min(i1, cells.across - 1)
        j0, j1 = max(j0, 0), min(j1, cells.along - 1)
    for j in range(j0, j1 + 1):
        turns_y = j // cells.along
        for i in range(i0, i1 + 1):
            turns_x = i // cells.across
            cell = (j - turns_y * cells.along) * cells.across + i - turns_x * cells.across
            for k in range(cells.first[cell], cells.first[cell + 1]):
                other = cells.rows[k]
                shade = min(2.0 * seen.height[other] / height - 1.0, 1.0) * seen.frontal[other]
                dx = x[other] + turns_x * plot.width - x[row]
                dy = y[other] + turns_y * plot.depth - y[row]
                square = dx * dx + dy * dy
                itself = other == row and turns_x == 0 and turns_y == 0
                if shade <= 0.0 or square > reach * reach or itself:
                    continue
                width = max(_ARC * np.sqrt(square), np.sqrt(seen.frontal[other]))
                depth[_sector(dx, dy)] += shade / (width * height)


@driver
def _look(first, step, x, y, seen, cells, plot, depth):  # type: ignore[no-untyped-def]
    n = len(x)
    for b in range(first, _BINS, step):
        for row in range(b * n // _BINS, (b + 1) * n // _BINS):
            if seen.height[row] > 0.0:
                _look_around(row, x, y, seen, cells, plot, depth[row])


def _cells(x: NDArray[np.float64], y: NDArray[np.float64], plot: Plot) -> Cells:
    """Sort trees into cells that hold a few of them each."""
    edge = np.sqrt(_TREES_PER_CELL * plot.width * plot.depth / max(len(x), 1))
    across = max(int(plot.width / edge), 1)
    along = max(int(plot.depth / edge), 1)
    edge_x, edge_y = plot.width / across, plot.depth / along
    column = np.minimum((x / edge_x).astype(np.int64), across - 1)
    line = np.minimum((y / edge_y).astype(np.int64), along - 1)
    cell = line * across + column
    rows = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[rows], np.arange(across * along + 1))
    return Cells(across, along, edge_x, edge_y, first.astype(np.int64), rows.astype(np.int64))


def upwind_depth(
    x: NDArray[np.float64], y: NDArray[np.float64], seen: Silhouettes, plot: Plot
) -> NDArray[np.float64]:
    """Count the crowns through which the wind has come to each tree.

    A tree upwind, at the distance r, hides A / (max(theta r, sqrt(A)) H) of the air that blows
    towards a tree of height H out of a sector of angle theta; A is its frontal area. It counts in
    full if it is at least as tall, not at all if it is half as tall or less, and linearly between.

    Parameters
    ----------
    x, y : float64 (n,)
        Stem bases, m.
    seen : Silhouettes
        n entries.
    plot : Plot

    Returns
    -------
    float64 (n, SECTORS)
        Frontal area in each sector within `REACH` tree heights per section of the air below the
        tree's top; the first sector is that around +x.
    """
    depth = np.zeros((len(x), SECTORS))
    in_threads(_look, x, y, seen, _cells(x, y, plot), plot, depth)
    return depth


def sheltered(depth: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the wind at the trees' tops, and how fast it falls below the canopy's top.

    From a sector behind the depth lambda the wind's square is w = 1 / (1 + beta lambda) of that
    over an open canopy (Raupach 1992), and its attenuation a (1 - w), which tends to that of closed
    stands.

    Parameters
    ----------
    depth : float64 (n, SECTORS)
        See `upwind_depth`.

    Returns
    -------
    exposure : float64 (n,)
        Share of the speed over an open canopy: the root of the mean of w, as loads go by squares.
    attenuation : float64 (n,)
        Mean over the sectors, weighted by w.
    """
    square = 1.0 / (1.0 + PARTITION * depth)
    mean = np.mean(square, axis=1)
    attenuation = ATTENUATION * np.mean(square * (1.0 - square), axis=1) / mean
    return np.sqrt(mean), attenuation
