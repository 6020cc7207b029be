"""A measured plot, and the same plot 20 years on: a table, and a picture of before and after.

python scenarios/inventory_continued.py --out out/inventory
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from analysis.common import panels, save  # noqa: E402
from scenarios.common import draw_map  # noqa: E402

SCENARIO = Path(__file__).with_suffix(".toml")
#: Rows of the printed table: column of `/stand`, what it is called.
ROWS = {
    "n_ha": "N, trees/ha",
    "qmd_cm": "Dq, cm",
    "basal_area_m2ha": "G, m²/ha",
    "top_height_m": "top height, m",
    "volume_m3ha": "V, m³/ha",
}
#: Width of a dbh class, cm.
CLASS_CM = 1.0


def stand_values(stand: forest.Stand) -> dict[str, float]:
    """Give the values of `ROWS` for a stand as it is now."""
    from forest.measure.stand import Flows, Plot, stand_rows

    rows, plot, kinds = stand.rows, stand.scenario.plot, len(stand.species)
    none = np.zeros(kinds, np.int64)
    columns = stand_rows(
        stand.year,
        stand.measure(),
        rows.x,
        rows.y,
        rows.species,
        Flows(none, none, none, np.zeros(kinds)),
        Plot(plot.size_m, plot.boundary == "periodic"),
        float("nan"),
    )
    return {name: float(columns[name][-1]) for name in ROWS}


def comparison(before: dict[str, float], run: forest.Run) -> pd.DataFrame:
    """Set the plot as measured beside the plot at the end."""
    stand = run.stand
    last = stand[(stand["species"].astype(str) == "all") & (stand["year"] == run.years[-1])].iloc[0]
    return pd.DataFrame(
        {
            "": list(ROWS.values()),
            f"start of {run.years[0]}": [before[name] for name in ROWS],
            f"end of {run.years[-1]}": [float(last[name]) for name in ROWS],
        }
    )


def draw(start: pd.DataFrame, end: pd.DataFrame, run: forest.Run) -> Figure:
    """Draw the maps before and after, and both distributions of dbh."""
    figure, ((left, middle, right),) = panels(3)
    size_m = run.scenario.plot.size_m
    draw_map(left, start, size_m, f"start of {run.years[0]}: {len(start)} trees")
    draw_map(middle, end, size_m, f"end of {run.years[-1]}: {len(end)} trees")
    thickest = max(np.nanmax(start["dbh_cm"]), np.nanmax(end["dbh_cm"]))
    edges = np.arange(-0.5, thickest / CLASS_CM + 1.5) * CLASS_CM  # whole centimetres amid classes
    for trees, label, style in ((start, "measured", "0.6"), (end, "simulated", "tab:green")):
        right.hist(trees["dbh_cm"].dropna(), edges, color=style, alpha=0.6, label=label)
    right.set(xlabel="dbh, cm", ylabel=f"trees per class of {CLASS_CM:g} cm")
    right.legend(frameon=False, fontsize=8)
    return figure


def main(words: Sequence[str] | None = None) -> None:
    """Build the plot, grow it, print the table and draw the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/inventory"), help="folder to fill")
    parser.add_argument("--years", type=int, help="years to grow; default: the scenario's")
    asked = parser.parse_args(words)
    try:
        scenario = forest.Scenario.load(SCENARIO)
        if asked.years is not None:
            scenario = scenario.with_overrides([f"years={asked.years}"])
        asked.out.mkdir(parents=True, exist_ok=True)
        stand = forest.Stand(scenario)
        start, before = stand.trees, stand_values(stand)
        to = asked.out / "inventory_continued.h5"
        with forest.simulate(scenario, to, overwrite=True, progress=True) as run:
            trees = run.trees
            end = trees[trees["year"] == run.years[-1]]
            save(draw(start, end, run), asked.out / "inventory_continued.png")
            table = comparison(before, run)
    except (forest.InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    print(table.to_string(index=False, float_format=lambda value: f"{value:.1f}"))


if __name__ == "__main__":
    main()
