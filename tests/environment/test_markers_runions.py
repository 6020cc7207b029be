"""The original space colonization does what Runions et al. 2007 say of it."""

from __future__ import annotations

import numpy as np

from tests.reference.space_colonization_runions import colonize


def test_it_fills_the_cloud_by_steps_of_equal_length() -> None:
    rng = np.random.default_rng(4)
    markers = rng.uniform((-1, -1, 2), (1, 1, 4), (150, 3))
    position, parent = colonize(markers, (0, 0, 0), 0.1, 1.0, 0.25)
    assert parent[0] == -1
    assert np.all(parent[1:] < np.arange(1, len(parent)))
    steps = np.linalg.norm(position[1:] - position[parent[1:]], axis=1)
    np.testing.assert_allclose(steps, 0.1)
    reach = np.linalg.norm(markers[:, None] - position[None], axis=2).min(axis=1)
    assert np.mean(reach <= 0.25) > 0.95
    children = np.bincount(parent[1:])
    assert np.count_nonzero(children > 1) > 10
    trunk = position[position[:, 2] < 1.0]
    assert np.ptp(trunk[:, 0]) < 0.2  # a bare trunk until the cloud is within reach
