"""Series of one run cross-date, by our own measure and by dplPy's."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import dplpy
import numpy as np
import pandas as pd
import pytest

from forest.dendro import campaign, interseries_correlation, read_rwl, ring_series, write_rwl
from forest.dendro.crossdating import LEAST_YEARS, relative_changes
from forest.record.run import Run


def test_relative_changes_by_hand():
    widths = pd.DataFrame({"A": [1.0, 3.0, 0.0, 0.0, 2.0, np.nan]}, index=range(2001, 2007))
    changes = relative_changes(widths)
    assert changes.index.tolist() == [2002, 2003, 2004, 2005, 2006]
    np.testing.assert_allclose(changes["A"], [1.0, -2.0, np.nan, 2.0, np.nan])


def naive(widths: pd.DataFrame) -> pd.Series:
    """Each series against the mean of the others, by pandas."""
    changes = relative_changes(widths)
    return pd.Series(
        {name: changes[name].corr(changes.drop(columns=name).mean(axis=1)) for name in changes}
    )


@pytest.mark.parametrize("seed", range(5))
def test_correlations_are_those_of_the_plain_way(seed):
    rng = np.random.default_rng(seed)
    common = rng.lognormal(size=(40, 1))
    widths = pd.DataFrame(common * rng.lognormal(size=(40, 4)), columns=list("ABCD"))
    widths.iloc[:12, 0] = np.nan
    widths.iloc[5, 1] = 0.0
    got = interseries_correlation(widths)
    pd.testing.assert_series_equal(got, naive(widths), check_names=False)


def agreement(trend: np.ndarray, own: float, shared: float) -> float:
    """Agreement of twelve series of one trend that differ by themselves and share a weather."""
    rng = np.random.default_rng(3)
    years = len(trend)
    own_noise = rng.lognormal(sigma=own, size=(years, 12))
    weather = rng.lognormal(sigma=shared, size=(years, 1))
    return float(interseries_correlation(pd.DataFrame(trend[:, None] * own_noise * weather)).mean())


def test_shared_weather_shows_beyond_a_shared_trend():
    age = np.arange(1.0, 61.0)
    for trend in (5.0 * np.exp(-age / 15), age * np.exp(-age / 12)):
        assert agreement(trend, 0.3, 0.3) > agreement(trend, 0.3, 0.0) + 0.3
    assert abs(agreement(5.0 * np.exp(-age / 15), 0.3, 0.0)) < 0.15


def test_a_bent_trend_that_is_shared_stays_in():
    """The limit that the documents name: smooth series of one age agree without any weather."""
    age = np.arange(1.0, 61.0)
    assert agreement(age * np.exp(-age / 12), 0.02, 0.0) > 0.7


def test_too_short_or_constant_series_have_none():
    noise = np.random.default_rng(4).lognormal(size=30)
    widths = pd.DataFrame({"A": noise, "same": noise, "level": 1.0, "short": noise})
    widths.loc[LEAST_YEARS:, "short"] = np.nan
    r = interseries_correlation(widths)
    assert r.isna().tolist() == [False, False, True, True]
    assert interseries_correlation(widths[["A"]]).isna().all()
    widths.loc[LEAST_YEARS, "short"] = 1.0
    assert not np.isnan(interseries_correlation(widths)["short"])


@pytest.fixture(scope="module")
def field(noisy_run: Run, tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, pd.DataFrame]:
    """Cores of the dominant trees, and what dplPy reads of their file."""
    year = int(noisy_run.years[-1])
    assert year % 10 == 9
    cores = campaign(noisy_run.rings, noisy_run.trees, year=year, n_trees=5)
    path = write_rwl(cores.widths, tmp_path_factory.mktemp("field") / "cores.rwl")
    return cores, dplpy.readers(str(path), verbose=False)


def test_a_file_of_a_run_is_read_to_a_thousandth(noisy_run, tmp_path):
    series = ring_series(noisy_run.rings)
    assert (series.widths == 0.0).any(axis=None)  # missing rings are among them
    path = write_rwl(series.widths, tmp_path / "run.rwl")
    for read in (read_rwl(path), dplpy.readers(str(path), verbose=False)):
        assert list(read.columns) == list(series.widths.columns)
        # Half a unit of rounding, and one where the number would be a marker.
        np.testing.assert_allclose(read, series.widths, atol=0.0015 + 1e-6, rtol=0)


def test_cores_of_a_run_cross_date(field):
    cores, read = field
    ours = interseries_correlation(cores.widths)
    theirs = dplpy.interseries_corr(read, prewhiten=False, biweight=False, corr="pearson")
    assert ours.mean() > 0.6
    assert theirs["mean"] > 0.6
    assert theirs["n_series"] == cores.widths.shape[1]


def test_cross_dating_by_dplpy_finds_the_right_years(field):
    _, read = field
    found = dplpy.xdate(
        dplpy.detrend(read), window_length=20, bin_floor=10, lag=5, show_flags=False
    )
    assert found["overall"]["rho"].mean() > 0.5
    # A core that is dated two years wrong is put right.
    name = read.columns[0]
    wrong = read.copy()
    wrong[name] = wrong[name].shift(2)
    at = {
        lag: interseries_correlation(wrong.assign(**{name: wrong[name].shift(lag)}))[name]
        for lag in range(-4, 5)
    }
    assert max(at, key=lambda lag: at[lag]) == -2


def test_the_chronology_follows_the_weather(field, noisy_run):
    _, read = field
    chronology = dplpy.chron(dplpy.detrend(read, fit="Spline", spline_period=20), plot=False)
    climate = noisy_run.climate.drop_duplicates("year").set_index("year")
    weather = climate["factor"].loc[chronology.index]
    assert chronology["std"].iloc[10:].corr(weather.iloc[10:]) > 0.5


def test_the_page_runs(noisy_run, tmp_path, monkeypatch):
    """The Python of docs/dendro.md, as it stands there."""
    page = Path(__file__).parents[2] / "docs" / "dendro.md"
    (tmp_path / "run.h5").write_bytes(noisy_run.path.read_bytes())
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for script in re.findall(r"^```python\n(.*?)^```", page.read_text(), re.M | re.S):
        exec(script, names)
    assert len(names["chronology"]) == len(names["cores"].widths)
    assert names["earlier"].about["year_shift"].eq(-200).all()
