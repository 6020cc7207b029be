"""Thinning and harvest: what each treatment changed, which trees went, and what the stand produced.

    python analysis/thinning.py thinned.h5 --to thinning.png --against unthinned.h5

Production is what stands, and all that was felled or died until then: thinning seldom raises the
sum, but little of it is lost and it stands in fewer, thicker trees. `--against` draws another run,
best of the same scenario without acts (`--set acts=[]`).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import Study, panels, script  # noqa: E402
from forest.errors import InputError  # noqa: E402
from forest.measure.tables import plot_of  # noqa: E402
from forest.record.run import Run  # noqa: E402

CLASS_CM = 4.0
#: Where a volume ends up, by kind of event.
_FATES = {"felled": "removed", "died": "dead", "windthrown": "dead"}
_SHADES = {"standing": "0.8", "dead": "0.55", "removed": "0.25"}


def treatments(run: Run) -> pd.DataFrame:
    """Give a row for each treatment of the whole stand.

    Returns
    -------
    DataFrame
        `year`, `act`, `kind`; N, G, Dq and SDI before and after it; `removed_ha`,
        `removed_m3ha`; and `ratio`, the mean square diameter of what went per that of the stand
        before: below 1 from below, above 1 from above. NaN where no tree with a dbh went.
    """
    table = run.treatments
    whole = table[table["species"] == "all"].set_index(["year", "number"])
    before, after = (whole[whole["stage"] == stage] for stage in ("before", "after"))
    made = before[["act", "kind"]].astype({"kind": str})
    for name, column in (
        ("n", "n_ha"),
        ("g", "basal_area_m2ha"),
        ("dq", "qmd_cm"),
        ("sdi", "sdi"),
    ):
        made[f"{name}_before"], made[f"{name}_after"] = before[column], after[column]
    made["removed_ha"] = after["removed_ha"]
    made["removed_m3ha"] = after["removed_volume_m3ha"]
    events = run.events
    felled = events[(events["kind"] == "felled") & events["dbh_cm"].notna()]
    mean_square = (felled["dbh_cm"] ** 2).groupby(felled["year"]).mean()
    fells = made["kind"].isin(["fell", "thin", "harvest"]) & (made["removed_ha"] > 0.0)
    once = made[fells].groupby("year").size() == 1  # events do not say which act of a year it was
    years = pd.Index(made.index.get_level_values("year"))
    known = fells.to_numpy() & once.reindex(years, fill_value=False).to_numpy()
    went = np.sqrt(mean_square.reindex(years).to_numpy(np.float64))
    made["ratio"] = np.where(known, went / made["dq_before"], np.nan)
    return made.reset_index().drop(columns="number")


def removals(run: Run) -> pd.DataFrame:
    """Count felled and dead trees per ha by dbh class, cm; columns `removed` and `dead`."""
    events = run.events[run.events["dbh_cm"].notna()]
    fate = events["kind"].astype(str).map(_FATES).dropna()
    classes = (events.loc[fate.index, "dbh_cm"] // CLASS_CM * CLASS_CM).astype(float)
    counts = pd.crosstab(classes, fate) / plot_of(run.scenario).hectares
    return counts.reindex(columns=["removed", "dead"], fill_value=0.0)


def production(run: Run) -> pd.DataFrame:
    """Give stem volumes over time, m3/ha: `standing`, `removed` and `dead` so far, and `total`.

    Indexed by calendar year.
    """
    stand = run.read("stand", ["year", "species", "volume_m3ha"])
    made = pd.DataFrame(
        {"standing": stand[stand["species"] == "all"].set_index("year").volume_m3ha}
    )
    events = run.events
    fate = events["kind"].astype(str).map(_FATES)
    volume = events["volume_m3"] / plot_of(run.scenario).hectares
    for name in ("removed", "dead"):
        here = fate == name
        yearly = volume[here].groupby(events.loc[here, "year"]).sum()
        made[name] = yearly.reindex(made.index, fill_value=0.0).cumsum()
    made["total"] = made[["standing", "removed", "dead"]].sum(axis=1)
    return made


def basal_area(run: Run) -> pd.Series:
    """Give basal area, m2/ha, over time; before and after a treatment at the turn of its year."""
    stand = run.read("stand", ["year", "species", "basal_area_m2ha"])
    end = stand[stand["species"] == "all"].set_index("year")["basal_area_m2ha"]
    parts = [end]
    if "treatments" in run.tables:
        table = run.treatments
        whole = table[table["species"] == "all"]
        parts.append(whole.set_index(whole["year"] - 1)["basal_area_m2ha"])
    return pd.concat(parts).sort_index(kind="stable")


def study(run: Run, against: Run | None = None) -> Study:
    """Draw basal area and production over time, and the removals by diameter."""
    if "treatments" not in run.tables or run.treatments.empty:
        raise InputError("has no treatment", where=str(run.path), expected="a run with acts")
    numbers, volumes = treatments(run), production(run)
    figure, ((left, middle, right),) = panels(3)
    left.plot(basal_area(run), color="k", lw=1.5, label="treated")
    if against is not None:
        left.plot(basal_area(against), color="0.6", lw=1.2, ls="--", label="left alone")
        left.legend(frameon=False, fontsize=8)
    left.set(xlabel="calendar year", ylabel="basal area, m²/ha", ylim=(0, None))
    gone = removals(run)
    bottom = np.zeros(len(gone))
    for name in ("removed", "dead"):
        middle.bar(
            gone.index + 0.5 * CLASS_CM,
            gone[name],
            0.9 * CLASS_CM,
            bottom=bottom,
            color=_SHADES[name],
            label=name,
        )
        bottom += gone[name].to_numpy()
    middle.set(xlabel="dbh, cm", ylabel="trees per ha")
    middle.legend(frameon=False, fontsize=8)
    names = ["standing", "removed", "dead"]
    right.stackplot(
        volumes.index,
        volumes[names].T.to_numpy(),
        colors=[_SHADES[name] for name in names],
        labels=names,
        lw=0,
    )
    if against is not None:
        right.plot(production(against)["total"], color="k", lw=1.2, ls="--", label="left alone")
    right.set(xlabel="calendar year", ylabel="stem volume so far, m³/ha", ylim=(0, None))
    right.margins(x=0.0)
    right.legend(frameon=False, fontsize=8, loc="upper left")
    return Study(figure, numbers)


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words, against=True)


if __name__ == "__main__":
    main()
