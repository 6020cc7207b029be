"""From cells near the surface to triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver
from forest._threads import in_threads
from forest.surface.blend.cells import Lattice, pack, unpack
from forest.surface.blend.dual import FACES, POINTS, VERTEX_BITS, loops, polygons
from forest.surface.blend.field import Blend, value
from forest.surface.blend.settling import settled

_Keys = NDArray[np.int64]
_CHUNKS = 64
_CORNERS = np.flatnonzero((POINTS % 2 == 0).all(axis=1))
#: Middles of edges and faces: points that are there where a neighbour is finer.
_BETWEEN = np.setdiff1d(np.arange(27), [*_CORNERS, 13])


def lattice_points(leaves: list[_Keys]) -> _Keys:
    """List the corners of all cells, and what faces with a point in the middle need."""
    points = np.zeros(0, np.int64)
    for level, keys in enumerate(leaves):
        shifts = pack(POINTS[_CORNERS] * (1 << level))
        points = _sorted(np.concatenate([points, *(keys + shift for shift in shifts)]))
    more = [points]
    for level, keys in enumerate(leaves[1:], 1):
        shifts = pack(POINTS * (1 << level))
        for face in FACES:
            cut = keys[_find(points, keys + shifts[face[8]]) >= 0]
            more += [cut + shifts[m] for m in face[4:8]]
    return _sorted(np.concatenate(more))


def _sorted(keys: _Keys) -> _Keys:
    """Sort keys and drop those that are there twice; in place."""
    keys.sort(kind="stable")
    return keys[np.concatenate(([True], keys[1:] != keys[:-1]))] if len(keys) else keys


def _find(points: _Keys, keys: _Keys) -> _Keys:
    """Index of each key among sorted points; -1 where it is none."""
    at = np.minimum(np.searchsorted(points, keys), len(points) - 1)
    return np.where(points[at] == keys, at, -1)


def members_of(points: _Keys, leaves: list[_Keys], inside: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Give the 27 points, -1 where there is none, of each cell that the surface may cross."""
    rows = []
    for level, keys in enumerate(leaves):
        shifts = pack(POINTS * (1 << level))
        corner = np.empty((len(keys), 8), np.int32)
        for k, point in enumerate(_CORNERS):
            corner[:, k] = _find(points, keys + shifts[point])
        if level == 0:  # nothing is finer
            within = inside[corner].sum(axis=1)
            crossed = (within > 0) & (within < 8)
            keys, corner = keys[crossed], corner[crossed]
        row = np.full((len(keys), 27), -1, np.int32)
        row[:, _CORNERS] = corner
        for point in _BETWEEN if level else ():
            row[:, point] = _find(points, keys + shifts[point])
        rows.append(row)
    return np.concatenate(rows)


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
        On the surface, or as far off it as `settled` says, m.
    triangles : int32 (m, 3)
        Anticlockwise from outside. Closed if no cell is missing.
    """
    keys = lattice_points(leaves)
    places = lattice.places(unpack(keys))
    f, near = np.empty(len(places)), np.empty(len(places), np.int64)
    in_threads(_values, blend.kernel, places, f, near)
    members = members_of(keys, leaves, f < 0.0)
    del keys
    points, triangles, room, hints = sheets(members, f, places, near, lattice.unit)
    del members, places, f, near
    return settled(blend, points, triangles, room, hints), triangles


def sheets(
    members: NDArray[np.int32],
    f: NDArray[np.float64],
    places: NDArray[np.float64],
    near: _Keys,
    unit: float,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64], _Keys]:
    """Part the lattice points inside from those outside by triangles.

    Parameters
    ----------
    members : int32 (cells, 27)
        Lattice points of each cell, -1 where there is none.
    f, places, near : arrays (n,), (n, 3), (n,)
        Values at lattice points, negative inside; where they lie, m; and the cones nearest to them.
    unit : float
        Half the width of the smallest cell, m.

    Returns
    -------
    tuple
        Points, triangles, how far each point may be moved at a time (m), and a cone near each.
    """
    points, room, hints, record, cells = _vertices(members, f, places, near, unit)
    middle, triangles = np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    made, count = polygons(record, f, points, cells, middle, triangles)
    middle, triangles = np.empty((made, 3)), np.empty((count, 3), np.int32)
    polygons(record, f, points, cells, middle, triangles)
    room = np.concatenate((room, np.full(made, 0.5 * unit)))
    hints = np.concatenate((hints, np.zeros(made, np.int64)))
    return np.concatenate((points, middle)), triangles, room, hints


def _vertices(
    members: NDArray[np.int32],
    f: NDArray[np.float64],
    places: NDArray[np.float64],
    near: _Keys,
    unit: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], _Keys, _Keys, int]:
    """Give vertices, how far each may be moved, cones near them, and records.

    Also how many vertices lie in cells; the others lie on faces.
    """
    none, empty = np.zeros(0), np.zeros(0, np.int64)
    no_pairs, no_points = np.zeros((0, 2), np.int64), np.zeros((0, 3))
    size = loops(
        members, f, places, near, no_points, none, empty, empty, no_pairs, no_points, False
    )
    points, room, hints = np.empty((size[0], 3)), np.empty(size[0]), np.empty(size[0], np.int64)
    record = np.empty(size[1], np.int64)
    pairs, between = np.empty((size[2], 2), np.int64), np.empty((size[2], 3))
    loops(members, f, places, near, points, room, hints, record, pairs, between, True)
    pairs, index = np.unique(np.sort(pairs, axis=1), axis=0, return_index=True)
    names = pairs.T << VERTEX_BITS | (len(points) + np.arange(len(pairs)))
    record = np.concatenate((record, names.ravel()))
    record.sort()
    hints = np.concatenate((hints, np.zeros(len(pairs), np.int64)))
    room = np.concatenate((room, np.full(len(pairs), 0.5 * unit)))
    return np.concatenate((points, between[index])), room, hints, record, int(size[0])
