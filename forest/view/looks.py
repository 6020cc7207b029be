"""What each species looks like in pictures: colours of leaves, bark and curves."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

RGB = tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """Colours (red, green, blue, 0 to 1) and foliage of a species.

    Attributes
    ----------
    leaf, bark, line : tuple of float
        Colours of leaves and bark in full light, and of the species' curve in plots.
    needles : bool
        Foliage lies along the shoot (else leaves of any direction stand at its end).
    """

    leaf: RGB
    bark: RGB
    line: RGB
    needles: bool = False


LOOKS: dict[str, Look] = {
    "picea_abies": Look((0.14, 0.29, 0.17), (0.52, 0.39, 0.31), (0.13, 0.37, 0.24), True),
    "pinus_sylvestris": Look((0.34, 0.48, 0.33), (0.60, 0.37, 0.24), (0.80, 0.42, 0.17), True),
    "fagus_sylvatica": Look((0.38, 0.54, 0.18), (0.55, 0.55, 0.52), (0.50, 0.66, 0.13)),
    "betula_pendula": Look((0.49, 0.60, 0.26), (0.88, 0.87, 0.83), (0.25, 0.60, 0.75)),
    "quercus_robur": Look((0.35, 0.51, 0.16), (0.43, 0.37, 0.30), (0.52, 0.33, 0.55)),
}

_OTHERS = (
    Look((0.36, 0.52, 0.22), (0.47, 0.38, 0.30), (0.20, 0.45, 0.70)),
    Look((0.44, 0.54, 0.25), (0.52, 0.45, 0.38), (0.70, 0.25, 0.30)),
    Look((0.28, 0.52, 0.26), (0.40, 0.33, 0.28), (0.45, 0.45, 0.20)),
)


def look_of(species: str) -> Look:
    """Give the look of a species; an unknown name always gets the same one of a few."""
    known = LOOKS.get(species)
    return known if known else _OTHERS[zlib.crc32(species.encode()) % len(_OTHERS)]
