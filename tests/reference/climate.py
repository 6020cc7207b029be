"""The climate of a year and the factor on income, slowly, from the definitions."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from tests.reference.random import uniforms

STREAM = 7
ADDRESS = {"temperature_c": 1, "precipitation_mm": 2, "drought_index": 3, "growth_index": 4}
EXTREME = 5
SECTION = {
    "temperature_c": "temperature",
    "precipitation_mm": "precipitation",
    "drought_index": "drought_index",
}


def normal(seed: int, address: int, year: int) -> float:
    """A standard normal draw (Box and Muller 1958)."""
    a, b, _, _ = uniforms(seed, STREAM, address, 0, year)
    return math.sqrt(-2.0 * math.log(a)) * math.cos(2.0 * math.pi * b)


def autoregressive(seed: int, address: int, year: int, phi: float) -> float:
    """Let x = phi x + sqrt(1 - phi^2) e run from 300 years before, when x was 0."""
    x = 0.0
    for t in range(year - 300, year + 1):
        x = phi * x + math.sqrt(1.0 - phi * phi) * normal(seed, address, t)
    return x


def curve(points: list[tuple[float, float]], x: float) -> float:
    """Go through the points in straight lines, and level beyond them."""
    if x <= points[0][0]:
        return points[0][1]
    for (x0, y0), (x1, y1) in pairwise(points):
        if x <= x1:
            return y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    return points[-1][1]


def value(climate: dict[str, Any], seed: int, start: int, year: int, name: str) -> float | None:
    """A variable of a year: from the series, else drawn, else none."""
    series = {row["year"]: row[name] for row in climate["series"]}
    if any(v is not None for v in series.values()):
        first, n = min(series), len(series)
        if year in series:
            return series[year]
        if climate["repeat"]:
            return series[first + (year - first) % n]
    process = (climate["generator"] or {}).get(name)
    if process:
        x = autoregressive(seed, ADDRESS[name], year, process["autocorrelation"])
        chance = climate["generator"]["extreme_probability"]
        if uniforms(seed, STREAM, EXTREME, 0, year)[0] < chance:
            x += process["extreme_shift_sd"]
        decades = (year - start) / 10
        drawn = process["mean"] + process["trend_per_decade"] * decades + process["sd"] * x
        if name == "precipitation_mm":
            return max(0.0, drawn)
        return max(0.05, drawn) if name == "growth_index" else drawn
    if name == "growth_index" and climate["noise_sd"]:
        return max(0.05, 1.0 + climate["noise_sd"] * normal(seed, 0, year))
    return None


def factor(
    climate: dict[str, Any], response: dict[str, Any], seed: int, start: int, year: int
) -> float:
    """A species' factor on income in a year."""
    product = 1.0
    for name, section in SECTION.items():
        points, bell = response[f"{section}_curve"], response[f"{section}_gaussian"]
        total = weights = 0.0
        for lag, weight in enumerate(response[f"{section}_lags"]):
            x = value(climate, seed, start, year - lag, name)
            if x is None:
                continue
            if points:
                share = curve(points, x)
            else:
                share = math.exp(-((x - bell[0]) ** 2) / (2 * bell[1] ** 2)) if bell else 1.0
            total, weights = total + weight * share, weights + weight
        if value(climate, seed, start, year, name) is not None and weights:
            product *= total / weights
    index = value(climate, seed, start, year, "growth_index")
    result = max(response["least_share"], product) * (1.0 if index is None else index)
    for extreme in climate["extreme_years"]:
        if extreme["year"] == year:
            result *= extreme["factor"]
    return result
