"""Bark: from the diameter of the wood to what a calliper meets, and back.

A species has one number for its bark, `mensuration.bark_factor`: the double bark thickness as a
share of the diameter over bark, at every height alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def diameter_over_bark(under_bark: ArrayLike, bark_factor: ArrayLike) -> NDArray[np.float64]:
    """Give the diameter over bark, in the unit of the diameter under bark.

    Parameters
    ----------
    under_bark : array_like
        Diameter of the wood.
    bark_factor : array_like
        Double bark thickness per diameter over bark, 0 to below 1.
    """
    return np.asarray(under_bark, np.float64) / (1.0 - np.asarray(bark_factor, np.float64))


def diameter_under_bark(over_bark: ArrayLike, bark_factor: ArrayLike) -> NDArray[np.float64]:
    """Give the diameter of the wood, in the unit of the diameter over bark."""
    return np.asarray(over_bark, np.float64) * (1.0 - np.asarray(bark_factor, np.float64))


def bark_thickness(over_bark: ArrayLike, bark_factor: ArrayLike) -> NDArray[np.float64]:
    """Give the thickness of the bark on one side, in the unit of the diameter over bark."""
    return 0.5 * np.asarray(over_bark, np.float64) * np.asarray(bark_factor, np.float64)


def bark_share(bark_factor: ArrayLike) -> NDArray[np.float64]:
    """Give the bark's share of a stem's volume over bark: 1 - (1 - b)^2."""
    return 1.0 - (1.0 - np.asarray(bark_factor, np.float64)) ** 2
