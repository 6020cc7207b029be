"""Where markers are, and which buds are near them: cells, tiles of cells, bins of buds.

A procedural marker is its cell: its place in the cell is a hash of seed and cell. Markers are
worked on in tiles of 4 x 4 x 4 cells, and buds are sorted into bins of that size. A periodic plot
is a plane tiled with copies of itself, so each bud near an edge is entered once more beyond the
other edge and nothing else needs to know of wrapping.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.random import STREAM_MARKER, philox

#: Cells along the edge of a tile, and in it: the 64 of them share one word of "gone" bits.
EDGE = 4
CELLS = 64

ELLIPSOID = 0
CYLINDER = 1
BOX = 2

_X_BITS = 11
_Z_BITS = 10


class Lattice(NamedTuple):
    """The cells, the box of tiles whose markers buds may reach, and the box that buds lie in.

    `cell` is the edge of a cell along x, y, z (m), `cells` the number of cells along x and y of a
    periodic plot (0: unbounded). Tiles `low` to `low + shape` hold markers; buds are sorted into
    the bins `low - reach` to `low + shape + reach`.
    """

    seed: np.uint64
    cell: NDArray[np.float64]
    cells: NDArray[np.int64]
    low: NDArray[np.int64]
    shape: NDArray[np.int64]
    reach: NDArray[np.int64]


class Entries(NamedTuple):
    """Buds sorted by bin, copies beyond the edges of a periodic plot included.

    Bin (x, y, z) holds entries ``first[b]`` to ``first[b + 1]``, b = x + nx (y + ny z).
    """

    first: NDArray[np.int64]
    bud: NDArray[np.int32]
    species: NDArray[np.int16]
    point: NDArray[np.float64]
    heading: NDArray[np.float32]


class Rows(NamedTuple):
    """Rows of bins around a tile that hold all buds within a distance, the nearest first.

    `offset` is (dy, dz, half) of each row, which runs from x - half to x + half.
    """

    offset: NDArray[np.int64]


class Sites(NamedTuple):
    """Per species: occupancy radius, perception distance (m), cosine and sine of half the angle."""

    occupancy: NDArray[np.float64]
    perception: NDArray[np.float64]
    cosine: NDArray[np.float64]
    sine: NDArray[np.float64]


class Cloud(NamedTuple):
    """Explicit markers sorted by tile: tile t holds ``order[first[t] : first[t + 1]]``.

    `first` is empty if there are none; `gone` tells which have been taken for good.
    """

    point: NDArray[np.float64]
    order: NDArray[np.int64]
    first: NDArray[np.int64]
    gone: NDArray[np.uint8]


class Gone(NamedTuple):
    """Bits of the markers that are gone for good, one word per tile [z, y, x].

    `at` is the place (z, y, x) of the first tile of the box in `bits`.
    """

    bits: NDArray[np.uint64]
    at: NDArray[np.int64]


class Envelopes(NamedTuple):
    """Regions outside which there are no procedural markers: shape, centre, full size (m)."""

    shape: NDArray[np.int64]
    centre: NDArray[np.float64]
    size: NDArray[np.float64]


@njit
def cell_words(seed: Any, tile_x: Any, j: Any, k: Any) -> Any:
    """Random words of the four cells of one row of a tile."""
    return philox(tile_x, j, k, STREAM_MARKER, seed, seed >> np.uint64(32))


@njit
def jitter(word: Any) -> Any:
    """Place of a marker in its cell, as fractions in (0, 1), from 32 random bits."""
    x = np.int64(word) & 2047
    y = (np.int64(word) >> _X_BITS) & 2047
    z = np.int64(word) >> (2 * _X_BITS)
    return (x + 0.5) / 2048.0, (y + 0.5) / 2048.0, (z + 0.5) / 1024.0


@njit
def inside(envelopes: Any, x: Any, y: Any, z: Any) -> Any:
    """Tell whether a point lies in any envelope (or there are none)."""
    n = len(envelopes.shape)
    for e in range(n):
        dx = 2.0 * (x - envelopes.centre[e, 0]) / envelopes.size[e, 0]
        dy = 2.0 * (y - envelopes.centre[e, 1]) / envelopes.size[e, 1]
        dz = 2.0 * (z - envelopes.centre[e, 2]) / envelopes.size[e, 2]
        if abs(dx) > 1.0 or abs(dy) > 1.0 or abs(dz) > 1.0:
            continue
        shape = envelopes.shape[e]
        if shape == BOX:
            return True
        if shape == CYLINDER and dx * dx + dy * dy <= 1.0:
            return True
        if shape == ELLIPSOID and dx * dx + dy * dy + dz * dz <= 1.0:
            return True
    return n == 0


@njit
def _bin_of(lattice: Any, x: Any, y: Any, z: Any) -> Any:
    """Bin of a point; -1 if no marker can be within reach of it."""
    cell = lattice.cell
    b = np.int64(0)
    for axis in range(2, -1, -1):
        value = x if axis == 0 else (y if axis == 1 else z)
        n = lattice.shape[axis] + 2 * lattice.reach[axis]
        i = np.int64(np.floor(value / (EDGE * cell[axis]))) - lattice.low[axis]
        i += lattice.reach[axis]
        if i < 0 or i >= n:
            return np.int64(-1)
        b = b * n + i
    return b


@njit
def _copies(value: Any, reach: Any, length: Any) -> Any:
    """Shifts (in plot lengths) that bring a coordinate within reach of a periodic plot."""
    if length == 0.0:
        return 0, 0
    low = np.int64(np.ceil((-reach - value) / length))
    high = np.int64(np.floor((length + reach - value) / length))
    return low, high


@njit
def _enter(buds: Any, sites: Any, lattice: Any, write: Any, cursor: Any, entries: Any) -> None:
    """Count the entries of each bin in `cursor`, or (`write`) put them where it points."""
    size_x = lattice.cell[0] * lattice.cells[0]
    size_y = lattice.cell[1] * lattice.cells[1]
    for b in range(len(buds.species)):
        s = buds.species[b]
        reach = max(sites.occupancy[s], sites.perception[s])
        low_x, high_x = _copies(buds.position[b, 0], reach, size_x)
        low_y, high_y = _copies(buds.position[b, 1], reach, size_y)
        z = buds.position[b, 2]
        for copy_y in range(low_y, high_y + 1):
            y = buds.position[b, 1] + copy_y * size_y
            for copy_x in range(low_x, high_x + 1):
                x = buds.position[b, 0] + copy_x * size_x
                place = _bin_of(lattice, x, y, z)
                if place < 0:
                    continue
                e = cursor[place]
                cursor[place] += 1
                if write:
                    entries.bud[e] = b
                    entries.species[e] = s
                    entries.point[e, 0] = x
                    entries.point[e, 1] = y
                    entries.point[e, 2] = z
                    for axis in range(3):
                        entries.heading[e, axis] = buds.heading[b, axis]


@njit
def sort_buds(buds: Any, sites: Any, lattice: Any) -> Any:
    """Sort buds, and their copies beyond periodic edges, into bins; stable."""
    bins = np.int64(1)
    for axis in range(3):
        bins *= lattice.shape[axis] + 2 * lattice.reach[axis]
    count = np.zeros(bins, np.int64)
    nothing = Entries(
        count,
        np.empty(0, np.int32),
        np.empty(0, np.int16),
        np.empty((0, 3), np.float64),
        np.empty((0, 3), np.float32),
    )
    _enter(buds, sites, lattice, False, count, nothing)
    first = np.zeros(bins + 1, np.int64)
    first[1:] = np.cumsum(count)
    n = first[bins]
    entries = Entries(
        first,
        np.empty(n, np.int32),
        np.empty(n, np.int16),
        np.empty((n, 3), np.float64),
        np.empty((n, 3), np.float32),
    )
    _enter(buds, sites, lattice, True, first[:-1].copy(), entries)
    return entries


@njit
def row_bounds(lattice: Any, first: Any, rows: Any, r: Any, x: Any, y: Any, z: Any) -> Any:
    """Entries in the r-th row of bins around the tile (x, y, z) of the box."""
    nx = lattice.shape[0] + 2 * lattice.reach[0]
    ny = lattice.shape[1] + 2 * lattice.reach[1]
    row = (z + lattice.reach[2] + rows.offset[r, 1]) * ny
    row = (row + y + lattice.reach[1] + rows.offset[r, 0]) * nx + x + lattice.reach[0]
    half = rows.offset[r, 2]
    return first[row - half], first[row + half + 1]


@driver
def _reach_lines(
    start: Any, step: Any, lattice: Any, first: Any, rows: Any, gone: Any, use_gone: Any, flags: Any
) -> None:
    nz, ny, nx = flags.shape
    for line in range(start, nz * ny, step):
        z = line // ny
        y = line % ny
        for x in range(nx):
            if use_gone:
                word = gone.bits[z + gone.at[0], y + gone.at[1], x + gone.at[2]]
                if word == np.uint64(0xFFFFFFFFFFFFFFFF):
                    continue
            for r in range(len(rows.offset)):
                here, end = row_bounds(lattice, first, rows, r, x, y, z)
                if end > here:
                    flags[z, y, x] = 1
                    break


def reached_tiles(
    lattice: Lattice, first: NDArray[np.int64], rows: Rows, gone: Gone, use_gone: bool
) -> NDArray[np.uint8]:
    """Flag the tiles that have buds within reach and markers left."""
    nx, ny, nz = lattice.shape
    flags = np.zeros((nz, ny, nx), np.uint8)
    in_threads(_reach_lines, lattice, first, rows, gone, use_gone, flags)
    return flags
