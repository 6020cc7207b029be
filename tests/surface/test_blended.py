"""The blended mesh: closed, smooth at joints, of the right volume, twigs and all."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest._threads import using_threads
from forest.errors import InputError
from forest.surface.blend import CrossingWarning, Flare, Reaction, blended
from forest.surface.blend import cells as cells_module
from forest.surface.blend import whole as whole_module
from forest.surface.blend.polygonise import march
from forest.surface.mesh import Mesh
from tests.surface.branchings import branching, random_tree, stem, tree
from tests.surface.bushes import bush

# A stem 20 cm thick and 1 m high with a round top.
STEM_M3 = np.pi * 0.01 + 2.0 / 3.0 * np.pi * 0.001


def greatest_turn(mesh: Mesh, low: float, high: float) -> float:
    """Greatest angle between neighbouring triangles in a range of heights, degree."""
    t = mesh.triangles
    a, b = t.ravel().astype(np.int64), np.roll(t, -1, axis=1).ravel().astype(np.int64)
    order = np.argsort(np.minimum(a, b) * len(mesh.points) + np.maximum(a, b), kind="stable")
    normal = mesh.face_normals()
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    pairs = order.reshape(-1, 2) // 3
    z = mesh.points[a[order[0::2]], 2]
    cosine = np.sum(normal[pairs[:, 0]] * normal[pairs[:, 1]], axis=1)[(z > low) & (z < high)]
    return float(np.rad2deg(np.arccos(np.clip(cosine.min(), -1.0, 1.0))))


def sound(mesh: Mesh) -> None:
    assert mesh.is_watertight
    assert mesh.volume > 0.0
    assert np.isfinite(mesh.uv).all() and np.isfinite(mesh.points).all()
    assert mesh.triangles.min() == 0 and mesh.triangles.max() == len(mesh.points) - 1


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 4), st.sampled_from([0.02, 0.03]))
def test_trees_are_closed_balls(seed: int, limbs: int, cell_m: float) -> None:
    skeleton = random_tree(seed, limbs)
    mesh = blended(skeleton, cell_m=cell_m)
    sound(mesh)
    assert mesh.genus().tolist() == [0]
    assert np.array_equal(np.unique(mesh.data["axis"]), np.unique(skeleton.axis))
    assert set(np.unique(mesh.data["tree_id"])) == {7}


@pytest.mark.filterwarnings("ignore::forest.surface.blend.CrossingWarning")
@settings(max_examples=5, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 8))
def test_whatever_crosses_is_closed(seed: int, n: int) -> None:
    skeleton = bush(seed, n)
    long = skeleton.length > 1e-9
    if not long.any():
        return
    try:
        mesh = blended(skeleton, cell_m=0.39 * skeleton.radius[long].max())
    except InputError as error:
        assert "grows from its base" in str(error)  # straight down
        return
    sound(mesh)


def test_volume_is_right_from_the_thinnest_limb_up() -> None:
    """Points off the surface make up for what the chords of triangles cut off."""
    errors = [
        abs(blended(stem(), cell_m=0.0999 / k, flare=None, cells_in_radius=k).volume / STEM_M3 - 1)
        for k in (2.5, 5.0)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 8.0  # faster than the cell's square


def test_a_leaning_stem_has_its_volume_above_the_ground() -> None:
    """A plane cuts as much from a leaning cylinder below its base's middle as it leaves above."""
    mesh = blended(tree([-1], [(0, 0, 0), (0.7, 0, 1.5)], [0.1], [True]), cell_m=0.033, flare=None)
    cylinder = np.pi * 0.01 * np.hypot(0.7, 1.5) + 2.0 / 3.0 * np.pi * 0.001
    assert mesh.volume == pytest.approx(cylinder, rel=0.003)
    assert mesh.points[:, 2].min() == pytest.approx(0.0, abs=1e-6)


def test_joint_has_no_crease() -> None:
    skeleton = branching(55.0, half=0.4)
    coarse = blended(skeleton, cell_m=0.01, flare=None, cells_in_radius=10.0)
    smooth = blended(skeleton, cell_m=0.006, flare=None, cells_in_radius=10.0)
    limb = dataclasses.replace(skeleton, parent=np.array([-1, 0, -1], np.int32))
    with pytest.warns(CrossingWarning, match="0 and 1"):  # they share no joint
        plain = blended(limb, cell_m=0.008, flare=None, cells_in_radius=10.0)
    turn = greatest_turn(smooth, 0.2, 0.7)
    assert turn < 50.0 and turn < 0.75 * greatest_turn(coarse, 0.2, 0.7)
    assert greatest_turn(plain, 0.2, 0.7) > 80.0


@pytest.fixture(scope="module")
def plain_stem() -> Mesh:
    return blended(stem(), cell_m=0.02, flare=None)


def test_points_lie_near_the_surface_and_normals_point_outward(plain_stem: Mesh) -> None:
    mesh = plain_stem
    side = (mesh.points[:, 2] > 0.1) & (mesh.points[:, 2] < 0.95)
    away = np.hypot(*mesh.points[side, :2].T) - 0.1
    assert away.min() > 0.0 and away.max() < 0.02**2 / (8.0 * 0.1)  # the rise over a cell's chord
    outward = np.sum(mesh.normals()[side, :2] * mesh.points[side, :2], axis=1)
    assert np.all(outward > 0.099)


def test_texture_runs_around_the_girth_and_along_the_axis(plain_stem: Mesh) -> None:
    mesh = plain_stem
    inner = np.all(
        (mesh.points[mesh.triangles, 2] > 0.1) & (mesh.points[mesh.triangles, 2] < 0.9), 1
    )
    corner, uv = mesh.points[mesh.triangles[inner]], mesh.uv[inner]
    assert uv[..., 1] == pytest.approx(corner[..., 2])
    away = np.linalg.norm(corner[:, 1] - corner[:, 0], axis=1)
    assert np.linalg.norm(uv[:, 1] - uv[:, 0], axis=1) == pytest.approx(away, rel=0.02)


def test_thick_wood_has_larger_cells_than_thin() -> None:
    mesh = blended(branching(thin=0.02, half=0.6), cell_m=0.008)
    edge = np.linalg.norm(
        mesh.points[mesh.triangles[:, 1]] - mesh.points[mesh.triangles[:, 0]], axis=1
    )
    axis, z = mesh.data["axis"][mesh.triangles[:, 0]], mesh.points[mesh.triangles[:, 0], 2]
    assert np.median(edge[(axis == 0) & (z < 0.3)]) > 1.7 * np.median(edge[(axis == 1) & (z > 0.8)])


def test_thin_limbs_are_tubes_welded_in() -> None:
    skeleton = random_tree(5, 4)
    coarse = blended(skeleton, cell_m=0.03)
    assert coarse.genus().tolist() == [0]
    fine = blended(skeleton, cell_m=0.012)
    assert coarse.volume == pytest.approx(fine.volume, rel=0.05)
    thin = coarse.data["axis"][coarse.triangles[:, 0]] > 0
    assert np.sum(thin) < 0.1 * np.sum(fine.data["axis"][fine.triangles[:, 0]] > 0)


def test_foot_is_flat_and_closed(plain_stem: Mesh) -> None:
    mesh = blended(stem(), cell_m=0.02, flare=Flare())
    for whole in (mesh, plain_stem):
        assert whole.points[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    assert mesh.volume > 1.03 * plain_stem.volume
    foot = plain_stem.points[plain_stem.points[:, 2] < 1e-6]
    assert np.hypot(*foot[:, :2].T).max() == pytest.approx(0.1, abs=1e-3)
    rim = np.hypot(*foot[:, :2].T) > 0.09
    around = np.sort(np.arctan2(*foot[rim, :2].T))
    assert np.diff(around).max() < 0.5  # no part of the rim is cut off


def test_reaction_wood_is_in_the_mesh() -> None:
    wood = Reaction(np.array([0.0, 1.0]), np.array([0.0, 0.03]), below=True)
    plain = blended(branching(90.0, half=0.6), cell_m=0.02)
    thick = blended(branching(90.0, half=0.6), cell_m=0.02, reaction=wood)
    limb = (plain.points[:, 0] > 0.4) & (plain.points[:, 0] < 0.6)
    more = (thick.points[:, 0] > 0.4) & (thick.points[:, 0] < 0.6)
    assert thick.points[more, 2].min() < plain.points[limb, 2].min() - 0.012
    assert thick.points[more, 2].max() == pytest.approx(plain.points[limb, 2].max(), abs=0.002)


def test_same_bits_in_one_thread_and_two() -> None:
    with using_threads(1):
        one = blended(random_tree(1, 2), cell_m=0.03)
    with using_threads(2):
        two = blended(random_tree(1, 2), cell_m=0.03)
    assert np.array_equal(one.points, two.points)
    assert np.array_equal(one.triangles, two.triangles) and np.array_equal(one.uv, two.uv)


def test_crossing_limbs_are_told() -> None:
    crossing = tree(
        [-1, 0, 0, 2, 1],
        [(0, 0, 0), (0, 0, 1), (0, 0, 2), (0.8, 0, 1.0), (0.8, 0, 2.2), (1.4, 0, 1.6)],
        [0.05, 0.05, 0.03, 0.03, 0.03],
        [True, True, False, True, False],
    )
    with pytest.warns(CrossingWarning, match="1 and 2"):
        mesh = blended(crossing, cell_m=0.012)
    assert mesh.is_watertight and mesh.genus().tolist() == [1]
    with pytest.raises(InputError, match="cross"):
        blended(crossing, cell_m=0.012, strict=True)


def test_a_surface_left_open_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def torn(*given: Any) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        points, triangles = march(*given)
        return points, triangles[1:]

    monkeypatch.setattr(whole_module, "march", torn)
    where = r"^cell_m: the surface stays open at 3 edges, the first near .* m; expected"
    with pytest.raises(InputError, match=where):
        blended(stem(), cell_m=0.04, flare=None)


def test_limbs_that_touch_without_crossing_are_told() -> None:
    turns = np.linspace(0.0, 6.2, 13)
    ring = [(0.4 * float(np.sin(a)), 0.0, 0.4 - 0.4 * float(np.cos(a))) for a in turns]
    loop = tree(list(range(-1, 12)), [(0.0, 0.0, -0.5), *ring], [0.05] * 13, [True] * 13)
    with pytest.warns(CrossingWarning, match="a handle, though no axes cross"):
        mesh = blended(loop, cell_m=0.02, flare=None)
    assert mesh.is_watertight and mesh.genus().tolist() == [1]
    with pytest.raises(InputError, match="no axes cross"):
        blended(loop, cell_m=0.02, flare=None, strict=True)


def test_what_is_thick_but_has_no_length_needs_smaller_cells() -> None:
    knob = tree([-1, 0], [(0, 0, 0), (0, 0, 0), (0, 0, 1)], [0.1, 0.03], [True, True])
    with pytest.raises(InputError, match=r"thickest internode has a radius of 0\.03 m"):
        blended(knob, cell_m=0.03)
    sound(blended(knob, cell_m=0.012))


def test_what_has_no_surface_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = branching()
    none = {f.name: getattr(whole, f.name)[:0] for f in dataclasses.fields(whole)[:9]}
    with pytest.raises(InputError, match="without internodes"):
        blended(dataclasses.replace(whole, **none))
    with pytest.raises(InputError, match=r"radius -0\.1 m"):
        blended(dataclasses.replace(whole, radius=np.array([0.1, -0.1, 0.1])))
    with pytest.raises(InputError, match="not a number"):
        blended(dataclasses.replace(whole, end=whole.end * np.nan))
    with pytest.raises(InputError, match="cell_m"):
        blended(whole, cell_m=0.06)
    with pytest.raises(InputError, match="above 0"):
        blended(whole, cell_m=-1.0)
    with pytest.raises(InputError, match="no internode has a length"):
        blended(dataclasses.replace(whole, start=0.0 * whole.start, end=0.0 * whole.end))
    monkeypatch.setattr(cells_module, "free_memory", lambda: 2.0**28)
    with pytest.raises(InputError, match=r"GiB of memory.*cells of about"):
        blended(whole, cell_m=0.0005, cells_in_radius=50.0)
