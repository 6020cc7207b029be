"""A road cut through a grown stand, and the storm of the year after (Hart & Baker 2003, 6.2).

`python scenarios/road_cut_and_storm.py` grows road_cut_and_storm.toml until its last year, fells
a strip across the wind, and lets a storm blow that few of the trees left do not withstand as it
begins; a copy keeps its trees. It
prints what winds the trees withstand and which fell, by distance from the new edge and by
slenderness, and draws both stands and the profile behind the road.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

import forest

SCENARIO = Path(__file__).with_suffix(".toml")
OUTCOMES = ("stood", "broken", "uprooted")
COLOURS = {"broken": "#c0392b", "uprooted": "#7d3c98"}


@dataclass(frozen=True)
class Storm:
    """A stand in a storm.

    Attributes
    ----------
    trees : DataFrame
        The rows of `/storms`, with `from_edge_m`, how far downwind of the road a tree stands;
        `critical_m_s`, the wind that it did not withstand when the storm began; and `slenderness`.
    height_m : float
        Mean height of the hundred thickest trees per hectare.
    """

    trees: pd.DataFrame
    height_m: float


def grow(scenario: forest.Scenario) -> forest.Stand:
    """Grow a stand until the year before its last."""
    stand = forest.Stand(scenario)
    for _ in range(scenario.years - 1):
        stand.step()
    return stand


def cut_road(stand: forest.Stand, road_m: float) -> int:
    """Fell the trees whose x is below the width of a road; give their number."""
    trees = stand.trees
    ids = trees.loc[trees["x_m"] < road_m, "tree_id"].tolist()
    stand.fell(ids)
    return len(ids)


def critical(stand: forest.Stand) -> pd.Series:
    """The least wind along x that each tree does not withstand, m/s, by tree id."""
    winds = stand.critical_wind(0.0).set_index("tree_id")
    return winds[["critical_break_m_s", "critical_uproot_m_s"]].min(axis=1)


def weather_storm(stand: forest.Stand, speed_m_s: float, road_m: float) -> Storm:
    """Let a storm blow along x, and grow the stand's last year."""
    before = critical(stand)
    stand.blow(speed_m_s, 0.0)
    record = stand.step()
    trees = pd.DataFrame(record.tables["storms"])
    trees["outcome"] = [OUTCOMES[code] for code in trees["outcome"]]
    trees["critical_m_s"] = trees["tree_id"].map(before)
    trees["from_edge_m"] = trees["x_m"] - road_m
    trees["slenderness"] = 100.0 * trees["height_m"] / trees["dbh_cm"]
    height = float(record.tables["stand"]["top_height_m"][-1])
    return Storm(trees, height)


def by_distance(cut: Storm, uncut: Storm, zone_m: float) -> pd.DataFrame:
    """Compare the two stands by distance from the new edge.

    Returns
    -------
    DataFrame
        A row per zone: trees, median critical wind with and without road, their ratio, and the
        shares of trees that fell, and of those that fell before others had exposed them.
    """
    last = cut.trees["from_edge_m"].max()
    zones = np.arange(0.0, last + zone_m, zone_m)

    def zone(storm: Storm) -> pd.Series:
        return pd.cut(storm.trees["from_edge_m"], zones, right=False)

    there, where = zone(cut), zone(uncut)
    fell = cut.trees["outcome"].ne("stood")
    table = pd.DataFrame(
        {
            "trees": cut.trees.groupby(there, observed=False).size(),
            "critical_m_s": cut.trees["critical_m_s"].groupby(there, observed=False).median(),
            "without_road": uncut.trees["critical_m_s"].groupby(where, observed=False).median(),
            "fell": fell.groupby(there, observed=False).mean(),
            "fell_first": cut.trees["round"].eq(1).groupby(there, observed=False).mean(),
            "fell_without": uncut.trees["outcome"]
            .ne("stood")
            .groupby(where, observed=False)
            .mean(),
        }
    )
    table.insert(3, "ratio", table["critical_m_s"] / table["without_road"])
    return table


def by_slenderness(storm: Storm) -> pd.DataFrame:
    """Count what became of trees by H/D: a row per class, a column per outcome."""
    classes = pd.cut(storm.trees["slenderness"], [0, 60, 70, 80, 90, np.inf], right=False)
    counts = pd.crosstab(classes, storm.trees["outcome"], dropna=False)
    return counts.reindex(columns=list(OUTCOMES), fill_value=0)


def draw(cut: Storm, uncut: Storm, zones: pd.DataFrame, road_m: float, to: Path) -> None:
    """Draw both stands from above and the profile behind the road."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(3, 1, figsize=(8, 10), height_ratios=[4, 4, 3])
    shown = {"without road": uncut, f"behind a road of {road_m:g} m": cut}
    worst = np.nanquantile(uncut.trees["critical_m_s"], 0.9)
    for axis, (name, storm) in zip(axes, shown.items(), strict=False):
        trees = storm.trees
        size = 0.35 * trees["dbh_cm"] ** 2
        marks = axis.scatter(
            trees["x_m"], trees["y_m"], s=size, c=trees["critical_m_s"], vmin=0, vmax=worst
        )
        for outcome, colour in COLOURS.items():
            lost = trees["outcome"].eq(outcome)
            axis.scatter(
                trees["x_m"][lost],
                trees["y_m"][lost],
                s=size[lost] + 12,
                facecolors="none",
                edgecolors=colour,
                linewidths=1.6,
                label=f"{outcome} ({lost.sum()})",
            )
        axis.set(title=name, ylabel="y, m", aspect="equal")
        axis.legend(loc="upper left", fontsize=8)
        figure.colorbar(marks, ax=axis, label="critical wind, m/s", shrink=0.6)
    if road_m > 0.0:
        axes[1].axvspan(0.0, road_m, color="0.9", zorder=0)
    middle = [zone.mid for zone in zones.index]
    profile = axes[2]
    profile.plot(middle, zones["without_road"], "o--", color="0.6", label="without road")
    profile.plot(middle, zones["critical_m_s"], "o-", color="black", label="behind the road")
    profile.set(
        xlabel="distance from the edge, m", ylabel="median critical wind, m/s", ylim=(0, None)
    )
    profile.legend(loc="lower right", fontsize=8)
    share = profile.twinx()
    width = 0.6 * (middle[1] - middle[0]) if len(middle) > 1 else 1.0
    share.bar(middle, zones["fell"], width=width, color=COLOURS["broken"], alpha=0.3)
    share.set(ylabel="share of trees that fell", ylim=(0, 1))
    figure.tight_layout()
    figure.savefig(to, dpi=110)
    plt.close(figure)


def main(words: Sequence[str] | None = None) -> None:
    """Grow, cut, blow, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scenario", type=Path, default=SCENARIO, help="what to grow")
    parser.add_argument("--road", type=float, default=30.0, help="width of the road, m (30)")
    parser.add_argument(
        "--weak",
        type=float,
        default=0.05,
        help="share of the trees behind the road that do not withstand the storm as it begins"
        " (0.05)",
    )
    parser.add_argument("--out", type=Path, default=Path(), help="folder for picture and table")
    parser.add_argument("--set", action="append", default=[], help="key=value of the scenario")
    given = parser.parse_args(words)
    scenario = forest.Scenario.load(given.scenario).with_overrides(given.set)
    uncut = grow(scenario)
    cut = forest.Stand.restore(scenario, *uncut.state())
    felled = cut_road(cut, given.road)
    speed = float(critical(cut).quantile(given.weak))
    with_road = weather_storm(cut, speed, given.road)
    without = weather_storm(uncut, speed, given.road)
    zones = by_distance(with_road, without, zone_m=5.0)
    print(
        f"top height {without.height_m:.1f} m; road of {given.road:g} m: {felled} trees felled; "
        f"storm of {speed:.1f} m/s"
    )
    print("\nby distance from the new edge\n", zones.round(2).to_string(), sep="")
    print("\nby slenderness H/D, behind the road\n", by_slenderness(with_road).to_string(), sep="")
    rounds = int(with_road.trees["round"].max())
    print(f"\nthe storm went on for {rounds} rounds of trees that fell and exposed others")
    given.out.mkdir(parents=True, exist_ok=True)
    draw(with_road, without, zones, given.road, given.out / "road_cut_and_storm.png")
    with_road.trees.to_csv(given.out / "road_cut_and_storm.csv", index=False)
    print(f"wrote {given.out / 'road_cut_and_storm.png'} and .csv")


if __name__ == "__main__":
    main()
