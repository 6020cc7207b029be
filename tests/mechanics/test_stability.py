"""Stems, self-buckling and bending frequency against their slow twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.mechanics.stability import Stability, stability
from forest.mechanics.stems import read_stem
from forest.mechanics.stress import Wind
from forest.trees.metamers import CONTINUED, TERMINAL
from tests.mechanics.stem_cases import SPECIES, pole, tapered, wood_of, woody_arena
from tests.reference import stems as slow
from tests.reference.plant import read_plant

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_stations(seed: int) -> None:
    m, trees = woody_arena(np.random.default_rng(seed), 2, 30)
    for row in range(2):
        of = wood_of(trees.species[row])
        stem = read_stem(m, trees, row, SPECIES)
        nodes = slow.stem_of(read_plant(m, trees, row))
        assert stem.metamer.tolist() == [n.index for n in nodes]
        for k, node in enumerate(nodes):
            mass, place = slow.load(nodes, k, of)
            near = pytest.approx
            assert stem.radius[k] == near(of.radius(node), rel=1e-5)
            assert stem.rigidity[k] == near(of.rigidity(node), rel=1e-5)
            assert stem.wood[k] == near(of.wood(node), rel=1e-5)
            assert stem.load[k] == near(mass, rel=1e-5)
            assert (stem.load_x[k], stem.load_y[k]) == near(tuple(place[:2]), rel=1e-5, abs=1e-7)
            assert (stem.leaf_area[k], stem.leaf_height[k]) == near(
                slow.leaf_area(nodes, k, of), rel=1e-5, abs=1e-7
            )


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_greenhill_and_frequency(seed: int) -> None:
    """Against dense eigenproblems of the same pieces."""
    m, trees = woody_arena(np.random.default_rng(seed), 2, 30)
    out = stability(m, trees, SPECIES)
    for row in range(2):
        pieces = slow.pieces_of(read_plant(m, trees, row), wood_of(trees.species[row]), 64)
        factor, frequency = slow.slopes(pieces), slow.beam(pieces)[1]
        assert out.safety_factor[row] == pytest.approx(factor, rel=1e-5)
        assert out.frequency_hz[row] == pytest.approx(frequency, rel=1e-5)


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_greenhill_on_a_fine_grid(seed: int) -> None:
    """Against beam elements of another kind, four times as many."""
    m, trees = woody_arena(np.random.default_rng(seed), 1, 30)
    out = stability(m, trees, SPECIES)
    pieces = slow.pieces_of(read_plant(m, trees, 0), wood_of(trees.species[0]), 256)
    factor, frequency = slow.beam(pieces)
    assert out.safety_factor[0] == pytest.approx(factor, rel=0.01)
    assert out.frequency_hz[0] == pytest.approx(frequency, rel=0.01)


def test_greenhill_load_at_the_tip() -> None:
    """A light column buckles under a load of pi^2 E I / (4 L^2) at its tip (Euler)."""
    m, trees = pole(tapered(50, 0.0, 0.02), 3.0)
    m.state[49] |= TERMINAL
    light = SPECIES._replace(green_density=np.full(2, 1e-6), leaf_mass=np.full(2, 5.0))
    euler = np.pi**2 * 6.3e9 * np.pi / 4.0 * 0.02**4 / (4.0 * 3.0**2)
    out = stability(m, trees, light)
    assert out.safety_factor[0] == pytest.approx(euler / (5.0 * 9.80665), rel=1e-3)


def test_greenhill_crown_load_lowers_safety() -> None:
    bare = stability(*pole(tapered(40, 1.0, 0.1), 12.0), SPECIES)
    m, trees = pole(tapered(40, 1.0, 0.1), 12.0)
    m.state[20:] |= TERMINAL
    leafy = stability(m, trees, SPECIES._replace(leaf_mass=np.full(2, 1.0)))
    assert leafy.safety_factor[0] < 0.9 * bare.safety_factor[0]
    assert leafy.frequency_hz[0] < 0.9 * bare.frequency_hz[0]


def test_rigidity_of_rods_counts() -> None:
    """With E I given, the weaker of a rod's two rigidities holds the stem."""
    m, trees = pole(tapered(40, 1.0, 0.1), 12.0)
    stem = read_stem(m, trees, 0, SPECIES)
    rods = np.zeros((len(m.parent), 3), np.float32)
    rods[:40, 1] = 2.0 * stem.rigidity
    rods[:40, 2] = 3.0 * stem.rigidity
    constant = stability(m, trees, SPECIES)
    given_rods = stability(m, trees, SPECIES, rigidity=rods)
    np.testing.assert_allclose(given_rods.safety_factor, 2.0 * constant.safety_factor, rtol=1e-5)
    np.testing.assert_allclose(given_rods.stress_share, constant.stress_share)


def test_stem_goes_on_along_a_branch() -> None:
    """Where the trunk has lost its leader, the branch at its last node is the stem."""
    m, trees = pole(tapered(10, 1.0, 0.05), 4.0)
    m.state[4] &= ~CONTINUED
    m.state[5] = CONTINUED  # starts an axis of its own
    m.order[5:10] = 1
    assert read_stem(m, trees, 0, SPECIES).metamer.tolist() == list(range(10))


def _same(one: Stability, other: Stability) -> None:
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


def test_threads_give_the_same_bits() -> None:
    m, trees = woody_arena(np.random.default_rng(5), 40, 40)
    wind = Wind(np.full(40, 15.0), 4.0, 0.3, np.full(40, 2.0))
    with using_threads(1):
        one = stability(m, trees, SPECIES, wind)
    with using_threads(3):
        _same(one, stability(m, trees, SPECIES, wind))


def test_tree_without_metamers_has_no_stem() -> None:
    m, trees = woody_arena(np.random.default_rng(1), 2, 5)
    trees.size[0] = 0
    out = stability(m, trees, SPECIES)
    assert all(np.isnan(column[0]) and np.isfinite(column[1]) for column in out)
