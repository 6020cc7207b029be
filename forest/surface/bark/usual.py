"""Which bark a species has, where nobody says."""

from __future__ import annotations

#: What stands for species that the table does not know: smooth bark says the least.
FALLBACK = "beech"

#: Words in names of species, botanical or common, and the preset that stands for them. Ours and
#: wide: a preset is the bark of a kind of tree, not of each species.
_WORDS = {
    "quercus": "oak",
    "oak": "oak",
    "robinia": "oak",
    "fraxinus": "oak",
    "sassafras": "oak",
    "willow": "oak",
    "tupelo": "oak",
    "pinus": "pine",
    "pine": "pine",
    "larix": "pine",
    "pseudotsuga": "pine",
    "picea": "spruce",
    "spruce": "spruce",
    "fir": "spruce",
    "fagus": "beech",
    "carpinus": "beech",
    "betula": "birch",
    "birch": "birch",
    "populus": "aspen",
    "aspen": "aspen",
    "poplar": "aspen",
    "acer": "maple",
    "maple": "maple",
}


def usual_preset(species: str) -> str:
    """Name the preset for a species, `quercus_robur` or `quaking_aspen`; `FALLBACK` if unknown."""
    for word in species.lower().split("_"):
        if word in _WORDS:
            return _WORDS[word]
    return FALLBACK
