"""Dual marching cubes over cells of any sizes, with dictionaries: a twin of `blend.dual`.

Lattice points are tuples of three integers. A cell is its low corner and its width. Nothing is
packed, numbered or sorted, and sheets are found by flooding from each crossed edge to its partners.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict

import numpy as np

Point = tuple[int, int, int]
Edge = frozenset[Point]
Cell = tuple[Point, int]
Place = np.ndarray

END = 0.02  # nearest to a lattice point that the surface is put on an edge, as a part of it


def shifted(point: Point, by: tuple[int, int, int]) -> Point:
    return (point[0] + by[0], point[1] + by[1], point[2] + by[2])


def faces(cell: Cell, f: dict[Point, float]) -> list[list[Point]]:
    """Rims of a cell's faces, or of their quarters where smaller cells lie beyond."""
    corner, wide = cell
    half = wide // 2
    found = []
    for axis, side in itertools.product(range(3), (0, wide)):

        def at(u: int, v: int, axis: int = axis, side: int = side) -> Point:
            by = [u, v]
            by.insert(axis, side)
            return shifted(corner, (by[0], by[1], by[2]))

        if at(half, half) in f:
            for u, v in itertools.product((0, half), repeat=2):
                found.append([at(u, v), at(u + half, v), at(u + half, v + half), at(u, v + half)])
        else:
            ring = [(0, 0), (half, 0), (wide, 0), (wide, half), (wide, wide), (half, wide),
                    (0, wide), (0, half)]  # fmt: skip
            found.append([at(u, v) for k, (u, v) in enumerate(ring) if k % 2 == 0 or at(u, v) in f])
    return found


def segments(ring: list[Point], f: dict[Point, float]) -> list[tuple[Edge, Edge]]:
    """Cut each run of points inside off a face: pairs of the edges at either end of a run."""
    n = len(ring)
    found = []
    for k in range(n):
        if f[ring[k]] >= 0.0 and f[ring[(k + 1) % n]] < 0.0:
            last = (k + 1) % n
            while f[ring[(last + 1) % n]] < 0.0:
                last = (last + 1) % n
            entry = frozenset((ring[k], ring[(k + 1) % n]))
            found.append((entry, frozenset((ring[last], ring[(last + 1) % n]))))
    return found


def crossing(edge: Edge, f: dict[Point, float], place: dict[Point, Place]) -> Place:
    a, b = sorted(edge)
    t = min(max(f[a] / (f[a] - f[b]), END), 1.0 - END)
    return (1.0 - t) * place[a] + t * place[b]


def flood(start: Edge, partners: dict[Edge, list[Edge]]) -> set[Edge]:
    reached, left = {start}, [start]
    while left:
        for other in partners[left.pop()]:
            if other not in reached:
                reached.add(other)
                left.append(other)
    return reached


def turn(edge: Edge, at: Place) -> float:
    """Where a place lies around an edge, anticlockwise seen against the edge's axis, rad."""
    a, b = sorted(edge)
    axis = next(k for k in range(3) if a[k] != b[k])
    u, v = (axis + 1) % 3, (axis + 2) % 3
    return math.atan2(at[v] - a[v], at[u] - a[u])


def surface(
    cells: list[Cell], f: dict[Point, float], place: dict[Point, Place]
) -> tuple[list[Place], list[tuple[int, int, int]]]:
    """Points and triangles between what is inside (f < 0) and outside.

    Lattice points lie at `place`, which may be off their coordinates.
    """
    points: list[Place] = []
    home: list[Cell | None] = []  # the cell of each point; None on a face
    around: dict[Edge, list[tuple[float, int]]] = defaultdict(list)
    on_face: dict[tuple[frozenset[Edge], frozenset[Point]], int] = {}
    for cell in cells:
        middle = np.array(cell[0]) + 0.5 * cell[1]
        partners: dict[Edge, list[Edge]] = defaultdict(list)
        for ring in faces(cell, f):
            pairs = segments(ring, f)
            for one, other in pairs:
                partners[one].append(other)
                partners[other].append(one)
            for pair in pairs if len(pairs) > 1 else []:
                key = (frozenset(pair), frozenset(ring))
                if key in on_face:
                    continue  # from the cell on its other side
                on_face[key] = len(points)
                points.append(np.mean([crossing(edge, f, place) for edge in pair], axis=0))
                home.append(None)
                for edge in pair:
                    around[edge].append((turn(edge, np.mean(ring, axis=0)), on_face[key]))
        left = set(partners)
        while left:
            sheet = flood(next(iter(left)), partners)
            left -= sheet
            for edge in sheet:
                around[edge].append((turn(edge, middle), len(points)))
            points.append(np.mean([crossing(edge, f, place) for edge in sheet], axis=0))
            home.append(cell)
    triangles: list[tuple[int, int, int]] = []
    for edge, ring_of in around.items():
        ring = [v for _, v in sorted(ring_of)]
        a, _ = sorted(edge)
        if f[a] >= 0.0:
            ring.reverse()
        triangles += polygon(ring, edge, points, home)
    return points, triangles


def polygon(
    ring: list[int], edge: Edge, points: list[Place], home: list[Cell | None]
) -> list[tuple[int, int, int]]:
    """Cut a polygon along its shorter diagonal, or from its middle, which is added to `points`."""
    n = len(ring)
    if n < 3:
        return []
    cells = [home[v] for v in ring]
    if None not in cells:
        if n == 3:
            return [(ring[0], ring[1], ring[2])]
        if n == 4:
            a, b, c, d = (points[v] for v in ring)
            allowed = [not beside(cells[k], cells[k + 2], edge) for k in range(2)]
            if any(allowed):
                first = allowed[0] and (
                    not allowed[1] or np.sum((a - c) ** 2) <= np.sum((b - d) ** 2)
                )
                k = 0 if first else 1
                return [
                    (ring[k], ring[k + 1], ring[k + 2]),
                    (ring[k], ring[k + 2], ring[(k + 3) % 4]),
                ]
    points.append(np.mean([points[v] for v in ring], axis=0))
    home.append(None)
    return [(len(points) - 1, ring[k], ring[(k + 1) % n]) for k in range(n)]


def beside(one: Cell | None, other: Cell | None, edge: Edge) -> bool:
    """Whether two cells share more than this edge: both of them are longer than it."""
    assert one is not None and other is not None
    length = sum(abs(a - b) for a, b in zip(*sorted(edge), strict=True))
    return one[1] > length and other[1] > length
