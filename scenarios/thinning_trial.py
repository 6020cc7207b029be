"""A thinning trial: one pine stand left alone, or thinned in five ways, three seeds each.

    python scenarios/thinning_trial.py --out out/thinning

A thinning does not make wood: light that felled trees leave is taken up by the others, and where it
is moderate the stand produces as much as one left alone, in fewer and thicker trees, and the wood
that would have died is sold. Where it is heavy, light falls on the ground. The tallest trees hardly
notice either. The ways:

* moderate, from below: every ten years the thinnest trees with 12 % of the basal area;
* heavy, from below: the same with 30 %;
* crown thinning, from above: the strongest competitors of the 300 thickest trees per ha, with 12 %;
* thickest, from above: every ten years the thickest trees with 12 %, as who needs money fells;
* geometric: every third row at 24 years, nothing later.

The script grows all plots (files that are there already are kept), prints the trial and draws it;
production is read from the files as `analysis/thinning.py` does.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from analysis.common import panels, save  # noqa: E402
from analysis.thinning import basal_area, production  # noqa: E402
from scenarios.common import one_line_errors, report  # noqa: E402
from scenarios.trials import as_asked, grow_all, trial_line  # noqa: E402

SCENARIO = Path(__file__).with_suffix(".toml")
EVERY_TEN_YEARS = "kind='thin', when='age >= 28', wait_years=10, at_most=5"
#: The acts of each way; None for the scenario file's own.
WAYS: dict[str, str | None] = {
    "unthinned": "[]",
    "moderate_below": None,
    "heavy_below": f"[{{{EVERY_TEN_YEARS}, method='below', share_g=0.3}}]",
    "crown": f"[{{{EVERY_TEN_YEARS}, method='selective', crop_trees_ha=300, crop_spacing_m=3, "
    "share_g=0.12}]",
    "above": f"[{{{EVERY_TEN_YEARS}, method='above', share_g=0.12}}]",
    "geometric": "[{kind='thin', when='age >= 24', at_most=1, method='geometric', every_row=3}]",
}
LABELS = {
    "unthinned": "unthinned",
    "moderate_below": "moderate, from below",
    "heavy_below": "heavy, from below",
    "crown": "crown thinning, from above",
    "above": "thickest, from above",
    "geometric": "geometric",
}
COLOURS = ("0.45", "tab:green", "tab:red", "tab:purple", "tab:blue", "tab:orange")
FATES = {"standing": 0.35, "removed": 0.9, "dead": 0.12}


def stands(base: forest.Scenario) -> dict[str, forest.Scenario]:
    """Give the stand under each way of thinning, by name."""
    made = {}
    for name, acts in WAYS.items():
        made[name] = base.with_overrides([] if acts is None else [f"acts={acts}"])
    return made


def measured(run: forest.Run) -> dict[str, Any]:
    """Measure one run at its end: a row of `trial`."""
    stand = run.read("stand")
    every = stand[stand["species"].astype(str) == "all"]
    last, volumes, events = every.iloc[-1], production(run).iloc[-1], run.events
    removed = events[(events["kind"] == "felled") & events["dbh_cm"].notna()]
    return {
        "n_ha": last["n_ha"],
        "qmd_cm": last["qmd_cm"],
        "top_height_m": last["top_height_m"],
        "basal_area_m2ha": last["basal_area_m2ha"],
        "felled_ha": every["removed_ha"].sum(),
        "felled_cm": np.sqrt((removed["dbh_cm"] ** 2).mean()) if len(removed) else np.nan,
        "died_ha": every["deaths_ha"].sum(),
        **{f"{fate}_m3ha": volumes[fate] for fate in FATES},
        "total_m3ha": volumes["total"],
    }


def trial(runs: forest.Sweep) -> pd.DataFrame:
    """Measure all runs: `way`, `replicate`, and the stand, the losses and the production."""
    rows = []
    for _, row in runs.manifest.iterrows():
        with forest.open_run(runs.folder / row["file"]) as run:
            rows.append({"way": row["scenario"], "replicate": row["replicate"], **measured(run)})
    return pd.DataFrame(rows)


def means(table: pd.DataFrame) -> pd.DataFrame:
    """Average a trial over its seeds; totals with their standard deviation, per cent of unthinned.

    Returns
    -------
    DataFrame
        The columns of `trial`; `total_sd`, m3/ha; and `total_%`, `top_height_%`, `qmd_%` and
        `died_%` of the unthinned stands' means.
    """
    groups = table.drop(columns="replicate").groupby("way", sort=False)
    mean = groups.mean()
    mean["total_sd"] = groups["total_m3ha"].std()
    alone = mean.loc["unthinned"]
    for column in ("total_m3ha", "top_height_m", "qmd_cm", "died_ha"):
        mean[f"{column.rsplit('_', 1)[0]}_%"] = 100.0 * mean[column] / alone[column]
    return mean.reset_index()


def draw_courses(axes: Sequence[Axes], runs: forest.Sweep) -> None:
    """Draw basal area, mean diameter and top height of the first seed of each way over age."""
    for name, colour in zip(WAYS, COLOURS, strict=True):
        of = runs.manifest[runs.manifest["scenario"] == name].iloc[0]
        with forest.open_run(runs.folder / of["file"]) as run:
            area, stand = basal_area(run), run.read("stand")
        every = stand[stand["species"].astype(str) == "all"].set_index("year")
        start = every.index[0] - 1
        for axis, of_year in zip(axes, (area, every["qmd_cm"], every["top_height_m"]), strict=True):
            axis.plot(of_year.index - start, of_year, color=colour, lw=1.4, label=LABELS[name])
    for axis, label in zip(
        axes, ("basal area, m²/ha", "mean diameter Dq, cm", "top height, m"), strict=True
    ):
        axis.set(xlabel="age, years", ylabel=label, ylim=(0, None))
    axes[0].legend(frameon=False, fontsize=8)


def draw_production(axes: Axes, mean: pd.DataFrame) -> None:
    """Draw what stands, was felled and died, one bar for each way, with the totals' spread."""
    at, bottom = np.arange(len(mean)), np.zeros(len(mean))
    for fate, strength in FATES.items():
        height = mean[f"{fate}_m3ha"].to_numpy()
        shade = [(colour, strength) for colour in COLOURS]
        axes.bar(at, height, 0.7, bottom=bottom, color=shade, edgecolor="0.3", lw=0.5)
        for x, low, tall in zip(at, bottom, height, strict=True):
            if tall > 0.05 * mean["total_m3ha"].max():
                axes.text(x, low + 0.5 * tall, fate, ha="center", va="center", fontsize=6)
        bottom += height
    axes.errorbar(at, bottom, mean["total_sd"].fillna(0.0), fmt="none", ecolor="k", capsize=3)
    axes.set_xticks(at, [LABELS[name].replace(" ", "\n") for name in mean["way"]], fontsize=7)
    axes.set(ylabel="stem volume produced, m³/ha")


def draw(runs: forest.Sweep, mean: pd.DataFrame) -> Figure:
    """Draw the courses of the stands, and what they produced."""
    figure, axes = panels(2, 2)
    draw_courses(axes.flat[:3], runs)
    draw_production(axes.flat[3], mean)
    return figure


def main(words: Sequence[str] | None = None) -> None:
    """Grow the trial, print what came of it and draw it."""
    asked = trial_line(__doc__, "thinning").parse_args(words)
    with one_line_errors():
        runs = grow_all(stands(as_asked(forest.Scenario.load(SCENARIO), asked)), asked)
        mean = means(trial(runs))
        save(draw(runs, mean), asked.out / "thinning_trial.png")
        report(mean, asked.out / "thinning_trial.csv")


if __name__ == "__main__":
    main()
