"""Tubes: closed, of the right volume and girth, without twist; and as their slow twin has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.surface.tubes import LEAST_RADIUS_M, tubes
from forest.trees.skeleton import Skeleton
from tests.reference.tubes import axes_of, thinned, unfolded
from tests.surface.bushes import bush


def _stem(places: np.ndarray, radius: np.ndarray) -> Skeleton:
    n = len(radius)
    zeros = np.zeros(n, np.int32)
    return Skeleton(
        parent=np.arange(-1, n - 1, dtype=np.int32),
        start=places[:-1],
        end=places[1:],
        radius=radius,
        axis=zeros,
        order=zeros,
        birth_year=np.arange(2000, 2000 + n, dtype=np.int32),
        leafy=np.zeros(n, np.bool_),
        serial=np.arange(n, dtype=np.int32),
        tree_id=7,
    )


def _nudged(tree: Skeleton, seed: int) -> Skeleton:
    """Move all ends a little: where wood turns back on itself, rounding would decide."""
    end = tree.end + np.random.default_rng(seed).normal(0.0, 0.01, tree.end.shape)
    start = np.where((tree.parent >= 0)[:, None], end[tree.parent], tree.start)
    return replace(tree, start=start, end=end)


def _pole(n: int = 5, radius: float = 0.1) -> Skeleton:
    places = np.linspace((3.0, 4.0, 0.0), (3.0, 4.0, 2.0), n + 1)
    return _stem(places, np.full(n, radius))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 40), tolerance=st.sampled_from([0.0, 0.02]))
def test_the_nodes_are_those_of_the_twin(seed: int, n: int, tolerance: float) -> None:
    tree = _nudged(bush(seed, n), seed)
    axes = [unfolded(thinned(a, tolerance)) for a in axes_of(tree, max(tolerance, 1e-9))]
    if not axes:
        with pytest.raises(InputError, match="no axis of any length"):
            tubes(tree, tolerance_m=tolerance)
        return
    mesh = tubes(tree, tolerance_m=tolerance, most_sides=3)
    first = 0
    for axis in axes:  # a centre, rings of three about the nodes, a centre
        last = first + 3 * len(axis) + 1
        rings = mesh.points[first + 1 : last].reshape(-1, 3, 3).mean(axis=1)
        here = slice(first + 1, last, 3)
        assert np.allclose(rings, [node.place for node in axis])
        assert np.allclose(mesh.data["radius_m"][here], [node.radius for node in axis])
        of = [node.internode for node in axis]
        assert np.array_equal(mesh.data["axis"][here], tree.axis[of])
        assert np.array_equal(mesh.data["order"][here], tree.order[of])
        assert np.allclose(mesh.points[[first, last]], [axis[0].place, axis[-1].place])
        first = last + 1
    assert first == len(mesh.points)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(1, 60),
    tolerance=st.sampled_from([0.0, 0.001, 0.03]),
    most=st.integers(3, 40),
)
def test_every_tube_is_closed(seed: int, n: int, tolerance: float, most: int) -> None:
    tree = bush(seed, n)
    if not np.any(tree.length > 1e-9):
        return
    mesh = tubes(tree, tolerance_m=tolerance, most_sides=most)
    assert mesh.is_watertight
    assert np.all(mesh.genus() == 0)
    assert len(mesh.genus()) == len(np.unique(mesh.data["axis"]))
    assert np.isfinite(mesh.uv).all()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 12))
def test_a_bent_stem_keeps_its_volume(seed: int, n: int) -> None:
    """A mitred prism of constant section holds section times length, however it bends."""
    rng = np.random.default_rng(seed)
    step = rng.normal((0.0, 0.0, 1.0), 0.15, (n, 3))
    places = np.concatenate((np.zeros((1, 3)), np.cumsum(step, axis=0)))
    mesh = tubes(_stem(places, np.full(n, 0.05)), tolerance_m=0.0, most_sides=12)
    length = np.linalg.norm(step, axis=1).sum()
    assert np.isclose(mesh.volume, np.pi * 0.05**2 * length, rtol=1e-9)


@pytest.mark.parametrize("most", [3, 4, 7, 48])
def test_a_cone_has_the_volume_of_a_cone(most: int) -> None:
    n, height, foot, tip = 8, 2.0, 0.1, 0.02
    radius = np.linspace(foot, tip, n + 1)
    places = np.linspace((0.0, 0.0, 0.0), (0.0, 0.0, height), n + 1)
    mean = 0.5 * (radius[1:] + radius[:-1])
    mesh = tubes(_stem(places, mean), tolerance_m=0.0, most_sides=most)
    nodes = np.concatenate((mean[:1], 0.5 * (mean[1:] + mean[:-1]), mean[-1:]))
    a, b = nodes[:-1], nodes[1:]
    assert np.isclose(mesh.volume, np.sum(np.pi / 3 * height / n * (a * a + a * b + b * b)))


def test_nodes_on_a_straight_cone_are_left_out() -> None:
    assert len(tubes(_pole(50)).points) == len(tubes(_pole(1)).points)
    bent = _pole(50)
    bent.end[20:, 0] += 0.5
    bent.start[21:, 0] += 0.5
    assert len(tubes(bent).points) > len(tubes(_pole(1)).points)


def test_thick_wood_has_more_sides() -> None:
    points = [len(tubes(_pole(1, radius)).points) for radius in (0.001, 0.01, 0.1, 0.4)]
    assert points == sorted(set(points))
    chord = tubes(_pole(1, 0.1), tolerance_m=0.001).points[1:-1] - (3.0, 4.0, 0.0)
    off = np.abs(np.linalg.norm(chord[:, :2], axis=1) - 0.1)
    assert off.max() <= 0.001


def test_texture_coordinates_are_metres() -> None:
    mesh = tubes(_pole())
    side = np.all(np.isin(mesh.triangles, [0, len(mesh.points) - 1], invert=True), axis=1)
    assert np.isclose(mesh.uv[side, :, 0].max(), 2.0 * np.pi * 0.1)
    assert mesh.uv[side, :, 0].min() == 0.0
    assert np.isclose(mesh.uv[side, :, 1].max(), 2.0)
    corners = mesh.points[mesh.triangles[side]]
    assert np.allclose(corners[..., 2], mesh.uv[side, :, 1])
    # Seen from outside u grows to the right, so that pictures are not mirrored.
    one, two = mesh.uv[:, 1] - mesh.uv[:, 0], mesh.uv[:, 2] - mesh.uv[:, 0]
    assert np.all(one[side, 0] * two[side, 1] > one[side, 1] * two[side, 0])


def test_no_twist_along_a_bent_stem() -> None:
    """Lines of one u turn no more than the axis does: bends in one plane leave them in it."""
    bend = np.linspace(0.0, 1.2, 30)
    places = np.column_stack((1.0 - np.cos(bend), 0.0 * bend, np.sin(bend)))
    mesh = tubes(_stem(places, np.full(29, 0.02)), tolerance_m=0.0, most_sides=4)
    rings = mesh.points[1:-1].reshape(-1, 4, 3)
    assert np.allclose(rings[:, [0, 2], 1], 0.0, atol=1e-12)
    assert np.ptp(rings[:, 1, 1]) < 1e-12


def test_a_branch_starts_at_its_parents_axis() -> None:
    stem = _pole(1)
    pair = replace(
        stem,
        parent=np.array([-1, 0], np.int32),
        start=np.array([(3.0, 4.0, 0.0), (3.1, 4.0, 1.0)]),
        end=np.array([(3.0, 4.0, 2.0), (4.0, 4.0, 1.5)]),
        radius=np.array([0.1, 0.02]),
        axis=np.array([0, 1], np.int32),
        order=np.array([0, 1], np.int32),
        birth_year=np.array([2000, 2005], np.int32),
        serial=np.array([0, 1], np.int32),
        leafy=np.zeros(2, np.bool_),
    )
    mesh = tubes(pair)
    branch = mesh.data["axis"] == 1
    assert np.allclose(mesh.points[branch][0], (3.0, 4.0, 1.0))
    assert set(mesh.data["birth_year"][branch]) == {2005}
    assert set(mesh.data["order"][branch]) == {1}
    assert set(mesh.data["tree_id"]) == {7}


def test_sharp_bends_of_thick_wood_do_not_fold() -> None:
    places = np.array([(0, 0, 0), (0, 0, 1), (0.08, 0, 1.05), (0.0, 0, 1.1), (0, 0, 2)], float)
    mesh = tubes(_stem(places, np.full(4, 0.3)), tolerance_m=0.0)
    side = mesh.face_normals()
    out = mesh.points[mesh.triangles].mean(axis=1) * (1.0, 1.0, 0.0)
    flat = np.abs(side[:, 2]) > 0.99 * np.linalg.norm(side, axis=1)
    assert np.all(np.sum(side * out, axis=1)[~flat] > 0.0)


def test_lobes_stand_out_and_keep_the_tube_closed() -> None:
    mesh = tubes(_pole(), lobes=(5, 0.2))
    assert mesh.is_watertight
    reach = np.linalg.norm(mesh.points[1:-1, :2] - (3.0, 4.0), axis=1)
    assert reach.max() > 1.18 * 0.1
    assert reach.min() < 0.82 * 0.1
    assert np.allclose(mesh.data["radius_m"], 0.1)


def test_bad_trees_are_refused() -> None:
    none = Skeleton(*(field[:0] for field in list(vars(_pole()).values())[:9]), tree_id=3)
    with pytest.raises(InputError, match="tree 3: has no internodes"):
        tubes(none)
    for radius in (-0.1, np.nan):
        bad = _pole()
        bad.radius[2] = radius
        with pytest.raises(InputError, match=r"internode 2 \(serial 2\)"):
            tubes(bad)
    lost = _pole()
    lost.end[1] = np.inf
    with pytest.raises(InputError, match="no number"):
        tubes(lost)
    with pytest.raises(InputError, match="tolerance_m is -1"):
        tubes(_pole(), tolerance_m=-1.0)
    with pytest.raises(InputError, match="most_sides is 2"):
        tubes(_pole(), most_sides=2)
    with pytest.raises(InputError, match="no axis of any length"):
        tubes(_stem(np.zeros((3, 3)), np.full(2, 0.1)))


def test_wood_that_tapers_to_nothing_gets_the_least_radius() -> None:
    mesh = tubes(_pole(1, 0.0))
    assert mesh.is_watertight
    assert np.all(mesh.data["radius_m"] == np.float32(LEAST_RADIUS_M))
