"""What rings at 1.3 m tell of the climate: correlations with lags, and the driest year.

    python analysis/climate_rings.py run.h5 --to climate.png

takes the trees that live in the last year and have 30 rings or more. A ring's index is its width
per mean of the eleven years around it; a chronology is the mean index of a species' trees.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, enough, panels, plain, script  # noqa: E402
from analysis.ring_series import widths_of  # noqa: E402
from forest.record.run import Run  # noqa: E402
from forest.view.looks import look_of  # noqa: E402

#: Years of which the running mean is taken, and how many must be there.
WINDOW, FEWEST = 11, 6
#: A ring is held against the mean of so many rings before and after it.
NEIGHBOURS = 2
LAGS = (0, 1, 2)
#: Rings from the pith, whose widths follow the young tree's and not the climate.
_JUVENILE = 5
_VARIABLES = ("temperature_c", "precipitation_mm", "drought_index", "growth_index", "factor")


def indices(widths: pd.DataFrame) -> pd.DataFrame:
    """Divide each series, without its first five rings, by its running mean of eleven years.

    Parameters
    ----------
    widths : DataFrame
        Widths in mm by calendar year, a column per tree.

    Returns
    -------
    DataFrame
        Indices around 1, of the same shape; NaN where there is no ring.
    """
    aged = widths.where(widths.notna().cumsum() > _JUVENILE)
    mean = aged.rolling(WINDOW, center=True, min_periods=FEWEST).mean()
    return aged / mean.where(mean > 0.0)


def pointer(widths: pd.DataFrame, year: int) -> pd.Series:
    """Give each tree's ring of a year per mean of the two before and the two after.

    Returns
    -------
    Series
        By tree; below 1 the ring is narrower than its neighbours. Trees that lack one of the
        five rings are left out.
    """
    around = [k for k in range(year - NEIGHBOURS, year + NEIGHBOURS + 1) if k != year]
    ratio = widths.loc[year] / widths.loc[around].mean(axis=0, skipna=False)
    return ratio.dropna()


def climate_of(run: Run, species: str) -> pd.DataFrame:
    """Give the climate that a species met: the columns of `/climate` by year."""
    table = run.climate
    of = table[table["species"].astype(str) == species]
    return of.set_index("year")[list(_VARIABLES)]


def driest(climate: pd.DataFrame, years: pd.Index) -> int:
    """Find the year with the lowest drought index, or factor where there is none.

    Years at the ends, which lack neighbours, do not count.
    """
    told = climate["drought_index"]
    by = climate["factor"] if told.isna().all() else told
    inner = [y for y in sorted(years)[NEIGHBOURS:-NEIGHBOURS] if y in by.index]
    return int(by.loc[inner].idxmin())


def correlations(chronology: pd.Series, climate: pd.DataFrame) -> dict[str, float]:
    """Correlate a chronology with each variable of the year, and of one and two years before."""
    found = {}
    for name in _VARIABLES:
        x = climate[name]
        if x.nunique() < 2:
            continue
        for lag in LAGS:
            found[f"{name}_{lag}"] = float(chronology.corr(x.shift(lag)))
    return found


def table(run: Run) -> pd.DataFrame:
    """Sum up what each species' rings tell.

    Returns
    -------
    DataFrame
        `species`, `trees`, `years`; correlations of the chronology, `<variable>_<lag>`, of the
        variables that differ between years; `driest_year`, `pointer` (mean ring of that year per
        mean of its neighbours) and `narrow` (share of trees whose ring is narrower than that).
    """
    rows = []
    for species, (widths, climate) in _series(run).items():
        chronology = indices(widths).mean(axis=1).dropna()
        year = driest(climate, chronology.index)
        ratio = pointer(widths, year)
        rows.append(
            {
                "species": species,
                "trees": widths.shape[1],
                "years": len(chronology),
                **correlations(chronology, climate),
                "driest_year": year,
                "pointer": ratio.mean(),
                "narrow": (ratio < 1.0).mean(),
            }
        )
    return pd.DataFrame(rows)


def _series(run: Run) -> dict[str, tuple[pd.DataFrame, pd.DataFrame]]:
    """Give each species' widths and climate."""
    widths, about = widths_of(run)
    enough(run.read("climate", ["year"]), "climate", run)
    groups = about.groupby("species").groups.items()
    return {str(name): (widths[list(ids)], climate_of(run, str(name))) for name, ids in groups}


def study(run: Run) -> Study:
    """Draw chronologies beside the climate, and the rings of the driest year."""
    figure, ((left, right),) = panels(2, size=(5.6, 3.6))
    series = _series(run)
    for k, (species, (widths, climate)) in enumerate(series.items()):
        colour = look_of(species).line
        chronology = indices(widths).mean(axis=1).dropna()
        left.plot(chronology, color=colour, lw=1.6, label=plain(species))
        left.plot(climate["factor"].loc[chronology.index], color=colour, lw=0.8, ls=":")
        year = driest(climate, chronology.index)
        left.axvline(year, color="0.85", zorder=0)
        ratio = pointer(widths, year).sort_values()
        spread = [k + 0.3 * (2 * i / max(len(ratio) - 1, 1) - 1) for i in range(len(ratio))]
        right.plot(spread, ratio, "o", ms=3, color=colour)
    left.set(xlabel="calendar year", ylabel="ring index; dotted: factor on income", ylim=(0, None))
    left.legend(frameon=False, fontsize=8)
    right.axhline(1.0, color="0.6", lw=0.8)
    right.set_xticks(range(len(series)), [plain(name) for name in series])
    right.set(ylabel="ring of the driest year per its neighbours", ylim=(0, None))
    right.set_xlim(-0.5, len(series) - 0.5)
    return Study(figure, table(run))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
