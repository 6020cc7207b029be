"""Rings add up to the radius under bark, at every height, and stay with their wood."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.measure.rings import (
    AT_CROWN_BASE,
    AT_HEIGHT,
    RingYear,
    breast_ring_widths,
    remember_discs,
    ring_rows,
)
from forest.measure.trees import measure_trees
from forest.trees.metamers import CONTINUED, MAIN, TERMINAL, allocate
from forest.trees.table import empty
from tests.builders import random_arena
from tests.measure.test_trees import ONE
from tests.reference.measure import discs

HEIGHTS = np.array([0.3, 1.3, 5.0])
EXPONENT = np.array([2.0])


def pole(birth: list[int]):
    """A pole of metamers of 1 m; the last has a living tip."""
    m = allocate(16)
    for field in m:
        field[...] = 0
    n = len(birth)
    m.parent[:n] = np.arange(n) - 1
    m.serial[:n] = np.arange(n)
    m.tip[:n, 2] = np.arange(1, n + 1)
    m.length[:n] = 1.0
    m.birth[:n] = birth
    m.state[:n] = MAIN | CONTINUED
    m.state[n - 1] = MAIN | TERMINAL
    trees = empty(1)
    trees.tree_id[:] = 7
    trees.size[0] = n
    trees.breast_serial[:] = -1
    trees.disc_serial[:] = -1
    return m, trees


def test_rings_of_a_pole_over_three_years() -> None:
    total = {}
    before = np.zeros(16, np.float32)
    told = np.full((1, 8), -1, np.int32)
    widths = []
    for step, diameters in enumerate(([0.02], [0.03, 0.01], [0.03, 0.02, 0.005]), start=1):
        m, trees = pole(list(range(1, step + 1)))
        trees.disc_serial[:] = told
        m.pipe[:step] = np.square(diameters)
        measures = measure_trees(m, trees, ONE, heights=HEIGHTS)
        now = RingYear(2000 + step, step, before, EXPONENT)
        rows = ring_rows(m, trees, measures, HEIGHTS, True, now)
        for place, height, age, width in zip(
            rows["place"], rows["stem_height_m"], rows["cambial_age"], rows["width_mm"], strict=True
        ):
            if place == AT_HEIGHT:
                total.setdefault(float(height), []).append((int(age), float(width)))
        crown = rows["place"] == AT_CROWN_BASE
        assert rows["stem_height_m"][crown].tolist() == [step]  # the only site is at the top
        widths.append(breast_ring_widths(m, trees, measures, now)[0])
        remember_discs(trees, m, measures)
        before, told = m.pipe.copy(), trees.disc_serial.copy()
    assert total[0.3] == [(1, pytest.approx(10.0)), (2, pytest.approx(5.0)), (3, 0.0)]
    assert total[1.3] == [(1, pytest.approx(5.0)), (2, pytest.approx(5.0))]
    assert 5.0 not in total
    assert np.isnan(widths[0])
    assert widths[1:] == [pytest.approx(5.0), pytest.approx(5.0)]


def test_wood_does_not_climb() -> None:
    """A disc stays with its metamer when bending lifts or lowers the stem."""
    m, trees = pole([1, 2, 3])
    m.pipe[:3] = 1e-4
    remember_discs(trees, m, measure_trees(m, trees, ONE, heights=HEIGHTS))
    assert trees.disc_serial[0, :3].tolist() == [0, 1, -1]
    m.tip[:3, 2] = [0.2, 1.1, 2.0]
    again = measure_trees(m, trees, ONE, heights=HEIGHTS)
    assert again.disc_metamer[0, :3].tolist() == [0, 1, -1]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_discs_equal_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 3, 40)
    heights = np.sort(rng.uniform(0.05, 2.0, 3))
    trees.disc_serial[:] = -1
    trees.disc_serial[:, :3] = rng.integers(-1, 40, (3, 3))
    found = measure_trees(m, trees, ONE, heights=heights).disc_metamer
    for row in range(3):
        assert found[row, [0, 1, 2, -1]].tolist() == discs(m, trees, list(heights), row)
