"""The climate must be readable in the rings of an open stand."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis import climate_rings
from forest.record.run import Run
from forest.scenario import Scenario
from forest.simulation import simulate

FILE = Path(__file__).parents[2] / "scenarios" / "climate_trial.toml"
YEARS = 42  # three years more than the driest, and 30 rings
TRIAL = Scenario.load(FILE).with_overrides([f"years={YEARS}"])


@pytest.fixture(scope="module")
def open_stand(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    path: Path = tmp_path_factory.mktemp("climate") / "run.h5"
    with simulate(TRIAL, path) as run:
        yield run


def test_rings_follow_the_climate_and_tell_the_drought(open_stand: Run) -> None:
    numbers = climate_rings.table(open_stand).set_index("species")
    assert set(numbers.index) == {"picea_abies", "pinus_sylvestris"}
    for _, row in numbers.iterrows():
        assert row["trees"] >= 10
        assert row["drought_index_0"] > 0.5
        assert row["factor_0"] > 0.5
        assert row["drought_index_0"] > row["drought_index_2"]
        assert row["narrow"] >= 0.9
        assert row["pointer"] < 0.85


def test_half_the_response_leaves_a_shallower_mark(open_stand: Run, tmp_path: Path) -> None:
    """Within a species: how deep a mark is hangs on what upkeep leaves a tree, too."""
    halves = []
    for name, species in open_stand.scenario.species.items():
        curve = [[at, 0.5 + 0.5 * share] for at, share in species.response.drought_index_curve]
        halves.append(f"species.{name}.response.drought_index_curve={curve}")
    with simulate(TRIAL.with_overrides(halves), tmp_path / "run.h5") as run:
        shallow = climate_rings.table(run).set_index("species")
    deep = climate_rings.table(open_stand).set_index("species")
    assert (shallow["driest_year"] == deep["driest_year"]).all()
    assert (shallow["pointer"] > deep["pointer"] + 0.05).all()
    assert (shallow["pointer"] < 1.0).all()


def test_without_a_response_the_drought_leaves_no_mark(tmp_path: Path) -> None:
    """The ring is narrow because the species answers, not because of anything else."""
    same = "response.drought_index_curve=[]"
    deaf = [f"species.{name}.{same}" for name in ("picea_abies", "pinus_sylvestris")]
    scenario = TRIAL.with_overrides([*deaf, "plot.size_m=[16, 16]"])
    with simulate(scenario, tmp_path / "run.h5") as run:
        assert (run.climate["factor"] == 1.0).all()
        assert run.climate["drought_index"].std() > 0.5
        numbers = climate_rings.table(run)
    assert (numbers["pointer"] > 0.85).all()


def test_the_table_of_the_climate_is_that_of_the_scenario(open_stand: Run) -> None:
    table = open_stand.climate
    assert len(table) == 2 * YEARS
    spruce = climate_rings.climate_of(open_stand, "picea_abies")
    pine = climate_rings.climate_of(open_stand, "pinus_sylvestris")
    assert spruce["drought_index"].equals(pine["drought_index"])
    assert spruce["temperature_c"].isna().all()
    dry = spruce["drought_index"].idxmin()
    assert spruce.loc[dry, "factor"] < pine.loc[dry, "factor"] < 1.0
    assert "factor_0" in climate_rings.table(open_stand)
    assert "growth_index_0" not in climate_rings.table(open_stand)  # it never changes


def test_pointer_and_correlations_by_hand() -> None:
    years = pd.RangeIndex(2000, 2040)
    rng = np.random.default_rng(3)
    factor = pd.Series(1.0 + 0.2 * rng.standard_normal(40), years)
    factor[2020] = 0.3
    widths = pd.DataFrame({"a": 2.0 * factor, "b": 5.0 * factor.shift(1)})
    assert climate_rings.indices(widths[["a"]]).iloc[:5].isna().all().all()
    climate = pd.DataFrame(dict.fromkeys(climate_rings._VARIABLES, np.nan), years)
    climate["factor"] = factor
    of_a = climate_rings.indices(widths[["a"]])["a"]
    r = climate_rings.correlations(of_a.dropna(), climate)
    assert set(r) == {"factor_0", "factor_1", "factor_2"}
    assert r["factor_0"] > 0.9
    of_b = climate_rings.indices(widths[["b"]])["b"]
    assert climate_rings.correlations(of_b.dropna(), climate)["factor_1"] > 0.9
    assert climate_rings.driest(climate, widths.index) == 2020
    ratio = climate_rings.pointer(widths, 2020)
    around = factor[[2018, 2019, 2021, 2022]].mean()
    assert ratio["a"] == pytest.approx(0.3 / around)
    assert climate_rings.pointer(widths, 2002).index.tolist() == ["a"]  # b begins in 2001
