"""Scots pine left to itself: what a forester expects of a dense stand over a century."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import forest
from analysis.fit_targets import KOIVISTO
from analysis.self_thinning import (
    HARD_YEAR,
    SCENARIO,
    SEEDS,
    follows_weather,
    grow,
    onset,
    self_thinning,
    thinning_slope,
    with_weather,
)


def test_slope_is_fitted_from_the_onset_of_mortality_on():
    age = pd.RangeIndex(1, 61, name="age")
    dq = pd.Series(np.linspace(4.0, 30.0, 60), index=age)
    number = pd.Series(np.minimum(2000.0, 2000.0 * (dq / 12.0) ** -1.6), index=age)
    stand = pd.DataFrame({"n_ha": number, "qmd_cm": dq})
    start = onset(stand)
    assert number[start] < 1700.0 <= number[start - 1]
    assert thinning_slope(stand) == pytest.approx(-1.6)


def test_young_pines_close_their_canopy_and_thin_themselves():
    crowded = ["plot.size_m=[6, 6]", "planting.density_ha=12000", "years=22"]
    stand = grow(forest.Scenario.load(SCENARIO).with_overrides(crowded)).stand
    assert stand["floor_light"].iloc[-1] < 0.25 < stand["floor_light"].iloc[5]
    assert stand["lai"].iloc[-1] > 2.0
    assert 0 < stand["n_ha"].iloc[-1] < stand["n_ha"].iloc[0]


@pytest.mark.stand
@pytest.mark.parametrize("seed", SEEDS)
def test_a_century_of_self_thinning(seed):
    stand = self_thinning(seed).stand
    assert -2.0 <= thinning_slope(stand) <= -1.3
    assert stand["n_ha"][80] < 1500.0
    late = stand.loc[40:]
    for age in (40, 60, 80):
        assert stand["basal_area_m2ha"][age] == pytest.approx(
            KOIVISTO.loc[age, "basal_area_m2ha"], rel=0.25
        )
        assert stand["top_height_m"][age] == pytest.approx(
            KOIVISTO.loc[age, "top_height_m"], rel=0.15
        )
    assert late["lai"].between(2.8, 4.0).all()  # pine stands have 3 to 4
    assert (stand.loc[25:, "floor_light"] < 0.2).all()


@pytest.mark.stand
def test_the_stand_lives_through_bad_years_and_its_rings_tell_them():
    history = with_weather(SEEDS[0])
    assert history.stand["n_ha"].iloc[-1] > 200.0
    _, detrended = follows_weather(history)
    assert detrended > 0.6
    around = history.ring.loc[HARD_YEAR - 3 : HARD_YEAR + 3]
    assert around.idxmin() == HARD_YEAR
