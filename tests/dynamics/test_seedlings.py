"""Rows of new trees."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from forest.dynamics.planting import seedlings
from forest.trees.table import Trees

VOXEL = 0.2


def _seedlings(x: np.ndarray, y: np.ndarray, seed: int = 5) -> Trees:
    return seedlings(
        x,
        y,
        (np.arange(len(x)) % 2).astype(np.int16),
        first_id=4,
        step=3,
        seed=seed,
        voxel_m=VOXEL,
        vigour_sd=np.array([0.0, 0.1]),
        seed_reserve_kg=np.array([0.001, 0.002]),
    )


@given(st.lists(st.tuples(st.floats(0, 50), st.floats(0, 50)), min_size=1, max_size=8))
def test_places(points: list[tuple[float, float]]) -> None:
    x, y = np.array(points).T
    trees = _seedlings(x, y)
    assert trees.tree_id.tolist() == list(range(4, 4 + len(points)))
    assert (trees.birth == 3).all()
    for axis, place in enumerate((x, y)):
        voxel = trees.base_voxel[:, axis] * VOXEL
        np.testing.assert_allclose(voxel + trees.base_offset[:, axis], place, atol=1e-6)
        assert (trees.base_offset[:, axis] > -1e-6).all()
        assert (trees.base_offset[:, axis] < VOXEL + 1e-6).all()


def test_vigour_lasts_and_spreads() -> None:
    x = np.zeros(4000)
    trees = _seedlings(x, x)
    same, spread = trees.vigour[::2], trees.vigour[1::2]
    assert (same == 1.0).all()
    assert abs(spread.mean() - 1.0) < 0.012
    assert abs(spread.std() - 0.1) < 0.01
    assert np.abs(spread - 1.0).max() <= 0.25 + 1e-6  # cut at 2.5 standard deviations
    np.testing.assert_array_equal(trees.vigour, _seedlings(x, x).vigour)
    assert (trees.vigour != _seedlings(x, x, seed=6).vigour).any()
    assert trees.reserve[:2].tolist() == [0.001, 0.002]
