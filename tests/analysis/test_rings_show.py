"""What rings must show: Pressler's law, decline with age, suppression and release."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis import pressler, ring_series
from analysis.self_thinning import SCENARIO
from forest.record.run import Run
from forest.scenario import Scenario
from forest.simulation import simulate
from forest.stand import Stand
from tests.analysis.conftest import DENSE_STAND
from tests.fixed import fixed

TWO_STOREYS = """
title = "beeches under pines"
years = 40
start_year = 1960
plot = { size_m = [10, 10], boundary = "periodic" }
environment = { shadow = {}, canopy = {} }
species = { pinus_sylvestris = { share = 1 }, fagus_sylvatica = { share = 1 } }
planting = { kind = "random", density_ha = 4000 }
"""


def test_rings_widen_to_the_crown_and_keep_their_area_below_it(tmp_path: Path):
    """Pressler: in stand-grown trees, from the discs below the crown and at its base."""
    crowded = fixed(DENSE_STAND, "years=45", "planting.density_ha=10000")  # long bare stems
    with simulate(crowded, tmp_path / "run.h5") as run:
        row = pressler.table(pressler.profiles(run)).set_index("species").loc["pinus_sylvestris"]
    assert row["trees"] >= 5
    assert row["rising"] > 0.9
    assert row["crown_per_breast"] > 1.2
    assert row["area_ratio"] == pytest.approx(1.0, abs=0.05)
    assert row["area_cv"] < 0.05


def test_the_rings_of_light_demanding_trees_narrow_with_age(dense_run: Run):
    numbers = ring_series.table(*ring_series.widths_of(dense_run))
    pine = numbers[(numbers["species"] == "pinus_sylvestris") & (numbers["source"] == "run")]
    assert pine["series"].iloc[0] >= 10
    assert pine["decline"].iloc[0] > 0.8
    assert pine["autocorrelation"].iloc[0] > 0.3


def test_suppressed_trees_grow_wide_rings_once_their_neighbours_are_felled():
    stand = Stand(Scenario.from_toml(TWO_STOREYS))
    widths = []
    for k in range(40):
        if k == 30:
            trees = stand.trees
            beech = trees[trees["species"].astype(str) == "fagus_sylvatica"]
            low = beech.loc[beech["height_m"] < beech["height_m"].median(), "tree_id"]
            stand.fell(trees.loc[~trees["tree_id"].isin(beech["tree_id"]), "tree_id"])
        of = stand.step().tables["trees"]
        widths.append(pd.Series(of["ring_width_mm"], index=of["tree_id"]))
    table = pd.DataFrame(widths)
    # seedlings of a shade that deep may be twenty years old when they reach breast height
    suppressed = table[[i for i in low if i in table]].iloc[25:].dropna(axis=1)
    before, after = suppressed.loc[25:29].mean(), suppressed.loc[33:39].mean()
    assert len(before) >= 3
    free = table.loc[5:10].mean().mean()
    assert before.median() < 0.5 * free
    assert (after > 2.0 * before).mean() >= 0.8


@pytest.mark.stand
def test_pressler_holds_over_a_century(tmp_path):
    scenario = Scenario.load(SCENARIO).with_overrides(["climate.noise_sd=0.2"])
    with simulate(scenario, tmp_path / "run.h5") as run:
        for year in (2049, 2074, 2099):
            (row,) = pressler.table(pressler.profiles(run, year)).to_dict("records")
            assert row["rising"] > 0.85
            assert row["crown_per_breast"] > 1.5
            assert row["area_ratio"] == pytest.approx(1.0, abs=0.05)
        numbers = ring_series.table(*ring_series.widths_of(run)).iloc[0]
        assert numbers["decline"] > 0.9
        assert 0.5 < numbers["mean_mm"] < 2.5
        assert np.isfinite(numbers["interseries"])
