"""The climate of a year, and what each species makes of it: a factor on income.

A year's climate is a pure function of scenario and calendar year; nothing is remembered between
years, so that a resumed run meets the same years.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, span_of
from forest.random import STREAM_CLIMATE, normals, uniforms

if TYPE_CHECKING:
    from forest.scenario import Scenario
    from forest.scenario.climate import Process
    from forest.species.response import Response

#: Variables of a year; their places are part of the address of a draw.
TEMPERATURE, PRECIPITATION, DROUGHT, GROWTH = (
    "temperature_c",
    "precipitation_mm",
    "drought_index",
    "growth_index",
)
VARIABLES = (TEMPERATURE, PRECIPITATION, DROUGHT, GROWTH)
_EXTREME = len(VARIABLES) + 1  # address of the draw that makes a year extreme

#: Years before this one to which species respond.
_MOST_LAG = 2
#: No year earns less than this share of a mean year, unless the scenario says so.
_LEAST = 0.05
#: Weight below which past years no longer count in an autocorrelated draw.
_FORGOTTEN = 1e-6


def noise_factor(year: int, seed: int, noise_sd: float) -> float:
    """Draw the growth index of a year: normal around 1, at least 0.05.

    Parameters
    ----------
    year : int
        Calendar year.
    seed : int
        Seed of the scenario; the draw is a pure function of seed and year.
    noise_sd : float
        Standard deviation.
    """
    if noise_sd <= 0.0:
        return 1.0
    draw, _ = normals(seed, STREAM_CLIMATE, 0, 0, year)
    return max(_LEAST, 1.0 + noise_sd * float(draw))


def departure(year: int, seed: int, variable: str, autocorrelation: float) -> float:
    """Draw a stationary AR(1) process of mean 0 and variance 1.

    It is the sum over all years up to this one of independent normal draws, each weaker by the
    autocorrelation than the next; the sum ends where weights fall below a millionth. So it
    depends on the year alone, and not on where a run begins.

    Parameters
    ----------
    year : int
        Calendar year.
    seed : int
        Seed of the scenario.
    variable : str
        One of `VARIABLES`; each has draws of its own.
    autocorrelation : float
        Correlation of consecutive years, above -1 and below 1.
    """
    address = 1 + VARIABLES.index(variable)
    total, weight, back = 0.0, 1.0, 0
    while abs(weight) > _FORGOTTEN:
        draw, _ = normals(seed, STREAM_CLIMATE, address, 0, year - back)
        total += weight * float(draw)
        weight *= autocorrelation
        back += 1
    return math.sqrt(1.0 - autocorrelation**2) * total


def is_extreme(year: int, seed: int, probability: float) -> bool:
    """Tell whether a year is extreme, in all variables together."""
    return bool(uniforms(seed, STREAM_CLIMATE, _EXTREME, 0, year)[0] < probability)


def drawn(
    year: int, start_year: int, seed: int, variable: str, process: Process, extreme: bool
) -> float:
    """Draw a variable of a year: mean and trend, departure, and the shift of an extreme year.

    Precipitation is at least 0, and the growth index 0.05.
    """
    x = departure(year, seed, variable, process.autocorrelation)
    if extreme:
        x += process.extreme_shift_sd
    mean = process.mean + process.trend_per_decade * (year - start_year) / 10.0
    value = mean + process.sd * x
    least = {PRECIPITATION: 0.0, GROWTH: _LEAST}.get(variable, -math.inf)
    return max(least, value)


def share_of_mean_year(response: Response, variable: str, value: float) -> float:
    """Give the response to one variable in one year; NaN if the value is not known."""
    curve, (optimum, width) = _function(response, variable)
    if math.isnan(value):
        return math.nan
    if curve:
        x, y = zip(*curve, strict=True)
        return float(np.interp(value, x, y))
    return math.exp(-0.5 * ((value - optimum) / width) ** 2) if width > 0.0 else 1.0


def with_lags(weights: tuple[float, float, float], shares: list[float]) -> float:
    """Weigh the responses of this year and the two before; 1 if this year's is not known.

    The weight of a year before the climate is known goes to the others.
    """
    if math.isnan(shares[0]):
        return 1.0
    known = [(w, s) for w, s in zip(weights, shares, strict=True) if not math.isnan(s)]
    total = sum(w for w, _ in known)
    return sum(w * s for w, s in known) / total if total > 0.0 else 1.0


class Climate:
    """The climate of one stand.

    Parameters
    ----------
    scenario : Scenario
    """

    def __init__(self, scenario: Scenario) -> None:
        self._said = scenario.climate
        self._seed = scenario.seed
        self._start = scenario.start_year
        self._responses = [species.response for species in scenario.species_list]

    def check_known(self, year: int) -> None:
        """Refuse a year that the series does not cover, as when a stand is driven on by hand.

        Raises
        ------
        InputError
        """
        for variable in self._said.given:
            if math.isnan(self._value(year, variable)):
                series = self._said.series
                raise InputError(
                    f"no {variable} of {year}",
                    where="climate.series",
                    expected=span_of(series[0].year, series[-1].year),
                )

    def values(self, year: int) -> dict[str, float]:
        """Give the climate of a calendar year, as the run file tells it.

        Returns
        -------
        dict of str to float
            Each of `VARIABLES`; NaN where the scenario says nothing. The growth index is then 1.
        """
        found = {variable: self._value(year, variable) for variable in VARIABLES}
        index = found[GROWTH]
        if math.isnan(index):
            index = 1.0
        for extreme in self._said.extreme_years:
            if extreme.year == year:
                index *= extreme.factor
        return {**found, GROWTH: index}

    def factors(self, year: int) -> NDArray[np.float64]:
        """Give each species' factor on income in a calendar year.

        It is the product of the responses to the climate, at least `least_share`, times the
        growth index.

        Returns
        -------
        float64 (species,)
        """
        now = self.values(year)
        before = [
            {v: self._value(year - lag, v) for v in VARIABLES} for lag in range(1, _MOST_LAG + 1)
        ]
        return np.array(
            [
                max(response.least_share, _answer(response, [now, *before])) * now[GROWTH]
                for response in self._responses
            ]
        )

    def _value(self, year: int, variable: str) -> float:
        """Look a variable up or draw it; NaN if neither can be."""
        said = self._said
        if variable in said.given:
            place = year - said.series[0].year
            if said.repeat:
                place %= len(said.series)
            if 0 <= place < len(said.series):
                return float(getattr(said.series[place], variable))
        process = said.generator.draws.get(variable) if said.generator else None
        if said.generator and process:
            extreme = is_extreme(year, self._seed, said.generator.extreme_probability)
            return drawn(year, self._start, self._seed, variable, process, extreme)
        if variable == GROWTH and said.noise_sd > 0.0:
            return noise_factor(year, self._seed, said.noise_sd)
        return math.nan


def _answer(response: Response, years: list[dict[str, float]]) -> float:
    """Multiply a species' responses to all variables; `years` begin with this one."""
    product = 1.0
    for variable in (TEMPERATURE, PRECIPITATION, DROUGHT):
        shares = [share_of_mean_year(response, variable, year[variable]) for year in years]
        product *= with_lags(_lags(response, variable), shares)
    return product


def _lags(response: Response, variable: str) -> tuple[float, float, float]:
    return {
        TEMPERATURE: response.temperature_lags,
        PRECIPITATION: response.precipitation_lags,
        DROUGHT: response.drought_index_lags,
    }[variable]


def _function(
    response: Response, variable: str
) -> tuple[tuple[tuple[float, float], ...], tuple[float, ...]]:
    """Give a variable's curve and its bell; a bell of width 0 is none."""
    curve, bell = {
        TEMPERATURE: (response.temperature_curve, response.temperature_gaussian),
        PRECIPITATION: (response.precipitation_curve, response.precipitation_gaussian),
        DROUGHT: (response.drought_index_curve, response.drought_index_gaussian),
    }[variable]
    return curve, bell or (0.0, 0.0)
