"""Colours of trees in a landscape by species and season, for simulated and parametric species."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.parametric import Parameters
from forest.surface.detail import SEASONS
from forest.view.looks import look_of
from forest.view.parametric_picture import WINTER_DULL, WINTER_SHARE, colour_of, leaf_colour

RGB = tuple[float, float, float]


class Colours(NamedTuple):
    """What a species looks like.

    Attributes
    ----------
    bark : tuple of float
        Red, green and blue, 0 to 1.
    foliage : dict of str to tuple of float
        By season.
    """

    bark: RGB
    foliage: dict[str, RGB]


_FRESH: RGB = (0.50, 0.63, 0.24)
_BROWN: RGB = (0.58, 0.40, 0.16)

#: Leaves of simulated species in fall.
_FALL: dict[str, RGB] = {
    "betula_pendula": (0.86, 0.68, 0.16),
    "fagus_sylvatica": (0.72, 0.42, 0.13),
    "quercus_robur": (0.60, 0.44, 0.18),
}


def parametric_colours(parameters: Parameters) -> Colours:
    """Give the colours that a parametric species' file names."""
    foliage = {season: _rgb(leaf_colour(parameters, season)) for season in SEASONS}
    return Colours(_rgb(colour_of(parameters.bark_colour)), foliage)


def colours_of(species: str, *, evergreen: bool) -> Colours:
    """Give the colours of a simulated species; an unknown one always has the same of a few."""
    look = look_of(species)
    bark, summer = look.bark, look.leaf
    if evergreen:
        dull = _mixed(summer, WINTER_DULL, WINTER_SHARE)
        young = _mixed(summer, _FRESH, 0.25)
        return Colours(bark, {"spring": young, "summer": summer, "fall": summer, "winter": dull})
    fall = _FALL.get(species, (0.75, 0.52, 0.15))
    return Colours(
        bark,
        {"spring": _mixed(summer, _FRESH, 0.6), "summer": summer, "fall": fall, "winter": _BROWN},
    )


def _rgb(colour: NDArray[np.float64]) -> RGB:
    red, green, blue = colour.tolist()
    return red, green, blue


def _mixed(one: RGB, other: RGB, share: float) -> RGB:
    a, b, c = ((1.0 - share) * x + share * y for x, y in zip(one, other, strict=True))
    return a, b, c
