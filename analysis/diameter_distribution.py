"""Diameter distributions over time, each with its Weibull curve.

    python analysis/diameter_distribution.py run.h5 --to diameters.png

The curve has two parameters, scale and shape, by maximum likelihood (Bailey & Dell 1973); shape
3.6 is about symmetric, less has its tail to the thick trees.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, enough, panels, script  # noqa: E402
from forest.measure.tables import plot_of  # noqa: E402
from forest.record.run import Run  # noqa: E402

FEWEST_TREES = 15  # for a curve
_YEARS_SHOWN = 5
_CLASS_CM = 2.0


class Weibull(NamedTuple):
    """A Weibull distribution from 0 on: scale in cm, shape, and how far off it is at most."""

    scale_cm: float
    shape: float
    kolmogorov: float


def fit(dbh_cm: Sequence[float]) -> Weibull:
    """Fit a Weibull distribution to diameters; `kolmogorov` is the greatest distance of shares."""
    shape, _, scale = stats.weibull_min.fit(dbh_cm, floc=0.0)
    distance = stats.kstest(dbh_cm, stats.weibull_min(shape, scale=scale).cdf).statistic
    return Weibull(float(scale), float(shape), float(distance))


def table(trees: pd.DataFrame) -> pd.DataFrame:
    """Fit the diameters of every tenth year.

    Parameters
    ----------
    trees : DataFrame
        `year`, `dbh_cm`.

    Returns
    -------
    DataFrame
        `year`, `trees` (with a dbh), `mean_cm`, `skewness`, and the fit's `scale_cm`, `shape` and
        `kolmogorov`; of the years that have at least 15 such trees.
    """
    rows = []
    last = int(trees["year"].max())
    for year, of in trees.dropna(subset="dbh_cm").groupby("year"):
        if (last - int(year)) % 10 == 0 and len(of) >= FEWEST_TREES:
            dbh = of["dbh_cm"].to_numpy(np.float64)
            row = {"year": int(year), "trees": len(dbh), "mean_cm": dbh.mean()}
            rows.append({**row, "skewness": stats.skew(dbh), **fit(dbh)._asdict()})
    return pd.DataFrame(rows)


def study(run: Run) -> Study:
    """Draw histograms of a few years and the curves' parameters over time."""
    trees = run.read("trees", ["year", "dbh_cm"])
    numbers = table(trees)
    enough(numbers, f"year with {FEWEST_TREES} trees that have a dbh", run)
    hectares = plot_of(run.scenario).hectares
    place = np.unique(np.linspace(0, len(numbers) - 1, _YEARS_SHOWN).round().astype(int))
    figure, axes = panels(3, 2, size=(3.6, 2.9))
    most = float(trees["dbh_cm"].max()) + _CLASS_CM
    edges = np.arange(0.0, most + _CLASS_CM, _CLASS_CM)
    across = np.linspace(0.01 * most, most, 300)  # below shape 1 the curve is infinite at 0
    for axis, row in zip(axes.flat, numbers.iloc[place].itertuples(), strict=False):
        dbh = trees.loc[trees["year"] == row.year, "dbh_cm"].dropna()
        count, _ = np.histogram(dbh, edges)
        axis.stairs(count / hectares, edges, fill=True, color="0.8")
        density = stats.weibull_min(row.shape, scale=row.scale_cm).pdf(across)
        axis.plot(across, density * row.trees * _CLASS_CM / hectares, "k", lw=1.4)
        text = f"{row.year}: scale {row.scale_cm:.1f} cm\nshape {row.shape:.2f}"
        axis.text(0.97, 0.97, text, transform=axis.transAxes, ha="right", va="top", fontsize=8)
        axis.set(xlabel="dbh, cm", ylabel="trees per ha, 2-cm classes")
    for axis in axes.flat[len(place) : -1]:
        axis.set_visible(False)
    last = axes.flat[-1]
    last.plot(numbers["year"], numbers["scale_cm"], "k", label="scale, cm")
    last.plot(numbers["year"], numbers["shape"], "k--", label="shape")
    last.axhline(3.6, color="0.7", lw=0.8, ls=":")
    last.set(xlabel="calendar year", ylim=(0, None))
    last.legend(frameon=False, fontsize=8)
    return Study(figure, numbers)


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
