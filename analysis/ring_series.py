"""Ring series at 1.3 m and their age trend, beside published means.

    python analysis/ring_series.py run.h5 --to rings.png

takes the trees that live in the last year and have 30 rings or more, as who cores a stand does.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, enough, panels, plain, script  # noqa: E402
from forest.dendro import interseries_correlation, ring_series  # noqa: E402
from forest.dendro.stems import at_height  # noqa: E402
from forest.record.run import Run  # noqa: E402
from forest.view.looks import look_of  # noqa: E402

FEWEST_RINGS = 30
BREAST_M = 1.3

#: Published means: width in mm, first-order autocorrelation, share of series that decline.
PUBLISHED = {
    "picea_abies": (2.28, 0.68, 0.95),
    "fagus_sylvatica": (1.68, 0.74, 0.23),
    "abies_alba": (0.94, 0.72, 0.83),
    "pinus_ponderosa": (0.99, 0.73, 0.84),
}
#: Width below which a ring is hardly found under the microscope.
HAIRLINE_MM = 0.05
# Of so many trees, and of half the series, the mean over cambial age is drawn: the last rings are
# those of the fastest seedlings alone.
_FEWEST_TREES = 3
_LAST = 10  # rings


def widths_of(run: Run) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Give the widths at 1.3 m of the living trees with enough rings, and whose they are."""
    last = int(run.years[-1])
    rings = run.rings
    here = rings[at_height(rings, BREAST_M) & (rings["place"].astype(str) == "height")]
    here = here[here["tree_id"].isin(here.loc[here["year"] == last, "tree_id"])]
    enough(here, "rings at 1.3 m", run)
    series = ring_series(here)
    long = series.widths.columns[series.widths.notna().sum() >= FEWEST_RINGS]
    enough(long, f"series of {FEWEST_RINGS} rings", run)
    return series.widths[long], series.about.loc[long]


def autocorrelation(width: pd.Series) -> float:
    """Correlate each ring with the one before; NaN where all are alike."""
    w = width.dropna().to_numpy(np.float64)
    if w[1:].std() == 0.0 or w[:-1].std() == 0.0:
        return float("nan")
    return float(np.corrcoef(w[1:], w[:-1])[0, 1])


def declines(width: pd.Series) -> bool:
    """Tell whether the straight line through a series falls."""
    w = width.dropna().to_numpy(np.float64)
    return bool(np.polyfit(np.arange(len(w)), w, 1)[0] < 0.0)


def table(widths: pd.DataFrame, about: pd.DataFrame) -> pd.DataFrame:
    """Sum up the series of each species, published means below.

    Parameters
    ----------
    widths : DataFrame
        A column per series; mm.
    about : DataFrame
        `species` of each, in the same order.

    Returns
    -------
    DataFrame
        `species`, `source`, `series`, `mean_mm`, `autocorrelation`, `decline` (share of series
        with a falling straight line), `missing` (share of rings of width 0), `interseries`
        (mean correlation of each series with all others of its species) and `hairline` (share of
        the trees whose last ten rings are narrower than 0.05 mm in the mean).
    """
    rows = []
    for species, ids in about.groupby("species").groups.items():
        of = widths[list(ids)]
        rows.append(
            {
                "species": species,
                "source": "run",
                "series": len(ids),
                "mean_mm": of.mean().mean(),
                "autocorrelation": of.apply(autocorrelation).mean(),
                "decline": of.apply(declines).mean(),
                "missing": (of == 0.0).sum().sum() / of.notna().sum().sum(),
                "interseries": interseries_correlation(of).mean(),
                "hairline": (of.tail(_LAST).mean() < HAIRLINE_MM).mean(),
            }
        )
    for species, (mean, correlation, share) in PUBLISHED.items():
        row = {"species": species, "source": "published", "mean_mm": mean}
        rows.append({**row, "autocorrelation": correlation, "decline": share})
    return pd.DataFrame(rows).astype({"series": "Int64"})


def by_cambial_age(widths: pd.DataFrame) -> pd.DataFrame:
    """Align series at the pith: rows are rings from the pith."""
    aligned = {name: w.dropna().reset_index(drop=True) for name, w in widths.items()}
    frame = pd.DataFrame(aligned)
    frame.index = pd.RangeIndex(1, len(frame) + 1, name="cambial_age")
    return frame


def study(run: Run) -> Study:
    """Draw the series over the years and their means over cambial age."""
    widths, about = widths_of(run)
    figure, ((left, right),) = panels(2, size=(5.0, 3.6))
    for species, ids in about.groupby("species").groups.items():
        colour = look_of(species).line
        of = widths[list(ids)]
        left.plot(of.index, of, color=colour, lw=0.4, alpha=0.25)
        left.plot(of.index, of.mean(axis=1), color=colour, lw=1.8)
        aged = by_cambial_age(of)
        fewest = max(min(_FEWEST_TREES, len(ids)), len(ids) / 2)
        aged = aged[aged.notna().sum(axis=1) >= fewest]
        right.fill_between(
            aged.index, *aged.quantile([0.25, 0.75], axis=1).to_numpy(), color=colour, alpha=0.2,
            lw=0,
        )  # fmt: skip
        right.plot(aged.mean(axis=1), color=colour, lw=1.8, label=f"{plain(species)} ({len(ids)})")
    left.set(xlabel="calendar year", ylabel="ring width at 1.3 m, mm", ylim=(0, None))
    right.set(
        xlabel="rings from the pith", ylabel="ring width, mm: mean, quartiles", ylim=(0, None)
    )
    right.legend(frameon=False, fontsize=8)
    return Study(figure, table(widths, about))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
