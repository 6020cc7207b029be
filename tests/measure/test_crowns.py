"""Crowns: simple bodies with known numbers, and the slow twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.measure.crowns import SLICES, crown_of, crown_polygon, crowns_of
from forest.measure.trees import MeasureSpecies, measure_trees
from forest.trees.metamers import LATERAL, TERMINAL, allocate
from forest.trees.skeleton import Skeleton, skeleton_of
from forest.trees.table import empty
from tests.builders import random_arena
from tests.reference.mensuration import crown_volume, hull_area, radii, tips

ONE = MeasureSpecies(*(np.array([v]) for v in (2.0, 0.1, 500.0, 0.5, 10.0, 0.1, 0.5)))


def with_tips(points: np.ndarray) -> tuple:
    """Make a tree of nothing but leaf-bearing tips."""
    m = allocate(len(points))
    m.tip[:] = points
    m.state[:] = TERMINAL
    trees = empty(1)
    trees.size[0] = len(points)
    return m, trees


def ring(radius: float, height: float, n: int = 8) -> np.ndarray:
    angle = (np.arange(n) + 0.5) * 2 * math.pi / n
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), np.full(n, height)))


def test_a_cylinder_filled_between_two_whorls():
    m, trees = with_tips(np.concatenate((ring(2.0, 3.0), ring(2.0, 8.0))))
    got = crowns_of(m, trees)
    octagon = 8 * 0.5 * 4 * math.sin(math.pi / 4)
    assert (got.base_m[0], got.top_m[0]) == (3.0, 8.0)
    assert got.radius_m[0] == pytest.approx(2.0)
    assert got.projection_m2[0] == pytest.approx(octagon)
    assert got.volume_m3[0] == pytest.approx(5.0 * octagon)


def test_a_cone_of_many_whorls():
    n = 400
    whorls = [ring(3.0 * (1 - k / n), 2.0 + 6.0 * k / n) for k in range(n + 1)]
    got = crowns_of(*with_tips(np.concatenate(whorls)))
    octagon = 8 * 0.5 * 9 * math.sin(math.pi / 4)
    # a slice is as wide as its lowest whorl: sum over (1 - k / 16)^2
    stack = sum((1 - k / SLICES) ** 2 for k in range(SLICES)) / SLICES
    assert got.volume_m3[0] == pytest.approx(6.0 * octagon * stack, rel=0.01)
    assert got.projection_m2[0] == pytest.approx(octagon)


def test_a_crown_without_leaves_or_area():
    m, trees = with_tips(ring(1.0, 2.0))
    m.state[:] = 0
    got = crowns_of(m, trees)
    assert np.isnan([got.base_m[0], got.top_m[0]]).all()
    assert got.radius_m.sum() == got.projection_m2[0] == got.volume_m3[0] == 0.0
    line = np.column_stack((np.arange(9.0), np.arange(9.0), np.arange(9.0)))
    got = crowns_of(*with_tips(line))
    assert got.projection_m2[0] == pytest.approx(0.0, abs=1e-12)
    assert crowns_of(*with_tips(line * [0, 0, 1])).projection_m2[0] == 0.0


def skeleton(end: np.ndarray, leafy: list[bool]) -> Skeleton:
    n = len(end)
    zeros = np.zeros(n, np.int32)
    return Skeleton(
        parent=zeros - 1,
        start=np.tile([10.0, 20.0, 0.0], (n, 1)),
        end=end + np.array([10.0, 20.0, 0.0]),
        radius=np.ones(n),
        axis=zeros,
        order=zeros,
        birth_year=zeros,
        leafy=np.array(leafy),
        serial=zeros,
    )


def test_the_polygon_of_a_square_crown():
    square = np.array([[1, 1, 5], [-1, 1, 5], [-1, -1, 5], [1, -1, 5], [0.5, 0, 6], [9, 9, 1]])
    shape = skeleton(square.astype(float), [True] * 5 + [False])
    polygon = crown_polygon(shape)
    assert sorted(map(tuple, polygon)) == [(9, 19), (9, 21), (11, 19), (11, 21)]
    x, y = polygon.T
    assert 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) == pytest.approx(4.0)
    assert crown_of(shape).projection_m2[0] == pytest.approx(4.0)
    assert crown_polygon(skeleton(square, [False] * 6)).shape == (0, 2)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 80))
def test_equals_the_slow_twin(seed, n):
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 4, n, internode_m=0.5)
    got = crowns_of(m, trees)
    measures = measure_trees(m, trees, ONE)
    np.testing.assert_array_equal(got.base_m, measures.crown_base_m)
    assert got.radius_m.mean(axis=1) == pytest.approx(measures.crown_radius_m)
    for row in range(4):
        points = tips(m, trees, row)
        assert got.radius_m[row] == pytest.approx(radii(points))
        assert got.volume_m3[row] == pytest.approx(crown_volume(points, SLICES), rel=1e-9)
        flat = [(x, y) for x, y, _ in points]
        assert got.projection_m2[row] == pytest.approx(hull_area(flat), rel=1e-9, abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(1, 300),
    grid=st.sampled_from([0.0, 0.5, 1.0]),
    shift=st.sampled_from([0.0, 4.0]),
)
def test_hulls_of_many_points_in_a_grid_or_beside_the_base(seed, n, grid, shift):
    points = np.random.default_rng(seed).normal(shift, 1.5, (n, 3))
    if grid:
        points = np.round(points / grid) * grid
    points = points.astype(np.float32)
    got = crowns_of(*with_tips(points)).projection_m2[0]
    flat = [(float(x), float(y)) for x, y, _ in points]
    assert got == pytest.approx(hull_area(flat), rel=1e-9, abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 60))
def test_a_skeleton_has_its_tree_s_crown(seed, n):
    m, trees = random_arena(np.random.default_rng(seed), 1, n, internode_m=0.5)
    m.state[trees.start[0]] |= LATERAL
    whole = crowns_of(m, trees)
    trees.x[:], trees.y[:] = 0.0, 0.0
    shape = skeleton_of(m, trees, 0, species="", pipe_exponent=2.0, start_year=0)
    for mine, theirs in zip(crown_of(shape), whole, strict=True):
        assert mine == pytest.approx(theirs, rel=1e-9, abs=1e-12)
