"""Steering a young stand towards old-growth structure (Hart & Baker 2003, section 1.1).

    python scenarios/steering_old_growth.py --out out/steering

Hart & Baker name "the task of re-creating old-growth effects in a new forest" through "selective
human intervention", with measurements from old forests as the goal. Here a planted stand is grown
twice: left alone, and with the thinnings, gaps, plantings and girdled trees of
steering_old_growth.toml. Every ten years both are held against a target: the diameters of an uncut
old stand (Leak 1996, see analysis/old_growth.py), and the share of the ground in canopy gaps that
Runkle (1982) found in old-growth forests. Snags, lying wood, thick trees and layers stand beside.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

import forest  # noqa: E402
from analysis import old_growth, thinning  # noqa: E402
from analysis.common import panels, save  # noqa: E402
from forest.measure.diameter_target import DiameterTarget, reverse_j  # noqa: E402
from forest.measure.tables import plot_of  # noqa: E402
from scenarios.common import command_line, draw_map, one_line_errors, report  # noqa: E402

SCENARIO = Path(__file__).with_suffix(".toml")
#: Canopy openings covered this share of old-growth mesic forests (Runkle 1982, Ecology 63).
GAP_SHARE = 0.095
STEP_YEARS = 10
STYLES = {"left alone": ("tab:gray", "--"), "steered": ("black", "-")}


def target() -> DiameterTarget:
    """Give the diameters of the old stand that the study of old growth takes as its target."""
    preset = {name: value for name, (value, _) in old_growth.TARGET.items()}
    return reverse_j(preset["q"], preset["basal_area"], preset["largest"])


def load(years: int | None, seed: int | None) -> forest.Scenario:
    """Read the scenario, perhaps for fewer years and without the treatments after them."""
    data: dict[str, Any] = tomllib.loads(SCENARIO.read_text())
    data["years"] = data["years"] if years is None else years
    data["seed"] = data["seed"] if seed is None else seed
    end = data["start_year"] + data["years"]
    data["acts"] = [act for act in data["acts"] if act.get("year", act.get("from_year")) < end]
    deaths = data["mortality"]["events"]
    data["mortality"]["events"] = [death for death in deaths if death["year"] < end]
    return forest.Scenario(**data)


def by_decade(run: forest.Run, goal: DiameterTarget) -> pd.DataFrame:
    """Hold a run against the target every ten years, the last one among them.

    Returns
    -------
    DataFrame
        By `age` of the stand: `overlap` with the target's diameters, 0 to 1; `gap_share`;
        `big_ha`, trees of 50 cm or more; `layers`; `snags_ha`; `dead_m3ha`, standing and lying;
        `n_ha` and `basal_area_m2ha` of all trees; `felled_m3ha` so far.
    """
    big = old_growth.TARGET["big"][0]
    found = old_growth.table(run, goal, big).set_index("year")
    found = found[["overlap", "gap_share", "big_ha", "layers"]]
    whole = [
        table[table["species"].astype(str) == "all"].set_index("year")
        for table in (run.deadwood, run.stand)
    ]
    dead, stand = whole
    found["snags_ha"] = dead["snags_ha"]
    found["dead_m3ha"] = dead["standing_m3ha"] + dead["lying_m3ha"]
    found[["n_ha", "basal_area_m2ha"]] = stand[["n_ha", "basal_area_m2ha"]]
    found["felled_m3ha"] = stand["removed_volume_m3ha"].cumsum()
    found = found[(int(run.years[-1]) - found.index) % STEP_YEARS == 0]
    found.index = pd.Index(found.index - int(run.years[0]) + 1, name="age")
    return found


def nearness(tables: dict[str, pd.DataFrame], since: int) -> pd.DataFrame:
    """Say how near each stand was to the target from an age on: means over decades, and the end.

    Returns
    -------
    DataFrame
        A row per stand: mean and last overlap of diameters, and how far the share of gaps was off
        the target's, as mean and at last.
    """
    rows = []
    for name, table in tables.items():
        of = table[table.index >= since]
        off = (of["gap_share"] - GAP_SHARE).abs()
        rows.append(
            {
                "stand": name,
                "overlap_mean": of["overlap"].mean(),
                "overlap_last": of["overlap"].iloc[-1],
                "gaps_off_mean": off.mean(),
                "gaps_off_last": off.iloc[-1],
            }
        )
    return pd.DataFrame(rows)


def treatments(run: forest.Run) -> pd.DataFrame:
    """List what was felled: a row per year and kind of act that took trees."""
    if "treatments" not in run.tables:
        return pd.DataFrame()
    done = thinning.treatments(run)
    done = done[done["removed_ha"] > 0.0]
    return done[["year", "kind", "n_before", "removed_ha", "g_before", "g_after", "ratio"]]


def draw(
    runs: dict[str, forest.Run], tables: dict[str, pd.DataFrame], goal: DiameterTarget, since: int
) -> Figure:
    """Draw the stand before, both at the end, their diameters, and the way to the target.

    Stems are four times as thick as they are.
    """
    figure, (maps, below) = panels(3, 2, size=(4.2, 4.0))
    steered = runs["steered"]
    first, last = int(steered.years[0]), int(steered.years[-1])
    start = min(first + since - 1, last)
    for axes, name, year in zip(
        maps, ("steered", "left alone", "steered"), (start, last, last), strict=True
    ):
        trees = runs[name].read("trees", years=(year, year)).sort_values("height_m")
        title = f"age {year - first + 1}" + ("" if year == start else f", {name}")
        draw_map(axes, trees, steered.scenario.plot.size_m, title, 4.0)
    diameters, overlap, open_ = below
    diameters.stairs(goal.n_ha, goal.limits_cm, fill=True, color="0.85", label="target")
    hectares = plot_of(steered.scenario).hectares
    for name, (colour, line) in STYLES.items():
        dbh = runs[name].read("trees", ["dbh_cm"], years=(last, last))["dbh_cm"]
        width = goal.limits_cm[1] - goal.limits_cm[0]
        most = max(float(np.nanmax(dbh, initial=0.0)), goal.limits_cm[-1]) + width
        count, edges = np.histogram(dbh.dropna(), np.arange(goal.limits_cm[0], most, width))
        diameters.stairs(count / hectares, edges, color=colour, ls=line, lw=1.4, label=name)
        table = tables[name]
        overlap.plot(table.index, table["overlap"], color=colour, ls=line, label=name)
        open_.plot(table.index, 100.0 * table["gap_share"], color=colour, ls=line)
    diameters.set_yscale("symlog", linthresh=10.0)
    diameters.set(xlabel="dbh, cm", ylabel="trees per ha, 5-cm classes", ylim=(0, None))
    diameters.set_title(f"age {last - first + 1}", fontsize=maps[0].title.get_fontsize())
    diameters.legend(frameon=False, fontsize=8)
    overlap.set(xlabel="age, years", ylabel="overlap with the target's diameters", ylim=(0, 1))
    overlap.legend(frameon=False, fontsize=8)
    open_.axhline(100.0 * GAP_SHARE, color="0.8", lw=4, zorder=0, label="old growth")
    open_.legend(frameon=False, fontsize=8)
    for axes in (overlap, open_):
        axes.axvline(since, color="0.8", lw=0.8, zorder=0)
    open_.set(xlabel="age, years", ylabel="ground in canopy gaps, %", ylim=(0, 40))
    return figure


def main(words: Sequence[str] | None = None) -> None:
    """Grow both stands, print how near they come to the target, and draw them."""
    parser = command_line(__doc__, "steering")
    parser.add_argument("--years", type=int, help="years to grow; default: the scenario's")
    asked = parser.parse_args(words)
    goal = target()
    with one_line_errors():
        scenario = load(asked.years, asked.seed)
        asked.out.mkdir(parents=True, exist_ok=True)
        ways = {
            "left alone": scenario.with_overrides(["acts=[]", "mortality.events=[]"]),
            "steered": scenario,
        }
        runs = {
            name: forest.simulate(
                way,
                asked.out / f"{name.replace(' ', '_')}.h5",
                threads=asked.threads,
                overwrite=True,
                progress=True,
            )
            for name, way in ways.items()
        }
        since = min((act.year for act in scenario.acts if act.year), default=scenario.start_year)
        since -= scenario.start_year
        tables = {name: by_decade(run, goal) for name, run in runs.items()}
        both = pd.concat(tables, names=["stand"]).reset_index()
        report(treatments(runs["steered"]), asked.out / "treatments.csv", "what was felled")
        report(both, asked.out / "by_decade.csv", f"every {STEP_YEARS} years")
        heading = f"nearness to the target from age {since} on; gaps there: {GAP_SHARE:g}"
        report(nearness(tables, since), asked.out / "nearness.csv", heading)
        save(draw(runs, tables, goal, since), asked.out / "steering_old_growth.png")
        for run in runs.values():
            run.close()


if __name__ == "__main__":
    main()
