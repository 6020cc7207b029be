"""Biomass by compartment and carbon, above ground: of trees, of the stand, and through the years.

All follow from the columns of `/trees`. `biomass_kg` there is the wood of stem and branches and
the leaves; bark comes on top of it here, at the density of the wood, for species have no other.
Roots are not modelled.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import pandas as pd

    from forest.record.run import Run

#: Carbon per dry mass.
CARBON_SHARE = 0.5

_KG_PER_TONNE = 1000.0


class Compartments(NamedTuple):
    """Dry mass of each tree's parts above the ground, kg, arrays of one entry per tree."""

    stem_wood_kg: NDArray[np.float64]
    branch_wood_kg: NDArray[np.float64]
    bark_kg: NDArray[np.float64]  # of stem and branches
    leaves_kg: NDArray[np.float64]
    above_ground_kg: NDArray[np.float64]  # the sum of these
    carbon_kg: NDArray[np.float64]  # half of it


def compartments(
    biomass_kg: ArrayLike,
    stem_volume_m3: ArrayLike,
    leaf_area_m2: ArrayLike,
    *,
    bark_factor: ArrayLike,
    density_kg_m3: ArrayLike,
    sla_m2_kg: ArrayLike,
) -> Compartments:
    """Divide trees into stem wood, branch wood, bark and leaves.

    Parameters
    ----------
    biomass_kg, stem_volume_m3, leaf_area_m2 : array_like
        Columns of `/trees`: wood and leaves; stem over bark; leaf area.
    bark_factor, density_kg_m3, sla_m2_kg : array_like
        Of each tree's species.

    Notes
    -----
    Branch wood is what is left of the biomass, and so has the rounding of all of it.
    """
    keep = (1.0 - np.asarray(bark_factor, np.float64)) ** 2
    density = np.asarray(density_kg_m3, np.float64)
    stem = np.asarray(stem_volume_m3, np.float64) * keep * density
    leaves = np.asarray(leaf_area_m2, np.float64) / np.asarray(sla_m2_kg, np.float64)
    branches = np.maximum(np.asarray(biomass_kg, np.float64) - leaves - stem, 0.0)
    bark = (stem + branches) * (1.0 / keep - 1.0)
    total = stem + branches + bark + leaves
    return Compartments(stem, branches, bark, leaves, total, CARBON_SHARE * total)


def stand_biomass(trees: pd.DataFrame, hectares: float) -> pd.DataFrame:
    """Sum the compartments of measured trees per hectare.

    Parameters
    ----------
    trees : pandas.DataFrame
        As `forest.measure.tables.measure_run` gives it.
    hectares : float
        Area of the plot.

    Returns
    -------
    pandas.DataFrame
        A row per species and a last one, `all`; columns as those of `Compartments`, but in t/ha
        (`stem_wood_tha`).
    """
    names = list(Compartments._fields)
    by_species = trees.groupby("species", observed=True)[names].sum()
    by_species.index = by_species.index.astype(str)
    by_species.loc["all"] = by_species.sum()
    by_species /= _KG_PER_TONNE * hectares
    by_species.columns = [name.replace("_kg", "_tha") for name in names]
    return by_species.reset_index(names="species")


def carbon_table(run: Run) -> pd.DataFrame:
    """Tell the carbon ledger and the stock beside it, in tonnes of carbon per hectare.

    Parameters
    ----------
    run : Run
        With the tables `carbon` and `stand`.

    Returns
    -------
    pandas.DataFrame
        A row per year and species, and one for all: `year`, `species`; the ledger, a year's
        `income_tcha`, `leaves_tcha`, `upkeep_tcha`, `extension_tcha`, `ring_tcha` and
        `reserve_change_tcha`; `growth_tcha`, what became leaves and wood; and `stock_tcha`, the
        carbon in wood and leaves of the living at the end of the year.

    Notes
    -----
    Income = leaves + upkeep + extension + ring + reserve change, every year.
    """
    ledger = ["income", "leaves", "upkeep", "extension", "ring", "reserve_change"]
    table = run.read("carbon")
    stand = run.read("stand", ["year", "species", "biomass_tha"])
    table[ledger] *= CARBON_SHARE / _KG_PER_TONNE
    table = table.rename(columns={name: f"{name}_tcha" for name in ledger})
    table["growth_tcha"] = table[["leaves_tcha", "extension_tcha", "ring_tcha"]].sum(axis=1)
    table = table.merge(stand, on=["year", "species"], how="left", validate="one_to_one")
    table["stock_tcha"] = CARBON_SHARE * table.pop("biomass_tha")
    return table
