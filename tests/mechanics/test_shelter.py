"""Shelter: against its slow twin, and what an edge is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.mechanics.shelter import Plot, Silhouettes, sheltered, silhouettes, upwind_depth
from forest.mechanics.stress import ATTENUATION
from forest.trees.metamers import LATERAL, TERMINAL
from tests.mechanics.stem_cases import SPECIES, woody_arena
from tests.reference import wind as slow

seeds = st.integers(0, 2**32 - 1)


@given(seeds, st.booleans(), st.integers(1, 30))
@settings(max_examples=25, deadline=None)
def test_shelter_against_all_pairs(seed: int, periodic: bool, n: int) -> None:
    rng = np.random.default_rng(seed)
    plot = Plot(rng.uniform(3.0, 30.0), rng.uniform(3.0, 30.0), periodic)
    x, y = rng.uniform(0.0, plot.width, n), rng.uniform(0.0, plot.depth, n)
    height = rng.uniform(0.2, 4.0, n) * (rng.random(n) < 0.9)
    seen = Silhouettes(height, rng.uniform(0.0, 5.0, n) * (height > 0.0))
    depth = upwind_depth(x, y, seen, plot)
    wanted = np.zeros((n, 8))
    if (height > 0.0).any():
        tall = height > 0.0
        wanted[tall] = slow.upwind_depth(x[tall], y[tall], height[tall], seen.frontal[tall], plot)
    np.testing.assert_allclose(depth, wanted, rtol=1e-9, atol=1e-12)
    with using_threads(1):
        np.testing.assert_array_equal(upwind_depth(x, y, seen, plot), depth)
    found = sheltered(depth)
    for row in range(n):
        assert (found[0][row], found[1][row]) == pytest.approx(slow.sheltered(wanted[row]))


def test_what_a_tree_shows_to_the_wind() -> None:
    m, trees = woody_arena(np.random.default_rng(3), 5, 30)
    seen = silhouettes(m, trees, SPECIES.leaf_area)
    for row in range(5):
        here = slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))
        state = m.state[here]
        sites = ((state & TERMINAL) != 0).sum() + ((state & LATERAL) != 0).sum()
        assert seen.height[row] == max(m.tip[here, 2].max(), 0.0)
        area = 0.5 * sites * SPECIES.leaf_area[trees.species[row]]
        assert seen.frontal[row] == pytest.approx(area)


def _rows(n: int, spacing: float, periodic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the wind and attenuations over n x n trees of 20 m; leaf area index 3."""
    place = (np.arange(n) + 0.5) * spacing
    x, y = (a.ravel() for a in np.meshgrid(place, place))
    seen = Silhouettes(np.full(n * n, 20.0), np.full(n * n, 1.5 * spacing**2))
    return sheltered(upwind_depth(x, y, seen, Plot(n * spacing, n * spacing, periodic)))


def test_a_closed_stand_halves_the_wind() -> None:
    """As beta was chosen: 0.47; and a periodic plot has no edge."""
    share, attenuation = _rows(12, 4.0, periodic=True)
    np.testing.assert_allclose(share, share[0], rtol=1e-9)
    assert share[0] == pytest.approx(0.47, abs=0.03)
    assert 0.7 * ATTENUATION < attenuation[0] < ATTENUATION


def test_edges_are_exposed() -> None:
    share, attenuation = (a.reshape(16, 16) for a in _rows(16, 8.0, periodic=False))
    assert share[0, 0] > share[0, 8] > share[4, 8] > share[8, 8]
    assert share[0, 8] > 1.3 * share[8, 8]
    assert attenuation[0, 8] < attenuation[8, 8]
    np.testing.assert_allclose(share, share[::-1].T, rtol=1e-9)


def test_lower_trees_give_no_shelter_and_a_lone_tree_has_none() -> None:
    x = np.array([5.0, 8.0])
    seen = Silhouettes(np.array([10.0, 5.0]), np.array([20.0, 20.0]))
    share, attenuation = sheltered(upwind_depth(x, x, seen, Plot(20.0, 20.0, periodic=False)))
    assert share[0] == 1.0
    assert attenuation[0] == 0.0
    assert share[1] < 1.0
