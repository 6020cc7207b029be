"""Which trees a thinning or harvest takes: rules on measured trees, pure functions of arrays.

Trees come as a `Census` and are named by their rows in it; ties are settled by tree id, so that the
order of rows does not matter. A tree without a dbh (NaN) is thinner than any other and has no basal
area; among such trees the lower one is the thinner.
"""

from __future__ import annotations

from itertools import chain, zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.measure.density import reineke_sdi
from forest.measure.stand import Plot
from forest.random import STREAM_THINNING, uniforms
from forest.trees.table import distances

#: A density counts as reached if it is above the target by no more than this share.
_CLOSE = 1e-9


class Census(NamedTuple):
    """Living trees as a marker sees them; arrays of n entries."""

    tree_id: NDArray[Any]
    species: NDArray[Any]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    dbh_cm: NDArray[np.float64]
    height_m: NDArray[np.float64]

    @property
    def basal_area_m2(self) -> NDArray[np.float64]:
        """Cross sections at breast height, m2; 0 without a dbh."""
        return np.asarray(0.25e-4 * np.pi * np.nan_to_num(self.dbh_cm) ** 2)

    def from_thin_to_thick(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Sort rows by dbh, then height, then tree id."""
        dbh = np.where(np.isnan(self.dbh_cm), -1.0, self.dbh_cm)[rows]
        return rows[np.lexsort((self.tree_id[rows], self.height_m[rows], dbh))]

    def from_thick_to_thin(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Sort rows by falling dbh, then falling height, then tree id."""
        dbh = np.where(np.isnan(self.dbh_cm), -1.0, self.dbh_cm)[rows]
        return rows[np.lexsort((self.tree_id[rows], -self.height_m[rows], -dbh))]

    def at_random(
        self, rows: NDArray[np.int64], seed: int, number: int, step: int
    ) -> NDArray[np.int64]:
        """Shuffle rows; a tree's draw depends on its id, the step and the act's number in it."""
        draw = [
            uniforms(seed, STREAM_THINNING, int(tree_id), number, step)[0]
            for tree_id in self.tree_id[rows]
        ]
        return rows[np.lexsort((self.tree_id[rows], np.array(draw, np.float64)))]


def _away(row: int, census: Census, plot: Plot) -> NDArray[np.float64]:
    """Give distances of all trees to one of them, m."""
    place = census.x[row], census.y[row]
    return distances(census.x, census.y, *place, plot.size_m, plot.periodic)


def density_left(
    order: NDArray[np.int64],
    counted: NDArray[np.bool_],
    census: Census,
    quantity: str,
    hectares: float,
    max_sdi: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Give a density of the stand after each tree that goes, in their order.

    Parameters
    ----------
    order : int64 (m,)
        Rows of trees that go one after the other.
    counted : bool (n,)
        Trees whose density it is; it holds for all of `order`.
    census : Census
    quantity : {"n_ha", "basal_area_m2ha", "sdi", "relative_density"}
        Relative density is SDI per greatest SDI, added up over species.
    hectares : float
        Area of the plot.
    max_sdi : float64 (species,)
        Greatest SDI of each species.

    Returns
    -------
    float64 (m + 1,)
        With none gone, one gone, ... all gone; it never rises.
    """

    def left(values: NDArray[np.float64]) -> NDArray[np.float64]:
        total = float(values[counted].sum())
        after = total - np.concatenate(([0.0], np.cumsum(values[order])))
        return np.maximum(after, 0.0)

    if quantity == "n_ha":
        return left(np.ones(len(counted))) / hectares
    if quantity == "basal_area_m2ha":
        return left(census.basal_area_m2) / hectares
    square = np.nan_to_num(census.dbh_cm) ** 2
    has_dbh = (square > 0.0).astype(np.float64)
    if quantity == "sdi":
        return _sdi(left(has_dbh), left(square)) / hectares
    whole = np.zeros(len(order) + 1)
    for kind, most in enumerate(max_sdi):
        own = (census.species == kind).astype(np.float64)
        whole += _sdi(left(own * has_dbh), left(own * square)) / (hectares * most)
    return whole


def _sdi(stems: NDArray[np.float64], squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give Reineke's index of numbers of stems and sums of their squared diameters, cm2."""
    mean_square = np.divide(squares, stems, out=np.zeros_like(stems), where=stems > 0.0)
    return reineke_sdi(stems, np.sqrt(mean_square))


def thin_to(
    order: NDArray[np.int64],
    counted: NDArray[np.bool_],
    census: Census,
    target: tuple[str, float],
    hectares: float,
    max_sdi: NDArray[np.float64],
) -> NDArray[np.int64]:
    """Take trees in order until no more than the target is left.

    Parameters
    ----------
    order, counted, census, hectares, max_sdi
        As for `density_left`.
    target : (quantity, float)
        A quantity of `density_left` and how much of it is left; or `share_n`, `share_g` and the
        share of `counted` that goes.

    Returns
    -------
    int64 (k,)
        The first of `order`: just so many that the density is at or below the target, all if it
        never is, none if it was before. Trees without a dbh are taken for numbers alone.
    """
    quantity, value = target
    if quantity not in ("n_ha", "share_n"):
        order = order[~np.isnan(census.dbh_cm[order])]
    share = quantity.startswith("share")
    name = {"share_n": "n_ha", "share_g": "basal_area_m2ha"}.get(quantity, quantity)
    left = density_left(order, counted, census, name, hectares, max_sdi)
    limit = (1.0 - value) * left[0] if share else value
    enough = left <= limit + _CLOSE * left[0]
    return order[: int(np.argmax(enough))] if enough.any() else order


def rows_of_trees(
    across: NDArray[np.float64], spacing_m: float, every: int, first: int
) -> NDArray[np.bool_]:
    """Tell which trees stand in every k-th row.

    Parameters
    ----------
    across : float64 (n,)
        Places across the rows, m; row 1 lies from 0 to one spacing.
    spacing_m : float
        Distance between rows.
    every, first : int
        One row of `every`, and the first one, counted from 1.
    """
    row = np.floor(across / spacing_m + 1e-9).astype(np.int64) + 1
    return np.asarray((row >= first) & ((row - first) % every == 0))


def strips_of_trees(
    across: NDArray[np.float64], width_m: float, spacing_m: float
) -> NDArray[np.bool_]:
    """Tell which trees stand on strips; the middle of the first lies half a spacing from 0."""
    return np.asarray(np.abs(across % spacing_m - 0.5 * spacing_m) <= 0.5 * width_m)


def spaced(
    order: NDArray[np.int64],
    census: Census,
    plot: Plot,
    spacing_m: float,
    *,
    count: int | None = None,
    basal_area_m2: float = np.inf,
) -> NDArray[np.int64]:
    """Choose trees in order, each at least `spacing_m` from those before it.

    Stops at `count` trees or once they have the basal area.
    """
    chosen: list[int] = []
    ground = census.basal_area_m2
    free = np.ones(len(census.x), np.bool_)
    sum_m2 = 0.0
    for row in order:
        if (count is not None and len(chosen) >= count) or sum_m2 >= basal_area_m2 * (1 - _CLOSE):
            break
        if not free[row]:
            continue
        chosen.append(int(row))
        sum_m2 += float(ground[row])
        if spacing_m > 0.0:
            free &= _away(row, census, plot) >= spacing_m
    return np.array(chosen, np.int64)


def competitors(
    crop: NDArray[np.int64],
    census: Census,
    candidates: NDArray[np.bool_],
    plot: Plot,
    count: int,
    within_m: float,
) -> NDArray[np.int64]:
    """Choose the strongest competitors of each crop tree.

    Parameters
    ----------
    crop : int64 (c,)
        Rows of crop trees; none of them goes.
    census : Census
    candidates : bool (n,)
        Trees that may go.
    plot : Plot
    count : int
        Competitors of each crop tree.
    within_m : float
        Distance within which trees compete, m.

    Returns
    -------
    int64 (k,)
        Rows in the order in which they go: the strongest of each crop tree, in the order of
        `crop`, then the second of each... A tree that presses two crop trees counts for both.

    Notes
    -----
    Strength is a neighbour's part in Hegyi's (1974) index: its dbh per that of the crop tree and
    per distance, so that for one crop tree d / distance decides.
    """
    may = candidates & ~np.isnan(census.dbh_cm)
    may[crop] = False
    strongest_of = []
    for row in crop:
        away = _away(row, census, plot)
        near = np.flatnonzero(may & (away <= within_m))
        strength = census.dbh_cm[near] / np.maximum(away[near], 1e-6)
        ranked = near[np.lexsort((census.tree_id[near], -strength))[:count]].tolist()
        strongest_of.append(ranked)
    rounds = chain.from_iterable(zip_longest(*strongest_of))
    return np.array([row for row in dict.fromkeys(rounds) if row is not None], np.int64)
