"""What hangs on trees, in summer and in winter, against its slow twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest._threads import using_threads
from forest.growth.dealing import deal
from forest.mechanics.loads import LoadSpecies, bury_sites, hang, make_loads
from forest.species import Species, shipped_table
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees
from tests.builders import random_arena
from tests.reference import loads as slow
from tests.reference.plant import read_plant

seeds = st.integers(0, 2**32 - 1)
EXPONENTS = np.array([2.0, 2.4])


def _species(fruit: float) -> list[Species]:
    """Spruce, whose needles stay in winter, and an oak with fruit."""
    spruce, oak = shipped_table("picea_abies"), shipped_table("quercus_robur")
    oak["mechanics"]["fruit_mass_kg"] = fruit
    return [Species(**spruce), Species(**oak)]


def _weights(m: Metamers, trees: Trees, species: LoadSpecies) -> NDArray[np.float32]:
    loads = make_loads(len(m.parent))
    hang(m, trees, deal(trees.size), species, loads)
    np.testing.assert_array_equal(loads.wind, 0.0)
    return loads.weight


@given(seeds, st.floats(0.0, 0.3), st.booleans())
@settings(max_examples=25, deadline=None)
def test_weights(seed: int, fruit: float, winter: bool) -> None:
    m, trees = random_arena(np.random.default_rng(seed), 3, 20, n_species=2)
    species = _species(fruit)
    of = LoadSpecies.of(species, EXPONENTS)
    weight = _weights(m, trees, of.in_winter() if winter else of)
    for row in range(3):
        kind = int(trees.species[row])
        for node in read_plant(m, trees, row):
            middle, tip = weight[trees.start[row] + node.index]
            wood = slow.wood_weight(node, species[kind], EXPONENTS[kind])
            hanging = slow.site_weight(node, species[kind], winter=winter)
            assert middle == pytest.approx(wood, rel=1e-6)
            assert tip == pytest.approx(hanging, rel=1e-6, abs=1e-12)


def test_winter_takes_fruit_and_short_lived_leaves() -> None:
    m, trees = random_arena(np.random.default_rng(1), 2, 40, n_species=2)
    trees.species[:] = [0, 1]
    of = LoadSpecies.of(_species(0.1), EXPONENTS)
    summer, winter = _weights(m, trees, of), _weights(m, trees, of.in_winter())
    spruce, oak = (slice(int(s), int(s + n)) for s, n in zip(trees.start, trees.size, strict=True))
    np.testing.assert_array_equal(winter[spruce], summer[spruce])
    np.testing.assert_array_equal(winter[oak, 0], summer[oak, 0])
    assert summer[oak, 1].max() > 0.0
    np.testing.assert_array_equal(winter[oak, 1], 0.0)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_sites_below_the_ground_die(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 3, 20)
    m.tip[:, 2] -= np.float32(rng.uniform(0.0, 0.5))
    before = m.state.copy()
    bury_sites(m, trees, deal(trees.size))
    sites = np.uint8(TERMINAL | LATERAL)
    untouched = np.ones(len(m.state), np.bool_)
    for row in range(3):
        nodes = read_plant(m, trees, row)
        here = trees.start[row] + np.arange(len(nodes))
        below = np.array(slow.buried(nodes))
        untouched[here] = ~below
        assert not np.any(m.state[here[below]] & sites)
        np.testing.assert_array_equal(m.state[here] | sites, before[here] | sites)
    np.testing.assert_array_equal(m.state[untouched], before[untouched])


def test_threads_hang_the_same() -> None:
    m, trees = random_arena(np.random.default_rng(3), 40, 40, n_species=2)
    of = LoadSpecies.of(_species(0.05), EXPONENTS)
    with using_threads(1):
        one = _weights(m, trees, of)
    with using_threads(3):
        np.testing.assert_array_equal(one, _weights(m, trees, of))
