"""What breaks and uproots a tree: against the slow twin, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.growth.dealing import BINS, Workbench, deal
from forest.mechanics.momentum import LAYERS, draw_crowns
from forest.mechanics.overthrow import CALM, GUST, Blow, Critical, find_critical
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
    canopy, thick = rng.uniform(1.0, 4.0), rng.uniform(0.05, 0.2)
    crowns = draw_crowns(m, trees, SPECIES, (along[0], along[1]), LAYERS * thick)
    density, edge = rng.uniform(0.0, 0.1, (3, LAYERS)), rng.uniform(0.0, 1.0, 3)
    gusts = rng.uniform(1.0, 5.0, 3)
    blow = Blow(along[0], along[1], canopy, thick, crowns.share, density, edge, gusts)
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
            place = slow.Place(along, canopy, crowns.thick, density[row], edge[row], gusts[row])
            drag = float(SPECIES.drag[trees.species[row]])
            return slow.strain(nodes, of, speed, place, drag, GUST)

        for way, speed in enumerate((found.breaks[row], found.uproots[row])):
            if np.isnan(speed):
                assert strains(100.0)[way] < 1.001 * limits[way]
            else:
                assert strains(1.002 * speed + 1e-4)[way] > 0.999 * limits[way]
                if speed > CALM:
                    assert strains(0.998 * speed)[way] < 1.001 * limits[way]


def _blow(n: int, m: Metamers, trees: Trees, speed_to: tuple[float, float] = (1.0, 0.0)) -> Blow:
    """A wind over trees that stand far from each other, under a canopy of 10 m."""
    crowns = draw_crowns(m, trees, SPECIES, speed_to, 10.0)
    alone = np.zeros((n, LAYERS)), np.zeros(n), np.ones(n)
    return Blow(*speed_to, 10.0, crowns.thick, crowns.share, *alone)


def test_a_bare_pole_stands_and_a_leaning_one_is_pulled_over_by_its_weight() -> None:
    """M = g m L sin(lean) / 2 per mass of the stem."""
    radius = np.full(40, 0.1)
    m, trees = pole(radius, 10.0)
    upright = _critical(m, trees, _blow(1, m, trees))
    assert np.isnan(upright.breaks[0])
    assert np.isnan(upright.uproots[0])
    lean = 0.1
    moment_per_mass = 9.80665 * 5.0 * np.sin(lean)
    m, trees = pole(radius, 10.0, lean)
    assert np.isnan(
        _critical(m, trees, _blow(1, m, trees), np.array([1.1 * moment_per_mass, 1])).uproots[0]
    )
    held = _critical(m, trees, _blow(1, m, trees), np.array([0.99 * moment_per_mass, 1.0]))
    assert held.uproots[0] == CALM


def test_slender_trees_break_and_stocky_ones_overturn() -> None:
    """At equal crown: resistance to breaking goes by d^3, to overturning by d^2 h."""
    kinds = {}
    for diameter, height in ((0.08, 10.0), (0.3, 10.0)):
        m, trees = pole(tapered(40, 0.6, 0.5 * diameter), height)
        m.state[20:40] |= TERMINAL | LATERAL
        found = _critical(m, trees, _blow(1, m, trees), np.array([18.0, 18.0]))
        kinds[diameter] = found.breaks[0] < found.uproots[0]
    assert kinds[0.08]
    assert not kinds[0.3]


def test_bins_hold_their_own_scratch() -> None:
    """Many trees, some without metamers to throw, give what each gives alone."""
    rng = np.random.default_rng(8)
    n = 2 * BINS
    m, trees = woody_arena(rng, n, 12)
    together = _critical(m, trees, _blow(n, m, trees, (0.6, 0.8)))
    for row in (0, 7, n - 1):
        alone = Trees(*(column[row : row + 1] for column in trees))
        one = _critical(m, alone, _blow(1, m, alone, (0.6, 0.8)))
        assert pytest.approx(one.breaks[0], nan_ok=True, rel=0) == together.breaks[row]
        assert pytest.approx(one.uproots[0], nan_ok=True, rel=0) == together.uproots[row]


def test_a_stem_that_would_buckle_under_its_load_stands_until_the_wind_blows() -> None:
    """The shape in which it stands carries it; only what the wind adds moves its weight aside."""
    m, trees = pole(tapered(40, 1.2, 0.03), 12.0, 0.01)
    m.state[30:40] |= TERMINAL | LATERAL
    found = _critical(m, trees, _blow(1, m, trees), np.array([128.0, 128.0]))
    assert found.breaks[0] > 1.0
    assert found.uproots[0] > 1.0
