"""Storms over grown stands: who falls, what is told of it, and that the same falls again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from forest._threads import using_threads
from forest.dynamics.storms import draw_storm
from forest.errors import InputError
from forest.record.run import open_run
from forest.scenario import Scenario
from forest.scenario.wind import YearlyStorms
from forest.simulation import simulate
from forest.stand import Stand
from forest.trees.table import have_grown
from tests.everything import VARIANTS, everything
from tests.tiny import assert_same_state, assert_same_years, steps

YEARS = 26
TOML = f"""
years = {YEARS}
start_year = 2001
plot = {{ size_m = [40, 10], boundary = "periodic" }}
environment = {{ shadow = {{}}, canopy = {{}} }}
species = {{ picea_abies = {{}} }}
planting = {{ kind = "random", density_ha = 4500, min_distance_m = 0.8 }}
output = {{ sample_trees = {{ dbh_quantiles = [0.0, 1.0], at_year = 2020 }} }}
wind = {{ from_height_m = 3 }}
"""


@pytest.fixture(scope="module")
def grown() -> Callable[..., Stand]:
    """Give copies of a stand of 25 years, before a storm that a twentieth does not withstand."""
    scenario = Scenario.from_toml(TOML)
    stand = Stand(scenario)
    steps(stand, YEARS - 1)
    arrays, meta = stand.state()
    speed = float(_least(stand.critical_wind()).quantile(0.05))
    storm = f"wind.storms=[{{ year = 2026, speed_m_s = {speed} }}]"

    def copy(*overrides: str) -> Stand:
        return Stand.restore(scenario.with_overrides([storm, *overrides]), arrays, meta)

    return copy


def _least(winds: pd.DataFrame) -> pd.Series:
    return winds[["critical_break_m_s", "critical_uproot_m_s"]].min(axis=1).fillna(200.0)


def _storms(stand: Stand) -> pd.DataFrame:
    return pd.DataFrame(stand.step().tables["storms"])


def _clear(stand: Stand, below_x_m: float) -> None:
    stand.fell(stand.rows.tree_id[stand.rows.x < below_x_m].tolist())


def test_a_road_exposes_the_trees_behind_it(grown: Callable[..., Stand]) -> None:
    stand = grown()
    before = stand.critical_wind().set_index("tree_id")
    _clear(stand, 15.0)
    after = stand.critical_wind().set_index("tree_id")
    ratio = (_least(after) / _least(before.loc[after.index])).to_numpy()
    x = after["x_m"].to_numpy()
    assert 0.4 < np.median(ratio[x < 18.0]) < 0.7
    assert np.median(ratio[x > 30.0]) > 0.85
    assert after["edge"][x < 18.0].median() > 5.0 * after["edge"][x > 30.0].median()
    from_the_east = stand.critical_wind(180.0).set_index("tree_id")
    assert (
        np.median(_least(from_the_east)[x > 37.0] / _least(before.loc[after.index])[x > 37]) < 0.8
    )


def test_damage_is_near_the_new_edge(grown: Callable[..., Stand]) -> None:
    stand, sheltered = grown("wind.storms=[]"), grown("wind.storms=[]")
    _clear(stand, 15.0)
    speed = float(_least(stand.critical_wind()).quantile(0.15))
    fell = stand.blow(speed)
    assert len(fell) > len(sheltered.blow(speed))
    blown = _storms(stand)
    lost = blown["outcome"] > 0
    first = blown["round"] == 1
    near, far = blown["x_m"] < 22.0, blown["x_m"] > 30.0
    assert first[near].mean() > 2.0 * first[far].mean()
    assert lost[near].mean() > lost[far].mean()
    assert set(fell) == set(blown["tree_id"][lost])


def test_what_a_storm_leaves_on_record(grown: Callable[..., Stand]) -> None:
    stand = grown()
    speed = stand.scenario.wind.storms[0].speed_m_s
    alive = set(stand.rows.tree_id.tolist())
    record = stand.step()
    blown = pd.DataFrame(record.tables["storms"])
    fallen = blown[blown["outcome"] > 0]
    assert 0 < len(fallen) < len(blown)
    assert set(fallen["tree_id"]) <= alive - set(stand.rows.tree_id.tolist())
    events = pd.DataFrame(record.tables["events"])
    thrown = events[events["kind"] == 5]
    assert sorted(thrown["tree_id"]) == sorted(fallen["tree_id"])
    assert (thrown["cause"] == 5).all()
    least = _least(blown)
    assert (least[fallen.index] <= speed).all()
    assert (least.drop(fallen.index) > speed).all()
    by_uproot = fallen["critical_uproot_m_s"] < fallen["critical_break_m_s"]
    np.testing.assert_array_equal(fallen["outcome"], np.where(by_uproot, 2, 1))
    assert (fallen["round"] > 0).all()
    assert (blown["round"].drop(fallen.index) == 0).all()
    assert (blown["height_m"] >= 3.0).all()
    assert (blown["year"] == 2026).all()


def test_those_that_fall_expose_others(grown: Callable[..., Stand]) -> None:
    """Whoever falls in a later round would have stood the first."""
    stand = grown()
    speed = stand.scenario.wind.storms[0].speed_m_s
    _clear(stand, 10.0)
    first = _least(stand.critical_wind().set_index("tree_id"))
    blown = _storms(grown_like(stand, speed)).set_index("tree_id")
    later = blown.index[blown["round"] > 1]
    assert len(later)
    assert (first[later] > speed).all()
    assert (first[blown.index[blown["round"] == 1]] <= speed + 1e-3).all()


def grown_like(stand: Stand, speed: float) -> Stand:
    """A copy that blows at once, with the trees as they are."""
    copy = Stand.restore(stand.scenario.with_overrides(["wind.storms=[]"]), *stand.state())
    copy.blow(speed)
    return copy


def test_soil_and_species_hold_trees(grown: Callable[..., Stand]) -> None:
    usual = grown().critical_wind()
    wet = grown("wind.anchorage=0.5").critical_wind()
    moved = usual["critical_uproot_m_s"].notna()
    assert (wet["critical_uproot_m_s"] < usual["critical_uproot_m_s"])[moved].all()
    np.testing.assert_array_equal(wet["critical_break_m_s"], usual["critical_break_m_s"])
    firm = grown("species.picea_abies.anchorage.turning_moment_nm_kg=500").critical_wind()
    assert (firm["critical_uproot_m_s"].fillna(200.0) > usual["critical_uproot_m_s"])[moved].all()
    assert len(grown("wind.from_height_m=5").critical_wind()) < len(usual)


def test_the_same_trees_fall_again(grown: Callable[..., Stand]) -> None:
    """One thread or two, in one go or over a checkpoint with a storm still unrecorded."""
    stand, other = grown(), grown()
    with using_threads(2):
        stand.blow(8.0, 30.0)
        years = steps(stand, 1)
    with using_threads(1):
        other.blow(8.0, 30.0)
        again = Stand.restore(other.scenario, *other.state())
        assert_same_years(steps(again, 1), years)
    assert_same_state(again, stand)
    assert set(years[0].tables["storms"]["storm"]) == {1, 2}


def test_trees_that_bend_fall_too(grown: Callable[..., Stand]) -> None:
    scenario = Scenario.from_toml(TOML).with_overrides(
        [
            "plot.size_m=[8, 8]",
            "mechanics={}",
            "years=14",
            "start_year=2013",
            "wind.from_height_m=1",
        ]
    )
    stand = Stand(scenario)
    steps(stand, 13)
    assert (_least(stand.critical_wind()) > 0.0).all()
    assert len(stand.blow(60.0)) > 0


def test_a_run_tells_its_storms(tmp_path: Path) -> None:
    scenario = Scenario.from_toml(TOML).with_overrides(
        [
            "wind.storms=[{ year = 2026, speed_m_s = 40 }]",
            "plot.size_m=[8, 8]",
            "years=12",
            "start_year=2016",
            "wind.from_height_m=1",
        ]
    )
    simulate(scenario, out=tmp_path / "run.h5").close()
    with open_run(tmp_path / "run.h5") as run:
        storms, events, trees = run.storms, run.events, run.trees
        fallen = storms[storms["outcome"] != "stood"]
        assert len(fallen)
        thrown = events[events["kind"] == "windthrown"]
        assert sorted(thrown["tree_id"]) == sorted(fallen["tree_id"])
        assert set(thrown["cause"]) == {"wind"}
        left = trees[trees["year"] == 2026]["tree_id"]
        assert not set(left) & set(fallen["tree_id"])
        assert run.population.set_index("year").loc[2026, "windthrown"] == len(fallen)


def _yearly(**fields: Any) -> YearlyStorms:
    return YearlyStorms(mode_m_s=15.0, dispersion_m_s=3.0, **fields)


def test_drawn_storms_have_their_distributions() -> None:
    """Gumbel: mean = mode + 0.5772 dispersion, sd = pi dispersion / sqrt(6); von Mises: I1/I0."""
    storms = [
        draw_storm(_yearly(direction_deg=350.0, concentration=2.0), 7, y) for y in range(2000)
    ]
    speeds = np.array([s.speed_m_s for s in storms])
    assert speeds.mean() == pytest.approx(15.0 + 0.5772 * 3.0, abs=0.3)
    assert speeds.std() == pytest.approx(np.pi * 3.0 / np.sqrt(6.0), rel=0.08)
    angle = np.radians([s.direction_deg for s in storms])
    mean = np.exp(1j * angle).mean()
    assert abs(mean) == pytest.approx(0.6978, abs=0.03)
    assert np.degrees(np.angle(mean)) % 360.0 == pytest.approx(350.0, abs=3.0)
    assert draw_storm(_yearly(), 7, 5) == draw_storm(_yearly(), 7, 5)
    assert draw_storm(_yearly(), 7, 5) != draw_storm(_yearly(), 8, 5)
    around = np.radians([draw_storm(_yearly(), 1, y).direction_deg for y in range(2000)])
    assert abs(np.exp(1j * around).mean()) < 0.06


def test_yearly_storms_blow_if_strong_enough(grown: Callable[..., Stand]) -> None:
    always = "wind={ yearly={ mode_m_s=12, dispersion_m_s=1, from_m_s=5 } }"
    never = "wind={ yearly={ mode_m_s=12, dispersion_m_s=1, from_m_s=90 } }"
    assert "storms" in grown(always).step().tables
    assert "storms" not in grown(never).step().tables


@pytest.mark.parametrize(
    ("override", "said"),
    [
        (
            "wind.storms=[{ year = 2040, speed_m_s = 20 }]",
            "wind.storms[0].year: 2040 is not a year",
        ),
        ("wind.storms=[{ year = 2010, speed_m_s = 0 }]", "wind.storms[0].speed_m_s"),
        ("wind.anchorag=1", "did you mean 'anchorage'"),
    ],
)
def test_refused(override: str, said: str) -> None:
    with pytest.raises(InputError) as refused:
        Scenario.from_toml(TOML).with_overrides([override])
    assert said in str(refused.value)


def test_refused_in_python(grown: Callable[..., Stand]) -> None:
    stand = grown()
    with pytest.raises(InputError, match=r"Stand\.blow: speed_m_s"):
        stand.blow(-1.0)
    with pytest.raises(InputError, match=r"Stand\.critical_wind: direction_deg"):
        stand.critical_wind(float("nan"))


def test_recruits_are_let_be_until_they_have_grown() -> None:
    """They may come tall and years old, but their stems are not yet made."""
    stand = Stand(everything(*VARIANTS["bending"], "wind.from_height_m=0.1"))
    steps(stand, 6)
    grown = have_grown(stand.rows, stand.arena.metamers, stand.steps)
    old = stand.rows.birth < stand.steps
    assert (old & ~grown).any()
    assert set(stand.critical_wind().tree_id) == set(stand.rows.tree_id[grown])
    fell = stand.blow(60.0)
    assert fell
    assert set(fell) <= set(stand.step().tables["storms"]["tree_id"])
