"""Frames of new metamers: growth is reproduced, and tropism curves what is new."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.growth.dealing import deal
from forest.mechanics.rods import frame_new
from tests.mechanics.rod_cases import chain, random_case, settled, tips
from tests.reference import rods as slow

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
def test_what_grew_stays_where_it_grew_if_nothing_bends(seed: int) -> None:
    case = random_case(np.random.default_rng(seed), 2, 60)
    case.loads.weight[:] = 0.0
    case.loads.wind[:] = 0.0
    case.rods.rest[:] = 0.0
    tip, bud = case.arena.tip.copy(), case.arena.bud.copy()
    settled(case)
    for row in range(2):
        here = slice(int(case.trees.start[row]), int(case.trees.start[row] + case.trees.size[row]))
        size = max(1.0, np.abs(tip[here]).max())
        np.testing.assert_allclose(case.arena.tip[here], tip[here], atol=1e-6 * size)
        np.testing.assert_allclose(case.arena.bud[here], bud[here], atol=1e-6)


@given(seeds)
def test_new_frames_follow_from_the_bent_parent(seed: int) -> None:
    """Heading, joint and the least rotation, whether the parent is old and bent or new."""
    rng = np.random.default_rng(seed)
    case = random_case(rng, 1, 30, sag=0.1)
    settled(case, 1e-4)
    s, n = int(case.trees.start[0]), int(case.trees.size[0])
    begin = max(1, n - int(rng.integers(1, 12)))
    case.arena.birth[s + begin : s + n] = 2
    case.arena.tip[s + begin : s + n] += rng.normal(size=(n - begin, 3)) * 0.02
    frame_new(*case[:2], deal(case.trees.size), case.rods, 2, np.zeros((1, 3)), np.ones((1, 3)))
    rods = case.rods
    for i in range(s + begin, s + n):
        p = s + int(case.arena.parent[i])
        end = slow.matrix(rods.frame[p])
        if p < s + begin:
            rate = rods.curvature[p].astype(float)
            end = end @ slow.rotation(0.5 * float(case.arena.length[p]) * rate)
        along = (case.arena.tip[i] - case.arena.tip[p]).astype(float)
        along /= np.linalg.norm(along)
        frame = slow.matrix(rods.frame[i])
        np.testing.assert_allclose(frame[:, 0], along, atol=1e-5)
        np.testing.assert_allclose(end @ slow.matrix(rods.joint[i]), frame, atol=1e-5)
        least = np.arccos(np.clip(end[:, 0] @ along, -1.0, 1.0))
        taken = np.arccos(np.clip(0.5 * (np.trace(frame @ end.T) - 1.0), -1.0, 1.0))
        assert taken == pytest.approx(least, abs=2e-3)
        assert not rods.rest[i].any()
        assert not rods.rigidity[i].any()


@pytest.mark.parametrize("pull", [0.3, -0.3])
def test_tropism_curves_a_new_shoot(pull: float) -> None:
    """Rest rate H x F / E I (eqs 4, 6): a level shoot turns towards F, about its level axis."""
    case = chain(40)
    case.arena.bud[:] = (0.0, 0.0, 1.0)
    tropism = np.array([[0.0, 0.0, pull]])
    frame_new(*case[:2], deal(case.trees.size), case.rods, 0, tropism, np.full((1, 3), 2.0))
    np.testing.assert_allclose(case.rods.rest[:, 0], 0.0, atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(case.rods.rest, axis=1), 0.15, rtol=1e-5)
    case.rods.rigidity[:] = 1.0
    settled(case)
    # an arc of curvature 0.15 / m and length 1 m
    np.testing.assert_allclose(
        tips(case)[-1],
        (np.sin(0.15) / 0.15, 0.0, np.sign(pull) * (1.0 - np.cos(0.15)) / 0.15),
        atol=1e-5,
    )
    slope = 0.15 * (1.0 - 0.5 / 40)
    np.testing.assert_allclose(
        case.arena.bud[-1], (-np.sign(pull) * np.sin(slope), 0.0, np.cos(slope)), atol=1e-5
    )


@pytest.mark.parametrize(("divergence", "deviation"), [(0.0, 0.7), (2.4, 1.1), (-2.0, 0.3)])
def test_a_branch_is_turned_by_divergence_and_deviation(
    divergence: float, deviation: float
) -> None:
    """Section 5.1, at the end of a bent parent."""
    case = chain(2, elevation=1.2, rigidity=1.0, weight=0.4, end_load=0.2)
    rho, theta = 0.5 * divergence, 0.5 * deviation
    case.rods.joint[1] = (
        np.cos(rho) * np.cos(theta),
        np.sin(rho) * np.cos(theta),
        -np.sin(rho) * np.sin(theta),
        np.cos(rho) * np.sin(theta),
    )
    settled(case)
    half = slow.rotation(0.25 * case.rods.curvature[0].astype(float))
    end = slow.matrix(case.rods.frame[0]) @ half
    start = end @ slow.branching(divergence, deviation)
    frame = start @ slow.rotation(0.25 * case.rods.curvature[1].astype(float))
    np.testing.assert_allclose(slow.matrix(case.rods.frame[1]), frame, atol=1e-6)
    np.testing.assert_allclose(tips(case)[1] - tips(case)[0], 0.5 * frame[:, 0], atol=1e-6)
