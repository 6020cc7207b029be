"""A field campaign in a simulated stand: the dominant trees, bored from two sides."""

from __future__ import annotations

from typing import Literal

import pandas as pd

from forest.dendro.cores import core
from forest.dendro.series import RingSeries, assemble
from forest.dendro.stems import at_height
from forest.errors import InputError, span_of
from forest.random import STREAM_CORE, uniforms


def campaign(
    rings: pd.DataFrame,
    trees: pd.DataFrame,
    *,
    year: int,
    n_trees: int = 10,
    by: Literal["dbh_cm", "height_m"] = "dbh_cm",
    stem_height_m: float = 1.3,
    aim_sd_deg: float = 3.0,
    seed: int = 1,
) -> RingSeries:
    """Take two cores from each of the dominant trees of a year.

    The first core of a tree enters on a side drawn at random, the second on the opposite side:
    the mean of the two is then free of the eccentricity to first order.

    Parameters
    ----------
    rings : pandas.DataFrame
        Rows of `/rings`. Rings later than `year` are not on the cores.
    trees : pandas.DataFrame
        Rows of `/trees`.
    year : int
        Calendar year at whose end the cores are taken.
    n_trees : int
        How many trees.
    by : 'dbh_cm' or 'height_m'
        What makes a tree dominant; of two alike the one with the lower number comes first.
    stem_height_m : float
        Height of the bores, m: one at which rings are on record.
    aim_sd_deg : float
        How well the borer is aimed at the pith; see `forest.dendro.core`.
    seed : int
        Of the random numbers.

    Returns
    -------
    RingSeries
        Two series per tree, the thickest (highest) tree first. A core without a single whole
        ring is left out.

    Raises
    ------
    InputError
        If the year is not on record, fewer than `n_trees` trees live in it that have rings at the
        height, or an argument is out of its range.
    """
    if by not in ("dbh_cm", "height_m"):
        raise InputError(f"by is '{by}'", where="campaign", expected="'dbh_cm' or 'height_m'")
    if n_trees < 1:
        raise InputError(f"n_trees is {n_trees}", where="campaign", expected="at least 1")
    until = rings[rings["year"] <= year]
    chosen = _dominant(until, trees, year, n_trees, by, stem_height_m)
    until = until[until["tree_id"].isin(chosen)]
    radii = []
    for tree_id in chosen:
        side, *_ = uniforms(seed, STREAM_CORE, tree_id, 0, year)
        first = round(360.0 * float(side), 1)
        for azimuth in (first, (first + 180.0) % 360.0):
            taken = core(
                until,
                tree_id,
                azimuth,
                stem_height_m=stem_height_m,
                aim_sd_deg=aim_sd_deg,
                seed=seed,
            )
            if len(taken.year):
                radii.append(taken.as_radius())
    if not radii:
        raise InputError(
            f"no core of {year} holds a ring", where="campaign", expected="a later year"
        )
    return assemble(radii)


def _dominant(
    rings: pd.DataFrame,
    trees: pd.DataFrame,
    year: int,
    n_trees: int,
    by: str,
    stem_height_m: float,
) -> list[int]:
    """Choose the thickest or highest living trees that have a ring at the height."""
    now = trees[(trees["year"] == year) & (trees["status"].astype(str) == "living")]
    if not len(now):
        years = trees["year"]
        span = span_of(years.min(), years.max()) if len(years) else "a run with years"
        raise InputError(f"no tree lives in {year}", where="campaign", expected=span)
    with_rings = rings.loc[at_height(rings, stem_height_m) & (rings["year"] == year), "tree_id"]
    now = now[now["tree_id"].isin(with_rings) & now[by].notna()]
    if len(now) < n_trees:
        raise InputError(
            f"{n_trees} trees asked for",
            where="campaign",
            expected=f"at most {len(now)}, which in {year} have rings at {stem_height_m:g} m",
        )
    order = now.sort_values([by, "tree_id"], ascending=[False, True])
    return [int(tree_id) for tree_id in order["tree_id"].iloc[:n_trees]]
