"""The fit of species: targets, places between bounds, thinning to a table, the search itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import forest
from analysis.fit_page import against_targets, branch_cm, succession
from analysis.fit_species import fit, present, search, write_values
from analysis.fit_stand import (
    grow_towards,
    misfit,
    number_at,
    open_slenderness,
    residual,
    scenario_of,
    thin_from_below,
    within,
)
from analysis.fit_targets import GOALS, Free, Target, yield_table
from forest.species import load_species, shipped_table

SMALL = replace(
    GOALS["pinus_sylvestris"],
    density_ha=5000.0,
    years=12,
    targets=(Target(12, "top_height_m", 4.0, 0.1),),
    free=(Free("carbon.light_use_efficiency_kg_m2", 0.2, 4.0),),
)


@pytest.mark.parametrize("name", GOALS)
def test_goals_fit_their_species(name: str) -> None:
    """What a fit may move exists, and what the file says lies between the bounds."""
    table = shipped_table(name)
    for free in GOALS[name].free:
        section, key = free.key.split(".")
        assert free.low <= table[section][key] <= free.high, free.key
    assert ((present(name, GOALS[name]) >= 0.0) & (present(name, GOALS[name]) <= 1.0)).all()


@given(st.floats(0.0, 1.0), st.sampled_from([(0.001, 0.1), (-0.5, 0.4), (20.0, 70.0)]))
@settings(max_examples=25, deadline=None)
def test_places_between_bounds(place: float, bounds: tuple[float, float]) -> None:
    free = Free("carbon.x", *bounds)
    assert free.place(free.value(place)) == pytest.approx(place, abs=0.01)


def test_yield_tables_name_their_source_and_agree_with_themselves() -> None:
    for name, author in (("koivisto_pine", "Koivisto"), ("assmann_franz_spruce", "Assmann")):
        source, table = yield_table(f"{name}.csv")
        assert author in source
        area = np.pi / 4e4 * table["n_ha"] * table["qmd_cm"] ** 2
        np.testing.assert_allclose(area, table["basal_area_m2ha"], rtol=0.03)


def test_numbers_between_the_ages_of_a_table() -> None:
    table = pd.DataFrame({"n_ha": [2000.0, 500.0]}, index=[40.0, 80.0])
    assert number_at(table, 40) == pytest.approx(2000.0)
    assert number_at(table, np.sqrt(40 * 80)) == pytest.approx(1000.0)
    assert number_at(table, 20) == pytest.approx(8000.0)
    assert number_at(table, 100) == pytest.approx(500.0)


def test_residuals_count_in_tolerances_and_ceilings_only_what_is_beyond() -> None:
    stand = pd.DataFrame({"lai": [2.0, 3.0], "sdi": [900.0, 1100.0]}, index=[1, 2])
    assert residual(stand, Target(2, "lai", 3.0, 0.1)) == 0.0
    assert residual(stand, Target(1, "lai", 3.0, 0.1)) == pytest.approx(np.log(2 / 3) / 0.1)
    ceiling = Target(0, "sdi", 1000.0, 0.05, side=1)
    assert residual(stand, ceiling) == pytest.approx(np.log(1.1) / 0.05)
    assert residual(stand.loc[:1], ceiling) == 0.0
    assert not within(1100.0, ceiling)
    assert within(400.0, ceiling)
    unborn = Target(9, "lai", 3.0, 0.1)
    assert misfit([stand], [unborn]) == 25.0


def test_the_thinnest_are_felled_to_the_number() -> None:
    scenario = scenario_of("pinus_sylvestris", SMALL, 6.0, 1, {})
    stand = forest.Stand(scenario)
    for _ in range(10):
        stand.step()
    before = stand.trees.set_index("tree_id")["dbh_cm"].fillna(0.0)
    thin_from_below(stand, 2500.0)
    after = stand.trees["tree_id"]
    assert len(after) == 9
    assert before[after].min() >= before.drop(after).max()
    thin_from_below(stand, 9000.0)
    assert len(stand.trees) == 9
    assert branch_cm(stand) > 0.0


def test_the_search_stays_inside_and_finds_the_least() -> None:
    tried = []

    def cost(x: np.ndarray) -> float:
        tried.append(x.copy())
        return float(((x - [0.2, 0.9]) ** 2).sum())

    found = search(cost, np.array([0.7, 0.3]), 200)
    np.testing.assert_allclose(found, [0.2, 0.9], atol=0.01)
    assert (np.array(tried) >= 0.0).all()
    assert (np.array(tried) <= 1.0).all()


def test_a_fit_comes_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(GOALS, "pinus_sylvestris", SMALL)
    values, before, after = fit("pinus_sylvestris", 8, 6.0, [1])
    assert after < before
    grown = grow_towards("pinus_sylvestris", SMALL, 6.0, 1, values)
    assert misfit([grown], SMALL.targets) == pytest.approx(after)
    assert "| 12 | top height, m | 4 |" in against_targets(SMALL, [grown, grown])


def test_a_greater_share_of_rings_makes_an_open_grown_tree_stockier() -> None:
    key = "carbon.ring_fraction"
    slender, stocky = (
        open_slenderness("pinus_sylvestris", SMALL, {key: value}) for value in (0.4, 0.7)
    )
    assert stocky < slender


def test_only_the_named_values_change(tmp_path: Path) -> None:
    source = Path(forest.__file__).parent / "species" / "pinus_sylvestris.toml"
    copy = tmp_path / "pine.toml"
    text = source.read_text(encoding="utf-8")
    copy.write_text(text, encoding="utf-8")
    write_values(copy, {"carbon.vigour_sd": 0.123, "leaves.area_m2": 0.0111}, "a table")
    changed = [
        new
        for old, new in zip(
            text.splitlines(), copy.read_text(encoding="utf-8").splitlines(), strict=True
        )
        if old != new
    ]
    told = "fitted with analysis/fit_species.py to a table"
    assert changed == [
        "area_m2 = 0.0111",
        "vigour_sd = 0.123",
        f'leaves.area_m2 = "{told}"',
        f'carbon.vigour_sd = "{told}"',
    ]
    assert load_species("pinus_sylvestris").carbon.vigour_sd != 0.123


def test_succession_of_shares() -> None:
    age = pd.RangeIndex(1, 81, name="age")
    area = pd.DataFrame(0.0, index=age, columns=["betula_pendula", "pinus_sylvestris"])
    area["betula_pendula"] = np.minimum(age, 20.0)
    area["picea_abies"] = np.maximum(0.0, 0.5 * (age - 20.0))
    assert succession(area) == (10, 61)
    assert succession(area.loc[:60]) == (10, None)
