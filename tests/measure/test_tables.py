"""Measured runs and stands: all tables of a small run agree with each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from forest.errors import InputError
from forest.measure.biomass import Compartments, carbon_table, compartments, stand_biomass
from forest.measure.bucking import Product
from forest.measure.gaps import gap_share
from forest.measure.increments import growth_table, volume_growth
from forest.measure.site_index import site_index_of
from forest.measure.tables import (
    SHAPE_COLUMNS,
    buck_run,
    buck_stand,
    measure_run,
    measure_stand,
    plot_of,
    stand_indices,
)
from forest.record.run import Run
from forest.simulation import simulate
from forest.stand import Stand
from tests.tiny import YEARS, tiny

LAST = 2000 + YEARS
PRODUCTS = [Product("stake", (0.5, 1.0), 1.0, 10.0)]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return simulate(tiny(), out=tmp_path_factory.mktemp("run") / "run.h5")


@pytest.fixture(scope="module")
def stand() -> Stand:
    stand = Stand(tiny())
    for _ in range(YEARS):
        stand.step()
    return stand


def test_a_run_and_its_live_stand_measure_alike(run: Run, stand: Stand):
    of_run, of_stand = measure_run(run, LAST), measure_stand(stand)
    assert set(of_run.columns) - set(of_stand.columns) == {"year", "status", "ring_width_mm"}
    sampled = of_run["tree_id"].isin(run.samples).to_numpy()
    assert sampled.any()
    for name in of_stand.columns:
        if name == "species":
            assert of_run[name].astype(str).tolist() == of_stand[name].tolist()
            continue
        rows = sampled if name in SHAPE_COLUMNS else slice(None)
        mine, theirs = of_run[name].to_numpy()[rows], of_stand[name].to_numpy()[rows]
        slack = 1e-5 * of_stand["above_ground_kg"].max() if name == "branch_wood_kg" else 1e-5
        assert mine == pytest.approx(theirs, rel=1e-4, abs=slack, nan_ok=True), name
    assert of_run.loc[~sampled, list(SHAPE_COLUMNS)].isna().all(axis=None)


def test_crowns_and_stems_agree_with_the_tree_table(stand: Stand):
    table = measure_stand(stand)
    radii = table[[name for name in SHAPE_COLUMNS if "radius" in name]]
    assert radii.mean(axis=1).to_numpy() == pytest.approx(table["crown_radius_m"])
    parts = [name for name in Compartments._fields if name not in ("above_ground_kg", "carbon_kg")]
    total = table[parts].sum(axis=1)
    assert total.to_numpy() == pytest.approx(table["above_ground_kg"])
    without_bark = (total - table["bark_kg"]).to_numpy()
    assert without_bark == pytest.approx(table["biomass_kg"].to_numpy())


def test_indices_of_a_stand(run: Run):
    trees = measure_run(run, LAST)
    got = stand_indices(trees, plot_of(run.scenario))
    row = run.stand.iloc[-1]
    assert got["curtis_rd"] == pytest.approx(row["basal_area_m2ha"] / row["qmd_cm"] ** 0.5)
    assert 0 < got["summation_sdi"] <= row["sdi"]
    assert got["species_profile"] == pytest.approx(got["relative_species_profile"] * np.log(2 * 3))
    assert got["bal_m2ha"] == pytest.approx(trees["bal_m2ha"].mean())
    assert got["gap_share"] == gap_share(trees, plot_of(run.scenario))
    nobody = stand_indices(trees[:0], plot_of(run.scenario))
    assert nobody.pop("summation_sdi") == 0.0
    assert nobody.pop("gap_share") == 1.0
    assert np.isnan(list(nobody.values())).all()


def test_basal_area_of_the_stand_is_that_of_its_trees(run: Run):
    sums = run.trees.groupby("year")["basal_area_m2"].sum() / plot_of(run.scenario).hectares
    whole = run.stand[run.stand["species"] == "all"].set_index("year")["basal_area_m2ha"]
    assert whole.to_numpy() == pytest.approx(sums.reindex(whole.index).to_numpy(), rel=1e-6)


def test_compartments_by_hand():
    got = compartments(
        5.0, 0.01, 2.0, bark_factor=0.1, density_kg_m3=400.0, sla_m2_kg=10.0
    )  # stem 0.81 * 4 kg, leaves 0.2 kg
    wood = 5.0 - 0.2
    assert got == pytest.approx((3.24, wood - 3.24, wood * (1 / 0.81 - 1), 0.2, *got[4:]))
    assert got.above_ground_kg == pytest.approx(wood / 0.81 + 0.2)
    assert got.carbon_kg == pytest.approx(got.above_ground_kg / 2)


def test_stand_biomass(run: Run):
    trees = measure_run(run, LAST)
    table = stand_biomass(trees, 0.01).set_index("species")
    of = trees[trees["species"] == "fagus_sylvatica"]
    assert table.loc["fagus_sylvatica", "leaves_tha"] == pytest.approx(of["leaves_kg"].sum() / 10)
    assert table.loc["all", "carbon_tha"] == pytest.approx(trees["carbon_kg"].sum() / 10)


def test_the_carbon_table_balances(run: Run):
    table = carbon_table(run)
    assert len(table) == len(run.carbon)
    parts = ["leaves", "upkeep", "extension", "ring", "reserve_change"]
    spent = table[[f"{name}_tcha" for name in parts]].sum(axis=1)
    assert table["income_tcha"].to_numpy() == pytest.approx(spent, rel=1e-6, abs=1e-9)
    assert table["income_tcha"].sum() == pytest.approx(run.carbon["income"].sum() / 2000)
    assert table["stock_tcha"].iloc[-1] == pytest.approx(run.stand["biomass_tha"].iloc[-1] / 2)


def test_increments_by_hand():
    stand = pd.DataFrame(
        {"year": [1, 2, 3], "species": "all", "volume_m3ha": [2.0, 10.0, 9.0], "other": 0}
    )
    events = pd.DataFrame(
        {
            "year": [2, 2, 3, 3],
            "species": "oak",
            "kind": ["died", "pruned", "felled", "windthrown"],
            "volume_m3": [0.5, 9.0, 2.0, 0.25],
        }
    )
    got = volume_growth(stand, events, 0.5, period=2)
    assert got["mortality_m3ha"].tolist() == [0, 1, 0.5]
    assert got["removed_m3ha"].tolist() == [0, 0, 4]
    assert got["net_increment_m3ha"].tolist() == [2, 8, 3]
    assert got["gross_increment_m3ha"].tolist() == [2, 9, 3.5]
    assert got["production_m3ha"].tolist() == [2, 10, 13]
    assert got["gross_production_m3ha"].tolist() == [2, 11, 14.5]
    assert got["mai_m3ha"].tolist() == pytest.approx([2, 5, 13 / 3])
    assert got["pai_m3ha"].tolist() == [2, 5, 5.5]
    with pytest.raises(InputError, match="unknown species 'oaks'"):
        volume_growth(stand, events, 0.5, species="oaks")
    with pytest.raises(InputError, match="1 year or more"):
        volume_growth(stand, events, 0.5, period=0)


def test_gross_increment_is_the_growth_of_the_trees(tmp_path: Path):
    """Felled, died or alive: each stem's growth is found again in the account of the stand."""
    with simulate(tiny("species.pinus_sylvestris.carbon.suppression_ratio=1",
                       "species.pinus_sylvestris.carbon.suppression_years=4"),
                  out=tmp_path / "run.h5") as run:  # fmt: skip
        assert (run.events["kind"] == "died").any()
        table = growth_table(run)
        volume = run.trees.pivot(index="year", columns="tree_id", values="stem_volume_m3")
        died = run.events[run.events["kind"] == "died"]
        for year, tree_id, cubic in died[["year", "tree_id", "volume_m3"]].itertuples(index=False):
            if year in volume.index and tree_id in volume.columns:
                volume.loc[year, tree_id] = cubic
        grown = volume.diff().where(volume.notna()).fillna(0.0).sum(axis=1).to_numpy()
        gross = table["gross_increment_m3ha"].to_numpy() * plot_of(run.scenario).hectares
        assert gross[1:] == pytest.approx(grown[1:], rel=1e-4, abs=1e-8)


def test_site_index_of_a_run(run: Run):
    top = run.stand[run.stand["species"] == "all"].set_index("year")["top_height_m"]
    assert site_index_of(run, base_age=YEARS) == pytest.approx(top[LAST])
    with pytest.raises(InputError, match="expected an age from 1 to 8"):
        site_index_of(run, base_age=50)
    with pytest.raises(InputError, match="unknown species 'oak'"):
        site_index_of(run, base_age=5, species="oak")


def test_bucking_a_run_and_a_stand(run: Run, stand: Stand):
    of_run, of_stand = buck_run(run, LAST, PRODUCTS), buck_stand(stand, PRODUCTS)
    exact = of_run[of_run.pop("stem") == "exact"].reset_index(drop=True)
    assert len(exact) > 0
    assert set(exact["tree_id"]) == set(run.samples) & set(of_run["tree_id"])
    same = of_stand[of_stand["tree_id"].isin(run.samples)].reset_index(drop=True)
    pd.testing.assert_frame_equal(exact, same, rtol=1e-4, check_dtype=False)
    assert of_stand["volume_m3"].sum() <= stand.trees["stem_volume_m3"].sum()
    assert set(of_run["tree_id"]) >= set(of_stand["tree_id"])


def test_bad_years(run: Run):
    for measured in (lambda: measure_run(run, 1900), lambda: buck_run(run, 1900, PRODUCTS)):
        with pytest.raises(InputError, match=r"no year 1900; expected a year from 2001 to 2008"):
            measured()


def test_a_stand_of_one_tree():
    one = Stand(tiny("planting.density_ha=100", "output.sample_trees.ids=[]"))
    one.step()
    assert len(one.rows.tree_id) == 1
    table = measure_stand(one)
    assert np.isnan(table["nearest_m"][0])
    assert np.isnan(table["hegyi"][0])  # no dbh


def test_a_sample_tree_has_no_shape_before_it_was_chosen(run: Run):
    early = measure_run(run, LAST - 1)
    (late,) = set(run.samples) - {1, 4}
    shaped = early.loc[early["crown_volume_m3"].notna(), "tree_id"]
    assert late in early["tree_id"].tolist()
    assert set(shaped) == set(run.samples) - {late}
