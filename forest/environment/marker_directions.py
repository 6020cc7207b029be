"""Best growth directions from the markers that buds have won (V of Palubicki et al. 2009, 4.1)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.environment.marker_buds import CHUNKS, chunk_bounds
from forest.environment.marker_tiles import CELLS, EDGE, Cloud, Entries, Lattice, cell_words, jitter


@njit
def sort_won(winner: Any, cloud_winner: Any, entry_bud: Any, n_buds: Any) -> Any:
    """Sort won markers by bud; stable, so that sums over them run in a fixed order.

    Returns
    -------
    first : int64 (n_buds + 1,)
        Bud b won the markers ``won[first[b] : first[b + 1]]``.
    won : int64 (n,)
        Flat indices into `winner`, and behind them those into `cloud_winner`.
    """
    flat = winner.reshape(-1)
    first = np.zeros(n_buds + 1, np.int64)
    for entry in flat:
        if entry >= 0:
            first[entry_bud[entry] + 1] += 1
    for entry in cloud_winner:
        if entry >= 0:
            first[entry_bud[entry] + 1] += 1
    first = np.cumsum(first)
    cursor = first[:-1].copy()
    won = np.empty(first[n_buds], np.int64)
    for k in range(len(flat)):
        if flat[k] >= 0:
            b = entry_bud[flat[k]]
            won[cursor[b]] = k
            cursor[b] += 1
    for k in range(len(cloud_winner)):
        if cloud_winner[k] >= 0:
            b = entry_bud[cloud_winner[k]]
            won[cursor[b]] = len(flat) + k
            cursor[b] += 1
    return first, won


@njit
def _marker(lattice: Any, tile: Any, code: Any) -> Any:
    """Place of a procedural marker."""
    nx, ny, _ = lattice.shape
    tile_x = lattice.low[0] + tile % nx
    j = (lattice.low[1] + tile // nx % ny) * EDGE + code // EDGE % EDGE
    k = (lattice.low[2] + tile // (nx * ny)) * EDGE + code // (EDGE * EDGE)
    a = code % EDGE
    words = cell_words(lattice.seed, tile_x, j, k)
    u, v, w = jitter(words[a])
    x = (tile_x * EDGE + a + u) * lattice.cell[0]
    return x, (j + v) * lattice.cell[1], (k + w) * lattice.cell[2]


@driver
def _direction_chunks(
    begin: Any,
    step: Any,
    lattice: Any,
    entries: Any,
    cloud: Any,
    tiles: Any,
    winner: Any,
    cloud_winner: Any,
    first: Any,
    won: Any,
    direction: Any,
) -> None:
    n_buds = len(first) - 1
    flat = winner.reshape(-1)
    for c in range(begin, CHUNKS, step):
        start, end = chunk_bounds(n_buds, c)
        for b in range(start, end):
            sx = sy = sz = 0.0
            for p in range(first[b], first[b + 1]):
                k = won[p]
                if k < len(flat):
                    e = flat[k]
                    x, y, z = _marker(lattice, tiles[k // CELLS], k % CELLS)
                else:
                    m = k - len(flat)
                    e = cloud_winner[m]
                    x, y, z = cloud.point[m, 0], cloud.point[m, 1], cloud.point[m, 2]
                x -= entries.point[e, 0]
                y -= entries.point[e, 1]
                z -= entries.point[e, 2]
                distance = np.sqrt(x * x + y * y + z * z)
                if distance > 0.0:
                    sx += x / distance
                    sy += y / distance
                    sz += z / distance
            length = np.sqrt(sx * sx + sy * sy + sz * sz)
            if length > 0.0:
                direction[b, 0] = sx / length
                direction[b, 1] = sy / length
                direction[b, 2] = sz / length


def directions(
    lattice: Lattice,
    entries: Entries,
    cloud: Cloud,
    tiles: NDArray[np.int64],
    winner: NDArray[np.int32],
    cloud_winner: NDArray[np.int32],
    first: NDArray[np.int64],
    won: NDArray[np.int64],
) -> NDArray[np.float32]:
    """Sum the unit vectors from each bud to its markers, normalized (V of 4.1).

    Returns
    -------
    float32 (n_buds, 3)
        Zero for a bud without markers.
    """
    direction = np.zeros((len(first) - 1, 3), np.float32)
    in_threads(
        _direction_chunks,
        lattice,
        entries,
        cloud,
        tiles,
        winner,
        cloud_winner,
        first,
        won,
        direction,
    )
    return direction
