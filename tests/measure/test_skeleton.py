"""A skeleton says the same as the arena it was taken from."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.trees.metamers import LATERAL, MAIN, TERMINAL
from forest.trees.skeleton import skeleton_of
from tests.builders import random_arena


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 80))
def test_skeleton_of_a_random_tree(seed, n):
    m, trees = random_arena(np.random.default_rng(seed), 2, n)
    row = 1
    s = skeleton_of(m, trees, row, species="oak", pipe_exponent=2.5, start_year=1900)
    first = int(trees.start[row])
    assert len(s) == trees.size[row]
    assert (s.tree_id, s.species) == (trees.tree_id[row], "oak")
    assert s.start[0].tolist() == [trees.x[row], trees.y[row], 0.0]
    assert s.axis[0] == 0
    axes = 1
    for j in range(len(s)):
        parent = s.parent[j]
        state = m.state[first + j]
        if j > 0:
            assert (s.start[j] == s.end[parent]).all()
            if state & MAIN:
                assert s.axis[j] == s.axis[parent]
            else:
                assert s.axis[j] == axes
                axes += 1
        assert s.leafy[j] == bool(state & (TERMINAL | LATERAL))
        assert s.birth_year[j] == 1900 + m.birth[first + j]
        assert (2 * s.radius[j]) ** 2.5 == pytest.approx(m.pipe[first + j])
    assert s.length == pytest.approx(m.length[first : first + len(s)], rel=1e-4, abs=1e-6)
