"""The climate of a year: what is drawn, what is given, and what species make of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.environment.climate import Climate, departure, is_extreme, noise_factor
from forest.errors import InputError
from forest.scenario import Scenario
from forest.scenario.climate import VARIABLES
from forest.stand import Stand
from tests.reference import climate as reference

START = 2001


def scenario(climate: dict[str, Any], response: dict[str, Any], seed: int = 1) -> Scenario:
    """One species of ten years whose response is the given one."""
    return Scenario(
        years=10,
        start_year=START,
        seed=seed,
        plot={"size_m": [5, 5]},
        climate=climate,
        environment={"shadow": {}},
        species={"tree": {"base": "generic_deciduous", "response": response}},
        planting={"kind": "explicit", "trees": [{"x_m": 1.0, "y_m": 1.0}]},
    )


def grown(climate: dict[str, Any], seed: int = 7) -> Climate:
    return Climate(scenario(climate, {}, seed))


# ------------------------------------------------------------------ the twin

_NUMBER = st.floats(-3.0, 3.0).map(lambda x: round(x, 3))
_SHARE = st.floats(0.0, 2.0).map(lambda x: round(x, 3))


@st.composite
def _lags(draw) -> list[float]:
    a = draw(st.integers(0, 10))
    b = draw(st.integers(0, 10 - a))
    return [a / 10, b / 10, (10 - a - b) / 10]


@st.composite
def _response(draw) -> dict[str, Any]:
    found: dict[str, Any] = {"least_share": draw(st.sampled_from([0.01, 0.1, 0.5]))}
    for name in ("temperature", "precipitation", "drought_index"):
        found[f"{name}_lags"] = draw(_lags())
        kind = draw(st.sampled_from(["none", "curve", "gaussian"]))
        if kind == "curve":
            xs = sorted(draw(st.sets(_NUMBER, min_size=1, max_size=4)))
            found[f"{name}_curve"] = [[x, draw(_SHARE)] for x in xs]
        elif kind == "gaussian":
            found[f"{name}_gaussian"] = [draw(_NUMBER), draw(st.floats(0.5, 4.0))]
    return found


@st.composite
def _climate(draw) -> dict[str, Any]:
    """A series of some variables, a generator of others, noise and extreme years."""
    names = list(VARIABLES)
    given_ = draw(st.lists(st.sampled_from(names), unique=True))
    drawn = draw(st.lists(st.sampled_from(names), unique=True))
    found: dict[str, Any] = {}
    if given_:
        repeat = draw(st.booleans())
        n = draw(st.integers(1, 6)) if repeat else 12
        first = START + (draw(st.integers(-20, 20)) if repeat else draw(st.integers(-2, 0)))
        rows = [{"year": first + k, **{v: abs(draw(_NUMBER)) for v in given_}} for k in range(n)]
        found.update(series=rows, repeat=repeat)
    if drawn:
        number = st.fixed_dictionaries(
            {
                "mean": _NUMBER,
                "sd": st.floats(0.0, 2.0),
                "trend_per_decade": _NUMBER,
                "autocorrelation": st.floats(-0.9, 0.9),
                "extreme_shift_sd": _NUMBER,
            }
        )
        found["generator"] = {
            "extreme_probability": draw(st.floats(0.0, 1.0)),
            **{v: draw(number) for v in drawn},
        }
    if "growth_index" not in drawn:
        found["noise_sd"] = draw(st.sampled_from([0.0, 0.2, 0.9]))
    found["extreme_years"] = [{"year": START + 3, "factor": draw(st.floats(0.0, 2.0))}]
    return found


@given(_climate(), _response(), st.integers(0, 2**40))
@settings(max_examples=25, deadline=None)
def test_like_the_twin(climate: dict[str, Any], response: dict[str, Any], seed: int) -> None:
    whole = scenario(climate, response, seed)
    said = whole.climate.model_dump()
    answer = whole.species_list[0].response.model_dump()
    mine = Climate(whole)
    for year in (START, START + 1, START + 3, START + 9):
        expected = reference.factor(said, answer, seed, START, year)
        # both forget the years of long ago, by a millionth
        assert mine.factors(year)[0] == pytest.approx(expected, rel=1e-4, abs=1e-4)


# ------------------------------------------------------------------ what is drawn


def test_a_scenario_without_climate_has_mean_years() -> None:
    climate = grown({})
    assert climate.factors(1990).tolist() == [1.0]
    found = climate.values(1990)
    assert found.pop("growth_index") == 1.0
    assert np.isnan(list(found.values())).all()


def test_extreme_years_multiply() -> None:
    extremes = [{"year": 1990, "factor": 0.5}, {"year": 1991, "factor": 1.2}]
    assert grown({"extreme_years": extremes}).factors(1990)[0] == 0.5
    noisy = grown({"noise_sd": 0.15, "extreme_years": extremes})
    assert noisy.factors(1991)[0] == noise_factor(1991, 7, 0.15) * 1.2


def test_noise() -> None:
    drawn = np.array([noise_factor(year, 7, 0.15) for year in range(3000)])
    assert abs(drawn.mean() - 1.0) < 0.015  # five standard errors
    assert abs(drawn.std() - 0.15) < 0.01
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.1
    assert noise_factor(5, 7, 0.15) == drawn[5]
    assert noise_factor(5, 8, 0.15) != drawn[5]
    assert min(noise_factor(year, 7, 2.0) for year in range(200)) == 0.05


@pytest.mark.parametrize("phi", [-0.5, 0.0, 0.3, 0.8])
def test_departures_are_stationary_and_autocorrelated(phi: float) -> None:
    x = np.array([departure(year, 3, "drought_index", phi) for year in range(-1500, 1500)])
    # standard errors of mean and variance grow with the memory
    memory = (1 + phi) / (1 - phi)
    assert abs(x.mean()) < 5 * np.sqrt(memory / len(x))
    assert abs(x.var() - 1.0) < 5 * np.sqrt(2 * (1 + phi**2) / (1 - phi**2) / len(x))
    assert np.corrcoef(x[1:], x[:-1])[0, 1] == pytest.approx(phi, abs=0.08)
    assert np.corrcoef(x[2:], x[:-2])[0, 1] == pytest.approx(phi**2, abs=0.1)


def test_a_year_is_the_last_one_and_a_shock() -> None:
    phi = 0.6
    x = np.array([departure(year, 3, "growth_index", phi) for year in range(400)])
    shock = (x[1:] - phi * x[:-1]) / np.sqrt(1 - phi**2)
    assert shock.std() == pytest.approx(1.0, abs=0.2)
    assert abs(np.corrcoef(shock[1:], shock[:-1])[0, 1]) < 0.2


def test_variables_are_drawn_apart() -> None:
    x = {v: [departure(year, 3, v, 0.2) for year in range(1000)] for v in VARIABLES}
    r = np.corrcoef(list(x.values()))
    assert np.abs(r[np.triu_indices(len(x), 1)]).max() < 0.16


def test_trend_spread_and_extreme_years_of_a_long_series() -> None:
    process = {"mean": 8.0, "sd": 0.5, "trend_per_decade": 0.2, "autocorrelation": 0.3}
    generator = {
        "extreme_probability": 0.05,
        "temperature_c": process,
        "drought_index": {"mean": 0.0, "sd": 1.0, "extreme_shift_sd": -3.0},
    }
    climate = grown({"generator": generator})
    years = np.arange(START, START + 2000)
    found = [climate.values(int(year)) for year in years]
    warmth = np.array([v["temperature_c"] for v in found])
    slope, start = np.polyfit(years - START, warmth, 1)
    assert slope == pytest.approx(0.02, abs=1e-3)
    assert start == pytest.approx(8.0, abs=0.15)
    assert (warmth - start - slope * (years - START)).std() == pytest.approx(0.5, abs=0.05)
    extreme = np.array([is_extreme(int(year), 7, 0.05) for year in years])
    assert 60 < extreme.sum() < 140
    dry = np.array([v["drought_index"] for v in found])
    assert dry[extreme].mean() == pytest.approx(-3.0, abs=0.5)
    assert abs(dry[~extreme].mean()) < 0.15


def test_drawn_rain_and_growth_are_not_negative() -> None:
    wild = {"mean": 0.5, "sd": 5.0}
    climate = grown({"generator": {"precipitation_mm": wild, "growth_index": wild}})
    found = [climate.values(year) for year in range(START, START + 50)]
    assert min(v["precipitation_mm"] for v in found) == 0.0
    assert min(v["growth_index"] for v in found) == 0.05


# ------------------------------------------------------------------ what is given


def test_given_years_go_before_drawn_ones() -> None:
    rows = [{"year": START + k, "drought_index": -1.0} for k in range(3)]
    generator = {"drought_index": {"mean": 5.0, "sd": 0.0}}
    climate = grown({"series": rows, "generator": generator})
    found = [climate.values(START + k)["drought_index"] for k in range(5)]
    assert found == [-1.0, -1.0, -1.0, 5.0, 5.0]


def test_a_series_repeats_both_ways() -> None:
    rows = [{"year": START + k, "growth_index": g} for k, g in enumerate([0.5, 1.0, 1.5])]
    climate = grown({"series": rows, "repeat": True})
    found = [climate.values(START + k)["growth_index"] for k in range(-3, 6)]
    assert found == [0.5, 1.0, 1.5] * 3


def test_weights_of_years_before_the_series_go_to_the_known_ones() -> None:
    rows = [{"year": START + k, "drought_index": float(k)} for k in range(10)]
    response = {
        "drought_index_curve": [[0.0, 0.0], [10.0, 1.0]],
        "drought_index_lags": [0.5, 0.3, 0.2],
        "least_share": 0.01,
    }
    climate = Climate(scenario({"series": rows}, response))
    assert climate.factors(START + 1)[0] == pytest.approx((0.5 * 0.1 + 0.3 * 0.0) / 0.8)
    assert climate.factors(START + 5)[0] == pytest.approx(0.5 * 0.5 + 0.3 * 0.4 + 0.2 * 0.3)


def test_no_climate_takes_all() -> None:
    response = {"drought_index_curve": [[-1.0, 0.0]], "least_share": 0.2}
    rows = [{"year": START + k, "drought_index": -2.0} for k in range(10)]
    assert Climate(scenario({"series": rows}, response)).factors(START)[0] == 0.2


def test_a_stand_driven_past_its_climate_is_left_as_it_was() -> None:
    rows = [{"year": START + k, "growth_index": 0.5} for k in range(10)]
    stand = Stand(scenario({"series": rows}, {}))
    for _ in range(10):
        stand.step()
    with pytest.raises(InputError, match=r"no growth_index of 2011; expected .* 2001 to 2010"):
        stand.step()
    assert stand.year == 2010
