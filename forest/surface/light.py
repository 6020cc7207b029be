"""What sun, sky and haze make of a colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError

# As in the pictures of single trees: a warm sun, a bluish sky.
_SUN = np.array([1.02, 0.96, 0.80])
_SKY = np.array([0.52, 0.57, 0.64])
_GAMMA = 0.85

#: Steps from the bark of a trunk to that of twigs.
BARKS = 8
_TWIG = np.array([0.34, 0.29, 0.24])
_TWIG_SHARE = 0.8
_THIN_M, _THICK_M = 0.01, 0.06  # diameters of stems with a twig's bark, and with the trunk's


def sunlit(colour: ArrayLike, share: ArrayLike) -> NDArray[np.float64]:
    """Light colours by the sky and by a share of the full sun.

    Parameters
    ----------
    colour : array_like (..., 3)
        Red, green and blue, 0 to 1.
    share : array_like (...)
        Sunlight, 0 to 1: the cosine of its angle of incidence, 0 in the shade.

    Returns
    -------
    float64 (..., 3)
        0 to 1. The eye sees shade brighter than the light is.
    """
    light = _SKY + np.asarray(share, np.float64)[..., None] * _SUN
    lit = np.clip(np.asarray(colour, np.float64) * light, 0.0, 1.0) ** _GAMMA
    return np.asarray(lit, np.float64)


def bark_steps(bark: ArrayLike) -> NDArray[np.float64]:
    """Give the colours (BARKS, 3) between a trunk's bark and that of twigs, a brownish grey.

    Young bark of pale trees, aspens and birches, is dark.
    """
    share = _TWIG_SHARE * np.arange(BARKS)[:, None] / (BARKS - 1)
    return np.asarray((1.0 - share) * np.asarray(bark, np.float64) + share * _TWIG, np.float64)


def bark_step(diameter_m: ArrayLike) -> NDArray[np.uint8]:
    """Tell which of the `bark_steps` stems of these diameters have; 0 from 6 cm on."""
    thin = (_THICK_M - np.asarray(diameter_m, np.float64)) / (_THICK_M - _THIN_M)
    return np.asarray(np.rint((BARKS - 1) * np.clip(thin, 0.0, 1.0)), np.uint8)


def haze_share(range_m: ArrayLike, haze: float | None) -> NDArray[np.float64]:
    """Give the share of haze in what is seen at a range: 1 - exp(-range / haze).

    Raises
    ------
    InputError
        If the haze is not above 0.
    """
    range_m = np.asarray(range_m, np.float64)
    if haze is None:
        return np.zeros_like(range_m)
    if not haze > 0.0:
        raise InputError(f"haze is {haze}", expected="metres above 0")
    return np.asarray(1.0 - np.exp(-range_m / haze), np.float64)
