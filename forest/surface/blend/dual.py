"""Dual marching cubes over balanced cells: always a closed surface without branching edges.

Signs at the corners of a cell cut its boundary along closed loops. Each loop is a vertex; around
each edge that the surface crosses the vertices of its cells make a polygon (Nielson 2004, Dual
marching cubes; over octrees: Ju et al. 2002, Dual contouring of Hermite data). How a face is cut
hangs only on the lattice points on its rim, so that both its cells agree: each run of corners
inside is cut off by a segment of its own. Where a face has two segments or more, each has a vertex
too; else two cells could share an edge of four triangles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit

#: Offsets, in half cells, of the 27 points of a cell; index 9 i + 3 j + k.
POINTS = np.array([[i, j, k] for i in range(3) for j in range(3) for k in range(3)], np.int64)
#: Nearest to a lattice point that the surface is put on an edge, as a part of it.
_END = 0.02
VERTEX_BITS = 30  # bits of a vertex' number in a record


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


FACES = _faces()
#: Where something lies around an edge, in eighths of a turn, by the signs of its offset plus 1.
_AROUND = np.array([[5, 4, 3], [6, -1, 2], [7, 0, 1]], np.int64)


@njit
def _outline(p: Any, face: Any, part: Any, ring: Any) -> Any:
    """List the points around a part of a face; gives how many, 0 where there is no such part."""
    if p[face[8]] >= 0:
        ring[0], ring[1] = face[part], face[4 + part]
        ring[2], ring[3] = face[8], face[4 + (part + 3) % 4]
        return np.int64(4)
    n = np.int64(0)
    if part == 0:
        for k in range(4):
            ring[n] = face[k]
            n += 1
            if p[face[4 + k]] >= 0:
                ring[n] = face[4 + k]
                n += 1
    return n


@njit
def _sign(a: Any) -> Any:
    return np.int64(a > 0) - np.int64(a < 0)


@njit
def _name(p: Any, a: Any, b: Any, at: Any) -> Any:
    """Name the edge between two of a cell's points, and where `at` (in quarters) lies around it."""
    low, high = min(a, b), max(a, b)
    axis = np.int64(0)
    while POINTS[low, axis] == POINTS[high, axis]:
        axis += 1
    u, v = (axis + 1) % 3, (axis + 2) % 3
    du = _sign(at[u] - POINTS[low, u] - POINTS[high, u])
    dv = _sign(at[v] - POINTS[low, v] - POINTS[high, v])
    half = np.int64((POINTS[low, axis] + POINTS[high, axis]) % 2)
    return ((np.int64(p[low]) * 3 + axis) * 8 + _AROUND[du + 1, dv + 1]) * 2 + half


@njit
def _crossing(p: Any, f: Any, place: Any, a: Any, b: Any, out: Any) -> None:
    """Add the place where the surface crosses an edge to `out`."""
    i, j = p[a], p[b]
    t = min(max(f[i] / (f[i] - f[j]), _END), 1.0 - _END)
    for k in range(3):
        out[k] += (1.0 - t) * place[i, k] + t * place[j, k]


@njit
def _cut(p: Any, f: Any, place: Any, follow: Any, ends: Any, pairs: Any, between: Any, used: Any,
         write: Any) -> Any:  # fmt: skip
    """Cut a cell's faces; gives the edges crossed. `follow` leads from each to the next one.

    Edges are called by the sum of their ends' offsets. Segments that need a vertex go to `pairs`.
    """
    ring = np.empty(8, np.int64)
    opened, closed = np.empty(4, np.int64), np.empty(4, np.int64)
    middle = np.empty(3)
    crossed = np.int64(0)
    for face in range(6):
        for part in range(4):
            n = _outline(p, FACES[face], part, ring)
            segments = np.int64(0)
            for k in range(n):
                if f[p[ring[k]]] < 0.0 or f[p[ring[(k + 1) % n]]] >= 0.0:
                    continue
                j = (k + 1) % n
                while f[p[ring[(j + 1) % n]]] < 0.0:
                    j = (j + 1) % n
                opened[segments], closed[segments] = k, j
                segments += 1
            for s in range(segments):
                for end in range(2):
                    k = closed[s] if end else opened[s]
                    a, b = ring[k], ring[(k + 1) % n]
                    edge = np.sum(POINTS[a] * _WEIGHT) + np.sum(POINTS[b] * _WEIGHT)
                    ends[edge, 0], ends[edge, 1] = a, b
                    if end:
                        last = edge
                    else:
                        first = edge
                if face % 2 == 0:
                    first, last = last, first
                follow[first] = last
                crossed += 1
                if segments < 2:
                    continue
                if write:
                    for k in range(3):
                        low = high = POINTS[ring[0], k]
                        for i in range(1, n):
                            low = min(low, POINTS[ring[i], k])
                            high = max(high, POINTS[ring[i], k])
                        middle[k] = low + high
                    k, m = used[2], np.int64(0)
                    between[k] = 0.0
                    for edge in (first, last):
                        a, b = ends[edge, 0], ends[edge, 1]
                        pairs[k, m] = _name(p, a, b, middle) & ~1
                        _crossing(p, f, place, a, b, between[k])
                        m += 1
                    between[k] *= 0.5
                used[2] += 1
    return crossed


_WEIGHT = np.array([25, 5, 1], np.int64)
_CENTRE = np.array([2.0, 2.0, 2.0])


@njit
def loops(members: Any, f: Any, place: Any, near: Any, vertex: Any, room: Any, hint: Any,
          record: Any, pairs: Any, between: Any, write: Any) -> Any:  # fmt: skip
    """Find the loops of all cells; gives the numbers of vertices, records and segments.

    If asked to, writes each vertex, half its cell's width and a cone near it; a record for each
    edge on a loop, its name and the vertex; and for each segment with a vertex the two edges that
    it joins.
    """
    used = np.zeros(3, np.int64)
    follow, ends = np.full(125, -1, np.int64), np.empty((125, 2), np.int64)
    for i in range(len(members)):
        p = members[i]
        inside, mixed = f[p[0]] < 0.0, False
        for k in range(27):
            if p[k] >= 0 and (f[p[k]] < 0.0) != inside:
                mixed = True
                break
        if not mixed:
            continue
        crossed = _cut(p, f, place, follow, ends, pairs, between, used, write)
        edge = np.int64(0)
        while crossed > 0:
            while follow[edge] < 0:
                edge += 1
            v, around, here = used[0], np.int64(0), edge
            if write:
                vertex[v] = 0.0
                room[v] = 0.5 * (place[p[26], 0] - place[p[0], 0])
                hint[v] = near[p[ends[edge, 0]]]
            while follow[here] >= 0:
                a, b = ends[here, 0], ends[here, 1]
                if write:
                    _crossing(p, f, place, a, b, vertex[v])
                    record[used[1]] = (_name(p, a, b, _CENTRE) << VERTEX_BITS) | v
                used[1] += 1
                around += 1
                ahead = follow[here]
                follow[here] = -1
                here = ahead
            if write:
                vertex[v] /= around
            used[0] += 1
            crossed -= around
    return used


@njit
def _put(out: Any, at: Any, a: Any, b: Any, c: Any, turned: Any) -> Any:
    if at < len(out):
        out[at, 0] = a
        out[at, 1], out[at, 2] = (c, b) if turned else (b, c)
    return at + 1


@njit
def polygons(record: Any, f: Any, point: Any, cells: Any, middle: Any, triangle: Any) -> Any:
    """Cut the polygon around each crossed edge into triangles.

    Parameters
    ----------
    record : int64 (r,)
        Sorted; those of one edge stand together, in the order around it.
    f : float64
        Values at lattice points.
    point : float64 (n, 3)
        Vertices; the first `cells` of them lie in cells, the others on faces.
    middle : float64 (k, 3)
        Filled with vertices in the middle of polygons; may be too short.
    triangle : int32 (m, 3)
        Filled; may be too short.

    Returns
    -------
    tuple
        How many polygons with a middle, and how many triangles there are.
    """
    ring, half = np.empty(16, np.int64), np.empty(16, np.int64)
    mask = (np.int64(1) << VERTEX_BITS) - 1
    made, count = np.int64(0), np.int64(0)
    i = np.int64(0)
    while i < len(record):
        edge = record[i] >> (VERTEX_BITS + 4)
        n, on_faces = np.int64(0), False
        while i < len(record) and record[i] >> (VERTEX_BITS + 4) == edge:
            if n < len(ring):
                ring[n], half[n] = record[i] & mask, (record[i] >> VERTEX_BITS) & 1
                on_faces = on_faces or ring[n] >= cells
                n += 1
            i += 1
        turned = f[edge // 3] >= 0.0
        if n < 3:
            continue  # cells are missing
        if n == 3 and not on_faces:
            count = _put(triangle, count, ring[0], ring[1], ring[2], turned)
            continue
        if n == 4 and not on_faces:
            # Two cells that share more than this edge are not joined across it.
            one, other = not (half[0] and half[2]), not (half[1] and half[3])
            if one and other:
                a, b = point[ring[0]] - point[ring[2]], point[ring[1]] - point[ring[3]]
                one = np.sum(a * a) <= np.sum(b * b)
            if one or other:
                k = 0 if one else 1
                count = _put(triangle, count, ring[k], ring[k + 1], ring[k + 2], turned)
                count = _put(triangle, count, ring[k], ring[k + 2], ring[(k + 3) % 4], turned)
                continue
        if made < len(middle):
            middle[made] = 0.0
            for k in range(n):
                middle[made] += point[ring[k]] / n
        for k in range(n):
            count = _put(triangle, count, len(point) + made, ring[k], ring[(k + 1) % n], turned)
        made += 1
    return made, count
