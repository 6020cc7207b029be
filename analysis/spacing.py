"""A spacing trial: slenderness, branches and crowns over the distance at which trees were planted.

    python analysis/spacing.py out/spacing/runs --to spacing.png

The folder is that of a sweep whose runs are regular plantings of one species, square, with sample
trees; `scenarios/spacing_trial.py` makes one. The rules are those by which Vospernik et al. (2010)
judged four simulators, and what every spacing trial found of branches and crowns.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from analysis.common import Study, plain, save  # noqa: E402
from analysis.social_classes import naslund  # noqa: E402
from forest.record.run import Run  # noqa: E402
from forest.trees.skeleton import Skeleton  # noqa: E402
from forest.view.looks import look_of  # noqa: E402

#: A tree is compared with open-grown ones in the year in which it grows past this dbh, cm.
AT_CM = 10.0
#: H/D of open-grown trees of 10 cm (Stampfer 1995, as used by Vospernik et al. 2010).
OPEN_GROWN = {"picea_abies": 64.0, "pinus_sylvestris": 56.0}
#: H/D of the mean tree of a very dense stand while it is small (the same).
VERY_DENSE = {"pinus_sylvestris": 111.0}
#: Mean diameter from which a stand is compared with it, cm; below, dbh is too near the top.
SMALL_CM = 5.0
#: Share of the trees, by dbh, that are the dominant or the suppressed ones.
FIFTH = 0.2
_FEWEST = 3  # trees that a height curve is fitted to
_APART_M = 7.0  # trees in the drawing
_UNSAFE = 80.0  # H/D from which snow and wind do damage
_WHORL = 3  # living branches that begin a crown


def mean_tree_slenderness(trees: pd.DataFrame) -> float:
    """Give H/D of the tree of mean basal area, its height from Näslund's curve; NaN if too few.

    Parameters
    ----------
    trees : DataFrame
        `dbh_cm` and `height_m` of the trees of a year that have a dbh.
    """
    if len(trees) < _FEWEST:
        return float("nan")
    a, b = naslund(trees["dbh_cm"], trees["height_m"])
    diameter = float(np.sqrt((trees["dbh_cm"] ** 2).mean()))
    return 100.0 * (1.3 + (diameter / (a + b * diameter)) ** 2) / diameter


def at_size(trees: pd.DataFrame, size_cm: float = AT_CM) -> float:
    """Give the mean H/D that trees had in the year in which they grew past a dbh; NaN if none did.

    Parameters
    ----------
    trees : DataFrame
        `year`, `tree_id`, `dbh_cm`, `height_m`.
    """
    past = trees[trees["dbh_cm"] >= size_cm].sort_values("year").groupby("tree_id").first()
    return float((100.0 * past["height_m"] / past["dbh_cm"]).mean())


def _branch_bases(tree: Skeleton) -> NDArray[np.bool_]:
    """Mark the first internodes of the branches on the trunk, but for one that replaces its top."""
    trunk = tree.axis == 0
    onward = np.zeros(len(tree), np.bool_)
    onward[tree.parent[trunk & (tree.parent >= 0)]] = True
    below = np.maximum(tree.parent, 0)
    return ~trunk & (tree.parent >= 0) & trunk[below] & onward[below]


def thickest_branch_cm(tree: Skeleton) -> float:
    """Give the greatest diameter, under bark, at the base of a tree's branches; NaN without any."""
    bases = _branch_bases(tree)
    return 200.0 * float(tree.radius[bases].max()) if bases.any() else float("nan")


def compact_crown_ratio(tree: Skeleton) -> float:
    """Give the share of a tree's height above its third-lowest living branch.

    As inventories do, which look for the lowest whorl of three: one or two branches that outlived
    their neighbours are no crown. 0 with fewer branches.
    """
    feet = np.sort(tree.start[_branch_bases(tree), 2])
    height = float(tree.end[:, 2].max())
    return 1.0 - float(feet[_WHORL - 1]) / height if len(feet) >= _WHORL else 0.0


def measured(run: Run) -> dict[str, Any]:
    """Measure one plot in its last year; a row of `trial`."""
    last = int(run.years[-1])
    trees = run.read("trees", ["year", "tree_id", "status", "dbh_cm", "height_m", "crown_base_m"])
    trees = trees[(trees["status"].astype(str) == "living") & (trees["dbh_cm"] > 0.0)]
    now = trees[trees["year"] == last].sort_values("dbh_cm")
    stand = run.read("stand", ["year", "species", "n_ha", "qmd_cm", "top_height_m"])
    stand = stand[stand["species"].astype(str) == "all"].set_index("year")
    slenderness = 100.0 * now["height_m"] / now["dbh_cm"]
    few = max(int(FIFTH * len(now)), 1)
    grown = stand.index[stand["qmd_cm"] >= SMALL_CM]
    by_year = trees[trees["year"].isin(grown)].groupby("year")
    course = pd.Series({year: mean_tree_slenderness(of) for year, of in by_year}, dtype=float)
    shapes = [run.skeleton(i, last) for i in run.samples if last in run.sample_years(i)]
    branches = pd.Series([thickest_branch_cm(shape) for shape in shapes], dtype=float)
    crowns = pd.Series([compact_crown_ratio(shape) for shape in shapes], dtype=float)
    (species,) = run.species_names
    return {
        "species": species,
        "spacing_m": float(run.scenario.planting.spacing_m[0]),
        "n_ha": float(stand["n_ha"].iloc[-1]),
        "qmd_cm": float(stand["qmd_cm"].iloc[-1]),
        "top_height_m": float(stand["top_height_m"].iloc[-1]),
        "h_d_small": course.iloc[0] if len(course) else np.nan,
        "h_d_most": course.max(),
        "h_d_at_10cm": at_size(trees),
        "h_d": mean_tree_slenderness(now),
        "h_d_dominant": slenderness.tail(few).mean(),
        "h_d_suppressed": slenderness.head(few).mean(),
        "branch_cm": branches.mean(),
        "crown_ratio": crowns.mean(),
        "crown_ratio_leaves": (1.0 - now["crown_base_m"] / now["height_m"]).mean(),
    }


def trial(runs: forest.Sweep) -> pd.DataFrame:
    """Measure all plots of a trial.

    Returns
    -------
    DataFrame
        A row per run: `species`, `spacing_m`, `replicate`; living trees, mean diameter and top
        height; H/D of the mean tree in the year in which its diameter passed 5 cm (`h_d_small`),
        its greatest since (`h_d_most`), of all trees as they passed 10 cm, of the mean tree in the
        last year, of the thickest and of the thinnest fifth; mean over the sample trees of the
        thickest branch's diameter, cm, and of the compact crown's ratio; mean crown ratio of
        all trees from their lowest leaves (`crown_ratio_leaves`).
    """
    rows = []
    for _, row in runs.manifest[runs.manifest["status"] == "done"].iterrows():
        with forest.open_run(runs.folder / row["file"]) as run:
            rows.append({**measured(run), "replicate": row["replicate"]})
    if not rows:
        raise forest.InputError("no finished run", where=str(runs.folder))
    return pd.DataFrame(rows)


def means(table: pd.DataFrame) -> pd.DataFrame:
    """Average a trial over its seeds, with the standard deviations of what the rules are about."""
    groups = table.drop(columns="replicate").groupby(["species", "spacing_m"], sort=False)
    mean, sd = groups.mean(), groups.std()
    for name in ("h_d", "branch_cm", "crown_ratio"):
        mean.insert(mean.columns.get_loc(name) + 1, f"{name}_sd", sd[name])
    return mean.reset_index()


def _chain(values: pd.Series, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def _falls(values: pd.Series) -> bool:
    return bool((values.diff()[1:] < 0.0).all())


def _verdict(holds: bool, values: pd.Series) -> str:
    return "–" if values.isna().any() else "yes" if holds else "no"


def rules(table: pd.DataFrame) -> pd.DataFrame:
    """Say by the means over seeds whether the rules of a spacing trial hold.

    Returns
    -------
    DataFrame
        `species`, `rule`, `found` (from the densest to the widest spacing), `limit`, and `holds`:
        yes, no, or – where it was not measured or no limit is published.
    """
    rows = []
    for species, of in means(table).groupby("species", sort=False):
        of = of.sort_values("spacing_m")
        most, least = VERY_DENSE.get(str(species)), OPEN_GROWN.get(str(species))
        more = of["h_d_suppressed"] - of["h_d_dominant"]
        known = of["h_d_at_10cm"].dropna()
        densest = of["h_d_most"].head(1)
        for rule, found, digits, limit, verdict in (
            (
                "greatest H/D of the mean tree, densest",
                densest,
                0,
                "–" if most is None else f"at most {most:g}",
                "–" if most is None else _verdict(bool((densest <= most).all()), densest),
            ),
            (
                "H/D at 10 cm",
                known,
                0,
                "–" if least is None else f"at least {least:g}",
                "–" if least is None or known.empty else _verdict(known.min() >= least, known),
            ),
            ("H/D of the mean tree", of["h_d"], 0, "falls", _verdict(_falls(of["h_d"]), of["h_d"])),
            (
                "H/D, suppressed above dominant",
                more,
                0,
                "above 0",
                _verdict(bool((more > 0.0).all()), more),
            ),
            (
                "thickest branch, cm",
                of["branch_cm"],
                1,
                "rises",
                _verdict(_falls(-of["branch_cm"]), of["branch_cm"]),
            ),
            (
                "crown ratio, from the third branch",
                of["crown_ratio"],
                2,
                "rises",
                _verdict(_falls(-of["crown_ratio"]), of["crown_ratio"]),
            ),
            (
                "crown ratio, from the lowest leaves",
                of["crown_ratio_leaves"],
                2,
                "rises",
                _verdict(_falls(-of["crown_ratio_leaves"]), of["crown_ratio_leaves"]),
            ),
        ):
            rows.append((str(species), rule, _chain(found, digits), limit, verdict))
    return pd.DataFrame(rows, columns=["species", "rule", "found", "limit", "holds"])


def middle_tree(run: Run) -> Skeleton | None:
    """Give the sample tree that is of middle dbh among those that live in the last year."""
    last = int(run.years[-1])
    trees = run.read("trees", ["tree_id", "dbh_cm"], years=(last, last))
    there = [i for i in run.samples if last in run.sample_years(i)]
    of = trees[trees["tree_id"].isin(there)].sort_values("dbh_cm")
    return run.skeleton(int(of["tree_id"].iloc[len(of) // 2]), last) if len(of) else None


def _draw_tree(axes: Axes, tree: Skeleton, at_m: float) -> None:
    """Draw a tree from the side."""
    colour = look_of(tree.species)
    base = tree.start[0, 0]
    lines = np.stack([tree.start, tree.end], axis=1)[:, :, (0, 2)]
    lines[:, :, 0] += at_m - base
    wood = LineCollection(
        list(lines),
        linewidths=np.clip(60.0 * tree.radius, 0.15, None),
        colors=[colour.bark],
        capstyle="round",
    )
    axes.add_collection(wood)
    tips = tree.end[tree.leafy]
    axes.plot(
        tips[:, 0] - base + at_m, tips[:, 2], "o", ms=1.4, mew=0, color=colour.leaf, alpha=0.5
    )


def _draw_profile(axes: Axes, runs: forest.Sweep, table: pd.DataFrame, species: str) -> None:
    """Draw the middle tree of each spacing, of the first seed, side by side."""
    at, top = 0.0, 1.0
    done = runs.manifest[runs.manifest["status"] == "done"].reset_index(drop=True)
    here = table[(table["species"] == species) & (table["replicate"] == 0)]
    for place, row in here.sort_values("spacing_m").iterrows():
        with forest.open_run(runs.folder / done.loc[place, "file"]) as run:
            tree = middle_tree(run)
        if tree is None:
            continue
        _draw_tree(axes, tree, at)
        axes.text(at, -0.8, f"{row['spacing_m']:g} m", ha="center", va="top", fontsize=8)
        top = max(top, float(tree.end[:, 2].max()))
        at += _APART_M
    axes.axhspan(-0.6, 0.0, color="white", zorder=3)  # hides the round ends of the stems
    axes.set(
        xlim=(-0.6 * _APART_M, max(at - _APART_M, 0.0) + 0.6 * _APART_M),
        ylim=(-2.0, 1.05 * top),
        aspect="equal",
    )
    axes.set(xticks=[], title=plain(species))
    axes.spines["bottom"].set_visible(False)
    axes.spines["left"].set_bounds(0.0, top)


#: Panels over spacing: columns with their line styles, label of the axis.
_OVER_SPACING = (
    ((("h_d_suppressed", ":"), ("h_d", "-"), ("h_d_dominant", "--")), "H/D"),
    ((("branch_cm", "-"),), "thickest branch, cm"),
    ((("crown_ratio", "-"), ("crown_ratio_leaves", ":")), "crown ratio"),
)


def study(runs: forest.Sweep, table: pd.DataFrame | None = None) -> Study:
    """Draw the middle trees, and slenderness, branches and crowns over spacing.

    `table` is the trial, where it has been measured already.
    """
    table = trial(runs) if table is None else table
    names = list(table["species"].unique())
    figure = Figure(figsize=(8.2, 6.1), layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subfigures(2, 1, height_ratios=[1.25, 1.0])
    profiles = above.subplots(1, len(names), squeeze=False, sharey=True)[0]
    for axes, species in zip(profiles, names, strict=True):
        axes.spines[["top", "right"]].set_visible(False)
        _draw_profile(axes, runs, table, species)
    profiles[0].set_ylabel("height, m")
    mean = means(table)
    for axes, (columns, label) in zip(below.subplots(1, 3), _OVER_SPACING, strict=True):
        axes.spines[["top", "right"]].set_visible(False)
        for species in names:
            of, each = mean[mean["species"] == species], table[table["species"] == species]
            for column, style in columns:
                colour = look_of(species).line
                axes.plot(of["spacing_m"], of[column], style, color=colour, lw=1.6)
                axes.plot(each["spacing_m"], each[column], ".", color=colour, ms=4, alpha=0.6)
        axes.set(xlabel="spacing, m", ylabel=label, ylim=(0, None))
    slenderness = below.axes[0]
    slenderness.axhline(_UNSAFE, color="0.6", lw=0.8, zorder=0)
    for style, name in ((":", "thinnest fifth"), ("-", "mean tree"), ("--", "thickest fifth")):
        slenderness.plot([], [], style, color="0.3", label=name)
    slenderness.legend(frameon=False, fontsize=8)
    for style, name in (("-", "third branch"), (":", "lowest leaves")):
        below.axes[2].plot([], [], style, color="0.3", label=f"from the {name}")
    below.axes[2].legend(frameon=False, fontsize=8)
    return Study(figure, mean)


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of the sweep")
    parser.add_argument("--to", type=Path, required=True, help="figure to write: .png, .pdf, .svg")
    asked = parser.parse_args(words)
    try:
        runs = forest.open_sweep(asked.folder)
        table = trial(runs)
        made = study(runs, table)
        save(made.figure, asked.to)
    except forest.InputError as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    for shown in (made.numbers, rules(table)):
        print(shown.to_string(index=False, float_format=lambda value: f"{value:.3g}"))


if __name__ == "__main__":
    main()
