"""Competition for markers: which bud each marker belongs to (Palubicki et al. 2009, 4.1)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.environment.marker_buds import CHUNKS, Buds
from forest.environment.marker_tiles import (
    CELLS,
    EDGE,
    Cloud,
    Entries,
    Envelopes,
    Gone,
    Lattice,
    Rows,
    Sites,
    cell_words,
    inside,
    jitter,
    row_bounds,
)

_BLOCK = 8  # neighbouring tiles that a chunk takes together


class Scratch(NamedTuple):
    """Markers of one tile that are still free: place, code, best squared distance, its entry."""

    point: NDArray[np.float64]
    code: NDArray[np.int64]
    best: NDArray[np.float64]
    winner: NDArray[np.int64]


@njit
def _gather(
    lattice: Any, envelopes: Any, cloud: Any, bits: Any, x: Any, y: Any, z: Any, free: Any
) -> Any:
    """List the markers of a tile that exist and are not gone; give their number."""
    n = 0
    tile_x = lattice.low[0] + x
    j0 = (lattice.low[1] + y) * EDGE
    k0 = (lattice.low[2] + z) * EDGE
    for c in range(EDGE):
        for b in range(EDGE):
            j = j0 + b
            k = k0 + c
            if k < 0 or (lattice.cells[1] > 0 and (j < 0 or j >= lattice.cells[1])):
                continue
            words = cell_words(lattice.seed, tile_x, j, k)
            for a in range(EDGE):
                i = tile_x * EDGE + a
                code = (c * EDGE + b) * EDGE + a
                if (bits >> np.uint64(code)) & np.uint64(1):
                    continue
                if lattice.cells[0] > 0 and (i < 0 or i >= lattice.cells[0]):
                    continue
                u, v, w = jitter(words[a])
                free.point[0, n] = (i + u) * lattice.cell[0]
                free.point[1, n] = (j + v) * lattice.cell[1]
                free.point[2, n] = (k + w) * lattice.cell[2]
                free.code[n] = code
                if inside(envelopes, free.point[0, n], free.point[1, n], free.point[2, n]):
                    n += 1
    if len(cloud.first) > 0:
        t = (z * lattice.shape[1] + y) * lattice.shape[0] + x
        for p in range(cloud.first[t], cloud.first[t + 1]):
            m = cloud.order[p]
            if cloud.gone[m] == 0:
                for axis in range(3):
                    free.point[axis, n] = cloud.point[m, axis]
                free.code[n] = CELLS + m
                n += 1
    return n


@njit
def _bounds(point: Any, n: Any) -> Any:
    """Box around the first `n` points (3, n): low x, y, z, high x, y, z."""
    low_x = high_x = point[0, 0]
    low_y = high_y = point[1, 0]
    low_z = high_z = point[2, 0]
    for m in range(1, n):
        low_x = min(low_x, point[0, m])
        high_x = max(high_x, point[0, m])
        low_y = min(low_y, point[1, m])
        high_y = max(high_y, point[1, m])
        low_z = min(low_z, point[2, m])
        high_z = max(high_z, point[2, m])
    return low_x, low_y, low_z, high_x, high_y, high_z


@njit
def _drop_within(point: Any, code: Any, n: Any, bx: Any, by: Any, bz: Any, radius2: Any) -> Any:
    """Drop the markers within a sphere; give the number left."""
    hits = 0
    for m in range(n):
        dx = point[0, m] - bx
        dy = point[1, m] - by
        dz = point[2, m] - bz
        hits += dx * dx + dy * dy + dz * dz <= radius2
    if hits == 0:
        return n
    left = 0
    for m in range(n):
        x = point[0, m]
        y = point[1, m]
        z = point[2, m]
        dx, dy, dz = x - bx, y - by, z - bz
        outside = dx * dx + dy * dy + dz * dz > radius2
        point[0, left] = x
        point[1, left] = y
        point[2, left] = z
        code[left] = code[m]
        left += outside
    return left


@njit
def _clear_occupied(
    lattice: Any, entries: Any, rows: Any, sites: Any, x: Any, y: Any, z: Any, free: Any, n: Any
) -> Any:
    """Drop the markers in the occupancy zone of any bud; give the number left."""
    at = entries.point
    low_x, low_y, low_z, high_x, high_y, high_z = _bounds(free.point, n)
    for r in range(len(rows.offset)):
        start, end = row_bounds(lattice, entries.first, rows, r, x, y, z)
        for e in range(start, end):
            radius = sites.occupancy[entries.species[e]]
            bx, by, bz = at[e, 0], at[e, 1], at[e, 2]
            dx = max(low_x - bx, bx - high_x, 0.0)
            dy = max(low_y - by, by - high_y, 0.0)
            dz = max(low_z - bz, bz - high_z, 0.0)
            if dx * dx + dy * dy + dz * dz > radius * radius:
                continue
            left = _drop_within(free.point, free.code, n, bx, by, bz, radius * radius)
            if left == 0:
                return 0
            if left < n:
                n = left
                low_x, low_y, low_z, high_x, high_y, high_z = _bounds(free.point, n)
    return n


@njit
def _precedes(tree_row: Any, serial: Any, kind: Any, a: Any, b: Any) -> Any:
    """Order buds that are equally near: the lower tree, then serial number, terminal first."""
    if tree_row[a] != tree_row[b]:
        return tree_row[a] < tree_row[b]
    if serial[a] != serial[b]:
        return serial[a] < serial[b]
    return kind[a] < kind[b]


@njit
def _compete_in_tile(
    lattice: Any,
    entries: Any,
    rows: Any,
    sites: Any,
    buds: Any,
    x: Any,
    y: Any,
    z: Any,
    free: Any,
    n: Any,
) -> None:
    """Give each free marker of a tile to the nearest bud whose cone holds it."""
    point, best, winner = free.point, free.best, free.winner
    px, py, pz = point[0], point[1], point[2]
    at, heading, bud = entries.point, entries.heading, entries.bud
    low_x, low_y, low_z, high_x, high_y, high_z = _bounds(point, n)
    dx, dy, dz = high_x - low_x, high_y - low_y, high_z - low_z
    radius = 0.5 * np.sqrt(dx * dx + dy * dy + dz * dz)
    mid_x, mid_y, mid_z = low_x + 0.5 * dx, low_y + 0.5 * dy, low_z + 0.5 * dz
    for m in range(n):
        best[m] = np.inf
        winner[m] = -1
    for r in range(len(rows.offset)):
        start, end = row_bounds(lattice, entries.first, rows, r, x, y, z)
        for e in range(start, end):
            s = entries.species[e]
            reach = sites.perception[s]
            cosine = sites.cosine[s]
            bx, by, bz = at[e, 0], at[e, 1], at[e, 2]
            dx = max(low_x - bx, bx - high_x, 0.0)
            dy = max(low_y - by, by - high_y, 0.0)
            dz = max(low_z - bz, bz - high_z, 0.0)
            if dx * dx + dy * dy + dz * dz > reach * reach:
                continue
            dx, dy, dz = mid_x - bx, mid_y - by, mid_z - bz
            hx = np.float64(heading[e, 0])
            hy = np.float64(heading[e, 1])
            hz = np.float64(heading[e, 2])
            # All markers lie in a sphere: it is outside the cone when it is further from the
            # cone's mantle than its radius.
            along = dx * hx + dy * hy + dz * hz
            across = np.sqrt(max(dx * dx + dy * dy + dz * dz - along * along, 0.0))
            if across * cosine - along * sites.sine[s] > radius + 1e-5 * (reach + radius):
                continue
            ties = 0
            for m in range(n):  # without branches, so that it vectorises
                dx = px[m] - bx
                dy = py[m] - by
                dz = pz[m] - bz
                distance2 = dx * dx + dy * dy + dz * dz
                seen = (distance2 <= reach * reach) & (
                    dx * hx + dy * hy + dz * hz >= cosine * np.sqrt(distance2)
                )
                ties += seen & (distance2 == best[m])
                nearer = seen & (distance2 < best[m])
                best[m] = distance2 if nearer else best[m]
                winner[m] = e if nearer else winner[m]
            if ties == 0:
                continue
            for m in range(n):
                dx = px[m] - bx
                dy = py[m] - by
                dz = pz[m] - bz
                distance2 = dx * dx + dy * dy + dz * dz
                if distance2 != best[m] or winner[m] == e:
                    continue
                seen = dx * hx + dy * hy + dz * hz >= cosine * np.sqrt(distance2)
                if seen and _precedes(
                    buds.tree_row, buds.serial, buds.kind, bud[e], bud[winner[m]]
                ):
                    winner[m] = e


@njit
def _update_gone(free: Any, n: Any, bits: Any, cloud_gone: Any, value: Any) -> Any:
    """Set the first `n` listed markers of a tile to gone (`value` 1) or back (0)."""
    for m in range(n):
        if free.code[m] >= CELLS:
            cloud_gone[free.code[m] - CELLS] = value
        elif value:
            bits |= np.uint64(1) << np.uint64(free.code[m])
        else:
            bits &= ~(np.uint64(1) << np.uint64(free.code[m]))
    return bits


@njit
def _work_on_tile(
    lattice: Any,
    entries: Any,
    rows_near: Any,
    rows_far: Any,
    sites: Any,
    buds: Any,
    envelopes: Any,
    cloud: Any,
    gone: Any,
    release: Any,
    tile: Any,
    free: Any,
    winner: Any,
    cloud_winner: Any,
) -> None:
    """Take and share out the markers of one tile."""
    nx, ny, _ = lattice.shape
    x, y, z = tile % nx, tile // nx % ny, tile // (nx * ny)
    gone_z, gone_y, gone_x = z + gone.at[0], y + gone.at[1], x + gone.at[2]
    winner[:] = -1
    bits = np.uint64(0) if release else gone.bits[gone_z, gone_y, gone_x]
    n = _gather(lattice, envelopes, cloud, bits, x, y, z, free)
    if n == 0:
        return
    if not release:
        bits = _update_gone(free, n, bits, cloud.gone, 1)
    n = _clear_occupied(lattice, entries, rows_near, sites, x, y, z, free, n)
    if not release:
        gone.bits[gone_z, gone_y, gone_x] = _update_gone(free, n, bits, cloud.gone, 0)
    if n == 0:
        return
    _compete_in_tile(lattice, entries, rows_far, sites, buds, x, y, z, free, n)
    for m in range(n):
        if free.code[m] < CELLS:
            winner[free.code[m]] = free.winner[m]
        else:
            cloud_winner[free.code[m] - CELLS] = free.winner[m]


@njit
def _compete_chunk(
    chunk: Any,
    lattice: Any,
    entries: Any,
    rows_near: Any,
    rows_far: Any,
    sites: Any,
    buds: Any,
    envelopes: Any,
    cloud: Any,
    gone: Any,
    release: Any,
    tiles: Any,
    scratch_size: Any,
    winner: Any,
    cloud_winner: Any,
) -> None:
    blocks = (len(tiles) + _BLOCK - 1) // _BLOCK
    free = Scratch(
        np.empty((3, scratch_size)),
        np.empty(scratch_size, np.int64),
        np.empty(scratch_size),
        np.empty(scratch_size, np.int64),
    )
    for block in range(chunk, blocks, CHUNKS):
        for t in range(block * _BLOCK, min((block + 1) * _BLOCK, len(tiles))):
            _work_on_tile(
                lattice,
                entries,
                rows_near,
                rows_far,
                sites,
                buds,
                envelopes,
                cloud,
                gone,
                release,
                tiles[t],
                free,
                winner[t],
                cloud_winner,
            )


@driver
def _compete_chunks(
    first: Any,
    step: Any,
    lattice: Any,
    entries: Any,
    rows_near: Any,
    rows_far: Any,
    sites: Any,
    buds: Any,
    envelopes: Any,
    cloud: Any,
    gone: Any,
    release: Any,
    tiles: Any,
    scratch_size: Any,
    winner: Any,
    cloud_winner: Any,
) -> None:
    for chunk in range(first, CHUNKS, step):
        _compete_chunk(
            chunk,
            lattice,
            entries,
            rows_near,
            rows_far,
            sites,
            buds,
            envelopes,
            cloud,
            gone,
            release,
            tiles,
            scratch_size,
            winner,
            cloud_winner,
        )


def compete(
    lattice: Lattice,
    entries: Entries,
    rows_near: Rows,
    rows_far: Rows,
    sites: Sites,
    buds: Buds,
    envelopes: Envelopes,
    cloud: Cloud,
    gone: Gone,
    release: bool,
    tiles: NDArray[np.int64],
    scratch_size: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Take the markers near buds and give the free ones to buds.

    Parameters
    ----------
    lattice, entries, rows_near, rows_far, sites, buds, envelopes, cloud
        See their classes; the rows reach as far as occupancy (near) and perception (far).
    gone : Gone
        Markers that are gone for good; updated unless `release`.
    tiles : int64 (n,)
        Tiles to work on, as flat indices of the box.
    scratch_size : int
        Largest number of markers in a tile.

    Returns
    -------
    winner, cloud_winner : int32 (n, 64), int32 (n_cloud,)
        Entry that each marker belongs to; -1 for none.
    """
    winner = np.empty((len(tiles), CELLS), np.int32)
    cloud_winner = np.full(len(cloud.point), -1, np.int32)
    in_threads(
        _compete_chunks,
        lattice,
        entries,
        rows_near,
        rows_far,
        sites,
        buds,
        envelopes,
        cloud,
        gone,
        release,
        tiles,
        scratch_size,
        winner,
        cloud_winner,
    )
    return winner, cloud_winner
