"""Wind in growth: the needed diameters against their twin, and stands that answer the wind."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.edge_trees import compare, grow, scenario
from forest._threads import using_threads
from forest.growth.dealing import Workbench, deal
from forest.mechanics.stress import Wind
from forest.mechanics.wind_growth import feel_wind
from forest.stand import Stand
from tests.mechanics.stem_cases import SPECIES, wood_of, woody_arena
from tests.reference import wind as slow
from tests.reference.plant import read_plant
from tests.tiny import assert_same_state, assert_same_years, steps, tiny

WINDY = ["plot.boundary=open", "mechanics={ bending=false, wind_m_s=15, wind_growth=true }"]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_needs_against_the_twin(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, trees = woody_arena(rng, 3, 25)
    species = SPECIES._replace(pipe_exponent=np.array([2.0, 2.0]))  # as mass balance has it
    shared = deal(trees.size)
    limit = np.array([2e6, 3e6])
    wind = Wind(rng.uniform(0.0, 20.0, 3), rng.uniform(1.0, 4.0), 0.0, rng.uniform(0.0, 2.0, 3))
    need = np.full(len(m.pipe), 9.0, np.float32)
    feel_wind(m, trees, shared, Workbench().scratch(shared), species, limit, wind, need)
    for row in range(3):
        sp = trees.species[row]
        of = wood_of(sp)
        wanted, stress = slow.need_of_stem(
            read_plant(m, trees, row),
            type(of)(2.0, of.density, of.leaf_mass, of.leaf_area, of.modulus),
            float(SPECIES.drag[sp]),
            limit[sp],
            (wind.speed[row], wind.canopy_height, wind.attenuation[row]),
        )
        s, n = int(trees.start[row]), int(trees.size[row])
        expected = np.zeros(n)
        expected[list(wanted)] = list(wanted.values())
        np.testing.assert_allclose(need[s : s + n], expected, rtol=2e-4, atol=1e-7)
        assert trees.wind_stress[row] == pytest.approx(stress, rel=2e-4)


def test_accounts_balance_and_bits_hold() -> None:
    """Carbon balances in the wind; threads and a restart change no bit; the wind changes much."""
    weak = "species.pinus_sylvestris.mechanics.wind_stress_limit=0.02"
    windy = tiny(*WINDY, weak, "output.sample_trees={}")
    stand = Stand(windy)
    with using_threads(2):
        years = steps(stand, 7)
    for year in years:
        carbon = year.tables["carbon"]
        spent = sum(carbon[name] for name in ("leaves", "upkeep", "extension", "ring"))
        np.testing.assert_allclose(carbon["income"], spent + carbon["reserve_change"], atol=1e-9)
    assert stand.rows.wind_stress.max() > 1.0
    with using_threads(1):
        other = Stand(windy)
        assert_same_years(steps(other, 4), years[:4])
        again = Stand.restore(windy, *other.state())
        assert_same_years(steps(again, 3), years[4:])
    assert_same_state(again, stand)


def test_stems_reach_the_limit_first() -> None:
    """A stem whose stress is below the limit grows as if there were no wind."""
    calm = steps(Stand(tiny("plot.boundary=open")), 4)
    gentle = [
        "plot.boundary=open",
        "mechanics={ bending=false, wind_m_s=0.01, wind_growth=true }",
    ]
    breeze = steps(Stand(tiny(*gentle)), 4)
    for one, other in zip(calm, breeze, strict=True):
        for name in ("height_m", "base_diameter_cm", "biomass_kg"):
            np.testing.assert_array_equal(one.tables["trees"][name], other.tables["trees"][name])


def test_edge_trees_are_thick_and_short() -> None:
    found = compare(grow(scenario("pinus_sylvestris", years=20, wind_growth=True)))
    plain = compare(grow(scenario("pinus_sylvestris", years=20, wind_growth=False)))
    assert found.slenderness["edge"] < 0.9 * found.slenderness["inside"]
    assert found.slenderness["edge"] < 0.95 * plain.slenderness["edge"]
    assert found.dbh_cm["edge"] > plain.dbh_cm["edge"]
    assert found.height_m["edge"] < plain.height_m["edge"]
    assert plain.stress["edge"] > 1.2 * plain.stress["inside"]
    assert found.leaning_out > 0.1
