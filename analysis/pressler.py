"""Pressler's law: rings widen from the butt to the crown, and keep their area below it.

    python analysis/pressler.py run.h5 --to pressler.png

takes the living trees with three discs or more below their crown, and the mean of the last five
years.
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
from forest.measure.stem import stems_of_skeletons  # noqa: E402
from forest.measure.taper import disc_diameters  # noqa: E402
from forest.record.run import Run  # noqa: E402
from forest.view.looks import look_of  # noqa: E402

YEARS = 5
FEWEST_DISCS = 3  # below the crown
BREAST_M = 1.3


def profiles(run: Run, year: int | None = None) -> pd.DataFrame:
    """Give the mean rings of the last years at the discs below the crown, and at its base.

    Parameters
    ----------
    run : Run
        With rings at several heights, and at the crown's base.
    year : int, optional
        Last of the years; the run's last if not given.

    Returns
    -------
    DataFrame
        A row per tree and place: `tree_id`, `species`, `stem_height_m`, `crown_base_m`,
        `width_mm` (mean of the years) and `area_cm2` (of a ring of the mean year; NaN at the
        crown's base, which is other wood every year). Trees with three discs or more below the
        crown in all the years.
    """
    last = int(run.years[-1]) if year is None else year
    rings = run.read("rings", years=(int(run.years[0]), last))
    recent = rings[rings["year"] > last - YEARS]
    base = recent[recent["place"].astype(str) == "crown_base"].groupby("tree_id")
    crown = base.agg(crown_base_m=("stem_height_m", "min"), width_mm=("width_mm", "mean"))
    discs = recent[recent["place"].astype(str) == "height"].copy()
    discs["stem_height_m"] = discs["stem_height_m"].astype(np.float64).round(3)
    by = discs.groupby(["tree_id", "stem_height_m"])["width_mm"].agg(["mean", "size"])
    rows = by[by["size"] == YEARS].reset_index().rename(columns={"mean": "width_mm"})
    now = disc_diameters(rings).stack().rename("diameter_m").rename_axis(by.index.names)
    rows = rows.join(now, on=by.index.names).join(crown["crown_base_m"], on="tree_id")
    rows = rows[rows["stem_height_m"] < rows["crown_base_m"]]
    grown_mm = YEARS * rows["width_mm"]
    outer_mm = 500.0 * rows["diameter_m"]
    rows["area_cm2"] = np.pi * (2.0 * outer_mm - grown_mm) * grown_mm / YEARS / 100.0
    rows = rows[rows.groupby("tree_id")["width_mm"].transform("size") >= FEWEST_DISCS]
    tops = crown.loc[crown.index.isin(rows["tree_id"])].reset_index()
    tops["stem_height_m"] = tops["crown_base_m"]
    every = pd.concat([rows.drop(columns=["size", "diameter_m"]), tops], ignore_index=True)
    names = rings.drop_duplicates("tree_id").set_index("tree_id")["species"].astype(str)
    every["species"] = every["tree_id"].map(names)
    return every.sort_values(["tree_id", "stem_height_m"], ignore_index=True)


def internodes(run: Run, tree_id: int) -> pd.DataFrame:
    """Give a sample tree's rings of the last years at every internode of its stem.

    Returns
    -------
    DataFrame
        `height_m`, `width_mm` and `area_cm2` of a mean year; internodes older than the years.
    """
    last = int(run.years[-1])
    before, after = (run.skeleton(tree_id, year) for year in (last - YEARS, last))
    path = stems_of_skeletons([after], 0.0).metamer
    path = path[np.isin(after.serial[path], before.serial)]
    place = pd.Series(np.arange(len(before)), before.serial)[after.serial[path]].to_numpy()
    inner, outer = before.radius[place], after.radius[path]
    return pd.DataFrame(
        {
            "height_m": after.end[path, 2] - after.start[0, 2],
            "width_mm": 1000.0 * (outer - inner) / YEARS,
            "area_cm2": 1e4 * np.pi * (outer**2 - inner**2) / YEARS,
        }
    )


def table(every: pd.DataFrame) -> pd.DataFrame:
    """Hold the profiles of each species against the law.

    Returns
    -------
    DataFrame
        `species`, `trees`; `rising`: share of steps from a disc to the next one up on which the
        ring is wider; `crown_per_breast`: median width at the crown's base per that at 1.3 m;
        `area_ratio`: median of the ring area at the highest disc below the crown per that at
        1.3 m; `area_cv`: median coefficient of variation of ring areas from 1.3 m to the crown.
    """
    rows = []
    for species, of in every.groupby("species"):
        step = of.groupby("tree_id")["width_mm"].diff().dropna()
        above = of[of["stem_height_m"] >= BREAST_M]
        breast = of[of["stem_height_m"] == BREAST_M].set_index("tree_id")
        crown = of[of["area_cm2"].isna()].set_index("tree_id")
        areas = above.dropna(subset="area_cm2").groupby("tree_id")["area_cm2"]
        rows.append(
            {
                "species": species,
                "trees": of["tree_id"].nunique(),
                "rising": (step > 0.0).mean(),
                "crown_per_breast": (crown["width_mm"] / breast["width_mm"]).median(),
                "area_ratio": (areas.last() / areas.first()).median(),
                "area_cv": (areas.std() / areas.mean()).median(),
            }
        )
    return pd.DataFrame(rows)


def study(run: Run) -> Study:
    """Draw width and area over height per crown base, relative to those at 1.3 m."""
    every = profiles(run)
    enough(every, f"tree with {FEWEST_DISCS} discs below its crown", run)
    figure, ((left, right),) = panels(2, size=(4.4, 4.2))
    breast = every[every["stem_height_m"] == BREAST_M].set_index("tree_id")
    for tree_id, tree in every[every["tree_id"].isin(breast.index)].groupby("tree_id"):
        colour = look_of(tree["species"].iloc[0]).line
        at = tree["stem_height_m"] / tree["crown_base_m"]
        for axes, name in ((left, "width_mm"), (right, "area_cm2")):
            axes.plot(
                tree[name] / breast.loc[tree_id, name], at, "o-", ms=3, lw=0.5, color=colour,
                alpha=0.5,
            )  # fmt: skip
    for tree_id in set(run.samples) & set(breast.index):
        if int(run.years[-1]) - YEARS not in run.sample_years(tree_id):
            continue
        of = internodes(run, tree_id)
        crown = every.loc[every["tree_id"] == tree_id, "crown_base_m"].iloc[0]
        for axes, name in ((left, "width_mm"), (right, "area_cm2")):
            axes.plot(of[name] / breast.loc[tree_id, name], of["height_m"] / crown, "k", lw=1.0)
    right.plot([], [], "k", lw=1.0, label="sample trees, every internode")
    right.plot([], [], "o-", color="0.6", ms=3, lw=0.5, label="discs; crown base (a)")
    right.legend(frameon=False, fontsize=8)
    for axes, what in ((left, "width"), (right, "area")):
        axes.axhline(1.0, color="0.6", lw=0.8, ls=":")
        axes.axvline(1.0, color="0.85", lw=0.8, zorder=0)
        axes.set(xlabel=f"ring {what} per that at 1.3 m", ylim=(0, None), xlim=(0, None))
    right.set(xlim=(0, 2))
    left.set(ylabel="height per height of the crown's base")
    return Study(figure, table(every))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
