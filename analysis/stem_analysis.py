"""Stem analysis: height over age from discs, and the stem's yearly outlines.

    python analysis/stem_analysis.py run.h5 --to stems.png

A disc tells in which year the stem reached its height. Of a sample tree every internode tells it.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, enough, panels, plain, script  # noqa: E402
from forest.dendro import ages  # noqa: E402
from forest.errors import InputError  # noqa: E402
from forest.measure.stem import stems_of_skeletons  # noqa: E402
from forest.measure.taper import disc_diameters  # noqa: E402
from forest.record.run import Run  # noqa: E402
from forest.trees.skeleton import Skeleton  # noqa: E402
from forest.view.looks import look_of  # noqa: E402

_OUTLINE_EVERY = 10  # years


def years_to_heights(run: Run) -> pd.DataFrame:
    """Tell how old the trees that live in the last year were when they reached their discs.

    Returns
    -------
    DataFrame
        A row per tree and disc: `tree_id`, `species`, `stem_height_m`, `age` (in the year of the
        innermost ring, the year of planting being 1).
    """
    last = int(run.years[-1])
    living = run.read("trees", ["tree_id", "species"], years=(last, last))
    rings = run.rings
    rings = rings[rings["tree_id"].isin(living["tree_id"])]
    enough(rings, "living tree with rings", run)
    reached = ages(rings, run.read("trees", ["tree_id", "year", "age"]))
    reached = reached[reached["year"] == last]  # the stem still stands there
    reached = reached.assign(age=reached["years_to_height"] + 1).merge(living, on="tree_id")
    reached["species"] = reached["species"].astype(str)
    return reached[["tree_id", "species", "stem_height_m", "age"]]


def stem_heights(skeleton: Skeleton) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Give the year in which each internode of a stem was made, and its upper end's height."""
    path = stems_of_skeletons([skeleton], 0.0).metamer
    return skeleton.birth_year[path], skeleton.end[path, 2] - skeleton.start[0, 2]


def outlines(run: Run, tree_id: int) -> dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Give a stem's radii, cm under bark, and their heights, in every tenth year and the last.

    Of a sample tree long on record at all internodes; of another one at its discs and the top.
    """
    last = int(run.years[-1])
    years = [*range(last, int(run.years[0]) - 1, -_OUTLINE_EVERY)]
    recorded = run.sample_years(tree_id) if tree_id in run.samples else ()
    if len(recorded) <= _OUTLINE_EVERY:
        recorded = ()
    drawn = {}
    for year in years:
        if len(recorded):
            if year not in recorded:
                continue
            stem = stems_of_skeletons([run.skeleton(tree_id, year)], 0.0)
            drawn[year] = (50.0 * stem.diameter_m, stem.reach_m)
            continue
        rings = run.rings
        mine = rings[(rings["tree_id"] == tree_id) & (rings["year"] <= year)]
        tree = run.read("trees", ["tree_id", "height_m"], years=(year, year))
        top = tree.loc[tree["tree_id"] == tree_id, "height_m"]
        if len(mine) and len(top) and int(mine["year"].max()) == year:
            disc = disc_diameters(mine).loc[tree_id]
            radius = np.append(50.0 * disc.to_numpy(np.float64), 0.0)
            drawn[year] = (radius, np.append(disc.index, top.iloc[0]))
    return drawn


def table(reached: pd.DataFrame) -> pd.DataFrame:
    """Give for each species and height the number of trees and quartiles of their ages."""
    by = reached.groupby(["species", "stem_height_m"])["age"]
    return by.agg(
        trees="size",
        quarter=lambda age: age.quantile(0.25),
        median="median",
        three_quarters=lambda age: age.quantile(0.75),
    ).reset_index()


def study(run: Run) -> Study:
    """Draw height over age, and the outlines of the thickest sample tree, or of all if none."""
    reached = years_to_heights(run)
    last = int(run.years[-1])
    now = run.read("trees", ["tree_id", "species", "age", "height_m", "dbh_cm"], years=(last, last))
    figure, ((left, right),) = panels(2, size=(4.8, 4.2))
    ends = now.rename(columns={"height_m": "stem_height_m"})[reached.columns]
    for species, of in reached.groupby("species"):
        colour = look_of(species).line
        whole = pd.concat([of, ends[ends["tree_id"].isin(of["tree_id"])]])
        for _, tree in whole.groupby("tree_id"):
            tree = tree.sort_values("age")
            left.plot(tree["age"], tree["stem_height_m"], color=colour, lw=0.4, alpha=0.35)
        middle = of.groupby("stem_height_m")["age"].median()
        left.plot(middle, middle.index, "o", color=colour, ms=5, label=plain(species))
    first = now.set_index("tree_id")
    chosen = [i for i in run.samples if i in first.index]
    for tree_id in chosen:
        year, height = stem_heights(run.skeleton(tree_id, last))
        planted = last - int(first.loc[tree_id, "age"])
        left.plot(year - planted, height, color="k", lw=1.2)
    if chosen:
        left.plot([], [], color="k", lw=1.2, label="sample trees, every internode")
    left.set(xlabel="age, years", ylabel="height, m", xlim=(0, None), ylim=(0, None))
    left.legend(frameon=False, fontsize=8)
    long = [i for i in chosen if len(run.sample_years(i)) > _OUTLINE_EVERY]
    of_outline = first.loc[long] if long else first
    if of_outline["dbh_cm"].isna().all():
        raise InputError(
            "has no tree that reaches 1.3 m", where=str(run.path), expected="an older stand"
        )
    thickest = int(of_outline["dbh_cm"].idxmax())
    for year, (radius, height) in outlines(run, thickest).items():
        colour = "k" if year == last else "0.55"
        for side in (-1, 1):
            right.plot(side * radius, height, color=colour, lw=0.8)
    right.set(xlabel="radius under bark, cm", ylabel="height, m", ylim=(0, None))
    right.set_title(f"tree {thickest}, every tenth year", fontsize=9)
    return Study(figure, table(reached))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
