"""Bark that tears as the tree thickens (Lefebvre and Neyret 2002)."""

from forest.surface.bark.growing import Bark, Snapshot, grow_bark
from forest.surface.bark.material import Material, fracture_range
from forest.surface.bark.shrinking import shrinking
from forest.surface.bark.strips import (
    EPIDERMIS,
    FRACTURE,
    Crossings,
    Elements,
    Fractures,
    StripGeometry,
    Strips,
    Tears,
)
from forest.surface.bark.viewed import BarkView

__all__ = [
    "EPIDERMIS",
    "FRACTURE",
    "Bark",
    "BarkView",
    "Crossings",
    "Elements",
    "Fractures",
    "Material",
    "Snapshot",
    "StripGeometry",
    "Strips",
    "Tears",
    "fracture_range",
    "grow_bark",
    "shrinking",
]
