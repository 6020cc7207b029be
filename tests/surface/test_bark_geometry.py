"""Bark as displaced triangles."""

from __future__ import annotations

import numpy as np
import pytest

from forest.errors import InputError
from forest.surface.bark import Bark
from forest.surface.bark.dressing import grow_preset
from forest.surface.bark.geometry import MATERIALS, _uncrossed, bark_geometry, cylinder, flat
from forest.surface.bark.presets import Preset


@pytest.fixture(scope="module")
def oak() -> tuple[Preset, Bark]:
    preset = Preset.load("oak")
    return preset, grow_preset(preset, 1.4, width_m=0.5, length_m=0.3, seed=4)


def _flat_area(uv: np.ndarray) -> np.ndarray:
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area: np.ndarray = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return area


@pytest.mark.parametrize("name", ["oak", "maple", "aspen"])
def test_a_whole_turn_is_a_closed_tube(name: str) -> None:
    preset = Preset.load(name)
    bark = grow_preset(preset, 1.4, width_m=0.4, length_m=0.2, seed=4)
    made = bark_geometry(bark, preset, cylinder(0.4 / (2 * np.pi)), girth_m=1.4)
    mesh = made.mesh
    area = _flat_area(mesh.uv)
    assert area.min() > 0.0
    assert area.sum() == pytest.approx(0.4 * 0.2, rel=1e-6)
    single = ~mesh.edges_with_two_faces()
    rims = 2 * 20  # 0.4 m in steps of 0.02 at either end
    assert single.sum() == rims
    assert mesh.components().max() == 0
    torn = (bark.elements.width * (bark.elements.kind == 1)).sum() / bark.elements.width.sum()
    assert area[made.material == 1].sum() / area.sum() == pytest.approx(torn, rel=0.06)
    outward = np.einsum(
        "ij,ij->i", mesh.face_normals()[:, :2], mesh.points[mesh.triangles[:, 0], :2]
    )
    assert (outward > 0).mean() > 0.8


def test_depth_and_epidermis(oak: tuple[Preset, Bark]) -> None:
    preset, bark = oak
    made = bark_geometry(bark, preset, flat(0.5), girth_m=1.4)
    depth = made.mesh.points[:, 1]  # it faces -y
    deepest = float(preset.aged(1.4)["depth_m"])
    assert 0.4 * deepest < depth.max() <= deepest
    assert depth.min() >= 0.0
    # The epidermis that is seen has its own length: the inside none.
    area = _flat_area(np.stack((made.epidermis_m, made.mesh.uv[..., 1]), axis=-1))
    rest = float(bark.strips.rest[0]) * 0.3
    assert area[made.material == 0].sum() == pytest.approx(rest, rel=0.04)
    assert abs(area[made.material == 1].sum()) < 0.02 * rest
    parts = [len(made.part(name).triangles) for name in MATERIALS]
    assert sum(parts) == len(made.mesh.triangles)
    assert min(parts) > 50


def test_a_piece_can_be_cut_out(oak: tuple[Preset, Bark]) -> None:
    preset, bark = oak
    made = bark_geometry(bark, preset, flat(0.5), turns=(0.2, 0.6), v_m=(0.1, 0.25))
    low, high = made.mesh.points.min(axis=0), made.mesh.points.max(axis=0)
    np.testing.assert_allclose([low[0], high[0], low[2], high[2]], [0.1, 0.3, 0.1, 0.25])
    with pytest.raises(InputError, match="at most one turn"):
        bark_geometry(bark, preset, flat(0.5), turns=(0.5, 0.5))


def test_lines_that_cross_or_touch_a_point_are_left_out() -> None:
    points = np.array([[0, 0], [1, 1], [0, 1], [1, 0], [2, 0], [4, 0], [3, 0.0001], [5, 5], [6, 5]])
    edges = np.array([[0, 1], [2, 3], [4, 5], [7, 8]])
    np.testing.assert_array_equal(_uncrossed(points, edges), [[0, 1], [7, 8]])
