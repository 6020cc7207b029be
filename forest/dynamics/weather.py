"""The year's weather: one factor on the income of all trees."""

from __future__ import annotations

from collections.abc import Sequence

from forest.random import STREAM_WEATHER, normals

#: No year earns less than this share of a mean year, unless the scenario says so.
_LEAST = 0.05


def income_factor(
    year: int, seed: int, noise_sd: float, extreme_years: Sequence[tuple[int, float]]
) -> float:
    """Give the factor on income in a calendar year.

    Parameters
    ----------
    year : int
        Calendar year.
    seed : int
        Seed of the scenario; the draw is a pure function of seed and year.
    noise_sd : float
        Standard deviation of the factor around 1.
    extreme_years : sequence of (year, factor)
        Factors that multiply the drawn one in the years named.
    """
    factor = 1.0
    if noise_sd > 0.0:
        draw, _ = normals(seed, STREAM_WEATHER, 0, 0, year)
        factor = max(_LEAST, 1.0 + noise_sd * float(draw))
    for extreme, value in extreme_years:
        if extreme == year:
            factor *= value
    return factor
