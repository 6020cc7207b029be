"""Colours of trees in a landscape by species and season, for simulated and parametric species."""

from __future__ import annotations

from typing import NamedTuple

from forest.view.looks import look_of

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

#: Leaves in fall, of simulated and of parametric species.
_FALL: dict[str, RGB] = {
    "betula_pendula": (0.86, 0.68, 0.16),
    "fagus_sylvatica": (0.72, 0.42, 0.13),
    "quercus_robur": (0.60, 0.44, 0.18),
    "quaking_aspen": (0.92, 0.72, 0.12),
    "black_tupelo": (0.60, 0.24, 0.12),
    "sassafras": (0.86, 0.45, 0.12),
    "weeping_willow": (0.76, 0.68, 0.22),
    "california_black_oak": (0.76, 0.50, 0.12),
    "lombardy_poplar": (0.84, 0.70, 0.18),
    "lilac": (0.52, 0.50, 0.18),
}

#: Bark and summer leaves of the parametric species that come with the program.
_PARAMETRIC: dict[str, tuple[RGB, RGB]] = {
    "quaking_aspen": ((0.78, 0.77, 0.68), (0.38, 0.52, 0.20)),
    "black_tupelo": ((0.40, 0.35, 0.29), (0.22, 0.42, 0.13)),
    "weeping_willow": ((0.44, 0.37, 0.25), (0.45, 0.55, 0.23)),
    "california_black_oak": ((0.36, 0.31, 0.26), (0.29, 0.43, 0.15)),
    "lombardy_poplar": ((0.47, 0.44, 0.37), (0.30, 0.47, 0.16)),
    "balsam_fir": ((0.42, 0.38, 0.34), (0.14, 0.29, 0.17)),
    "sassafras": ((0.43, 0.33, 0.25), (0.34, 0.51, 0.18)),
    "queen_palm": ((0.53, 0.49, 0.42), (0.30, 0.46, 0.18)),
    "lilac": ((0.45, 0.40, 0.33), (0.25, 0.44, 0.20)),
    "saguaro": ((0.34, 0.46, 0.27), (0.34, 0.46, 0.27)),
}


def colours_of(species: str, *, evergreen: bool) -> Colours:
    """Give the colours of a species; an unknown one looks like some other, always the same."""
    if species in _PARAMETRIC:
        bark, summer = _PARAMETRIC[species]
    else:
        look = look_of(species)
        bark, summer = look.bark, look.leaf
    if evergreen:
        dull = _mixed(summer, (0.30, 0.33, 0.22), 0.25)
        young = _mixed(summer, _FRESH, 0.25)
        return Colours(bark, {"spring": young, "summer": summer, "fall": summer, "winter": dull})
    fall = _FALL.get(species, (0.75, 0.52, 0.15))
    return Colours(
        bark,
        {"spring": _mixed(summer, _FRESH, 0.6), "summer": summer, "fall": fall, "winter": _BROWN},
    )


def _mixed(one: RGB, other: RGB, share: float) -> RGB:
    a, b, c = ((1.0 - share) * x + share * y for x, y in zip(one, other, strict=True))
    return a, b, c
