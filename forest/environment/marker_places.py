"""Where the free markers of a space are, for people who want to see them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest.environment.marker_buds import list_buds
from forest.environment.marker_tiles import EDGE, cell_words, inside, jitter
from forest.environment.markers import MarkerSpace
from forest.trees.metamers import Metamers
from forest.trees.table import Trees


def free_markers(
    space: MarkerSpace, low: NDArray[np.float64], high: NDArray[np.float64], most: int
) -> tuple[NDArray[np.float64], int]:
    """List the markers in a box that are not gone for good.

    A marker that a bud of this year occupies is listed too where the space gives markers back.

    Parameters
    ----------
    space : MarkerSpace
    low, high : float64 (3,)
        Corners of the box, m; nothing below the ground is listed.
    most : int
        About how many places to look at: of more, rows of four cells are drawn at even steps.

    Returns
    -------
    float64 (n, 3)
        m.
    int
        One of how many rows was looked at.
    """
    cell = space.cell_m
    state = space.state()
    first = np.floor(np.maximum(low, (low[0], low[1], 0.0)) / cell).astype(np.int64)
    last = np.floor(high / cell).astype(np.int64)
    for axis in range(2):
        if space.cells[axis]:
            first[axis] = max(first[axis], 0)
            last[axis] = min(last[axis], space.cells[axis] - 1)
    rows = [
        (x, j, k)
        for k in range(first[2], last[2] + 1)
        for j in range(first[1], last[1] + 1)
        for x in range(first[0] // EDGE, last[0] // EDGE + 1)
    ]
    step = max(1, EDGE * len(rows) // most)
    gone, gone_low = state["gone"], state["gone_low"].astype(np.int64)
    found = []
    for x, j, k in rows[::step]:
        words = cell_words(space.seed, np.int64(x), np.int64(j), np.int64(k))
        bits = _word(gone, np.array((k // EDGE, j // EDGE, x)) - gone_low)
        for a in range(EDGE):
            i = x * EDGE + a
            code = (k % EDGE * EDGE + j % EDGE) * EDGE + a
            if not first[0] <= i <= last[0] or bits >> code & 1:
                continue
            u, v, w = jitter(words[a])
            point = ((i + u) * cell[0], (j + v) * cell[1], (k + w) * cell[2])
            if inside(space.envelopes, *point):
                found.append(point)
    points = np.array(found, np.float64).reshape(-1, 3)
    cloud = space.cloud[state["cloud_gone"] == 0]
    cloud = cloud[np.all((cloud >= low) & (cloud <= high), axis=1)]
    return np.concatenate((points, cloud)), step


def _word(gone: NDArray[np.generic], tile: NDArray[np.int64]) -> int:
    if gone.size == 0 or np.any(tile < 0) or np.any(tile >= gone.shape):
        return 0
    return int(gone[tuple(tile)])


def occupied(
    points: NDArray[np.float64],
    metamers: Metamers,
    trees: Trees,
    occupancy_m: NDArray[np.floating],
    wraps_m: tuple[float, float] | None,
) -> NDArray[np.bool_]:
    """Tell which points lie in the occupancy zone of a living bud, as it is now.

    Parameters
    ----------
    points : float64 (n, 3)
        m; inside the plot where it wraps.
    metamers, trees
        The stand.
    occupancy_m : float (species,)
        Radius of the zone around a bud of each species.
    wraps_m : (float, float), optional
        Sides of a periodic plot.
    """
    from scipy.spatial import cKDTree

    buds = list_buds(metamers, trees)
    taken = np.zeros(len(points), np.bool_)
    box = None if wraps_m is None else (*wraps_m, 0.0)
    for species, radius in enumerate(occupancy_m):
        places = buds.position[buds.species == species]
        if box is not None:
            places[:, :2] %= wraps_m
            places[:, :2][places[:, :2] >= wraps_m] = 0.0  # a rounded-up remainder
        rest = np.flatnonzero(~taken)
        if len(places) and len(rest):
            bound = np.nextafter(float(radius), np.inf)  # the zone's edge belongs to it
            away, _ = cKDTree(places, boxsize=box).query(points[rest], distance_upper_bound=bound)
            taken[rest[np.isfinite(away)]] = True
    return taken
