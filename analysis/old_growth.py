"""How near a stand has come to old-growth structure: diameters, gaps, big trees, dead wood, layers.

    python analysis/old_growth.py run.h5 --to old_growth.png --q 1.3 --basal-area 35 --largest 80

Hart & Baker 2003 (section 1.1) name "the task of re-creating old-growth effects in a new forest"
through "selective human intervention": measurements from existing old-growth forests are the goal.
The target here is a reversed J (de Liocourt), as preset that of an uncut old-growth northern
hardwood stand, 28.2 m2/ha falling by q = 1.39 per 2 inches (Leak 1996), that is 1.383 per 5 cm; its
largest diameter, 70 cm, is chosen.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, enough, panels, script  # noqa: E402
from forest.measure.competition import species_profile  # noqa: E402
from forest.measure.diameter_target import CLASS_CM, DiameterTarget, reverse_j  # noqa: E402
from forest.measure.gaps import gaps  # noqa: E402
from forest.measure.tables import plot_of  # noqa: E402
from forest.record.run import Run  # noqa: E402

TARGET = {
    "q": (1.383, "quotient of neighbouring classes of 5 cm"),
    "basal_area": (28.2, "basal area of the target, m2/ha"),
    "largest": (70.0, "its largest diameter, cm"),
    "big": (50.0, "dbh from which on a tree is big, cm"),
}
STEP_YEARS = 5

#: Smaller openings are spaces between neighbours' crowns, m2.
LEAST_GAP_M2 = 5.0

#: Rate at which dead stems decay, per year: 0.032 (pine) to 0.054 (beech), Herrmann et al. 2015.
DECAY_PER_YEAR = 0.04

_TREES = ("year", "x_m", "y_m", "dbh_cm", "height_m", "crown_radius_m")
_YEARS_DRAWN = 4


def effective_layers(height_m: Sequence[float]) -> float:
    """Give the number of layers, 1 to 3, that trees fill evenly: exp of Shannon over Pretzsch's.

    These are the top fifth of the greatest height, the 30 % below and the lower half.
    """
    height = np.asarray(height_m, np.float64)
    return float(np.exp(species_profile(height, np.zeros(len(height)))))


def dead_wood(run: Run) -> pd.Series[float]:
    """Give the stem volume of trees that died or were thrown, m3/ha, less what has decayed.

    Of every year of the run; wood that lay there before it began is not known, and felled stems
    are taken away.
    """
    events = run.read("events", ["year", "kind", "volume_m3"])
    left = events[events["kind"].isin(["died", "windthrown"])]
    years = range(int(run.years[0]), int(run.years[-1]) + 1)
    came = left.groupby("year")["volume_m3"].sum().reindex(years, fill_value=0.0)
    stock, volume = [], 0.0
    for added in came:
        volume = volume * np.exp(-DECAY_PER_YEAR) + added
        stock.append(volume)
    return pd.Series(stock, came.index) / plot_of(run.scenario).hectares


def table(run: Run, target: DiameterTarget, big_cm: float) -> pd.DataFrame:
    """Measure every fifth year, the last one among them.

    Returns
    -------
    DataFrame
        `year`; `overlap_n`, `overlap_g` and their geometric mean `overlap` with the target
        (`forest.measure.diameter_target`); `gap_share` in gaps of 5 m2 or more, and the area of the
        `largest_gap_m2`; `big_ha`, trees of `big_cm` or more; `dead_wood_m3ha`; `layers`. Years
        without trees are left out.
    """
    plot = plot_of(run.scenario)
    trees = run.read("trees", list(_TREES))
    dead = dead_wood(run)
    last = int(run.years[-1])
    rows = []
    for year, of in trees.groupby("year"):
        if (last - int(year)) % STEP_YEARS:
            continue
        found = gaps(of, plot)
        rows.append(
            {
                "year": int(year),
                **target.agreement(of["dbh_cm"], plot.hectares)._asdict(),
                "gap_share": found.share(least_m2=LEAST_GAP_M2),
                "largest_gap_m2": float(found.area_m2.max(initial=0.0)),
                "big_ha": float((of["dbh_cm"] >= big_cm).sum()) / plot.hectares,
                "dead_wood_m3ha": dead[year],
                "layers": effective_layers(of["height_m"]),
            }
        )
    return pd.DataFrame(rows)


def study(
    run: Run,
    *,
    q: float = TARGET["q"][0],
    basal_area: float = TARGET["basal_area"][0],
    largest: float = TARGET["largest"][0],
    big: float = TARGET["big"][0],
) -> Study:
    """Draw diameters beside the target, and what tells old growth over the years."""
    target = reverse_j(q, basal_area, largest)
    thick = run.read("trees", ["dbh_cm"])["dbh_cm"]
    enough(thick[thick >= target.limits_cm[0]], f"tree of {target.limits_cm[0]:g} cm", run)
    numbers = table(run, target, big)
    figure, axes = panels(2, 2, size=(4.6, 3.2))
    _draw_diameters(axes[0, 0], run, target, numbers["year"])
    year = numbers["year"]
    overlap, canopy, old = axes[0, 1], axes[1, 0], axes[1, 1]
    overlap.plot(year, numbers["overlap"], "k", lw=1.8, label="both")
    overlap.plot(year, numbers["overlap_n"], "k--", lw=1.0, label="number of trees")
    overlap.plot(year, numbers["overlap_g"], "k:", lw=1.0, label="basal area")
    overlap.set(xlabel="calendar year", ylabel="overlap with the target", ylim=(0, 1))
    overlap.legend(frameon=False, fontsize=8)
    canopy.plot(year, 100.0 * numbers["gap_share"], "k", label="area in gaps, %")
    canopy.set(xlabel="calendar year", ylabel="area in gaps, %", ylim=(0, 100))
    _beside(canopy, year, numbers["layers"], "layers", (1.0, 3.0))
    old.plot(year, numbers["dead_wood_m3ha"], "k")
    old.set(xlabel="calendar year", ylabel="dead wood, m³/ha", ylim=(0, None))
    _beside(old, year, numbers["big_ha"], f"trees of {big:g} cm per ha", (0.0, None))
    return Study(figure, numbers)


def _draw_diameters(axis: Any, run: Run, target: DiameterTarget, years: pd.Series[int]) -> None:
    """Draw the classes of some years, pale to black, and the target as bars."""
    hectares = plot_of(run.scenario).hectares
    axis.stairs(target.n_ha, target.limits_cm, fill=True, color="0.85", label="target")
    place = np.unique(np.linspace(0, len(years) - 1, _YEARS_DRAWN).round().astype(int))
    for k, shade in zip(place, np.linspace(0.7, 0.0, len(place)), strict=True):
        year = int(years.iloc[k])
        dbh = run.read("trees", ["dbh_cm"], years=(year, year))["dbh_cm"]
        classes = target.classes(dbh, hectares)
        to = classes["to_cm"].replace(np.inf, target.limits_cm[-1] + CLASS_CM)
        edges = np.append(classes["from_cm"], to.iloc[-1])
        axis.stairs(classes["n_ha"], edges, color=str(shade), lw=1.4, label=str(year))
    axis.set_yscale("symlog", linthresh=10.0)
    axis.set(xlabel="dbh, cm", ylabel="trees per ha, 5-cm classes", ylim=(0, None))
    axis.legend(frameon=False, fontsize=8)


def _beside(axis: Any, x: Any, values: Any, label: str, limits: tuple[float, float | None]) -> None:
    """Plot on an axis of its own to the right, dashed."""
    other = axis.twinx()
    other.plot(x, values, "k--", lw=1.2)
    other.set(ylabel=f"{label} (dashed)", ylim=limits)
    other.spines["top"].set_visible(False)


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words, TARGET)


if __name__ == "__main__":
    main()
