"""Succession: who has the basal area over time, and how the stand renews itself.

    python analysis/succession.py run.h5 --to succession.png

Where the run has them, seedlings, dead wood, and the losses and ingrowth of stems of 10 cm are
drawn too.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.common import (  # noqa: E402
    LIGHT_DEMANDING,
    SHADE_TOLERANT,
    Study,
    enough,
    panels,
    plain,
    script,
)
from forest.record.run import Run  # noqa: E402
from forest.view.looks import look_of  # noqa: E402

#: From this dbh on a tree is a stem of the canopy's demography, cm.
STEM_CM = 10.0
#: Mean light of the floor below which it counts as shade.
SHADE = 0.10
#: Basal area from which shares are those of a stand, not of a few saplings, m2/ha.
LEAST_M2HA = 1.0
#: Years of a row of `turnover`.
SPAN_YEARS = 10
#: Years before the end over which a stand's demography is told.
LATE_YEARS = 100


def basal_areas(run: Run) -> pd.DataFrame:
    """Give basal area, m²/ha: a row per stand age, a column per species."""
    stand = run.read("stand", ["year", "species", "basal_area_m2ha"])
    stand["species"] = stand["species"].astype(str)
    wide = stand.pivot(index="year", columns="species", values="basal_area_m2ha")
    wide = wide[list(run.species_names)]
    wide.index = pd.RangeIndex(1, len(wide) + 1, name="age")
    return wide


def shares(area: pd.DataFrame, least_m2ha: float = 0.0) -> pd.DataFrame:
    """Give the species' shares, in the years in which all have more than a basal area together."""
    total = area.sum(axis=1)
    return area[total > least_m2ha].div(total[total > least_m2ha], axis=0)


def group(share: pd.DataFrame, names: Sequence[str]) -> pd.Series[float]:
    """Sum up the shares of those of some species that there are."""
    return share[[name for name in share if name in names]].sum(axis=1)


def overtaking(share: pd.DataFrame) -> int | None:
    """Give the age from which shade-tolerant species have more than the light-demanding ones."""
    light, shade = group(share, LIGHT_DEMANDING), group(share, SHADE_TOLERANT)
    behind = share.index[(shade <= light).to_numpy()]
    if not len(behind):
        return int(share.index[0])
    return None if behind[-1] == share.index[-1] else int(behind[-1]) + 1


def table(area: pd.DataFrame) -> pd.DataFrame:
    """Give each species' greatest share of basal area and the age at which it has it.

    Parameters
    ----------
    area : DataFrame
        See `basal_areas`.

    Returns
    -------
    DataFrame
        `species`, `peak_age`, `peak_share`, `last_share` and `last_m2ha`. Years with 1 m²/ha or
        less have no shares, unless there are no others.
    """
    share = shares(area, LEAST_M2HA)
    if not len(share):
        share = shares(area)
    return pd.DataFrame(
        {
            "species": share.columns,
            "peak_age": share.idxmax().to_numpy(),
            "peak_share": share.max().to_numpy(),
            "last_share": share.iloc[-1].to_numpy(),
            "last_m2ha": area.iloc[-1].to_numpy(),
        }
    )


def turnover(trees: pd.DataFrame, span: int = SPAN_YEARS) -> pd.DataFrame:
    """Give the losses and the ingrowth of stems of 10 cm, % of those of the year before a year.

    Parameters
    ----------
    trees : DataFrame
        `year`, `tree_id`, `dbh_cm` and `status` of `/trees`.
    span : int
        Years of a row; the last years that do not fill one have none.

    Returns
    -------
    DataFrame
        `age`, the stand's at the end of the span; `stems`, their mean number; `lost` and `grown`,
        % a year. Spans without stems are left out.
    """
    first = int(trees["year"].min())
    living = trees[trees["status"].astype(str) == "living"]
    big = living[living["dbh_cm"] >= STEM_CM]
    sets = {int(year): set(ids) for year, ids in big.groupby("year")["tree_id"]}
    alive = {int(year): set(ids) for year, ids in living.groupby("year")["tree_id"]}
    nobody: set[int] = set()
    rows = []
    for start in range(first, int(trees["year"].max()) - span + 1, span):
        before = lost = grown = 0
        for year in range(start + 1, start + span + 1):
            were, are = sets.get(year - 1, nobody), sets.get(year, nobody)
            before += len(were)
            lost += len(were - alive.get(year, nobody))
            grown += len(are - were)
        if before:
            rows.append(
                {
                    "age": start + span - first + 1,
                    "stems": before / span,
                    "lost": 100.0 * lost / before,
                    "grown": 100.0 * grown / before,
                }
            )
    return pd.DataFrame(rows, columns=["age", "stems", "lost", "grown"])


def seedling_survival(run: Run) -> pd.Series[float]:
    """Give the share of seedlings that outlive a year while the floor is in shade, by species.

    Of those that stood at the end of the year before; NaN for a species that had none.
    """
    rows = run.read("regeneration", ["year", "species", "n_ha", "died_ha"])
    floor = run.read("stand", ["year", "species", "floor_light"])
    floor = floor[floor["species"].astype(str) == "all"].set_index("year")["floor_light"]
    names = list(run.species_names)
    wide = rows.astype({"species": str}).pivot(index="year", columns="species")
    before, died = wide["n_ha"][names].shift(1), wide["died_ha"][names]
    dark = (floor.reindex(wide.index) < SHADE).to_numpy() & before.notna().all(axis=1).to_numpy()
    stood = before[dark].sum()
    return 1.0 - died[dark].sum() / stood.where(stood > 0.0)


def deaths_by_cause(run: Run) -> pd.DataFrame:
    """Count the stems of 10 cm that were lost: a row per species, a column per cause."""
    events = run.read("events", ["species", "kind", "cause", "dbh_cm"])
    lost = events["kind"].isin(["died", "windthrown", "felled"]) & (events["dbh_cm"] >= STEM_CM)
    of = events[lost]
    counts = pd.crosstab(of["species"].astype(str), of["cause"].astype(str))
    return counts.reindex([name for name in run.species_names if name in counts.index])


def holds(run: Run, name: str) -> bool:
    """Tell whether a run has rows of a table that its scenario may leave empty."""
    return name in run.tables and len(run.read(name, ["year"])) > 0


def by_species(run: Run) -> pd.DataFrame:
    """Give the table of shares, and what the run tells of seedlings and deaths beside it."""
    numbers = table(basal_areas(run))
    if holds(run, "regeneration"):
        numbers["seedlings_live"] = numbers["species"].map(seedling_survival(run))
    causes = deaths_by_cause(run)
    for cause in causes:
        numbers[str(cause)] = numbers["species"].map(causes[cause]).fillna(0).astype(int)
    return numbers


def pattern(run: Run) -> pd.DataFrame:
    """Set the stand's succession beside published figures.

    Returns
    -------
    DataFrame
        `what`, `value`, and `published`, text. Light and leaf area are of the last hundred years
        of the run, and so are losses and ingrowth; a stand younger than 60 has none of them.
    """
    area = basal_areas(run)
    share = shares(area, LEAST_M2HA)
    enough(share, "basal area of 1 m²/ha", run)
    passed = overtaking(share)
    rows: list[tuple[str, Any, str]] = []
    pioneers = [name for name in area if name in LIGHT_DEMANDING]
    if pioneers:
        first = str(area[pioneers].max().idxmax())
        peak = int(share[first].idxmax())
        rows.append((f"share of {plain(first)} is greatest at age", peak, "10 to 40"))
    rows += [
        (
            "tolerant pass light-demanding species at age",
            np.nan if passed is None else passed,
            "40 to 100",
        ),
        ("share of tolerant species at the end", group(share, SHADE_TOLERANT).iloc[-1], ""),
    ]
    stand = run.read("stand", ["year", "species", "lai", "floor_light", "basal_area_m2ha"])
    every = stand[stand["species"].astype(str) == "all"]
    late = every[60:].tail(LATE_YEARS)
    if len(late):
        rows += [
            ("basal area, m²/ha", late["basal_area_m2ha"].mean(), "33 beech, 55 to 70 spruce"),
            ("leaf area index", late["lai"].mean(), "5.5 deciduous, to 10 spruce"),
            ("light at the floor", late["floor_light"].mean(), "0.02 to 0.05"),
        ]
        trees = run.read("trees", ["year", "tree_id", "dbh_cm", "status"])
        moving = turnover(trees[trees["year"] >= late["year"].iloc[0]], len(late) - 1)
        for column, what in (("lost", "stems of 10 cm lost"), ("grown", "stems grown to 10 cm")):
            value = moving[column].iloc[0] if len(moving) else np.nan
            rows.append((f"{what}, % a year", value, "1.4 to 1.8"))
    return pd.DataFrame(rows, columns=["what", "value", "published"])


def _draw_shares(left: Axes, right: Axes, area: pd.DataFrame) -> None:
    total, share = area.sum(axis=1), shares(area)
    colours = [look_of(name).line for name in area]
    for name, colour in zip(area, colours, strict=True):
        left.plot(area[name], color=colour, lw=1.8, label=plain(name))
    left.plot(total, color="0.6", lw=1.0, ls="--", label="all")
    left.set(xlabel="stand age, years", ylabel="basal area, m²/ha", ylim=(0, 1.35 * total.max()))
    left.legend(frameon=False, fontsize=8, ncols=2, loc="upper left")
    right.stackplot(share.index, share.T.to_numpy(), colors=colours, lw=0)
    right.set(xlabel="stand age, years", ylabel="share of basal area", ylim=(0, 1))
    right.margins(x=0.0)
    passed = overtaking(share)
    if passed is not None and share.index[0] < passed:
        right.axvline(passed, color="k", lw=1.0, ls=":")


def _draw_light(axes: Axes, stand: pd.DataFrame) -> None:
    every = stand[stand["species"].astype(str) == "all"]
    age = np.arange(1, len(every) + 1)
    axes.plot(age, every["lai"], color="tab:green", lw=1.4)
    axes.set(xlabel="stand age, years", ylim=(0, None))
    axes.set_ylabel("leaf area index", color="tab:green")
    floor = axes.twinx()
    floor.plot(age, every["floor_light"], color="tab:orange", lw=1.4)
    floor.set(yscale="log", ylim=(0.01, 1.0))
    floor.set_ylabel("light at the floor", color="tab:orange")


def _draw_seedlings(axes: Axes, rows: pd.DataFrame) -> None:
    for name, of in rows.groupby("species", observed=True, sort=False):
        per_m2 = of["n_ha"].to_numpy() / 10_000.0
        smooth = pd.Series(per_m2).rolling(5, center=True, min_periods=1).mean()
        axes.plot(np.arange(1, len(of) + 1), smooth, color=look_of(str(name)).line, lw=1.4)
    axes.set(xlabel="stand age, years", ylabel="seedlings per m²", yscale="log", ylim=(1e-3, None))


def _draw_turnover(axes: Axes, trees: pd.DataFrame) -> None:
    moving = turnover(trees)
    axes.axhspan(1.4, 1.8, color="0.88", lw=0)
    axes.plot(moving["age"], moving["lost"], "o-", color="tab:red", ms=3, label="lost")
    axes.plot(moving["age"], moving["grown"], "o-", color="tab:green", ms=3, label="grown to it")
    axes.set(xlabel="stand age, years", ylabel="% a year of stems of 10 cm", ylim=(0, 8))
    axes.legend(frameon=False, fontsize=8)


def _draw_dead_wood(axes: Axes, dead: pd.DataFrame) -> None:
    every = dead[dead["species"].astype(str) == "all"]
    age = np.arange(1, len(every) + 1)
    axes.stackplot(
        age,
        every["lying_m3ha"],
        every["standing_m3ha"],
        colors=["#8c6d46", "#c9b18b"],
        labels=["lying", "standing"],
    )
    axes.set(xlabel="stand age, years", ylabel="dead wood, m³/ha")
    axes.legend(frameon=False, fontsize=8, loc="upper left")


def study(run: Run) -> Study:
    """Draw basal area and shares over stand age, and what the run tells of renewal."""
    area = basal_areas(run)
    total = area.sum(axis=1)
    enough(total[total > 0.0], "tree of 1.3 m", run)
    renews = holds(run, "regeneration")
    figure, axes = panels(3, 2) if renews else panels(2)
    axes = list(axes.flat)
    _draw_shares(axes[0], axes[1], area)
    if renews:
        _draw_light(axes[2], run.read("stand", ["species", "lai", "floor_light"]))
        _draw_seedlings(axes[3], run.read("regeneration", ["species", "n_ha"]))
        _draw_turnover(axes[4], run.read("trees", ["year", "tree_id", "dbh_cm", "status"]))
        if holds(run, "deadwood"):
            _draw_dead_wood(
                axes[5], run.read("deadwood", ["species", "standing_m3ha", "lying_m3ha"])
            )
        else:
            axes[5].set_axis_off()
    return Study(figure, by_species(run))


def main(words: Sequence[str] | None = None) -> None:
    """Read the command line, draw and print."""
    script(__doc__, study, words)


if __name__ == "__main__":
    main()
