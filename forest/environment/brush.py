"""The procedural brush: markers laid along a stroke (Palubicki et al. 2009, section 5).

"At each iteration of the modeling algorithm the brush position defines the center of a sphere
within which marker points are generated." A stroke is a path of such spheres; between two points of
the path the brush moves on a straight line and its radius changes linearly. Markers are one
jittered point per cell of a grid, as the procedural ones are, kept where the spheres hold them; a
cell has one marker however often the brush passes.

All places are whole multiples of 2^-20 m, about a micrometre, so that a sum or difference of two of
them is exact: what symmetric brushes lay is then symmetric exactly (`forest.environment.symmetry`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.random import STREAM_BRUSH, philox

#: Places are whole multiples of 1 / this, m.
PER_METRE = 1048576.0
_RANDOM = 4294967296.0
#: A piece of the path is at most so many of its radii (or cells) long: its box is then nearly full.
_LONGEST = 4.0


class Pieces(NamedTuple):
    """A stroke cut into straight pieces.

    Attributes
    ----------
    start, end : float64 (n, 3)
        Ends of each, m.
    start_radius, end_radius : float64 (n,)
        Radius of the brush there, m.
    part : int64 (n,)
        Part of the stroke that each belongs to, from 0; rises along the path.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    start_radius: NDArray[np.float64]
    end_radius: NDArray[np.float64]
    part: NDArray[np.int64]


def on_grid(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round places to whole multiples of 2^-20 m."""
    return np.asarray(np.rint(places * PER_METRE) / PER_METRE, np.float64)


def cut_path(
    points: NDArray[np.float64], radius: NDArray[np.float64], parts: int, spacing_m: float
) -> Pieces:
    """Cut a path into parts of equal length, and these into short pieces.

    Parameters
    ----------
    points : float64 (n, 3)
        The path, m; at least one point.
    radius : float64 (n,)
        Radius of the brush at each point, m.
    parts : int
        Steps over which the brush moves along it.
    spacing_m : float
        Edge of a marker's cell, m.
    """
    if len(points) == 1:
        return Pieces(points, points, radius, radius, np.zeros(1, np.int64))
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.concatenate((np.zeros(1), np.cumsum(length)))
    borders = along[-1] * np.arange(1, parts) / parts
    first, last = np.searchsorted(borders, along[:-1], "right"), np.searchsorted(borders, along[1:])
    coarse = np.maximum(np.maximum(radius[:-1], radius[1:]), spacing_m) * _LONGEST
    line, share = [], []
    for s, n in enumerate(np.maximum(np.ceil(length / coarse), 1.0).astype(int)):
        cuts = np.arange(n + 1) / n
        if last[s] > first[s]:
            here = (borders[first[s] : last[s]] - along[s]) / length[s]
            cuts = np.unique(np.concatenate((cuts, here)))
        line.append(np.full(len(cuts) - 1, s))
        share.append(np.column_stack((cuts[:-1], cuts[1:])))
    at, span = np.concatenate(line), np.concatenate(share)
    ends = [
        np.where(
            t[:, None] == 1.0,
            points[at + 1],
            points[at] + t[:, None] * (points[at + 1] - points[at]),
        )
        for t in span.T
    ]
    wide = [
        np.where(t == 1.0, radius[at + 1], radius[at] + t * (radius[at + 1] - radius[at]))
        for t in span.T
    ]
    middle = along[at] + span.mean(axis=1) * length[at]
    part = np.searchsorted(borders, middle, "right").astype(np.int64)
    return Pieces(ends[0], ends[1], wide[0], wide[1], part)


@njit
def within_piece(pieces: Any, s: Any, x: Any, y: Any, z: Any) -> Any:
    """Tell whether any sphere of a piece holds a point."""
    px = x - pieces.start[s, 0]
    py = y - pieces.start[s, 1]
    pz = z - pieces.start[s, 2]
    dx = pieces.end[s, 0] - pieces.start[s, 0]
    dy = pieces.end[s, 1] - pieces.start[s, 1]
    dz = pieces.end[s, 2] - pieces.start[s, 2]
    r = pieces.start_radius[s]
    dr = pieces.end_radius[s] - r
    # |p - t d|^2 - (r + t dr)^2 is least at t = (p d + r dr) / (d d - dr dr), if that is a parabola
    # open upwards; else one end's sphere holds all others.
    curve = dx * dx + dy * dy + dz * dz - dr * dr
    t = 0.0
    if curve > 0.0:
        t = min(max((px * dx + py * dy + pz * dz + r * dr) / curve, 0.0), 1.0)
    elif dr > 0.0:
        t = 1.0
    ax, ay, az = px - t * dx, py - t * dy, pz - t * dz
    wide = r + t * dr
    return ax * ax + ay * ay + az * az <= wide * wide


@njit
def _place(index: Any, word: Any, spacing: Any) -> Any:
    """Coordinate of a marker in its cell from 32 random bits, on the grid of places."""
    value = (index + (np.float64(word) + 0.5) / _RANDOM) * spacing
    return np.floor(value * PER_METRE + 0.5) / PER_METRE


@njit
def _mark(
    pieces: Any, spacing: Any, key: Any, write: Any, cell: Any, point: Any, piece: Any
) -> Any:
    """Count the markers of all pieces, or (`write`) list them; give their number.

    A marker that the piece before holds as well is not listed again.
    """
    n = 0
    for s in range(len(pieces.part)):
        low = np.empty(3, np.int64)
        high = np.empty(3, np.int64)
        for axis in range(3):
            a = pieces.start[s, axis]
            b = pieces.end[s, axis]
            ra = pieces.start_radius[s]
            rb = pieces.end_radius[s]
            low[axis] = np.int64(np.floor(min(a - ra, b - rb) / spacing))
            high[axis] = np.int64(np.floor(max(a + ra, b + rb) / spacing))
        low[2] = max(low[2], 0)  # nothing lies below the ground
        for k in range(low[2], high[2] + 1):
            for j in range(low[1], high[1] + 1):
                for i in range(low[0], high[0] + 1):
                    u, v, w, _ = philox(i, j, k, STREAM_BRUSH, key[0], key[1])
                    x = _place(i, u, spacing)
                    y = _place(j, v, spacing)
                    z = _place(k, w, spacing)
                    if not within_piece(pieces, s, x, y, z):
                        continue
                    if s > 0 and within_piece(pieces, s - 1, x, y, z):
                        continue
                    if write:
                        cell[n, 0], cell[n, 1], cell[n, 2] = i, j, k
                        point[n, 0], point[n, 1], point[n, 2] = x, y, z
                        piece[n] = s
                    n += 1
    return n


@njit
def _stroke_key(seed: Any, number: Any) -> Any:
    """Key of the random numbers of a stroke."""
    a, b, _, _ = philox(number, number >> 32, 0, STREAM_BRUSH, seed, seed >> np.uint64(32))
    return np.array([a, b], np.uint64)


def lay_markers(
    pieces: Pieces, spacing_m: float, seed: int, number: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give the markers of a stroke, above the ground.

    Parameters
    ----------
    pieces : Pieces
        The stroke.
    spacing_m : float
        Edge of the cells that hold one marker each.
    seed, number : int
        Seed of the run, and number of the stroke in it: they fix each marker's place in its cell.

    Returns
    -------
    point : float64 (n, 3)
        Places, m, along the path.
    part : int64 (n,)
        Part of the stroke that laid each.
    """
    key = _stroke_key(np.uint64(seed), np.int64(number))
    cell, point = np.empty((0, 3), np.int64), np.empty((0, 3))
    piece = np.empty(0, np.int64)
    n = _mark(pieces, spacing_m, key, False, cell, point, piece)
    cell, point, piece = np.empty((n, 3), np.int64), np.empty((n, 3)), np.empty(n, np.int64)
    _mark(pieces, spacing_m, key, True, cell, point, piece)
    kept = first_of_each(cell)
    return point[kept], pieces.part[piece[kept]]


def first_of_each(rows: NDArray[Any]) -> NDArray[np.int64]:
    """Find the first of equal rows (n, 3); their indices in rising order."""
    if not len(rows):
        return np.empty(0, np.int64)
    order = np.lexsort(rows.T)  # stable
    ordered = rows[order]
    new = np.ones(len(rows), np.bool_)
    new[1:] = np.any(ordered[1:] != ordered[:-1], axis=1)
    return np.sort(order[new])
