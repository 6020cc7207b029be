"""The ring of stiff and soft elements (Lefebvre and Neyret 3.2.2, 5.1)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.surface.bark.equilibrium import equilibrium, residual
from tests.reference import bark as twin

numbers = st.floats(0.01, 1.0)


@st.composite
def rings(draw):  # type: ignore[no-untyped-def]
    """Elements that alternate or not, held or not, on a substrate that stretched unevenly."""
    n = draw(st.integers(1, 12))
    column = st.lists(numbers, min_size=n, max_size=n)
    rest = 0.1 * np.array(draw(column))
    if n > 1 and draw(st.booleans()):
        rest[1::2] = 0.0
    stiffness = 10 ** (4 * np.array(draw(column)) - 2)
    grip = draw(st.sampled_from([0.0, 1e-3, 1.0, 100.0])) * np.array(draw(column))
    under = np.array(draw(column))
    anchor = draw(st.floats(-1, 1)) + np.concatenate([[0.0], np.cumsum(under)[:-1]])
    return stiffness, rest, grip, anchor, float(under.sum())


def force_scale(stiffness, rest, grip, anchor, girth) -> float:  # type: ignore[no-untyped-def]
    """Give the greatest force that an element bears on the substrate's lengths, or at its own.

    What is left over at a vertex is a difference of such forces, and can be no smaller than their
    rounding.
    """
    below = np.diff(np.append(anchor, anchor[0] + girth))
    return float(np.max(stiffness * np.maximum(np.abs(below), rest)))


@settings(max_examples=60, deadline=None)
@given(rings())
def test_equals_the_dense_solution(ring) -> None:  # type: ignore[no-untyped-def]
    x = equilibrium(*ring)
    left = residual(*ring, x)
    assert np.abs(left).max() <= 1e-9 * force_scale(*ring)
    assert x == pytest.approx(twin.equilibrium(*ring), abs=1e-6)


@settings(max_examples=25, deadline=None)
@given(rings())
def test_a_free_ring_bears_one_tension(ring) -> None:  # type: ignore[no-untyped-def]
    stiffness, rest, grip, anchor, girth = ring
    x = equilibrium(stiffness, rest, 0.0 * grip, anchor, girth)
    pull = stiffness * (np.diff(np.append(x, x[0] + girth)) - rest)
    assert pull == pytest.approx(np.full(len(pull), pull[0]), rel=1e-6, abs=1e-9)


def test_weak_grip_is_no_grip() -> None:
    """The free ring is the limit of springs that weaken, weighed by the epidermis beside them."""
    rng = np.random.default_rng(1)
    rest, stiffness = rng.uniform(0.1, 1, 6), rng.uniform(1, 10, 6)
    anchor, girth = np.sort(rng.uniform(0, 5, 6)), 5.5
    grip = 0.5 * (rest + np.roll(rest, 1))
    free = equilibrium(stiffness, rest, 0 * grip, anchor, girth)
    assert equilibrium(stiffness, rest, 1e-7 * grip, anchor, girth) == pytest.approx(free, abs=1e-6)


def test_strong_grip_follows_the_substrate() -> None:
    rng = np.random.default_rng(2)
    anchor = np.sort(rng.uniform(0, 5, 6))
    x = equilibrium(np.ones(6), np.full(6, 0.5), np.full(6, 1e9), anchor, 5.0)
    assert x == pytest.approx(anchor, abs=1e-6)
