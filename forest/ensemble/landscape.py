"""The plots of a sweep read as one landscape: which species and stages hold how much of its area.

Every finished run is a plot and counts by its area. Plots know nothing of each other: no seed or
shade passes between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from forest.ensemble.manifest import DONE
from forest.errors import InputError
from forest.measure.stages import STAGES, development_stage

if TYPE_CHECKING:
    import pandas as pd

    from forest.ensemble.sweep import Sweep

#: The dominant species of a plot on which none has a basal area worth the name.
NONE = "none"

#: Least basal area of a plot that has a dominant species, m2/ha.
LEAST_BASAL_AREA_M2HA = 1.0

_AVERAGED = ("n_ha", "basal_area_m2ha", "volume_m3ha", "biomass_tha", "top_height_m")
_READ = ("year", "species", "qmd_cm", *_AVERAGED)


@dataclass(frozen=True)
class Landscape:
    """Many plots over the years.

    Attributes
    ----------
    plots : pandas.DataFrame
        A row per plot and year: `run` (its name), `scenario`, settings, `replicate`, `seed`,
        `area_ha`, `year`, `dominant` (the species with the largest share of basal area, or
        ``"none"``), `dominant_share` (NaN where none), `stage` (`forest.measure.stages`), `changed`
        (whether this year another species became dominant than the last one that was), and
        `top_height_m`, `qmd_cm`, `basal_area_m2ha`, `n_ha`, `volume_m3ha`, `biomass_tha`.
    by_species : pandas.DataFrame
        A row per plot, year and species that the plot's scenario names: `run`, `area_ha`, `year`,
        `species`, `basal_area_m2ha`, `volume_m3ha`, `biomass_tha` and `share` of the plot's basal
        area (NaN where it has none).
    """

    plots: pd.DataFrame
    by_species: pd.DataFrame

    @cached_property
    def years(self) -> tuple[int, ...]:
        """The calendar years of the plots, ascending."""
        return tuple(int(year) for year in sorted(self.plots["year"].unique()))

    @cached_property
    def totals(self) -> pd.DataFrame:
        """The whole landscape, a row per year.

        `plots` and `area_ha` that have the year; of stems, basal area, volume, biomass and top
        height the mean by area under the column's own name, and ``..._sd``, the standard deviation
        between plots (NaN of one plot); `turnover`, the share of the area on which another
        species has become dominant this year. A plot without trees has no top height.
        """
        import pandas as pd

        rows = []
        for year, of in self.plots.groupby("year"):
            area = of["area_ha"]
            row: dict[str, Any] = {"year": year, "plots": len(of), "area_ha": area.sum()}
            for name in _AVERAGED:
                has = of[name].notna()
                row[name] = _mean(of.loc[has, name], area[has])
                row[f"{name}_sd"] = of[name].std()
            row["turnover"] = area[of["changed"]].sum() / area.sum()
            rows.append(row)
        return pd.DataFrame(rows)

    @cached_property
    def dominants(self) -> pd.DataFrame:
        """Share of the area by dominant species: a row per year, a column per species and `none`.

        Species that nowhere dominate have no column.
        """
        found = set(self.plots["dominant"])
        names = [*dict.fromkeys(self.by_species["species"]), NONE]
        return self._shares_of_area("dominant", [name for name in names if name in found])

    @cached_property
    def stages(self) -> pd.DataFrame:
        """Share of the area by development stage: a row per year, a column per stage."""
        return self._shares_of_area("stage", list(STAGES))

    @cached_property
    def species(self) -> pd.DataFrame:
        """What each species has of the landscape, a row per year and species.

        `basal_area_m2ha`, `volume_m3ha` and `biomass_tha`: means by area over all plots, of which
        those that have not the species count as 0. `share` of the landscape's basal area;
        `plot_share` and `plot_share_sd`, mean and standard deviation of the plots' own shares, over
        plots that have any basal area.
        """
        import pandas as pd

        area = self.plots.groupby("year")["area_ha"].sum()
        stocked = self.plots["basal_area_m2ha"] > 0.0
        n = stocked.groupby(self.plots["year"]).sum()
        rows = []
        for (year, species), of in self.by_species.groupby(["year", "species"], sort=False):
            row: dict[str, Any] = {"year": year, "species": species}
            for name in ("basal_area_m2ha", "volume_m3ha", "biomass_tha"):
                row[name] = float(of[name] @ of["area_ha"]) / area[year]
            # plots whose scenario does not name the species have a share of 0
            shares = np.zeros(int(n[year]))
            own = of["share"].dropna().to_numpy()
            shares[: len(own)] = own
            row["plot_share"] = shares.mean() if len(shares) else np.nan
            row["plot_share_sd"] = shares.std(ddof=1) if len(shares) > 1 else np.nan
            rows.append(row)
        table = pd.DataFrame(rows).sort_values("year", kind="stable", ignore_index=True)
        ground = table["basal_area_m2ha"]
        whole = ground.groupby(table["year"]).transform("sum")
        table.insert(3, "share", ground / whole.where(whole > 0.0))
        return table

    def _shares_of_area(self, column: str, names: list[str]) -> pd.DataFrame:
        area = self.plots.pivot_table(
            index="year", columns=column, values="area_ha", aggfunc="sum", fill_value=0.0,
            observed=True,
        )  # fmt: skip
        area.columns = area.columns.astype(str)
        area = area.reindex(columns=names, fill_value=0.0)
        return area.div(area.sum(axis=1), axis=0)


def landscape(
    folder: str | Path, *, least_basal_area_m2ha: float = LEAST_BASAL_AREA_M2HA
) -> Landscape:
    """Read the folder of a sweep as a landscape, a plot for each finished run.

    Parameters
    ----------
    folder : path
        Of the sweep.
    least_basal_area_m2ha : float
        Basal area below which a plot has no dominant species.

    Raises
    ------
    InputError
        If the folder holds no sweep, or no finished run with a stand table, or the least basal area
        is below 0.
    """
    from forest.ensemble.sweep import open_sweep

    return landscape_of(open_sweep(folder), least_basal_area_m2ha=least_basal_area_m2ha)


def landscape_of(
    sweep: Sweep, *, least_basal_area_m2ha: float = LEAST_BASAL_AREA_M2HA
) -> Landscape:
    """Read a sweep as a landscape; see `landscape`."""
    import pandas as pd

    from forest.measure.tables import plot_of
    from forest.record.run import open_run

    if not least_basal_area_m2ha >= 0.0:
        raise InputError(
            f"{least_basal_area_m2ha}", where="least_basal_area_m2ha", expected="0 or more"
        )
    shown = ["scenario", *sweep.parameters, "replicate", "seed"]
    plots, by_species = [], []
    for _, row in sweep.manifest[sweep.manifest["status"] == DONE].iterrows():
        with open_run(sweep.folder / row["file"]) as run:
            if "stand" not in run.tables:
                continue
            table = run.read("stand", list(_READ))
            area = plot_of(run.scenario).hectares
        table["species"] = table["species"].astype(str)  # codes differ between scenarios
        named = {"run": row["run"], **{name: row[name] for name in shown}, "area_ha": area}
        whole, each = _plot(table, least_basal_area_m2ha)
        plots.append(_with_names(whole, named))
        by_species.append(_with_names(each, {"run": row["run"], "area_ha": area}))
    if not plots:
        raise InputError("no finished run holds a stand table", where=str(sweep.folder))
    joined = pd.concat(plots, ignore_index=True)
    joined["stage"] = pd.Categorical(joined["stage"], list(STAGES))
    return Landscape(joined, pd.concat(by_species, ignore_index=True))


def _plot(table: pd.DataFrame, least: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Read the stand table of a run: a row per year, and a row per year and species."""
    whole = table[table["species"] == "all"].set_index("year")
    each = table[table["species"] != "all"]
    total = whole["basal_area_m2ha"]
    ground = each.pivot(index="year", columns="species", values="basal_area_m2ha")
    ground = ground[list(dict.fromkeys(each["species"]))]  # in the scenario's order
    share = ground.div(total.where(total > 0.0), axis=0)
    largest = share.max(axis=1).where(total >= least)
    dominant = share.fillna(0.0).idxmax(axis=1).where(largest.notna(), NONE)
    rows = whole.drop(columns="species").assign(
        dominant=dominant,
        dominant_share=largest,
        stage=development_stage(whole["top_height_m"], whole["qmd_cm"], total),
        changed=_changes(dominant),
    )
    order = ["dominant", "dominant_share", "stage", "changed", "top_height_m", "qmd_cm",
             "basal_area_m2ha", "n_ha", "volume_m3ha", "biomass_tha"]  # fmt: skip
    each = each[["year", "species", "basal_area_m2ha", "volume_m3ha", "biomass_tha"]].copy()
    long = share.melt(ignore_index=False, value_name="share").reset_index()
    return rows[order].reset_index(), each.merge(long, on=["year", "species"])


def _changes(dominant: pd.Series[str]) -> pd.Series[bool]:
    """Mark the years in which another species became dominant than the last one that was."""
    known = dominant.where(dominant != NONE)
    before = known.ffill().shift()
    return known.notna() & before.notna() & (known != before)


def _with_names(table: pd.DataFrame, named: dict[str, Any]) -> pd.DataFrame:
    for place, (name, value) in enumerate(named.items()):
        table.insert(place, name, value)
    return table


def _mean(values: pd.Series[float], weights: pd.Series[float]) -> float:
    return float(values @ weights) / float(weights.sum()) if len(values) else float("nan")
