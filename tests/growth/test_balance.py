"""Growth rates of Hart & Baker against their slow twin."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from forest.growth.balance import growth_shares
from tests.builders import random_arena
from tests.reference import balance as slow
from tests.reference.plant import read_plant


def _weights(m, trees, gains):  # type: ignore[no-untyped-def]
    s, n = int(trees.start[0]), int(trees.size[0])
    weights = np.empty((2, n))
    growth_shares(
        m.parent[s : s + n],
        m.state[s : s + n],
        m.tip[s : s + n],
        m.length[s : s + n],
        m.pipe[s : s + n],
        m.light[s : s + n],
        gains,
        weights,
        np.empty((3, n)),
        np.empty((2, n), np.int32),
    )
    return weights


@given(
    st.integers(0, 2**32 - 1), st.sampled_from([1.0, 20.0, 500.0]), st.sampled_from([2.0, 2.5, 3.0])
)
def test_growth_shares(seed: int, offset_length: float, exponent: float) -> None:
    m, trees = random_arena(np.random.default_rng(seed), 1, 25)
    gains = slow.Gains(500.0, 0.1, 0.45, 1.5, offset_length, exponent)
    weights = _weights(m, trees, (500.0, 0.1, 0.45, 1.5, offset_length, exponent))
    nodes = read_plant(m, trees, 0)
    for (index, arm), expected in slow.weights(nodes[0], gains).items():
        row = 0 if arm == "main" else 1
        np.testing.assert_allclose(weights[row, index], expected, rtol=1e-5, atol=1e-6)


def test_growth_goes_to_the_light_side() -> None:
    """A tree that leans to +x: a bud limb on the other side grows faster (eq. 13 as read)."""
    m, trees = random_arena(np.random.default_rng(0), 1, 1)
    s = int(trees.start[0])
    m.parent[s : s + 4] = [-1, 0, 1, 1]
    m.state[s : s + 4] = [1 | 16, 1 | 16 | 8, 1 | 2, 2]
    m.tip[s : s + 4] = [[0, 0, 1], [0.5, 0, 2], [1.5, 0, 2], [-0.1, 0, 2.5]]
    m.length[s : s + 4] = 1.0
    m.pipe[s : s + 4] = 1e-4
    m.light[s : s + 4] = 0.5
    trees.size[0] = 4
    weights = _weights(m, trees, (500.0, 0.1, 0.45, 0.0, 20.0, 2.0))
    heavy, light = weights[0, 1], weights[1, 1]
    assert light > 0.55 > heavy  # 0.55: a limb across the lean
