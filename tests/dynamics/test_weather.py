"""The year's weather."""

from __future__ import annotations

import numpy as np
import pytest

from forest.dynamics.weather import income_factor


def test_a_mean_year_without_noise() -> None:
    assert income_factor(1990, 1, 0.0, []) == 1.0


def test_extreme_years_multiply() -> None:
    years = [(1990, 0.5), (1991, 1.2), (1990, 0.8)]
    assert income_factor(1990, 1, 0.0, years) == pytest.approx(0.4)
    drawn = income_factor(1991, 1, 0.15, [])
    assert income_factor(1991, 1, 0.15, years) == pytest.approx(1.2 * drawn)


def test_noise() -> None:
    drawn = np.array([income_factor(year, 7, 0.15, []) for year in range(3000)])
    assert abs(drawn.mean() - 1.0) < 0.015  # five standard errors
    assert abs(drawn.std() - 0.15) < 0.01
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.1
    assert income_factor(5, 7, 0.15, []) == drawn[5]
    assert income_factor(5, 8, 0.15, []) != drawn[5]


def test_no_year_earns_nothing() -> None:
    assert min(income_factor(year, 7, 2.0, []) for year in range(200)) == 0.05
