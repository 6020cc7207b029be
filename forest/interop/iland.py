"""A run's tables under the column names of iLand's outputs `tree` and `stand`.

Names, units and meanings are those of iLand's output descriptions
(https://iland-model.org/Outputs).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forest.interop.mapping import (
    SPECIES_CODES,
    Filled,
    ForeignTable,
    cumulative_loss,
    plot_hectares,
)

if TYPE_CHECKING:
    import pandas as pd

    from forest.record.run import Run

_UNITS_OF_LAND = ("`ru`, `rid`", "a plot has no resource units")

TREE = ForeignTable(
    "iLand",
    "tree",
    "A living tree and year. iLand has trees from 4 m height; here all are listed.",
    (
        Filled("year", "calendar year", "`trees.year`", lambda r: r["year"]),
        Filled(
            "species",
            "",
            "`trees.species`; iLand's four letters for the species that it knows, else our name",
            lambda r: r["code"],
        ),
        Filled("id", "", "`trees.tree_id`", lambda r: r["tree_id"]),
        Filled("x", "m", "`trees.x_m`", lambda r: r["x_m"]),
        Filled("y", "m", "`trees.y_m`", lambda r: r["y_m"]),
        Filled("dbh", "cm", "`trees.dbh_cm`", lambda r: r["dbh_cm"]),
        Filled("height", "m", "`trees.height_m`", lambda r: r["height_m"]),
        Filled("basalArea", "m2", "`trees.basal_area_m2`", lambda r: r["basal_area_m2"]),
        Filled("volume_m3", "m3", "`trees.stem_volume_m3`", lambda r: r["stem_volume_m3"]),
        Filled("age", "years", "`trees.age`", lambda r: r["age"]),
        Filled("leafArea_m2", "m2", "`trees.leaf_area_m2`", lambda r: r["leaf_area_m2"]),
    ),
    (
        _UNITS_OF_LAND,
        (
            "`foliageMass`, `stemMass`, `branchMass`, `fineRootMass`, `coarseRootMass`, "
            "`reserve_kg`",
            "the tree table has the mass above ground as one number, and no roots",
        ),
        (
            "`lri`, `lightResponse`, `stressIndex`, `treeFlags`",
            "quantities of iLand's own model; our `light` is another one than its light index",
        ),
    ),
)

STAND = ForeignTable(
    "iLand",
    "stand",
    "A year and species, per hectare. iLand counts trees from 4 m height; here all count.",
    (
        Filled("year", "calendar year", "`stand.year`", lambda r: r["year"]),
        Filled("species", "", "`stand.species`, as in `tree`", lambda r: r["code"]),
        Filled("area_ha", "ha", "`plot.size_m` of the scenario", lambda r: r["area_ha"]),
        Filled("count_ha", "1/ha", "`stand.n_ha`", lambda r: r["n_ha"]),
        Filled("dbh_avg_cm", "cm", "`stand.mean_dbh_cm`", lambda r: r["mean_dbh_cm"]),
        Filled(
            "height_avg_m", "m", "mean of `trees.height_m`", lambda r: r["mean_height"], ("trees",)
        ),
        Filled("volume_m3", "m3/ha", "`stand.volume_m3ha`", lambda r: r["volume_m3ha"]),
        Filled(
            "gwl_m3",
            "m3/ha",
            "`stand.volume_m3ha` and `events.volume_m3` of all trees that died, were felled or "
            "thrown so far",
            lambda r: r["volume_m3ha"] + r["lost"],
            ("events",),
        ),
        Filled("basal_area_m2", "m2/ha", "`stand.basal_area_m2ha`", lambda r: r["basal_area_m2ha"]),
        Filled("LAI", "m2/m2", "`stand.lai`", lambda r: r["lai"]),
    ),
    (
        _UNITS_OF_LAND,
        ("`total_carbon_kg`, `NPP_kg`, `NPPabove_kg`", "iLand's include the roots; we have none"),
        ("`cohort_count_ha`", "regeneration is made of trees, not of cohorts"),
    ),
)

_LOST = ("died", "felled", "windthrown")


def iland_trees(run: Run) -> pd.DataFrame:
    """Give the tree table under the names of iLand's output `tree`.

    Parameters
    ----------
    run : Run
        With a tree table.

    Returns
    -------
    pandas.DataFrame
        A row per living tree and year; the columns are those of `TREE`.

    Raises
    ------
    InputError
        If the run stored no tree table.
    """
    rows = run.read("trees")
    return TREE.fill(rows.assign(code=_codes(rows)), run)


def iland_stand(run: Run) -> pd.DataFrame:
    """Give the stand table under the names of iLand's output `stand`.

    Parameters
    ----------
    run : Run
        With a stand table; its tree and event tables fill further columns.

    Returns
    -------
    pandas.DataFrame
        A row per year and species; the columns are those of `STAND`.

    Raises
    ------
    InputError
        If the run stored no stand table.
    """
    rows = run.read("stand")
    rows = rows[rows["species"] != "all"].reset_index(drop=True)
    rows = rows.assign(code=_codes(rows), area_ha=plot_hectares(run))
    if "trees" in run.tables:
        trees = run.read("trees", ["year", "species", "height_m"]).astype({"species": str})
        heights = trees.groupby(["year", "species"])["height_m"].mean()
        rows["mean_height"] = _look_up(rows, heights)
    if "events" in run.tables:
        rows["lost"] = _look_up(rows, cumulative_loss(run, _LOST).stack())
    return STAND.fill(rows, run)


def _codes(rows: pd.DataFrame) -> pd.Series:
    names = rows["species"].astype(str)
    return names.map(lambda name: SPECIES_CODES[name].iland if name in SPECIES_CODES else name)


def _look_up(rows: pd.DataFrame, by_year_and_species: pd.Series) -> pd.Series:
    """Find each row's value in a series over years and species; NaN where there is none."""
    import pandas as pd

    keys = pd.MultiIndex.from_arrays([rows["year"], rows["species"].astype(str)])
    return pd.Series(by_year_and_species.reindex(keys).to_numpy(), index=rows.index)
