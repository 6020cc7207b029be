"""How many seeds trees bear: by size, by the light of their crowns, and by mast years."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.regeneration.traits import SeedTraits
from forest.random import STREAM_MAST, uniforms


def seeds_borne(
    species: NDArray[np.int64],
    height_m: NDArray[np.float64],
    leaf_area_m2: NDArray[np.float64],
    light: NDArray[np.float64],
    traits: SeedTraits,
) -> NDArray[np.float64]:
    """Give the viable seeds that trees bear in a mean year.

    A tree bears none below the height of maturity; above it as many as its leaf area times
    L (1 + h) / (L + h), with the mean light L of its crown: none in the dark, all in full light.

    Parameters
    ----------
    species : int (n,)
    height_m, leaf_area_m2, light : float64 (n,)
        Light as a share of full light; NaN, a tree without leaves, counts as dark.
    traits : SeedTraits

    Returns
    -------
    float64 (n,)
    """
    lit = np.clip(np.nan_to_num(light), 0.0, 1.0)
    half = traits.light_half[species]
    with np.errstate(invalid="ignore"):
        response = np.where(lit > 0.0, lit * (1.0 + half) / (lit + half), 0.0)
    ripe = height_m >= traits.maturity_height_m[species]
    return np.where(ripe, traits.seeds_per_leaf_m2[species] * leaf_area_m2 * response, 0.0)


def mast_factors(seed: int, year: int, traits: SeedTraits) -> NDArray[np.float64]:
    """Give each species' factor on its seeds in a calendar year; its mean over the years is 1.

    In a mast year, which all trees of a species share, the share of its seeds that falls in mast
    years comes at once. Years are drawn independently: two mast years may follow each other.

    Parameters
    ----------
    seed : int
        Seed of the scenario.
    year : int
        Calendar year.
    traits : SeedTraits

    Returns
    -------
    float64 (species,)
    """
    factors = 1.0 - traits.mast_share
    for kind, interval in enumerate(traits.mast_interval_years):
        draw, _, _, _ = uniforms(seed, STREAM_MAST, kind, 0, year)
        if draw * interval < 1.0:
            factors[kind] += traits.mast_share[kind] * interval
    return factors
