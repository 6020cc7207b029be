"""An old oak in a young pine plantation: what it costs the pines, what its felling gives back.

`python scenarios/retained_oak.py` grows retained_oak.toml three times: as it is, with the oak
felled at half time; with the oak left standing; and without one. It prints the pines' height and
growth by distance from the oak, and draws them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import common
import numpy as np
import pandas as pd

import forest

SCENARIO = Path(__file__).with_suffix(".toml")
PLOTS = {
    "oak felled": (),
    "oak kept": ("acts=[]",),
    "no oak": ("acts=[]", "residual_trees=[]"),
}
COLOURS = {"oak felled": "#c0392b", "oak kept": "#2c3e50", "no oak": "#95a5a6"}
#: The same tree of two plots is drawn so far apart, m.
_APART_M = 0.22
#: Growth is told over so many years.
GROWTH_YEARS = 4


def grow(scenario: forest.Scenario, to: Path, threads: int | None) -> pd.DataFrame:
    """Grow a plot; give its trees, with their distance from the oak's place."""
    with forest.simulate(scenario, out=to, overwrite=True, threads=threads) as run:
        return run.trees[["year", "tree_id", "x_m", "y_m", "dbh_cm", "height_m"]]


def add_distance(trees: pd.DataFrame, scenario: forest.Scenario) -> pd.DataFrame:
    """Add how far each tree stands from the oak, on the torus."""
    oak = scenario.residual_trees[0]
    apart = np.abs(trees[["x_m", "y_m"]].to_numpy(np.float64) - [oak.x_m, oak.y_m])
    apart = np.minimum(apart, np.array(scenario.plot.size_m) - apart)
    return trees.assign(from_oak_m=np.hypot(*apart.T))


def by_distance(
    trees: pd.DataFrame, rings_m: Sequence[float], years: Sequence[int]
) -> pd.DataFrame:
    """Average the trees of some years by rings around the oak.

    Returns
    -------
    DataFrame
        A row per year and ring: living trees, their mean dbh and height, and their height growth
        per year over the `GROWTH_YEARS` before.
    """
    height = trees.pivot(index="tree_id", columns="year", values="height_m")
    parts = []
    for year in years:
        now = trees[trees["year"] == year].set_index("tree_id")
        growth = (height[year] - height[year - GROWTH_YEARS]) / GROWTH_YEARS
        now = now.assign(growth_m=growth.reindex(now.index))
        ring = pd.cut(now["from_oak_m"], list(rings_m), right=False)
        found = now.groupby(ring, observed=False).agg(
            n=("height_m", "size"),
            dbh_cm=("dbh_cm", "mean"),
            height_m=("height_m", "mean"),
            growth_m=("growth_m", "mean"),
        )
        found.insert(0, "year", year)
        found.insert(1, "ring_m", [f"{r.left:g}-{r.right:g}" for r in found.index])
        parts.append(found.reset_index(drop=True))
    return pd.concat(parts, ignore_index=True)


def draw(plots: dict[str, pd.DataFrame], scenario: forest.Scenario, felled: int, to: Path) -> None:
    """Draw heights by distance before the felling and in the end, and growth near the oak."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    last = scenario.calendar[-1]
    oak = forest.Stand(scenario).residual.trees[0]
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.2))
    # Until the felling the plots that have an oak are one: its dots would lie on each other.
    before = {"oak kept": "oak, both plots", "no oak": "no oak"}
    after = {name: name for name in ("oak kept", "no oak", "oak felled")}
    for axis, year, groups in zip(axes, (felled - 1, last), (before, after), strict=False):
        axis.axvspan(0.0, oak.crown_radius_m, color="#d9efe0", lw=0, zorder=0)
        for k, (name, label) in enumerate(groups.items()):
            now = plots[name][plots[name]["year"] == year]
            beside = now["from_oak_m"] + _APART_M * (k - 0.5 * (len(groups) - 1))
            axis.scatter(beside, now["height_m"], s=7, color=COLOURS[name], label=label)
        axis.set(title=f"{year}", xlabel="distance from the oak, m", ylabel="height of pines, m")
        axis.set(xlim=(0, None), ylim=(0, None))
        axis.legend(fontsize=8, loc="lower right")
    for name, trees in plots.items():
        near = trees[trees["from_oak_m"] < oak.crown_radius_m]
        height = near.pivot(index="tree_id", columns="year", values="height_m")
        growth = height.diff(axis=1).mean()
        if name == "oak felled":
            growth = growth[growth.index >= felled - 1]  # before, it is the plot whose oak is kept
        axes[2].plot(growth, color=COLOURS[name], label=name)
    axes[2].axvline(felled - 0.5, color="0.5", ls=":")
    axes[2].set(
        title="pines under the crown",
        xlabel="year",
        ylabel="height growth, m per year",
        ylim=(0, None),
    )
    axes[2].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(to, dpi=110)
    plt.close(figure)


def main(words: Sequence[str] | None = None) -> None:
    """Grow, print and draw."""
    parser = common.command_line(__doc__, "retained_oak")
    parser.add_argument("--set", action="append", default=[], help="key=value of the scenario")
    given = parser.parse_args(words)
    with common.one_line_errors():
        scenario = forest.Scenario.load(SCENARIO, given.set, seed=given.seed)
        given.out.mkdir(parents=True, exist_ok=True)
        felled = scenario.acts[0].year
        plots = {}
        for name, changes in PLOTS.items():
            to = given.out / f"{name.replace(' ', '_')}.h5"
            trees = grow(scenario.with_overrides(changes), to, given.threads)
            plots[name] = add_distance(trees, scenario)
        edge = 0.5 * min(scenario.plot.size_m)
        rings = np.linspace(0.0, edge, 5)
        tables = [
            by_distance(trees, rings, (felled - 1, scenario.calendar[-1])).assign(plot=name)
            for name, trees in plots.items()
        ]
        table = pd.concat(tables, ignore_index=True)
        common.report(table, given.out / "retained_oak.csv", "pines by distance from the oak")
        draw(plots, scenario, felled, given.out / "retained_oak.png")


if __name__ == "__main__":
    main()
