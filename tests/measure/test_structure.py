"""Structure indices: small examples by hand, and patterns with a known index."""

from __future__ import annotations

import math

import numpy as np
import pytest

from forest.measure import structure
from forest.measure.structure import Neighbours, clark_evans, crown_cover, mingling


def test_gini_by_hand():
    assert structure.gini(np.array([2.0, 2.0, 2.0])) == pytest.approx(0.0)
    assert structure.gini(np.array([0.0, 0.0, 6.0])) == pytest.approx(1.0)
    # n = 3, sorted 1 2 3: (-2*1 + 0*2 + 2*3) / (2 * 6)
    assert structure.gini(np.array([3.0, 1.0, 2.0])) == pytest.approx(1 / 3)
    assert math.isnan(structure.gini(np.array([1.0])))


def test_diversity_by_hand():
    even = np.array([5.0, 5.0, 0.0])
    assert structure.shannon(even) == pytest.approx(math.log(2))
    assert structure.simpson(even) == pytest.approx(0.5)
    assert structure.shannon(np.array([3.0])) == structure.simpson(np.array([3.0])) == 0.0
    assert math.isnan(structure.shannon(np.zeros(2)))


def triangle_lattice(columns: int, rows: int) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    row, column = np.divmod(np.arange(columns * rows), columns)
    rise = math.sqrt(3) / 2
    return column + 0.5 * (row % 2), row * rise, (float(columns), rows * rise)


def test_clark_evans_of_known_patterns():
    x, y, size = triangle_lattice(12, 12)
    assert clark_evans(Neighbours(x, y, size, True)) == pytest.approx(2.149, abs=1e-3)
    x, y = np.random.default_rng(3).uniform(0, 50, (2, 3000))
    assert clark_evans(Neighbours(x, y, (50, 50), True)) == pytest.approx(1.0, abs=0.03)
    assert clark_evans(Neighbours(x, y, (50, 50), False)) == pytest.approx(1.0, abs=0.03)


def test_donnelly_removes_the_bias_of_the_edge():
    draws = np.random.default_rng(5).uniform(0, 10, (200, 2, 30))
    mean = np.mean([clark_evans(Neighbours(x, y, (10, 10), False)) for x, y in draws])
    assert mean == pytest.approx(1.0, abs=0.03)


def test_distance_wraps_only_on_a_periodic_plot():
    x, y = np.array([0.5, 9.5]), np.array([5.0, 5.0])
    assert Neighbours(x, y, (10, 10), True).nearest == pytest.approx([1.0, 1.0])
    assert Neighbours(x, y, (10, 10), False).nearest == pytest.approx([9.0, 9.0])
    # on the far edge itself, and a rounding error before the near one
    edge = Neighbours(np.array([10.0, -1e-18]), y, (10, 10), True)
    assert edge.nearest == pytest.approx([0.0, 0.0])


def test_a_tree_is_never_its_own_neighbour():
    x = np.zeros(8)
    assert not (Neighbours(x, x, (5, 5), False).index == np.arange(8)[:, None]).any()
    assert math.isnan(clark_evans(Neighbours(x[:1], x[:1], (5, 5), True)))
    assert len(mingling(Neighbours(x[:1], x[:1], (5, 5), True), np.zeros(1))) == 0


def test_mingling_by_hand():
    # on a line, 1 m apart, species a a a b b: the four neighbours are all the others
    x = np.arange(5.0)
    got = mingling(Neighbours(x, np.zeros(5), (50, 50), False), np.array([0, 0, 0, 1, 1]))
    assert got == pytest.approx([0.5, 0.5, 0.5, 0.75, 0.75])


def test_crown_cover_wraps_and_overlaps():
    x, y = np.array([0.0, 5.0, 5.0]), np.array([0.0, 5.0, 5.0])
    radius, species = np.array([2.0, 2.0, 1.0]), np.array([0, 1, 0])
    disc = math.pi * 4 / 100
    torus = crown_cover(x, y, radius, species, 2, (10, 10), True)
    assert torus[1] == pytest.approx(disc, rel=0.05)
    assert torus[0] == pytest.approx(disc * 1.25, rel=0.05)
    assert torus[2] == pytest.approx(2 * disc, rel=0.05)
    assert crown_cover(x, y, radius, species, 2, (10, 10), False)[2] == pytest.approx(
        1.25 * disc, rel=0.05
    )


def test_crown_cover_equals_its_slow_twin():
    rng = np.random.default_rng(11)
    x, y = rng.uniform(0, (7.0, 5.0), (9, 2)).T
    radius = rng.uniform(0, 2, 9)
    for periodic in (True, False):
        hit = 0
        for cx in np.arange(0.25, 7, 0.5):
            for cy in np.arange(0.25, 5, 0.5):
                dx, dy = np.abs(x - cx), np.abs(y - cy)
                if periodic:
                    dx, dy = np.minimum(dx, 7 - dx), np.minimum(dy, 5 - dy)
                hit += bool((dx**2 + dy**2 <= radius**2).any())
        got = crown_cover(x, y, radius, np.zeros(9, int), 1, (7.0, 5.0), periodic)
        assert got[1] == pytest.approx(hit / 140)
