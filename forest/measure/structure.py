"""How trees share a plot: inequality, diversity, and their pattern in space.

Distances wrap where the plot is periodic.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest._jit import njit
from forest._threads import thread_count

#: Edge of the raster on which crowns are laid, m.
COVER_CELL_M = 0.5

_NEIGHBOURS = 4  # of the mingling index


def gini(sizes: NDArray[np.float64]) -> float:
    """Measure how unequal sizes are: 0 all alike, 1 all in one; NaN below two trees.

    sum((2 j - n - 1) g_j) / ((n - 1) sum(g)) with g in ascending order (Gini's unbiased form).
    """
    n = len(sizes)
    total = float(np.sum(sizes))
    if n < 2 or total <= 0.0:
        return float("nan")
    rank = 2.0 * np.arange(1, n + 1) - n - 1.0
    return float(rank @ np.sort(sizes)) / ((n - 1) * total)


def _shares(amounts: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(amounts[amounts > 0.0] / amounts.sum(), np.float64)


def shannon(amounts: NDArray[np.float64]) -> float:
    """Give Shannon's diversity -sum(p ln p) of the species' amounts; NaN if all are 0."""
    if not np.any(amounts > 0.0):
        return float("nan")
    p = _shares(amounts)
    return float(np.sum(p * np.log(1.0 / p)))


def simpson(amounts: NDArray[np.float64]) -> float:
    """Give Simpson's diversity 1 - sum(p^2) of the species' amounts; NaN if all are 0."""
    if not np.any(amounts > 0.0):
        return float("nan")
    return float(1.0 - np.sum(_shares(amounts) ** 2))


def _tree_of_places(
    places: NDArray[np.float64], size_m: tuple[float, float], periodic: bool
) -> cKDTree:
    if not periodic:
        return cKDTree(places)
    wrapped = np.mod(places, size_m)
    wrapped[wrapped >= np.asarray(size_m)] = 0.0  # mod of a tiny negative number rounds up
    return cKDTree(wrapped, boxsize=size_m)


#: Trees from which on threads are worth starting.
_WORTH_THREADS = 2000


class Neighbours:
    """The four nearest neighbours of every tree, found once and used by several indices.

    Parameters
    ----------
    x, y : float64 (n,)
        Places, m.
    size_m : tuple of float
        Size of the plot, m.
    periodic : bool
        Whether distances wrap.
    """

    def __init__(
        self,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        size_m: tuple[float, float],
        periodic: bool,
    ) -> None:
        self.size_m = size_m
        self.periodic = periodic
        n = len(x)
        k = min(_NEIGHBOURS, n - 1)
        self.index = np.empty((n, max(k, 0)), np.int64)
        self.distance = np.empty((n, max(k, 0)))
        if k < 1:
            return
        tree = _tree_of_places(np.column_stack((x, y)), size_m, periodic)
        workers = thread_count() if n > _WORTH_THREADS else 1
        distance, index = tree.query(tree.data, k + 1, workers=workers)
        # A tree is its own nearest neighbour, except that one on the same spot may come before
        # it, or push it off the list: drop itself, or else the farthest.
        own = index == np.arange(n)[:, None]
        own[~own.any(axis=1), -1] = True
        self.index = index[~own].reshape(n, k)
        self.distance = distance[~own].reshape(n, k)

    @property
    def nearest(self) -> NDArray[np.float64]:
        """Distance to the nearest neighbour, m; empty below two trees."""
        return self.distance[:, 0] if self.distance.shape[1] else np.empty(0)


def clark_evans(neighbours: Neighbours) -> float:
    """Give Clark and Evans' aggregation index R: 1 random, below clumped, 2.149 a triangle grid.

    Mean distance to the nearest neighbour over its expectation in a Poisson pattern (Clark &
    Evans 1954); on an open plot the expectation is Donnelly's (1978), which corrects for the
    neighbours that the edge hides. NaN below two trees.
    """
    n = len(neighbours.nearest)
    if n < 2:
        return float("nan")
    width, depth = neighbours.size_m
    area = width * depth
    expected = 0.5 * np.sqrt(area / n)
    if not neighbours.periodic:
        expected += (0.0514 + 0.041 / np.sqrt(n)) * 2.0 * (width + depth) / n
    return float(np.mean(neighbours.nearest) / expected)


def mingling(neighbours: Neighbours, species: NDArray[Any]) -> NDArray[np.float64]:
    """Give for each tree the share of its four nearest neighbours that are of another species.

    (von Gadow 1993; fewer neighbours where there are no four; no correction for edges.)
    Empty below two trees.
    """
    if not neighbours.index.shape[1]:
        return np.empty(0)
    return np.asarray((species[neighbours.index] != species[:, None]).mean(axis=1), np.float64)


@njit
def _lay_discs(
    x: Any, y: Any, radius: Any, layer: Any, width: Any, depth: Any, periodic: Any, covered: Any
) -> Any:
    """Mark the cells whose centre lies under a disc, one layer of `covered` per species."""
    _, ny, nx = covered.shape
    dx = width / nx
    dy = depth / ny
    for t in range(len(x)):
        r = radius[t]
        low = int(np.floor((y[t] - r) / dy))
        high = int(np.floor((y[t] + r) / dy))
        for row in range(low, high + 1):
            if not periodic and (row < 0 or row >= ny):
                continue
            away = (row + 0.5) * dy - y[t]
            rest = r * r - away * away
            if rest < 0.0:
                continue
            half = np.sqrt(rest)
            left = int(np.ceil((x[t] - half) / dx - 0.5))
            right = int(np.floor((x[t] + half) / dx - 0.5))
            for column in range(left, right + 1):
                if periodic:
                    covered[layer[t], row % ny, column % nx] = True
                elif 0 <= column < nx:
                    covered[layer[t], row, column] = True


def crown_raster(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    radius: NDArray[np.float64],
    species: NDArray[np.int64],
    n_species: int,
    size_m: tuple[float, float],
    periodic: bool,
) -> NDArray[np.bool_]:
    """Lay crowns as discs on a raster of about 0.5 m: (n_species, ny, nx), rows along y.

    A cell counts as covered if its centre lies under a crown.
    """
    nx, ny = (max(round(side / COVER_CELL_M), 1) for side in size_m)
    covered = np.zeros((n_species, ny, nx), np.bool_)
    _lay_discs(
        np.asarray(x, np.float64),
        np.asarray(y, np.float64),
        np.asarray(radius, np.float64),
        np.asarray(species, np.int64),
        float(size_m[0]),
        float(size_m[1]),
        bool(periodic),
        covered,
    )
    return covered


def crown_cover(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    radius: NDArray[np.float64],
    species: NDArray[np.int64],
    n_species: int,
    size_m: tuple[float, float],
    periodic: bool,
) -> NDArray[np.float64]:
    """Give the share of the plot under crowns, for each species and for all together.

    Crowns are discs on a raster of about 0.5 m; a cell counts if its centre lies under one.

    Returns
    -------
    float64 (n_species + 1,)
        The last entry is for all species.
    """
    covered = crown_raster(x, y, radius, species, n_species, size_m, periodic)
    each = covered.mean(axis=(1, 2))
    return np.append(each, covered.any(axis=0).mean())
