"""Texture coordinates of the blended surface: those of each triangle by itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.surface.blend import blend_of
from forest.surface.blend.unrolled import unroll
from forest.surface.frames import carry_frames
from tests.reference import unrolled as slow
from tests.surface.branchings import random_tree


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 4))
def test_triangles_are_unrolled_each_by_itself(seed: int, limbs: int) -> None:
    rng = np.random.default_rng(seed)
    skeleton = random_tree(seed, limbs)
    blend = blend_of(skeleton, flare=None)
    side = carry_frames(skeleton)[1]
    middle = skeleton.end[rng.integers(0, len(skeleton), 30)] + rng.normal(0.0, 0.1, (30, 3))
    points = (middle[:, None] + rng.normal(0.0, 0.03, (30, 3, 3))).reshape(-1, 3)
    triangles = np.arange(90, dtype=np.int32).reshape(-1, 3)
    own = blend.limb(points).cone
    which = rng.random(30) < 0.8
    uv = np.full((30, 3, 2), -1.0)
    unroll(blend.limbs, side, points, own, triangles, which, uv)
    expected = np.full((30, 3, 2), -1.0)
    for t in np.flatnonzero(which):
        expected[t] = slow.uv(blend.limbs, side, points[triangles[t]], own[triangles[t]])
    assert uv == pytest.approx(expected, abs=1e-9)
