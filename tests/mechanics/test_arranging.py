"""Branches that are bent by hand: compared with matrices and with the least bending."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from forest.mechanics.arranging import MOST_TURN, NEAR, axis_path, carry, reach
from tests.builders import random_arena
from tests.reference.arranging import carried, energy


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.0, 0.5))
def test_carry_is_as_with_matrices(seed: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    arena, trees = random_arena(rng, 1, 25)
    here = slice(int(trees.start[0]), int(trees.start[0]) + int(trees.size[0]))
    parent, tip, state = arena.parent[here], arena.tip[here], arena.state[here]
    n = len(parent)
    path = axis_path(parent, state, int(rng.integers(n)))
    path = path[1:] if parent[path[0]] < 0 else path
    spins = Rotation.from_rotvec(rng.normal(size=(len(path), 3)) * spread).as_quat()
    turns = np.ascontiguousarray(spins[:, [3, 0, 1, 2]])
    moved, turned, placed = np.zeros(n, np.bool_), np.empty((n, 4)), np.empty((n, 3))
    carry(parent, tip, path, turns, moved, turned, placed)
    np.testing.assert_allclose(placed, carried(parent, tip, path, turns), atol=1e-9)
    np.testing.assert_array_equal(placed[~moved], tip[~moved].astype(np.float64))


def chain_of(rng: np.random.Generator, m: int) -> tuple[np.ndarray, np.ndarray]:
    step = rng.normal(size=(m, 3)) * 0.3 + [1.0, 0.0, 0.3]
    chain = 0.1 * np.concatenate((np.zeros((1, 3)), np.cumsum(step, axis=0)))
    flexibility = np.linspace(1.0, rng.uniform(0.3, 0.9), m) ** -4.0
    return chain, flexibility / flexibility.max()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 40), st.floats(0.0, 3.0))
def test_reach_never_goes_away_and_keeps_its_limits(seed: int, m: int, far: float) -> None:
    rng = np.random.default_rng(seed)
    chain, flexibility = chain_of(rng, m)
    target = chain[-1] + rng.normal(size=3) * far * np.linalg.norm(chain[-1])
    turns = np.empty((m, 4))
    left = reach(chain, target, flexibility, MOST_TURN, turns)
    angles = 2.0 * np.arccos(np.clip(np.abs(turns[:, 0]), 0.0, 1.0))
    assert (angles <= MOST_TURN + 1e-6).all()
    end = carried(np.arange(-1, m), chain, np.arange(1, m + 1), turns)[-1]
    assert np.linalg.norm(end - target) == pytest.approx(left, abs=1e-8)
    assert left <= np.linalg.norm(chain[-1] - target) + 1e-12
    again = np.empty((m, 4))
    assert reach(chain, target, flexibility, MOST_TURN, again) == left
    np.testing.assert_array_equal(turns, again)


@pytest.mark.parametrize("seed", range(6))
def test_reach_gets_there(seed: int) -> None:
    """A place that joints within their limits can come to is come to."""
    rng = np.random.default_rng(seed)
    m = 12
    chain, flexibility = chain_of(rng, m)
    spins = Rotation.from_rotvec(rng.normal(size=(m, 3)) * 0.08).as_quat()[:, [3, 0, 1, 2]]
    target = carried(np.arange(-1, m), chain, np.arange(1, m + 1), spins)[-1]
    turns = np.empty((m, 4))
    assert reach(chain, target, flexibility, MOST_TURN, turns) <= NEAR


@pytest.mark.parametrize("seed", range(3))
def test_reach_bends_about_as_little_as_it_can(seed: int) -> None:
    """The energy is within a fifth of the least, as a general optimiser finds it."""
    rng = np.random.default_rng(seed)
    m = 6
    chain, flexibility = chain_of(rng, m)
    target = chain[-1] + rng.normal(size=3) * 0.05
    target *= min(1.0, 0.97 * np.linalg.norm(chain[-1]) / np.linalg.norm(target))
    parent, path, turns = np.arange(-1, m), np.arange(1, m + 1), np.empty((m, 4))
    assert reach(chain, target, flexibility, 3.0, turns) <= NEAR

    def quaternions(vectors: np.ndarray) -> np.ndarray:
        return Rotation.from_rotvec(vectors.reshape(m, 3)).as_quat()[:, [3, 0, 1, 2]]

    found = minimize(
        lambda v: energy(flexibility, quaternions(v)),
        rng.normal(size=3 * m) * 0.01,
        constraints={
            "type": "eq",
            "fun": lambda v: carried(parent, chain, path, quaternions(v))[-1] - target,
        },
        method="SLSQP",
        options={"maxiter": 300},
    )
    assert found.success
    assert energy(flexibility, turns) < 1.2 * found.fun


def test_a_straight_chain_turns_most_where_it_is_thin() -> None:
    m = 10
    chain = np.zeros((m + 1, 3))
    chain[:, 0] = np.linspace(0.0, 1.0, m + 1)
    thin = np.linspace(1.0, 0.4, m) ** -4.0
    turns, even = np.empty((m, 4)), np.empty((m, 4))
    target = np.array([0.95, 0.2, 0.0])
    reach(chain, target, thin / thin.max(), MOST_TURN, turns)
    reach(chain, target, np.ones(m), MOST_TURN, even)
    assert np.argmin(turns[:, 0]) > np.argmin(even[:, 0])
