"""What breaks and uproots a tree: against the slow twin, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.growth.dealing import BINS, Workbench, deal
from forest.mechanics.overthrow import GUST, Blow, Critical, draw_crown, find_critical
from forest.mechanics.stems import NO_RIGIDITY
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees
from tests.mechanics.stem_cases import SPECIES, pole, tapered, wood_of, woody_arena
from tests.reference import storms as slow
from tests.reference.plant import read_plant

TURNING = np.array([0.5, 2.0])
RUPTURE = SPECIES.rupture * 0.1


def _critical(m: Metamers, trees: Trees, blow: Blow, turning: np.ndarray = TURNING) -> Critical:
    n = len(trees.size)
    out = Critical(np.full(n, np.nan), np.full(n, np.nan))
    shared = deal(trees.size)
    species = SPECIES._replace(rupture=RUPTURE)
    find_critical(
        m,
        trees,
        shared,
        Workbench().scratch(shared),
        species,
        turning,
        NO_RIGIDITY,
        blow,
        np.ones(n, np.bool_),
        out,
    )
    return out


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_critical_winds_against_the_twin(seed: int) -> None:
    """Just below them a tree resists, and above them it does not."""
    rng = np.random.default_rng(seed)
    m, trees = woody_arena(rng, 3, 25)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    canopy = rng.uniform(1.0, 4.0)
    blow = Blow(along[0], along[1], canopy, rng.uniform(0.3, 1.0, 3), rng.uniform(0.0, 2.0, 3))
    found = _critical(m, trees, blow)
    with using_threads(1):
        again = _critical(m, trees, blow)
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one, other)
    for row in range(3):
        sp = trees.species[row]
        nodes, of = read_plant(m, trees, row), wood_of(sp)
        limits = (RUPTURE[sp], slow.anchor(nodes, of, TURNING[sp]))

        def strains(
            speed: float, row: int = row, of: slow.Wood = of, nodes: list[slow.Node] = nodes
        ) -> tuple[float, float]:
            wind = (along, canopy, blow.attenuation[row])
            drag = float(SPECIES.drag[trees.species[row]])
            return slow.strain(nodes, of, speed * blow.share[row], wind, drag, GUST)

        for way, speed in enumerate((found.breaks[row], found.uproots[row])):
            if np.isnan(speed):
                assert strains(100.0)[way] < 1.001 * limits[way]
            else:
                assert strains(1.002 * speed + 1e-4)[way] > 0.999 * limits[way]
                if speed > 1e-4:
                    assert strains(0.998 * speed)[way] < 1.001 * limits[way]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_what_crowns_show_against_the_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, trees = woody_arena(rng, 2, 40)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    along = np.array([np.cos(angle), np.sin(angle)])
    for row in range(2):
        layers = np.full((3, 16), 7.0)
        area = float(SPECIES.leaf_area[trees.species[row]])
        draw_crown(m, trees, np.int64(row), area, along[0], along[1], layers)
        wanted = slow.crown_shares(read_plant(m, trees, row), area, along)
        np.testing.assert_allclose(layers[0], wanted, rtol=1e-6, atol=1e-12)


def _still(n: int) -> Blow:
    return Blow(1.0, 0.0, 10.0, np.ones(n), np.zeros(n))


def test_a_bare_pole_stands_and_a_leaning_one_is_pulled_over_by_its_weight() -> None:
    """M = g m L sin(lean) / 2 per mass of the stem."""
    radius = np.full(40, 0.1)
    upright = _critical(*pole(radius, 10.0), _still(1))
    assert np.isnan(upright.breaks[0])
    assert np.isnan(upright.uproots[0])
    lean = 0.1
    moment_per_mass = 9.80665 * 5.0 * np.sin(lean)
    m, trees = pole(radius, 10.0, lean)
    assert np.isnan(_critical(m, trees, _still(1), np.array([1.1 * moment_per_mass, 1])).uproots[0])
    held = _critical(m, trees, _still(1), np.array([0.99 * moment_per_mass, 1.0]))
    assert held.uproots[0] < 0.01


def test_slender_trees_break_and_stocky_ones_overturn() -> None:
    """At equal crown: resistance to breaking goes by d^3, to overturning by d^2 h."""
    kinds = {}
    for diameter, height in ((0.08, 10.0), (0.3, 10.0)):
        m, trees = pole(tapered(40, 0.6, 0.5 * diameter), height)
        m.state[20:40] |= TERMINAL | LATERAL
        found = _critical(m, trees, _still(1), np.array([18.0, 18.0]))
        kinds[diameter] = found.breaks[0] < found.uproots[0]
    assert kinds[0.08]
    assert not kinds[0.3]


def test_bins_hold_their_own_scratch() -> None:
    """Many trees, some without metamers to throw, give what each gives alone."""
    rng = np.random.default_rng(8)
    n = 2 * BINS
    m, trees = woody_arena(rng, n, 12)
    blow = Blow(0.6, 0.8, 2.0, np.full(n, 0.7), np.full(n, 1.0))
    together = _critical(m, trees, blow)
    for row in (0, 7, n - 1):
        alone = Trees(*(column[row : row + 1] for column in trees))
        one = _critical(m, alone, Blow(0.6, 0.8, 2.0, np.full(1, 0.7), np.full(1, 1.0)))
        assert pytest.approx(one.breaks[0], nan_ok=True, rel=0) == together.breaks[row]
        assert pytest.approx(one.uproots[0], nan_ok=True, rel=0) == together.uproots[row]
