"""Obstacles as masks of voxels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._jit import njit
from forest.environment.obstacles import Box, Mesh, no_solid, solid_at, solid_voxels, voxelise
from forest.errors import InputError
from tests.reference.obstacles import in_box


@njit
def ask(solid, voxels):
    return [solid_at(solid, v[0], v[1], v[2]) for v in voxels]


def all_voxels(low: int, high: int) -> np.ndarray:
    axis = np.arange(low, high, dtype=np.int64)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


corner = st.tuples(*[st.integers(0, 7).map(lambda i: 0.2 * i + 0.03)] * 3)


@settings(max_examples=20, deadline=None)
@given(corner, corner, st.booleans())
def test_box_equals_twin(one, other, periodic):
    low, high = np.minimum(one, other), np.maximum(one, other) + 0.2
    box = Box(tuple(low), tuple(high))
    solid = voxelise([box], (10, 10), periodic=periodic, voxel_m=0.2)
    voxels = all_voxels(-2, 12)
    home = voxels.copy()
    if periodic:
        home[:, :2] %= 10
    assert ask(solid, voxels) == [in_box(box, tuple(v), 0.2) for v in home]


def test_nothing_is_solid_without_obstacles():
    assert not any(ask(no_solid(), all_voxels(-1, 2)))
    assert voxelise([], (5, 5), periodic=True, voxel_m=0.2).mask.size == 1


def test_thin_wall_fills_one_voxel_across():
    wall = Box((1.01, 0.0, 0.0), (1.02, 1.0, 1.0))
    voxels = solid_voxels(voxelise([wall], (10, 10), periodic=False, voxel_m=0.2))
    assert set(voxels[:, 0]) == {5}
    assert len(voxels) == 25


def test_box_over_the_edge_of_a_torus_comes_in_on_the_other_side():
    box = Box((1.8, 0.0, 0.0), (2.2, 0.2, 0.2))
    voxels = solid_voxels(voxelise([box], (10, 10), periodic=True, voxel_m=0.2))
    assert sorted(voxels[:, 0]) == [0, 9]


def test_closed_mesh_fills_its_volume(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    file = tmp_path / "ball.stl"
    pyvista.Sphere(radius=1.0, center=(2.0, 2.0, 2.0)).save(file)
    voxels = solid_voxels(voxelise([Mesh(file)], (20, 20), periodic=False, voxel_m=0.2))
    distance = np.linalg.norm((voxels + 0.5) * 0.2 - 2.0, axis=1)
    assert distance.max() <= 1.0
    assert len(voxels) * 0.2**3 == pytest.approx(4 / 3 * np.pi, rel=0.05)


def test_open_or_unreadable_mesh_is_refused(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    file = tmp_path / "sheet.stl"
    pyvista.Plane().triangulate().save(file)
    with pytest.raises(InputError, match="not closed"):
        voxelise([Mesh(file)], (20, 20), periodic=False, voxel_m=0.2)
    with pytest.raises(InputError, match="cannot read"):
        voxelise([Mesh(tmp_path / "none.stl")], (20, 20), periodic=False, voxel_m=0.2)


@pytest.mark.parametrize(
    "box",
    [
        Box((-3000.0, -3000.0, 0.0), (3000.0, 3000.0, 100.0)),
        Box((90_000.0, 90_000.0, 0.0), (90_001.0, 90_001.0, 1.0)),
    ],
    ids=["large", "far"],
)
def test_obstacles_that_fit_no_memory_are_refused(box):
    with pytest.raises(InputError, match=r"^obstacles: too large or too far away"):
        voxelise([box], (20, 20), periodic=False, voxel_m=0.2)
