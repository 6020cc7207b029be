"""Which trees of a stand the rules of a scenario choose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.management import thinning
from forest.management.regions import inside
from forest.management.thinning import Census
from forest.measure.stand import Plot
from forest.measure.tables import plot_of
from forest.measure.trees import TreeMeasures
from forest.scenario.cuttings import Harvesting, Rule, Thinning
from forest.scenario.model import Regular

if TYPE_CHECKING:
    from forest.stand import Stand

Rows = NDArray[np.int64]
Mask = NDArray[np.bool_]

#: Where a thinning around crop trees does not say: competitors of each, and their distance, m.
COMPETITORS = 1
WITHIN_M = 6.0


def census_of(stand: Stand, measures: TreeMeasures) -> Census:
    """Take the census of a measured stand."""
    rows = stand.rows
    return Census(rows.tree_id, rows.species, rows.x, rows.y, measures.dbh_cm, measures.height_m)


def trees_of(
    rule: Rule, census: Census, stand: Stand, standing: Mask, species: tuple[str, ...] | None
) -> tuple[Mask, Mask]:
    """Give the standing trees of some species, and those of them that a rule may touch."""
    names = stand.species_names
    counted = standing.copy()
    if species is not None:
        counted &= np.isin(census.species, [names.index(name) for name in species])
    chosen = counted.copy()
    if rule.min_dbh_cm is not None:
        chosen &= census.dbh_cm >= rule.min_dbh_cm  # NaN is below any limit
    if rule.max_dbh_cm is not None:
        chosen &= ~(census.dbh_cm > rule.max_dbh_cm)
    return counted, chosen


def to_thin(rule: Thinning, census: Census, stand: Stand, standing: Mask, number: int) -> Rows:
    """Choose the rows that a thinning takes of the trees that stand.

    Parameters
    ----------
    rule : Thinning
    census : Census
        All n trees.
    stand : Stand
        Plot, species, seed and time.
    standing : bool (n,)
        Trees that no act has taken yet.
    number : int
        Of the act in its year.
    """
    counted, chosen = trees_of(rule, census, stand, standing, rule.species)
    rows, plot = np.flatnonzero(chosen), plot_of(stand.scenario)
    if rule.method == "geometric":
        return rows[_lined(rule, census, stand)[rows]]
    if rule.method == "selective":
        order = _around_crop_trees(rule, census, stand, standing, chosen, plot)
    elif rule.method == "below":
        order = census.from_thin_to_thick(rows)
    elif rule.method == "above":
        order = census.from_thick_to_thin(rows)
    else:
        order = census.at_random(rows, stand.scenario.seed, number, stand.steps)
    if rule.target is None:
        return order
    most = np.array([s.mensuration.max_sdi for s in stand.species])
    return thinning.thin_to(order, counted, census, rule.target, plot.hectares, most)


def _lined(rule: Thinning, census: Census, stand: Stand) -> Mask:
    """Tell which trees stand on the rows or strips of a geometric thinning."""
    along_y = rule.rows_along == "y"
    across = census.x if along_y else census.y
    if rule.strip_width_m is not None and rule.strip_spacing_m is not None:
        return thinning.strips_of_trees(across, rule.strip_width_m, rule.strip_spacing_m)
    spacing, planting = rule.row_spacing_m, stand.scenario.planting
    if spacing is None:
        assert isinstance(planting, Regular)
        spacing = planting.spacing_m[0 if along_y else 1]
    assert rule.every_row is not None
    first = rule.every_row if rule.first_row is None else rule.first_row
    return thinning.rows_of_trees(across, spacing, rule.every_row, first)


def _around_crop_trees(
    rule: Thinning, census: Census, stand: Stand, standing: Mask, chosen: Mask, plot: Plot
) -> Rows:
    """Order the competitors of crop trees as they go."""
    assert rule.crop_trees_ha is not None
    crop, _ = trees_of(rule, census, stand, standing, rule.crop_species)
    order = census.from_thick_to_thin(np.flatnonzero(crop & ~np.isnan(census.dbh_cm)))
    count = max(round(rule.crop_trees_ha * plot.hectares), 1)
    favoured = thinning.spaced(order, census, plot, rule.crop_spacing_m or 0.0, count=count)
    number = rule.competitors
    if number is None:
        number = COMPETITORS if rule.target is None else len(census.x)
    within = WITHIN_M if rule.within_m is None else rule.within_m
    return thinning.competitors(favoured, census, chosen, plot, number, within)


def to_harvest(rule: Harvesting, census: Census, stand: Stand, standing: Mask) -> Rows:
    """Choose the rows that a harvest takes of the trees that stand; see `to_thin`."""
    counted, chosen = trees_of(rule, census, stand, standing, rule.species)
    plot = plot_of(stand.scenario)
    if rule.method == "diameter_limit":
        assert rule.limit_cm is not None
        chosen &= census.dbh_cm >= rule.limit_cm
    elif rule.method == "gap":
        assert rule.gap is not None
        chosen &= inside(rule.gap, census.x, census.y, plot)
    elif rule.method == "shelterwood":
        assert rule.keep_share is not None
        has_dbh = ~np.isnan(census.dbh_cm)
        order = census.from_thick_to_thin(np.flatnonzero(counted & has_dbh))
        enough = rule.keep_share * float(census.basal_area_m2[counted].sum())
        kept = thinning.spaced(
            order, census, plot, rule.seed_spacing_m or 0.0, basal_area_m2=enough
        )
        chosen &= has_dbh
        chosen[kept] = False
    return np.flatnonzero(chosen)


def to_prune(
    rule: Rule, thickest_ha: float | None, census: Census, stand: Stand, standing: Mask
) -> Rows:
    """Choose the rows that are pruned: of the trees that stay all, or the thickest with a dbh."""
    _, chosen = trees_of(rule, census, stand, standing, rule.species)
    if thickest_ha is None:
        return np.flatnonzero(chosen)
    order = census.from_thick_to_thin(np.flatnonzero(chosen & ~np.isnan(census.dbh_cm)))
    count = max(round(thickest_ha * plot_of(stand.scenario).hectares), 1)
    return np.sort(order[:count])
