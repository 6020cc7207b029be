"""Growth dominance: do the large trees grow more than their share?

    python analysis/growth_dominance.py run.h5 --to dominance.png

Binkley et al. 2006: trees are ordered from the smallest to the largest; the coefficient is 1 less
twice the area under the curve of their cumulative growth over their cumulative size. It is
positive where large trees grow more than their share of size, negative where small ones do.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, enough, panels, script  # noqa: E402
from forest.measure.structure import gini  # noqa: E402
from forest.record.run import Run  # noqa: E402

YEARS = 5
FEWEST_TREES = 5
_CURVES = 4


def dominance_curve(
    size: ArrayLike, growth: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give cumulative shares of size and of growth, (n + 1,), from the smallest tree on."""
    size, growth = (np.asarray(values, np.float64) for values in (size, growth))
    order = np.argsort(size, kind="stable")
    shares = [np.concatenate(([0.0], np.cumsum(of[order]))) for of in (size, growth)]
    return shares[0] / shares[0][-1], shares[1] / shares[1][-1]


def growth_dominance(size: ArrayLike, growth: ArrayLike) -> float:
    """Give Binkley's coefficient; 0 where each tree grows in proportion to its size."""
    return 1.0 - 2.0 * float(np.trapezoid(*dominance_curve(size, growth)[::-1]))


def periods(run: Run) -> dict[int, pd.DataFrame]:
    """Give `size` and `growth` in stem volume of the trees that lived through five years.

    Returns
    -------
    dict of DataFrame
        By the last year of a period. Size is at its beginning.
    """
    trees = run.read("trees", ["year", "tree_id", "stem_volume_m3"])
    volume = trees.pivot(index="year", columns="tree_id", values="stem_volume_m3")
    last = int(run.years[-1])
    found = {}
    for year in range(last, int(run.years[0]) + YEARS - 1, -YEARS):
        of = pd.DataFrame({"size": volume.loc[year - YEARS], "end": volume.loc[year]}).dropna()
        of["growth"] = of.pop("end") - of["size"]
        if len(of) >= FEWEST_TREES and of["size"].sum() > 0.0 and of["growth"].sum() > 0.0:
            found[year] = of
    return dict(reversed(found.items()))


def table(found: dict[int, pd.DataFrame]) -> pd.DataFrame:
    """Give `year`, `trees`, `dominance` and the Gini coefficient of sizes for each period."""
    return pd.DataFrame(
        [
            {
                "year": year,
                "trees": len(of),
                "dominance": growth_dominance(of["size"], of["growth"]),
                "gini_volume": gini(of["size"].to_numpy()),
            }
            for year, of in found.items()
        ]
    )


def study(run: Run) -> Study:
    """Draw the curves of some periods and the coefficient over time."""
    found = periods(run)
    enough(found, f"five years that {FEWEST_TREES} trees lived through", run)
    numbers = table(found)
    figure, ((left, right),) = panels(2)
    place = np.unique(np.linspace(0, len(numbers) - 1, _CURVES).round().astype(int))
    for k, shade in zip(place, np.linspace(0.75, 0.0, len(place)), strict=True):
        year = int(numbers["year"][k])
        of = found[year]
        curve = dominance_curve(of["size"], of["growth"])
        left.plot(*curve, color=str(shade), lw=1.5, label=f"{year - YEARS} to {year}")
    left.plot([0, 1], [0, 1], color="0.6", lw=0.8, ls=":")
    left.set(xlabel="cumulative share of stem volume", ylabel="cumulative share of its growth")
    left.legend(frameon=False, fontsize=8)
    right.plot(numbers["year"], numbers["dominance"], "k", label="growth dominance")
    right.plot(numbers["year"], numbers["gini_volume"], "k--", label="Gini of volume")
    right.axhline(0.0, color="0.6", lw=0.8, ls=":")
    right.set(xlabel="calendar year")
    right.legend(frameon=False, fontsize=8)
    return Study(figure, numbers)


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
