"""Marching tetrahedra over balanced cells: always a closed surface without branching edges.

A cell is cut into tetrahedra between its centre and triangles on its faces. How a face is cut
hangs only on which lattice points exist on it, so that both its cells agree: a face with a point
in its middle is four squares, one with points on its edges a fan from the first of them, one
without any is cut along the diagonal from its lowest corner.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.surface.blend.cells import Lattice, pack, unpack
from forest.surface.blend.field import Blend, on_surface, value
from forest.surface.mesh import Mesh

_Keys = NDArray[np.int64]
_CHUNKS = 64
#: Nearest to a lattice point that a vertex is put on an edge, as a part of it.
_END = 0.08

#: Offsets, in half cells, of the 27 points of a cell; index 9 i + 3 j + k.
_POINTS = np.array([[i, j, k] for i in range(3) for j in range(3) for k in range(3)], np.int64)


def _faces() -> NDArray[np.int64]:
    """Points of each face: four corners around it, the middles after each, and its centre.

    Seen from outside the corners of the high faces run anticlockwise, of the low ones clockwise.
    """
    rows = []
    for axis in range(3):
        b, c = [(1, 2), (2, 0), (0, 1)][axis]
        for side in (0, 2):
            row = []
            for u, v in ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)):
                p = [0, 0, 0]
                p[axis], p[b], p[c] = side, u, v
                row.append(9 * p[0] + 3 * p[1] + p[2])
            rows.append(row)
    return np.array(rows, np.int64)


_FACES = _faces()


def lattice_points(leaves: list[_Keys]) -> _Keys:
    """List corners and centres of all cells, and what faces with a point in the middle need."""
    corner = _POINTS[(_POINTS % 2 == 0).all(1)]
    parts = []
    for level, keys in enumerate(leaves):
        grid = unpack(keys)
        parts.append(np.unique(pack((grid[:, None] + corner * (1 << level)).reshape(-1, 3))))
        parts.append(pack(grid + (1 << level)))
    points = np.unique(np.concatenate(parts))
    more = []
    for level, keys in enumerate(leaves):
        if level == 0:
            continue
        grid = unpack(keys)
        for face in _FACES:
            centre = pack(grid + _POINTS[face[8]] * (1 << level))
            cut = grid[_find(points, centre) >= 0]
            more += [pack(cut + _POINTS[m] * (1 << level)) for m in face[4:8]]
    return np.unique(np.concatenate([points, *more]))


def _find(points: _Keys, keys: _Keys) -> _Keys:
    """Index of each key among sorted points; -1 where it is none."""
    at = np.minimum(np.searchsorted(points, keys), len(points) - 1)
    return np.where(points[at] == keys, at, -1)


def _members(points: _Keys, leaves: list[_Keys]) -> NDArray[np.int32]:
    """Give each cell's 27 points as indices, -1 where there is none."""
    rows = []
    for level, keys in enumerate(leaves):
        grid = unpack(keys)
        row = np.empty((len(keys), 27), np.int32)
        for k, offset in enumerate(_POINTS):
            whole = bool((offset % 2 == 0).all()) or k == 13
            if level == 0 and not whole:
                row[:, k] = -1
            else:
                row[:, k] = _find(points, pack(grid + offset * (1 << level)))
        rows.append(row)
    return np.concatenate(rows)


@njit
def _emit(
    a: Any, b: Any, c: Any, d: Any, inside: Any, count: Any, key: Any, n: Any, write: Any
) -> Any:
    """Cut one tetrahedron, its corners positively turned; gives the number of triangles so far."""
    which = (
        np.int64(inside[a]) + 2 * np.int64(inside[b]) + 4 * np.int64(inside[c])
    ) + 8 * np.int64(inside[d])
    if which == 0 or which == 15:
        return count
    # Bring the corners into an even order in which those inside come first.
    if which == 2 or which == 13:
        a, b, c, d = b, c, a, d
    elif which == 4 or which == 11:
        a, b, c, d = c, a, b, d
    elif which == 8 or which == 7:
        a, b, c, d = d, c, b, a
    elif which == 5:
        a, b, c, d = a, c, d, b
    elif which == 9:
        a, b, c, d = a, d, b, c
    elif which == 6:
        a, b, c, d = b, c, a, d
    elif which == 10:
        a, b, c, d = b, d, c, a
    elif which == 12:
        a, b, c, d = c, d, a, b
    one = which == 1 or which == 2 or which == 4 or which == 8
    three = which == 14 or which == 13 or which == 11 or which == 7
    if one:
        if write:
            _triangle(key, count, n, a, b, a, c, a, d)
        return count + 1
    if three:
        if write:
            _triangle(key, count, n, a, b, a, d, a, c)
        return count + 1
    if write:
        _triangle(key, count, n, a, c, a, d, b, d)
        _triangle(key, count + 1, n, a, c, b, d, b, c)
    return count + 2


@njit
def _triangle(key: Any, at: Any, n: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> None:
    key[at, 0] = min(a, b) * n + max(a, b)
    key[at, 1] = min(c, d) * n + max(c, d)
    key[at, 2] = min(e, f) * n + max(e, f)


@njit
def _face(
    o: Any, p: Any, face: Any, high: Any, inside: Any, count: Any, key: Any, n: Any, write: Any
) -> Any:
    """Cut the tetrahedra over one face of a cell whose centre is `o`."""
    if p[face[8]] >= 0:
        for k in range(4):
            a, b, c, d = p[face[0]], p[face[4]], p[face[8]], p[face[7]]  # lowest corner first
            if k == 1:
                a, b, c, d = p[face[4]], p[face[1]], p[face[5]], p[face[8]]
            elif k == 2:
                a, b, c, d = p[face[8]], p[face[5]], p[face[2]], p[face[6]]
            elif k == 3:
                a, b, c, d = p[face[7]], p[face[8]], p[face[6]], p[face[3]]
            count = _pair(o, a, b, c, d, high, inside, count, key, n, write)
        return count
    apex = -1
    for k in range(4):
        if apex < 0 and p[face[4 + k]] >= 0:
            apex = k
    if apex < 0:
        return _pair(
            o, p[face[0]], p[face[1]], p[face[2]], p[face[3]], high, inside, count, key, n, write
        )
    top = np.int64(p[face[4 + apex]])
    last = np.int64(p[face[(apex + 1) % 4]])
    for step in range(1, 4):
        middle = np.int64(p[face[4 + (apex + step) % 4]])
        corner = np.int64(p[face[(apex + step + 1) % 4]])
        if middle >= 0:
            count = _one(o, top, last, middle, high, inside, count, key, n, write)
            last = middle
        count = _one(o, top, last, corner, high, inside, count, key, n, write)
        last = corner
    return count


@njit
def _pair(
    o: Any, a: Any, b: Any, c: Any, d: Any, high: Any, inside: Any, count: Any, key: Any, n: Any,
    write: Any,
) -> Any:  # fmt: skip
    count = _one(o, a, b, c, high, inside, count, key, n, write)
    return _one(o, a, c, d, high, inside, count, key, n, write)


@njit
def _one(
    o: Any, a: Any, b: Any, c: Any, high: Any, inside: Any, count: Any, key: Any, n: Any, write: Any
) -> Any:
    o, a, b, c = np.int64(o), np.int64(a), np.int64(b), np.int64(c)
    if high:
        return _emit(o, a, b, c, inside, count, key, n, write)
    return _emit(o, a, c, b, inside, count, key, n, write)


@njit
def _march(members: Any, faces: Any, inside: Any, key: Any, write: Any) -> Any:
    """Cut all cells; gives the number of triangles, and writes their edges' names if asked."""
    count = np.int64(0)
    n = np.int64(len(inside))
    for i in range(len(members)):
        p = members[i]
        o = p[13]
        mixed = False
        for k in range(27):
            if p[k] >= 0 and inside[p[k]] != inside[o]:
                mixed = True
        if not mixed:
            continue
        for f in range(6):
            count = _face(o, p, faces[f], f % 2 == 1, inside, count, key, n, write)
    return count


@driver
def _settle(
    first: Any, step: Any, field: Any, points: Any, most: Any, steps: Any, hints: Any
) -> None:
    for c in range(first, _CHUNKS, step):
        for i in range(len(points) * c // _CHUNKS, len(points) * (c + 1) // _CHUNKS):
            x, y, z, hints[i] = on_surface(
                field, points[i, 0], points[i, 1], points[i, 2], hints[i], steps, most[i]
            )
            points[i, 0], points[i, 1], points[i, 2] = x, y, z


@driver
def _values(first: Any, step: Any, field: Any, points: Any, out: Any, hints: Any) -> None:
    for c in range(first, _CHUNKS, step):
        hint = np.int64(0)
        for i in range(len(points) * c // _CHUNKS, len(points) * (c + 1) // _CHUNKS):
            out[i], hint = value(field, points[i, 0], points[i, 1], points[i, 2], hint)
            hints[i] = hint


def march(
    blend: Blend, lattice: Lattice, leaves: list[_Keys]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Polygonise the surface in the given cells.

    Returns
    -------
    points : float64 (n, 3)
        On the surface, m; only near it if the mesh is open.
    triangles : int32 (m, 3)
        Anticlockwise from outside. Closed if no cell is missing.
    """
    lattice_keys = lattice_points(leaves)
    members = _members(lattice_keys, leaves)
    places = lattice.places(unpack(lattice_keys))
    f, hints = np.empty(len(places)), np.empty(len(places), np.int64)
    in_threads(_values, blend.kernel, places, f, hints)
    inside = f < 0.0
    none = np.zeros((0, 3), np.int64)
    edges = np.empty((int(_march(members, _FACES, inside, none, False)), 3), np.int64)
    _march(members, _FACES, inside, edges, True)
    del members
    names, corners = np.unique(edges, return_inverse=True)
    del edges
    a, b = names // len(places), names % len(places)
    t = np.clip(f[a] / (f[a] - f[b]), _END, 1.0 - _END)[:, None]
    points = (1.0 - t) * places[a] + t * places[b]
    most = 0.5 * np.linalg.norm(places[a] - places[b], axis=1)
    hints = hints[a]
    triangles: NDArray[np.int32] = corners.reshape(-1, 3).astype(np.int32)
    if not Mesh(points, triangles, np.zeros((0, 3, 2))).is_watertight:
        return points, triangles  # a cell is missing: not worth the pulling
    return _even(blend, points, triangles, most, hints), triangles


#: Rounds in which vertices move towards the middle of their neighbours, along the surface.
_ROUNDS = 2


def _even(
    blend: Blend,
    points: NDArray[np.float64],
    triangles: NDArray[np.int32],
    most: NDArray[np.float64],
    hints: _Keys,
) -> NDArray[np.float64]:
    """Even out the triangles near the surface, then pull their vertices onto it."""
    kernel = blend.kernel
    in_threads(_settle, kernel, points, most, np.int64(1), hints)
    count = np.bincount(triangles.ravel(), minlength=len(points))[:, None].astype(np.float64)
    for _ in range(_ROUNDS):
        middle = np.zeros_like(points)
        for k in range(3):
            for axis in range(3):
                around = points[triangles[:, (k + 1) % 3], axis]
                around = around + points[triangles[:, (k + 2) % 3], axis]
                middle[:, axis] += np.bincount(triangles[:, k], around, minlength=len(points))
        step = 0.5 * (middle / (2.0 * count) - points)
        size = np.linalg.norm(step, axis=1)
        step *= np.minimum(1.0, 0.5 * most / np.maximum(size, 1e-12))[:, None]
        points = points + step
    in_threads(_settle, kernel, points, most, np.int64(6), hints)
    return points
