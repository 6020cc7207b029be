"""Cells to triangles: whatever the signs are, the surface is closed and parts inside from out."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest.surface.blend.cells import pack, unpack
from forest.surface.blend.polygonise import lattice_points, members_of, sheets
from forest.surface.mesh import Mesh
from tests.reference import dual as slow

_WIDE = 4  # large cells along an edge of the block


def _block(rng: np.random.Generator, cut: float, wide: int = _WIDE) -> list[NDArray[np.int64]]:
    """Fill a cube with cells of two sizes: a part of the large ones is cut into eight."""
    large = np.array(list(itertools.product(range(wide), repeat=3))) * 4
    inner = np.all((large > 0) & (large < 4 * (wide - 1)), axis=1)
    split = inner & (rng.random(len(large)) < cut)
    eight = np.array(list(itertools.product((0, 2), repeat=3)))
    small = (large[split][:, None] + eight).reshape(-1, 3)
    return [np.sort(pack(small)), np.sort(pack(large[~split]))]


def _winding(mesh: Mesh, x: NDArray[np.float64]) -> float:
    """How often a mesh runs around a point (the solid angles of its triangles over 4 pi)."""
    a, b, c = (mesh.points[mesh.triangles[:, k]] - x for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    top = np.sum(a * np.cross(b, c), axis=1)
    bottom = la * lb * lc + np.sum(a * b, 1) * lc + np.sum(b * c, 1) * la + np.sum(c * a, 1) * lb
    return float(np.sum(np.arctan2(top, bottom)) / (2.0 * np.pi))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from([0.0, 0.3, 1.0]), st.sampled_from([0.1, 0.5, 0.8]))
def test_any_signs_give_a_closed_surface_between_inside_and_outside(
    seed: int, cut: float, share: float
) -> None:
    rng = np.random.default_rng(seed)
    leaves = _block(rng, cut)
    keys = lattice_points(leaves)
    grid = unpack(keys)
    outer = np.any((grid == 0) | (grid == 4 * _WIDE), axis=1)
    f = np.where((rng.random(len(keys)) < share) & ~outer, -1.0, 1.0) * rng.uniform(0.1, 1.0)
    if not np.any(f < 0.0):
        return
    members = members_of(keys, leaves, f < 0.0)
    near = np.zeros(len(keys), np.int64)
    points, triangles, room, hints = sheets(members, f, grid.astype(np.float64), near, 1.0)
    assert len(points) == len(room) == len(hints)
    mesh = Mesh(points, triangles, np.zeros((0, 3, 2)))
    assert mesh.is_watertight
    if cut > 0.0:
        return  # a vertex may lie on a point in the middle of a large cell's face
    around = [_winding(mesh, grid[i] + 1e-4) for i in range(len(keys))]
    assert np.array_equal(np.round(around) == 1.0, f < 0.0)


def _triangles(triangles: NDArray[np.int64]) -> list[list[int]]:
    """Corners of triangles, each from its least on, in order; the way around is kept."""
    least = np.argmin(triangles, axis=1)
    return sorted(np.roll(t, -k).tolist() for t, k in zip(triangles, least, strict=True))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from([0.0, 0.4, 1.0]), st.sampled_from([0.1, 0.5, 0.8]))
def test_surface_is_that_of_dictionaries(seed: int, cut: float, share: float) -> None:
    rng = np.random.default_rng(seed)
    leaves = _block(rng, cut, wide=3)
    keys = lattice_points(leaves)
    grid = unpack(keys)
    f = np.where(rng.random(len(keys)) < share, -1.0, 1.0) * rng.uniform(0.1, 1.0, len(keys))
    members = members_of(keys, leaves, f < 0.0)
    near = np.zeros(len(keys), np.int64)
    places = grid + rng.uniform(-0.2, 0.2, grid.shape)  # so that no two diagonals are equal
    points, triangles, _, _ = sheets(members, f, places, near, 1.0)
    cells = [
        (tuple(corner), 2 << level)
        for level, corners in enumerate(leaves)
        for corner in unpack(corners).tolist()
    ]
    names = list(map(tuple, grid.tolist()))
    where = dict(zip(names, places, strict=True))
    expected, polygons = slow.surface(cells, dict(zip(names, f.tolist(), strict=True)), where)
    assert len(points) == len(expected) and len(triangles) == len(polygons)
    if not len(points):
        return
    at = cKDTree(points)  # middles of polygons may coincide: such points are one
    own, same = (
        np.array([min(near) for near in at.query_ball_point(x, 1e-9)])
        for x in (points, np.array(expected))
    )
    assert np.array_equal(np.sort(own), np.sort(same))
    assert _triangles(own[triangles]) == _triangles(same[np.array(polygons)])


def test_a_missing_cell_leaves_the_surface_open() -> None:
    leaves = _block(np.random.default_rng(1), 0.0)
    keys = lattice_points(leaves)
    grid = unpack(keys)
    f = np.linalg.norm(grid - 8.1, axis=1) - 5.0
    leaves[1] = leaves[1][leaves[1] != pack(np.array([[4, 4, 12]]))[0]]
    members = members_of(keys, leaves, f < 0.0)
    places, near = grid.astype(np.float64), np.zeros(len(keys), np.int64)
    points, triangles, _, _ = sheets(members, f, places, near, 1.0)
    assert not Mesh(points, triangles, np.zeros((0, 3, 2))).is_watertight
