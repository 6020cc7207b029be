"""The wind within a canopy: against its slow twin, and the momentum that crowns share."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.mechanics.fetch import lay_ways
from forest.mechanics.momentum import (
    FRICTION,
    LAYERS,
    Crowns,
    canopies,
    draw_crowns,
    fill_winds,
    press,
)
from forest.mechanics.shelter import Plot
from tests.mechanics.stem_cases import SPECIES, woody_arena
from tests.reference import storms as slow
from tests.reference.plant import read_plant

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_what_crowns_show_against_the_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, trees = woody_arena(rng, 2, 40)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    along = np.array([np.cos(angle), np.sin(angle)])
    crowns = draw_crowns(m, trees, SPECIES, (along[0], along[1]), rng.uniform(0.5, 4.0))
    for row in range(2):
        sp = trees.species[row]
        area = float(SPECIES.leaf_area[sp])
        nodes = read_plant(m, trees, row)
        share, shown = slow.crown_layers(nodes, area, along, crowns.thick)
        np.testing.assert_allclose(crowns.share[row], share, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(crowns.drag[row], SPECIES.drag[sp] * shown, rtol=1e-6)


@given(SEEDS, st.booleans(), st.integers(1, 25))
@settings(max_examples=25, deadline=None)
def test_canopies_against_all_pairs(seed: int, periodic: bool, n: int) -> None:
    rng = np.random.default_rng(seed)
    plot = Plot(rng.uniform(3.0, 15.0), rng.uniform(3.0, 15.0), periodic)
    x, y = rng.uniform(0.0, plot.width, n), rng.uniform(0.0, plot.depth, n)
    standing = rng.random(n) < 0.8
    height, direction = rng.uniform(1.0, 8.0), rng.uniform(0.0, 360.0)
    drag = rng.uniform(0.0, 1.0, (n, LAYERS))
    crowns = Crowns(0.1, drag, drag)
    ways = lay_ways(x, y, height, direction, plot)
    found = canopies(standing, crowns, ways)
    wanted = slow.canopy(x, y, drag, standing, height, np.radians(direction), plot)
    np.testing.assert_allclose(found, wanted, rtol=1e-8)
    with using_threads(1):
        np.testing.assert_array_equal(canopies(standing, crowns, ways), found)


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_winds_against_the_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    density = rng.uniform(0.0, rng.choice([0.0, 0.001, 0.2]), LAYERS)
    speed, height = rng.uniform(0.1, 50.0), rng.uniform(5.0, 30.0)
    thick, edge, gusts = height * rng.uniform(0.5, 1.5) / LAYERS, rng.random(), rng.uniform(1, 7)
    wind = np.zeros((3, LAYERS))
    press(speed, height, thick, density, (edge, gusts), wind)
    wanted = slow.winds(speed, height, thick, density, edge)
    pressure = slow.pressure(wanted, density, gusts)
    np.testing.assert_allclose(wind[0], [layer.wind for layer in wanted], rtol=1e-6)
    np.testing.assert_allclose(wind[1], pressure, rtol=1e-6)


def _drag(speed: float, density: np.ndarray) -> float:
    """Stress that crowns far within a stand take out of the wind, Pa per rho."""
    wind = np.zeros((3, LAYERS))
    press(speed, 20.0, 20.0 / LAYERS, density, (0.0, 1.0), wind)
    return float(0.5 * density @ wind[1])


@pytest.mark.parametrize("speed", [8.0, 15.0, 30.0])
def test_crowns_share_the_momentum_that_the_wind_brings(speed: float) -> None:
    """Their drags add up to rho (0.3 u)^2 at most; a few crowns take what each alone would."""
    most = (FRICTION * speed) ** 2
    shape = np.where(np.arange(LAYERS) > 12, 1.0 / 19.0, 0.0)
    taken = [_drag(speed, index * shape) / most for index in (0.1, 0.5, 1.0, 5.0)]
    assert (np.diff(taken) > 0.0).all()
    assert taken[-1] == pytest.approx(1.0, abs=0.01)
    alone = 0.5 * 1e-4 * slow.streams(speed) * speed**2
    assert _drag(speed, 1e-4 * shape) == pytest.approx(alone, rel=0.01)


def test_the_wind_falls_with_the_crowns_above_and_blows_into_an_edge() -> None:
    density = np.where(np.arange(LAYERS) > 12, 0.5 / 19.0, 0.0)
    wind = np.zeros((3, LAYERS))
    fill_winds(15.0, 20.0, 20.0 / LAYERS, density, 0.0, wind)
    assert (np.diff(wind[0][12:]) > 0.0).all()
    np.testing.assert_allclose(wind[0][:13], wind[0][0])
    fill_winds(15.0, 20.0, 20.0 / LAYERS, density, 1.0, wind)
    np.testing.assert_allclose(wind[0], 15.0)


def test_gusts_at_an_edge_multiply_the_moment() -> None:
    density = np.where(np.arange(LAYERS) > 12, 0.5 / 19.0, 0.0)
    arm = (np.arange(LAYERS) + 0.5) * density
    moments = []
    for exposure in ((0.0, 1.0), (0.6, 3.0), (1.0, 4.3)):
        wind = np.zeros((3, LAYERS))
        press(15.0, 20.0, 20.0 / LAYERS, density, exposure, wind)
        moments.append(float(arm @ wind[1]))
    np.testing.assert_allclose(np.array(moments) / moments[0], [1.0, 3.0, 4.3])
