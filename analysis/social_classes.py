"""Height over diameter, and slenderness, by social class.

    python analysis/social_classes.py run.h5 --to classes.png

A tree's class follows from its height per top height (the mean of the 100 thickest per ha) in the
same year: dominant from 0.9, codominant from 0.75, intermediate from 0.5, below that suppressed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, enough, panels, script  # noqa: E402
from forest.record.run import Run  # noqa: E402

#: Least height per top height of each class.
CLASSES = {"dominant": 0.9, "codominant": 0.75, "intermediate": 0.5, "suppressed": 0.0}
COLOURS = ("#1b4332", "#52a176", "#e0a526", "#b5402a")

_YEARS_SHOWN = 4
_FEWEST_TREES = 8  # for a height curve
_BREAST_M = 1.3


def classify(height_m: pd.Series, top_height_m: pd.Series) -> pd.Categorical:
    """Give the social class of trees."""
    bounds = [-np.inf, *sorted(CLASSES.values())[1:], np.inf]
    names = list(CLASSES)
    return pd.cut(height_m / top_height_m, bounds, right=False, labels=names[::-1]).values


def naslund(dbh_cm: pd.Series, height_m: pd.Series) -> tuple[float, float]:
    """Fit Näslund's height curve h = 1.3 + d² / (a + b d)² to trees higher than 1.3 m.

    Returns
    -------
    a, b : float
        Of the straight line d / sqrt(h - 1.3) = a + b d.
    """
    b, a = np.polyfit(dbh_cm, dbh_cm / np.sqrt(height_m - _BREAST_M), 1)
    return float(a), float(b)


def measured(run: Run) -> pd.DataFrame:
    """Give `year`, `dbh_cm`, `height_m`, `slenderness` and `social` of all trees with a dbh."""
    trees = run.read("trees", ["year", "dbh_cm", "height_m"]).dropna()
    trees = trees[(trees["height_m"] > _BREAST_M) & (trees["dbh_cm"] > 0.0)]
    stand = run.read("stand", ["year", "species", "top_height_m"])
    top = stand[stand["species"].astype(str) == "all"].set_index("year")["top_height_m"]
    trees["social"] = classify(trees["height_m"], trees["year"].map(top))
    trees["slenderness"] = 100.0 * trees["height_m"] / trees["dbh_cm"]
    return trees


def table(trees: pd.DataFrame) -> pd.DataFrame:
    """Give number, mean dbh and height and median slenderness by class, in every 20th year."""
    last = int(trees["year"].max())
    some = trees[(last - trees["year"]) % 20 == 0]
    by = some.groupby(["year", "social"], observed=True)
    rows = by.agg(
        trees=("dbh_cm", "size"),
        mean_dbh_cm=("dbh_cm", "mean"),
        mean_height_m=("height_m", "mean"),
        slenderness=("slenderness", "median"),
    )
    return rows.reset_index()


def study(run: Run) -> Study:
    """Draw height curves of a few years over the last year's trees, and slenderness over time."""
    trees = measured(run)
    enough(trees, "tree of 1.3 m", run)
    figure, ((left, right),) = panels(2, size=(4.6, 3.8))
    years = np.unique(trees["year"])
    last = years[-1]
    for name, colour in zip(CLASSES, COLOURS, strict=True):
        of = trees[trees["social"] == name]
        now = of[of["year"] == last]
        left.plot(now["dbh_cm"], now["height_m"], "o", ms=3.5, color=colour, label=name)
        by_year = of.groupby("year")["slenderness"]
        median = by_year.median()[by_year.size() >= 3]
        right.plot(median, color=colour, lw=1.8, label=name)
    shown = years[np.linspace(0, len(years) - 1, _YEARS_SHOWN + 1).round().astype(int)[1:]]
    for year in np.unique(shown):
        of = trees[trees["year"] == year]
        if len(of) < _FEWEST_TREES:
            continue
        a, b = naslund(of["dbh_cm"], of["height_m"])
        across = np.linspace(of["dbh_cm"].min(), of["dbh_cm"].max(), 100)
        left.plot(across, _BREAST_M + (across / (a + b * across)) ** 2, "k", lw=0.9)
        end = _BREAST_M + (across[-1] / (a + b * across[-1])) ** 2
        left.annotate(f" {year}", (across[-1], end), fontsize=8, va="center")
    left.set(xlabel="dbh, cm", ylabel="height, m", xlim=(0, None), ylim=(0, None))
    left.legend(frameon=False, fontsize=8, loc="lower right")
    right.axhline(80.0, color="0.7", lw=0.8, ls=":")
    right.set(xlabel="calendar year", ylabel="slenderness, height per dbh", ylim=(40, 200))
    return Study(figure, table(trees))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
