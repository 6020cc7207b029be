"""Exposure to a wind of one direction: against its slow twin, and what edges and gaps do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.mechanics.fetch import Exposure, expose, heading, lay_ways
from forest.mechanics.shelter import Plot
from tests.reference import storms as slow


@given(st.integers(0, 2**32 - 1), st.booleans(), st.integers(1, 25))
@settings(max_examples=25, deadline=None)
def test_exposure_against_all_pairs(seed: int, periodic: bool, n: int) -> None:
    rng = np.random.default_rng(seed)
    plot = Plot(rng.uniform(8.0, 30.0), rng.uniform(8.0, 30.0), periodic)
    x, y = rng.uniform(0.0, plot.width, n), rng.uniform(0.0, plot.depth, n)
    height = rng.uniform(0.5, 4.0, n)
    standing = rng.random(n) < 0.8
    canopy, direction = rng.uniform(1.0, 4.0), rng.uniform(0.0, 360.0)
    found = expose(height, standing, lay_ways(x, y, canopy, direction, plot))
    wanted = slow.exposure(x, y, height, standing, canopy, np.radians(direction), plot)
    for got, column in zip(found, zip(*wanted, strict=True), strict=True):
        np.testing.assert_allclose(got, column, rtol=1e-8, atol=1e-12)
    with using_threads(1):
        again = expose(height, standing, lay_ways(x, y, canopy, direction, plot))
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one, other)


@given(
    st.integers(0, 2**32 - 1),
    st.integers(0, 4),
    st.sampled_from([0.0, 90.0, 180.0, 270.0, 45.0, 1e-7]) | st.floats(0.0, 360.0),
)
@settings(max_examples=25, deadline=None)
def test_ways_hold_every_image_that_meets_them(seed: int, n: int, direction: float) -> None:
    """Against all images of small plots under tall trees, one by one."""
    rng = np.random.default_rng(seed)
    plot = Plot(rng.uniform(1.0, 9.0), rng.uniform(1.0, 9.0), periodic=True)
    x, y = rng.uniform(0.0, plot.width, n), rng.uniform(0.0, plot.depth, n)
    canopy = rng.uniform(0.5, 4.0)
    ways = lay_ways(x, y, canopy, direction, plot)
    found = sorted(zip(ways.other_along, ways.other_across, ways.other, strict=True))
    assert found == sorted(slow.images(x, y, canopy, heading(direction), plot))


def _rows(
    columns: np.ndarray, lines: int, spacing: float, plot: Plot, direction: float = 0.0
) -> Exposure:
    """Trees of 20 m in a square grid at the given multiples of the spacing along x."""
    x, y = (a.ravel() for a in np.meshgrid((columns + 0.5) * spacing, (np.arange(lines) + 0.5)))
    height = np.full(len(x), 20.0)
    ways = lay_ways(x, y * spacing, 20.0, direction, plot)
    return expose(height, np.ones(len(x), np.bool_), ways)


def test_a_periodic_stand_has_no_edge() -> None:
    found = _rows(np.arange(12.0), 12, 2.5, Plot(30.0, 30.0, periodic=True), 30.0)
    np.testing.assert_allclose(found.edge, 0.0, atol=1e-6)
    np.testing.assert_allclose(found.spacing, 2.5, rtol=0.05)


@pytest.mark.parametrize("gap", [1, 2, 4, 8, 12])
def test_behind_a_gap_it_is_as_published(gap: int) -> None:
    """A stand of 10 heights, a gap, and the far side of it; 40 trees to four heights."""
    spacing, lines = 2.0, 40
    columns = np.concatenate((np.arange(100.0), np.arange(100.0, 140.0) + 10.0 * gap))
    side = Plot(2000.0, lines * spacing, periodic=False)
    found = _rows(columns, lines, spacing, side)
    middle = found.edge.reshape(lines, -1)[lines // 2]
    for tree in (0, 5, 10, 20):
        expected = slow.behind_an_edge(0.1, 0.1 * tree, gap + 0.1)
        assert middle[100 + tree] == pytest.approx(expected, rel=0.2, abs=0.01)
    assert middle[0] == 1.0  # beyond an open plot there is open land
    assert middle[99] < 1e-6


def test_the_wind_comes_from_one_side() -> None:
    spacing, side = 2.5, 16
    plot = Plot(spacing * side, spacing * side, periodic=False)
    found = _rows(np.arange(16.0), side, spacing, plot, direction=180.0)
    edge = found.edge.reshape(side, side)
    assert (edge[:, -1] == 1.0).all()
    assert (np.diff(edge[8]) > 0.0).all()
    np.testing.assert_allclose(edge, edge[::-1], rtol=1e-9)


def test_the_fallen_expose_and_the_low_shelter_nobody() -> None:
    rng = np.random.default_rng(5)
    x, y = rng.uniform(0.0, 60.0, 300), rng.uniform(0.0, 20.0, 300)
    plot = Plot(60.0, 20.0, periodic=False)
    ways = lay_ways(x, y, 15.0, 0.0, plot)
    height = np.full(300, 15.0)
    all_stand = expose(height, np.ones(300, np.bool_), ways)
    lee = x > 30.0
    cleared = expose(height, lee, ways)
    low = expose(np.where(lee, 15.0, 7.0), np.ones(300, np.bool_), ways)
    assert (cleared.edge[lee] > all_stand.edge[lee]).all()
    np.testing.assert_array_equal(low.edge[lee], cleared.edge[lee])
    assert np.isnan(cleared.gusts[~lee]).all()
