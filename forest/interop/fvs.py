"""A run's tables under the column names of FVS_TreeList and FVS_Summary2, in FVS' units.

Names and meanings are those of the Forest Vegetation Simulator's output database, as its source
makes them (dbsqlite/dbstrls.f and dbssumry.f at github.com/USDAForestService).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from forest.interop.mapping import (
    CM_PER_INCH,
    HA_PER_ACRE,
    M_PER_FOOT,
    SPECIES_CODES,
    Filled,
    ForeignTable,
    plot_hectares,
    yearly_loss,
)

if TYPE_CHECKING:
    import pandas as pd

    from forest.record.run import Run

_FT2 = M_PER_FOOT**2
_FT3 = M_PER_FOOT**3
_DEATHS = ("died", "windthrown")

_CASE = ("`CaseID`", "the key of a case of FVS")

TREELIST = ForeignTable(
    "FVS",
    "FVS_TreeList",
    "A tree and year: the living, then those that died or were thrown in the year, whose `TPA` is "
    "0. `DBH` is at 1.3 m, not at 4.5 feet, and missing below that height.",
    (
        Filled("StandID", "", "name of the run file", lambda r: r["stand_id"]),
        Filled("Year", "calendar year", "`trees.year`", lambda r: r["year"]),
        Filled("PrdLen", "years", "1: the growth is a year's", lambda r: r["period"]),
        Filled("TreeId", "", "`trees.tree_id`", lambda r: r["tree_id"].astype(str)),
        Filled(
            "SpeciesPLANTS",
            "",
            "`trees.species`; its PLANTS symbol, if FVS knows the species",
            lambda r: r["species"].astype(str).map(_plants),
        ),
        Filled("TPA", "1/acre", "expansion by `plot.size_m`; 0 for the dead", lambda r: r["tpa"]),
        Filled(
            "MortPA", "1/acre", "the same for the dead, 0 for the living", lambda r: r["mort_pa"]
        ),
        Filled("DBH", "in", "`trees.dbh_cm`", lambda r: r["dbh_cm"] / CM_PER_INCH),
        Filled(
            "DG",
            "in",
            "twice `trees.ring_width_mm`: the year's growth of the diameter inside bark",
            lambda r: 2.0 * r["ring_width_mm"] / (10.0 * CM_PER_INCH),
        ),
        Filled("Ht", "ft", "`trees.height_m`", lambda r: r["height_m"] / M_PER_FOOT),
        Filled(
            "HtG",
            "ft",
            "`trees.height_m` less that of the year before",
            lambda r: r["height_growth_m"] / M_PER_FOOT,
        ),
        Filled(
            "PctCr",
            "%",
            "share of `trees.height_m` above `trees.crown_base_m`",
            lambda r: 100.0 * (1.0 - r["crown_base_m"] / r["height_m"]),
        ),
        Filled(
            "CrWidth",
            "ft",
            "twice `trees.crown_radius_m`",
            lambda r: 2.0 * r["crown_radius_m"] / M_PER_FOOT,
        ),
        Filled(
            "BAPctile",
            "%",
            "share of the basal area in trees that are not thicker",
            lambda r: 100.0 * (1.0 - r["thicker_m2ha"] / r["total_m2ha"]),
        ),
        Filled(
            "PtBAL",
            "ft2/acre",
            "basal area of the thicker trees",
            lambda r: r["thicker_m2ha"] * HA_PER_ACRE / _FT2,
        ),
        Filled(
            "TCuFt",
            "ft3",
            "`trees.stem_volume_m3`, over bark",
            lambda r: r["stem_volume_m3"] / _FT3,
        ),
        Filled(
            "MCuFt",
            "ft3",
            "`trees.merchantable_volume_m3`",
            lambda r: r["merchantable_volume_m3"] / _FT3,
        ),
        Filled("TreeAge", "years", "`trees.age`", lambda r: r["age"]),
    ),
    (
        _CASE,
        ("`TreeIndex`, `PtIndex`, `ActPt`", "places in FVS' memory and sample points"),
        ("`SpeciesFVS`, `SpeciesFIA`", "codes of FVS' variants and of the American inventory"),
        ("`TreeVal`, `SSCD`, `MistCD`, `MDefect`, `BDefect`, `TruncHt`, `EstHt`", "not simulated"),
        ("`BdFt`, `Ht2TDCF`, `Ht2TDBF`", "sawlog rules of FVS' regions"),
    ),
)

SUMMARY = ForeignTable(
    "FVS",
    "FVS_Summary2",
    "A year, at its end and after its fellings. `PrdLen` and `Mort` tell, as in FVS, of the "
    "period that follows; in the last year they are 0.",
    (
        Filled("StandID", "", "name of the run file", lambda r: r["stand_id"]),
        Filled("Year", "calendar year", "`stand.year`", lambda r: r["year"]),
        Filled(
            "RmvCode",
            "",
            "2 (after removal) if `stand.removed_ha` is above 0, else 0",
            lambda r: np.where(r["removed_ha"] > 0.0, 2, 0),
        ),
        Filled("Tpa", "1/acre", "`stand.n_ha`", lambda r: r["n_ha"] * HA_PER_ACRE),
        Filled(
            "TPrdTpa",
            "1/acre",
            "`stand.n_ha` and all `stand.removed_ha` so far",
            lambda r: (r["n_ha"] + r["removed_ha"].cumsum()) * HA_PER_ACRE,
        ),
        Filled(
            "BA",
            "ft2/acre",
            "`stand.basal_area_m2ha`",
            lambda r: r["basal_area_m2ha"] * HA_PER_ACRE / _FT2,
        ),
        Filled("SDI", "1/acre", "`stand.sdi`, Reineke's", lambda r: r["sdi"] * HA_PER_ACRE),
        Filled("ReinekeSDI", "1/acre", "the same", lambda r: r["sdi"] * HA_PER_ACRE),
        Filled(
            "TopHt",
            "ft",
            "`stand.top_height_m`: of the 100 thickest per ha, where FVS takes 40 per acre",
            lambda r: r["top_height_m"] / M_PER_FOOT,
        ),
        Filled("QMD", "in", "`stand.qmd_cm`", lambda r: r["qmd_cm"] / CM_PER_INCH),
        Filled(
            "TCuFt",
            "ft3/acre",
            "`stand.volume_m3ha`",
            lambda r: r["volume_m3ha"] * HA_PER_ACRE / _FT3,
        ),
        Filled(
            "TPrdTCuFt",
            "ft3/acre",
            "`stand.volume_m3ha` and all `stand.removed_volume_m3ha` so far",
            lambda r: (r["volume_m3ha"] + r["removed_volume_m3ha"].cumsum()) * HA_PER_ACRE / _FT3,
        ),
        Filled(
            "MCuFt",
            "ft3/acre",
            "sum of `trees.merchantable_volume_m3`",
            lambda r: r["merchantable_m3ha"] * HA_PER_ACRE / _FT3,
            ("trees",),
        ),
        Filled("PrdLen", "years", "years to the next row", lambda r: r["period"]),
        Filled(
            "Mort",
            "ft3/acre/year",
            "`events.volume_m3` of the trees that die or are thrown in the next year",
            lambda r: r["dies_next_m3ha"] * HA_PER_ACRE / _FT3,
            ("events",),
        ),
    ),
    (
        _CASE,
        ("`Age`, `MAI`", "a stand of trees of all ages has none"),
        (
            "`RTpa`, `RTCuFt`, `RMCuFt`, `RSCuFt`, `RBdFt`",
            "FVS writes them in a row before the removal; `TPrdTpa` and `TPrdTCuFt` less the "
            "standing tell what was removed",
        ),
        ("`Acc`", "its growth of survivors is not told apart from that of the dead"),
        ("`ZeideSDI`, `SDIMax`, `RDSDI`, `GMD`, `CCF`", "not computed"),
        (
            "`TPrdMCuFt`, `SCuFt`, `TPrdSCuFt`, `BdFt`, `TPrdBdFt`",
            "sawlog rules of FVS' regions; of felled trees the stem volume is known",
        ),
        ("`ForTyp`, `SizeCls`, `StkCls`", "classes of the American inventory"),
    ),
)


def fvs_treelist(run: Run) -> pd.DataFrame:
    """Give the tree table under the names and in the units of FVS_TreeList.

    Parameters
    ----------
    run : Run
        With a tree table; its event table adds the year's dead.

    Returns
    -------
    pandas.DataFrame
        A row per tree and year; the columns are those of `TREELIST`.

    Raises
    ------
    InputError
        If the run stored no tree table.
    """
    import pandas as pd

    expansion = HA_PER_ACRE / plot_hectares(run)
    living = _in_double(run.read("trees"))
    living["height_growth_m"] = living.groupby("tree_id")["height_m"].diff()
    living = living.join(_competition(living, plot_hectares(run)))
    rows = living.assign(tpa=expansion, mort_pa=0.0)
    if "events" in run.tables:
        events = _in_double(run.read("events"))
        dead = events[events["kind"].isin(_DEATHS)].rename(columns={"volume_m3": "stem_volume_m3"})
        dead = dead[["year", "tree_id", "species", "dbh_cm", "height_m", "stem_volume_m3"]]
        rows = pd.concat([rows, dead.assign(tpa=0.0, mort_pa=expansion)], ignore_index=True)
        rows = rows.sort_values("year", kind="stable", ignore_index=True)
    return TREELIST.fill(rows.assign(stand_id=run.path.stem, period=1), run)


def fvs_summary(run: Run) -> pd.DataFrame:
    """Give the stand table under the names and in the units of FVS_Summary2.

    Parameters
    ----------
    run : Run
        With a stand table; its tree and event tables fill further columns.

    Returns
    -------
    pandas.DataFrame
        A row per year, of all species together; the columns are those of `SUMMARY`.

    Raises
    ------
    InputError
        If the run stored no stand table.
    """
    rows = run.read("stand")
    rows = rows[rows["species"] == "all"].reset_index(drop=True)
    rows["stand_id"] = run.path.stem
    rows["period"] = rows["year"].shift(-1, fill_value=rows["year"].max()) - rows["year"]
    if "trees" in run.tables:
        trees = run.read("trees", ["year", "merchantable_volume_m3"])
        volume = trees.groupby("year")["merchantable_volume_m3"].sum()
        per_hectare = volume.reindex(rows["year"], fill_value=0.0).to_numpy() / plot_hectares(run)
        rows["merchantable_m3ha"] = per_hectare
    if "events" in run.tables:
        dies = yearly_loss(run, _DEATHS)
        rows["dies_next_m3ha"] = dies.shift(-1, fill_value=0.0).reindex(rows["year"]).to_numpy()
    return SUMMARY.fill(rows, run)


def _in_double(rows: pd.DataFrame) -> pd.DataFrame:
    """Widen what is stored in single precision before it is converted."""
    return rows.astype(dict.fromkeys(rows.select_dtypes("float32"), np.float64))


def _competition(trees: pd.DataFrame, hectares: float) -> pd.DataFrame:
    """Sum the basal area of each tree's year, and of its thicker trees, m2/ha."""
    import pandas as pd

    area = trees["basal_area_m2"] / hectares
    dbh = trees["dbh_cm"].fillna(0.0)
    total = area.groupby(trees["year"]).transform("sum")
    of_size = area.groupby([trees["year"], dbh]).sum()
    up_to = of_size.groupby(level=0).cumsum()
    not_thicker = up_to.reindex(pd.MultiIndex.from_arrays([trees["year"], dbh])).to_numpy()
    # Subtraction leaves a rounding error where no tree is thicker.
    thicker = np.maximum(total - not_thicker, 0.0)
    return pd.DataFrame({"total_m2ha": total, "thicker_m2ha": thicker})


def _plants(species: str) -> str | None:
    return SPECIES_CODES[species].plants if species in SPECIES_CODES else None
