"""Stands that renew themselves, whole: from seed to tree, by any way that a run can go."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from forest._threads import using_threads
from forest.dynamics.storms import BROKEN, UPROOTED
from forest.establishment import Newcomers, establish
from forest.growth.parameters import species_traits
from forest.record.checkpoint import latest_checkpoint, write_checkpoint
from forest.record.run import Run
from forest.scenario import Scenario
from forest.simulation import simulate
from forest.stand import Stand
from tests.tiny import assert_same_runs, assert_same_state, assert_same_years, steps

YEARS = 12
EARLY = {"maturity_height_m": 1.0, "seeds_per_leaf_m2": 3000.0}
BASE: dict[str, Any] = {
    "years": YEARS,
    "start_year": 2001,
    "plot": {"size_m": [8, 8], "boundary": "periodic"},
    "climate": {"noise_sd": 0.1},
    "environment": {"shadow": {}, "canopy": {}},
    "species": {
        "betula_pendula": {"regeneration": EARLY},
        "quercus_robur": {},
        "fagus_sylvatica": {},
    },
    "planting": {
        "kind": "explicit",
        "trees": [{"x_m": 2.0, "y_m": 2.0, "species": "betula_pendula"}],
    },
    "regeneration": {
        "handover_height_m": 1.0,
        "seed_rain": {"quercus_robur": 2.0, "fagus_sylvatica": 1.0},
    },
    "output": {"checkpoint_every_years": 5},
}


def _scenario(**changes: Any) -> Scenario:
    return Scenario(**{**BASE, **changes})


@pytest.fixture(scope="module")
def grown(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The whole run on one thread; the writer has checked its ledgers."""
    return simulate(_scenario(), tmp_path_factory.mktemp("grown") / "run.h5", threads=1)


@pytest.mark.usefixtures("three_threads")
def test_same_on_threads_and_resumed(grown: Run, tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    with simulate(_scenario(), out, threads=2) as other:
        assert_same_runs(grown, other)
    simulate(_scenario(years=7), out, overwrite=True).close()
    with simulate(_scenario(), out, resume=True) as other:
        assert_same_runs(grown, other)


def test_restored_stand_goes_on_the_same(tmp_path: Path) -> None:
    scenario = _scenario()
    whole = Stand(scenario)
    before = steps(whole, 6)
    whole.fell([1])  # its stump waits for the next year
    arrays, meta = whole.state()
    write_checkpoint(tmp_path / "run.h5", arrays, meta, step=6)
    found = latest_checkpoint(tmp_path / "run.h5")
    assert found is not None
    restored = Stand.restore(scenario, *found)
    assert len(whole.regeneration.cohorts.n)  # type: ignore[union-attr]
    assert_same_state(whole, restored)
    with using_threads(1):
        after = steps(whole, 4)
    with using_threads(2):
        assert_same_years(after, steps(restored, 4))
    assert_same_state(whole, restored)
    assert len(before[-1].tables["regeneration"]["n_ha"]) == 3


def test_every_seedling_is_accounted_for(grown: Run) -> None:
    table = grown.regeneration.pivot(index="year", columns="species")
    came = table["germinated_ha"] + table["sprouts_ha"]
    went = table["died_ha"] + table["crowded_ha"] + table["recruits_ha"]
    np.testing.assert_allclose(table["n_ha"].diff().iloc[1:], (came - went).iloc[1:], atol=1e-6)
    assert (table["n_low_ha"] + table["n_high_ha"] <= table["n_ha"] + 1e-6).all(axis=None)
    assert (went.sum() > 0).any()


def test_recruits_have_their_events_a_year_later(grown: Run) -> None:
    events = grown.events[grown.events.kind == "recruited"]
    told = grown.regeneration.groupby("year").recruits_ha.sum() * 64 / 10_000
    found = events.groupby("year").size().reindex(told.index, fill_value=0)
    assert found.to_numpy()[1:].tolist() == pytest.approx(told.to_numpy()[:-1].tolist())
    assert len(events) > 0
    recruit = events.iloc[0]
    tree = grown.trees[(grown.trees.tree_id == recruit.tree_id)].iloc[0]
    assert tree.age > 3  # of the seedling, not of the tree of buds
    assert recruit.height_m == pytest.approx(1.0, abs=0.4)


def test_no_seed_from_immature_trees_or_without_rain(grown: Run) -> None:
    table = grown.regeneration.pivot(index="year", columns="species", values="seeds_ha")
    trees = grown.trees[grown.trees.tree_id == 1].set_index("year")
    ripe = trees.height_m >= EARLY["maturity_height_m"]
    birch = table["betula_pendula"]
    assert (birch[~ripe.reindex(birch.index)] == 0.0).all()
    assert (birch[ripe.reindex(birch.index)] > 0.0).all()
    assert (table["quercus_robur"] > 0.0).all()


def test_mothers_are_trees_that_bore_seed() -> None:
    stand = Stand(_scenario())
    steps(stand, 5)
    assert stand.regeneration is not None
    cohorts = stand.regeneration.cohorts
    assert set(cohorts.mother[cohorts.species == 0].tolist()) == {1}  # the only birch
    assert set(cohorts.mother[cohorts.species > 0].tolist()) == {0}  # seed from outside
    steps(stand, 3)
    born = {int(m) for m in stand.rows.mother_id[stand.rows.species == 0][1:]}
    assert born == {1}


def test_seedlings_shade_the_floor_but_not_themselves() -> None:
    stand = Stand(_scenario())
    steps(stand, 5)
    assert stand.regeneration is not None
    canopy = stand.surroundings.canopy
    assert canopy is not None
    stand.surroundings.expose(stand.arena.metamers, stand.rows, stand.steps)
    above = canopy.ground_light.mean()
    canopy.grow_under(np.full(canopy.ground_light.shape, 1.0))
    assert stand.floor_light < 0.75 * above
    stand.surroundings.expose(stand.arena.metamers, stand.rows, stand.steps)
    assert canopy.ground_light.mean() == above  # what falls on the seedlings
    assert stand.floor_light < 0.75 * above


def test_stumps_of_felled_trees_sprout() -> None:
    trees = [{"x_m": x + 0.5, "y_m": 4.0, "species": "quercus_robur"} for x in range(8)]
    scenario = _scenario(
        planting={"kind": "explicit", "trees": trees}, regeneration={"handover_height_m": 1.5}
    )
    stand = Stand(scenario)
    steps(stand, 2)
    stand.fell(list(range(1, 9)))
    record = stand.step()
    assert stand.regeneration is not None
    cohorts = stand.regeneration.cohorts
    assert record.tables["regeneration"]["sprouts_ha"][1] == cohorts.n.sum() * 10_000 / 64
    assert cohorts.sprout.all()
    assert 0 < len(cohorts.n) <= 8
    mothers = set(cohorts.mother.tolist())
    steps(stand, 2)
    assert len(stand.rows.tree_id)
    assert set(stand.rows.mother_id.tolist()) <= mothers
    assert stand.rows.reserve.min() > 0.0


def test_stumps_of_burnt_trees_sprout_a_year_later() -> None:
    trees = [{"x_m": x + 0.5, "y_m": 4.0, "species": "quercus_robur"} for x in range(8)]
    fire = {"year": 2003, "x_m": 4.0, "y_m": 4.0, "radius_m": 20.0, "share": 1.0, "cause": "fire"}
    scenario = _scenario(
        planting={"kind": "explicit", "trees": trees},
        regeneration={"handover_height_m": 1.5},
        mortality={"events": [fire]},
    )
    burnt, after = steps(Stand(scenario), 4)[2:]
    assert len(burnt.tables["trees"]["tree_id"]) == 0
    assert burnt.tables["regeneration"]["sprouts_ha"].sum() == 0.0
    assert after.tables["regeneration"]["sprouts_ha"][1] > 0.0


def test_stumps_of_wind_broken_trees_sprout() -> None:
    """What a storm breaks leaves a stump; what it uproots does not: in the year and by hand."""
    trees = [{"x_m": x + 0.5, "y_m": 4.0, "species": "quercus_robur"} for x in range(8)]
    rest = {
        "planting": {"kind": "explicit", "trees": trees},
        "regeneration": {"handover_height_m": 1.5},
    }
    named = {"from_height_m": 0.1, "storms": [{"year": 2003, "speed_m_s": 100}]}
    firm, loose = {"anchorage": 10.0}, {"anchorage": 0.001}
    for soil, sprout in ((firm, True), (loose, False)):
        stand = Stand(_scenario(**rest, wind={**named, **soil}))
        storm, after = steps(stand, 4)[2:]
        outcome = storm.tables["storms"]["outcome"]
        assert (outcome == (BROKEN if sprout else UPROOTED)).all()
        assert len(outcome) == 8
        assert (after.tables["regeneration"]["sprouts_ha"][1] > 0.0) == sprout
        by_hand = Stand(_scenario(**rest, wind={"from_height_m": 0.1, **soil}))
        steps(by_hand, 3)
        assert len(by_hand.blow(100.0)) == 8
        assert (by_hand.step().tables["regeneration"]["sprouts_ha"][1] > 0.0) == sprout


def test_recruits_have_their_height_where_stems_have_short_internodes() -> None:
    short = {"internode_factor_by_order": [[0, 0.4], [1, 1.0]]}
    stand = Stand(_scenario(species={"betula_pendula": {"architecture": short}}, regeneration=None))
    upright = np.array([[0.0, 0.0, 1.0]])
    one, none = np.ones(1), np.zeros(1, np.int64)
    new = Newcomers(one, one, none, upright, 1.5 * one, none, none, one)
    establish(stand, new, "recruited", species_traits(stand.species, paper=False))
    unit = stand.species[0].architecture.internode_length_m
    assert stand.measure().height_m[-1] == pytest.approx(1.5, abs=0.2 * unit)


def test_succession_from_bare_ground() -> None:
    """Birch takes the open ground; what comes up beneath it later is beech."""
    scenario = _scenario(
        years=45,
        species={"betula_pendula": {}, "fagus_sylvatica": {}},
        planting={"kind": "explicit", "trees": []},
        regeneration={"seed_rain": {"betula_pendula": 200.0, "fagus_sylvatica": 0.3}},
    )
    stand = Stand(scenario)
    years = [record.tables for record in steps(stand, 45)]
    assert len(years[0]["trees"]["tree_id"]) == 0
    birch, beech, _ = years[19]["stand"]["basal_area_m2ha"]
    assert birch > 5.0 * beech
    recruits = np.array([tables["regeneration"]["recruits_ha"] for tables in years])
    early, late = recruits[:12].sum(axis=0), recruits[20:].sum(axis=0)
    assert early[0] > 3.0 * early[1]
    assert late[1] > 2.0 * late[0]


def test_a_gap_is_recolonised_and_a_closed_stand_is_not() -> None:
    """Birch seed falls everywhere; under spruces it comes to nothing, where they are felled not."""
    spruces = [
        {"x_m": x + 0.5, "y_m": y + 0.5, "species": "picea_abies"}
        for x in range(12)
        for y in range(12)
    ]
    scenario = _scenario(
        plot={"size_m": [12, 12], "boundary": "periodic"},
        species={"betula_pendula": {}, "picea_abies": {}},
        planting={"kind": "explicit", "trees": spruces},
        regeneration={"handover_height_m": 1.0, "seed_rain": {"betula_pendula": 2000.0}},
    )
    stand = Stand(scenario)
    steps(stand, 14)
    gap = (stand.rows.species == 0) | (stand.rows.y > 4.0)
    stand.fell(stand.rows.tree_id[gap].tolist())
    before = stand.next_id
    steps(stand, 8)
    new = (stand.rows.tree_id >= before) & (stand.rows.mother_id == 0)
    assert (stand.rows.species[new] == 0).all()
    assert new.sum() > 10
    assert (stand.rows.y[new] > 4.0).mean() > 0.9


def test_a_stand_without_it_has_no_rows(tmp_path: Path) -> None:
    scenario = _scenario(regeneration=None, years=1)
    with simulate(scenario, tmp_path / "run.h5") as run:
        assert run.regeneration.empty
    assert "regeneration" not in Stand(scenario).step().tables
