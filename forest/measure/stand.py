"""The stand table: what a forester writes down of a plot, per hectare, each year."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.measure import structure
from forest.measure.trees import TreeMeasures

#: Reineke's exponent and the diameter (25.4 cm = 10 inches) to which SDI refers.
REINEKE_EXPONENT = 1.605
REINEKE_DIAMETER_CM = 25.4

#: Trees per ha whose mean height is the top height.
TOP_TREES_HA = 100.0

_HECTARE_M2 = 10_000.0


class Flows(NamedTuple):
    """Trees that came and went during the year, arrays of one entry per species."""

    recruits: NDArray[np.int64]
    deaths: NDArray[np.int64]  # died, or thrown by the wind
    removed: NDArray[np.int64]  # felled
    removed_volume_m3: NDArray[np.float64]


class Plot(NamedTuple):
    """The plot's size, m, and whether it wraps."""

    size_m: tuple[float, float]
    periodic: bool

    @property
    def hectares(self) -> float:
        """Area, ha."""
        return self.size_m[0] * self.size_m[1] / _HECTARE_M2


def top_height(dbh_cm: NDArray[np.float64], height_m: NDArray[np.float64], count: float) -> float:
    """Give the mean height of the `count` thickest trees, the last one in part; NaN without trees.

    Trees without a dbh stand behind all others, the higher first.
    """
    n = len(height_m)
    if n == 0:
        return float("nan")
    thickness = np.where(np.isnan(dbh_cm), -1.0, dbh_cm)
    by_rank = np.lexsort((-height_m, -thickness))
    weight = np.clip(count - np.arange(n), 0.0, 1.0)
    return float(weight @ height_m[by_rank] / weight.sum())


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _row(
    measures: TreeMeasures, here: NDArray[np.bool_], plot: Plot, plot_trees: float
) -> dict[str, float]:
    """Sum up the trees for which `here` is true."""
    area = plot.hectares
    dbh = measures.dbh_cm[here]
    thick = dbh[~np.isnan(dbh)]
    ground = measures.basal_area_m2[here]
    height = measures.height_m[here]
    total = float(ground.sum())
    qmd = float(np.sqrt(np.mean(thick**2))) if len(thick) else float("nan")
    stems = len(thick) / area
    return {
        "n_ha": len(dbh) / area,
        "basal_area_m2ha": total / area,
        "qmd_cm": qmd,
        "mean_dbh_cm": _mean(thick),
        "top_height_m": top_height(dbh, height, plot_trees),
        "lorey_height_m": float(ground @ height) / total if total > 0.0 else float("nan"),
        "volume_m3ha": float(measures.stem_volume_m3[here].sum()) / area,
        "biomass_tha": float(measures.biomass_kg[here].sum()) / area / 1000.0,
        "lai": float(measures.leaf_area_m2[here].sum()) / area / _HECTARE_M2,
        "sdi": stems * (qmd / REINEKE_DIAMETER_CM) ** REINEKE_EXPONENT if len(thick) else 0.0,
        "gini_basal_area": structure.gini(ground[ground > 0.0]),
    }


def _species_of_row(rows: NDArray[np.int64], n_species: int) -> list[NDArray[np.bool_]]:
    masks = [rows == s for s in range(n_species)]
    masks.append(np.ones(len(rows), np.bool_))
    return masks


def stand_rows(
    year: int,
    measures: TreeMeasures,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    species: NDArray[Any],
    flows: Flows,
    plot: Plot,
    floor_light: float,
) -> dict[str, NDArray[Any]]:
    """Give this year's rows of the stand table: one per species, and a last one for all.

    Parameters
    ----------
    year : int
        Calendar year.
    measures : TreeMeasures
        The living trees, n of them.
    x, y : float64 (n,)
        Their places, m.
    species : int array (n,)
        Their species, 0 to k - 1.
    flows : Flows
        What came and went this year, k entries each.
    plot : Plot
        Size and boundary.
    floor_light : float
        Relative irradiance on the ground; entered in the row of all species only (NaN else).

    Returns
    -------
    dict of arrays
        Columns of k + 1 rows. `species` is the species' index, k for all.

    Notes
    -----
    `n_ha` counts all trees, the diameters (`qmd_cm`, `mean_dbh_cm`, `sdi`) only those that have a
    dbh. Top height is the mean of the 100 thickest per ha of the row's species. Volume is the
    stems' over bark. SDI = N (Dq / 25.4 cm)^1.605 (Reineke 1933). Shannon's and Simpson's index
    are by basal area. Clark–Evans regards the trees of the row alone, mingling the neighbours of
    whatever species; both wrap on a periodic plot.
    """
    species = np.asarray(species, np.int64)
    k = len(flows.recruits)
    area = plot.hectares
    masks = _species_of_row(species, k)
    rows = [_row(measures, here, plot, TOP_TREES_HA * area) for here in masks]
    columns: dict[str, NDArray[Any]] = {
        "year": np.full(k + 1, year, np.int32),
        "species": np.arange(k + 1, dtype=np.int16),
    }
    for name in rows[0]:
        columns[name] = np.array([row[name] for row in rows])
    columns["floor_light"] = np.append(np.full(k, np.nan), floor_light)
    columns["canopy_cover"] = structure.crown_cover(
        x, y, measures.crown_radius_m, species, k, plot.size_m, plot.periodic
    )
    for name, counts in (
        ("recruits_ha", flows.recruits),
        ("deaths_ha", flows.deaths),
        ("removed_ha", flows.removed),
        ("removed_volume_m3ha", flows.removed_volume_m3),
    ):
        columns[name] = np.append(counts, np.sum(counts)) / area

    ground = columns["basal_area_m2ha"][:k]
    diversity = [np.where(np.arange(k) == s, ground, 0.0) for s in range(k)] + [ground]
    columns["shannon"] = np.array([structure.shannon(amounts) for amounts in diversity])
    columns["simpson"] = np.array([structure.simpson(amounts) for amounts in diversity])

    everyone = structure.Neighbours(x, y, plot.size_m, plot.periodic)
    mixed = structure.mingling(everyone, species)
    evans = []
    mingled = []
    for here in masks:
        whole = bool(here.all())
        own = everyone if whole else structure.Neighbours(x[here], y[here], *plot)
        evans.append(structure.clark_evans(own))
        mingled.append(_mean(mixed[here]) if len(mixed) else float("nan"))
    columns["clark_evans"] = np.array(evans)
    columns["mingling"] = np.array(mingled)
    return columns
