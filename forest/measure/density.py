"""Stand density: how full a stand is, whatever its age and site."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.measure.stand import REINEKE_DIAMETER_CM, REINEKE_EXPONENT


def reineke_sdi(n_ha: ArrayLike, qmd_cm: ArrayLike) -> NDArray[np.float64]:
    """Give Reineke's index: N (Dq / 25.4 cm)^1.605, trees per ha (Reineke 1933)."""
    ratio = np.asarray(qmd_cm, np.float64) / REINEKE_DIAMETER_CM
    return np.asarray(np.asarray(n_ha, np.float64) * ratio**REINEKE_EXPONENT)


def summation_sdi(dbh_cm: NDArray[np.float64], hectares: float) -> float:
    """Sum each tree's own (d / 25.4 cm)^1.605, per ha (Shaw 2000).

    It does not exceed Reineke's index and equals it where all trees are alike; the two part in
    uneven stands. Trees without a dbh (NaN) do not count.
    """
    thick = dbh_cm[~np.isnan(dbh_cm)]
    return float(np.sum((thick / REINEKE_DIAMETER_CM) ** REINEKE_EXPONENT)) / hectares


def relative_density(sdi: ArrayLike, maximum_sdi: ArrayLike) -> float:
    """Give a stand's density as a share of the greatest possible.

    Parameters
    ----------
    sdi : array_like
        Stand density index, of the stand or of each of its species.
    maximum_sdi : array_like
        The greatest that the species, alone, reach. The shares of several species add up.
    """
    shares = np.asarray(sdi, np.float64) / np.asarray(maximum_sdi, np.float64)
    return float(np.sum(shares))


def curtis_rd(basal_area_m2ha: ArrayLike, qmd_cm: ArrayLike) -> NDArray[np.float64]:
    """Give Curtis' relative density G / sqrt(Dq), with m2/ha and cm (Curtis 1982)."""
    root = np.sqrt(np.asarray(qmd_cm, np.float64))
    return np.asarray(np.asarray(basal_area_m2ha, np.float64) / root)
