"""Stems drawn through discs beside the same trees' true stems: diameters, and what logs bring.

    python analysis/drawn_stems.py run.h5 --to drawn.png

takes the sample trees that live in the last year. All stems are cut for the products that `forest
bucking` cuts without a list.
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
from forest.measure.bucking import buck  # noqa: E402
from forest.measure.products import DEFAULT_PRODUCTS  # noqa: E402
from forest.measure.stem import Stems, stems_of_skeletons  # noqa: E402
from forest.measure.tables import sample_skeletons  # noqa: E402
from forest.measure.taper import RINGS_READ, disc_diameters, taper_stems  # noqa: E402
from forest.record.run import Run  # noqa: E402
from forest.view.looks import look_of  # noqa: E402

#: Heights per tree height at which diameters are compared.
RELATIVE_HEIGHTS = np.arange(1, 20) / 20.0
UPPER = 0.7
_PERCENT = 100.0


def both_stems(run: Run) -> tuple[pd.DataFrame, Stems, Stems]:
    """Give the living sample trees' rows of `/trees`, their true stems and the drawn ones."""
    year = int(run.years[-1])
    shapes = sample_skeletons(run, year)
    trees = run.read("trees", years=(year, year)).set_index("tree_id")
    shapes = [shape for shape in shapes if trees["dbh_cm"][shape.tree_id] > 0.0]
    enough(shapes, "living sample tree of 1.3 m", run)
    rows = trees.loc[[shape.tree_id for shape in shapes]].reset_index()
    rows["species"] = rows["species"].astype(str)
    of = {one.name: one.mensuration for one in run.scenario.species_list}
    bark = np.array([of[name].bark_factor for name in rows["species"]])
    rows["stump_m"] = [of[name].stump_height_m for name in rows["species"]]
    true = stems_of_skeletons(shapes, bark)
    rings = run.read("rings", RINGS_READ, years=(int(run.years[0]), year))
    return rows, true, taper_stems(rows, disc_diameters(rings), bark)


def excess_cm(true: Stems, drawn: Stems) -> np.ndarray:
    """Give how much thicker drawn stems are, under bark, (n, 19): at each relative height."""
    height = np.minimum(true.height_m, drawn.height_m)
    at = [height * share for share in RELATIVE_HEIGHTS]
    pairs = [[s.diameter_at(h, over_bark=False) for s in (drawn, true)] for h in at]
    return np.column_stack([_PERCENT * (of_drawn - of_true) for of_drawn, of_true in pairs])


def worth(stems: Stems, rows: pd.DataFrame) -> np.ndarray:
    """Give what each stem's logs bring, (n,)."""
    logs = buck(stems, DEFAULT_PRODUCTS, stump_m=rows["stump_m"].to_numpy())
    return logs.groupby("stem")["value"].sum().reindex(range(len(stems)), fill_value=0.0).to_numpy()


def table(rows: pd.DataFrame, excess: np.ndarray) -> pd.DataFrame:
    """Sum up by species.

    Parameters
    ----------
    rows : DataFrame
        `species` and the worth of the logs, `true` and `drawn`.
    excess : ndarray
        Of the same trees; see `excess_cm`.

    Returns
    -------
    DataFrame
        `species`, `trees`; `worth_ratio`: what drawn stems bring per what the true ones do, all
        together; `tree_error`: median over trees of the difference, per true worth;
        `upper_excess_cm`: mean by which a drawn stem is too thick from 0.7 of the height up.
    """
    upper = excess[:, RELATIVE_HEIGHTS >= UPPER].mean(axis=1)
    found = []
    for species, of in rows.assign(upper=upper).groupby("species"):
        sold = of[of["true"] > 0.0]
        found.append(
            {
                "species": species,
                "trees": len(of),
                "worth_ratio": of["drawn"].sum() / of["true"].sum() if len(sold) else np.nan,
                "tree_error": (sold["drawn"] / sold["true"] - 1.0).abs().median(),
                "upper_excess_cm": of["upper"].mean(),
            }
        )
    return pd.DataFrame(found)


def study(run: Run) -> Study:
    """Draw worth against worth, and the excess over relative height."""
    rows, true, drawn = both_stems(run)
    rows = rows.assign(true=worth(true, rows), drawn=worth(drawn, rows))
    excess = excess_cm(true, drawn)
    figure, ((left, right),) = panels(2, size=(4.4, 4.2))
    for species, of in rows.groupby("species"):
        colour = look_of(species).line
        left.plot(of["true"], of["drawn"], "o", ms=4, color=colour, label=plain(species))
        right.plot(excess[of.index].T, RELATIVE_HEIGHTS, color=colour, lw=0.5, alpha=0.5)
    most = max(rows["true"].max(), rows["drawn"].max())
    left.plot([0, most], [0, most], color="0.6", lw=0.8, ls=":")
    left.legend(frameon=False, fontsize=8)
    left.set(xlabel="worth of the true stem's logs", ylabel="worth of the drawn stem's logs")
    right.axvline(0.0, color="0.6", lw=0.8, ls=":")
    right.set(xlabel="drawn less true diameter, cm", ylabel="relative height", ylim=(0, 1))
    return Study(figure, table(rows, excess))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
