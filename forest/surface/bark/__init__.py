"""Bark that tears as the tree thickens (Lefebvre and Neyret 2002)."""

from forest.surface.bark.strips import (
    EPIDERMIS,
    FRACTURE,
    Bark,
    Elements,
    Fractures,
    StripGeometry,
    Strips,
    Tears,
)

__all__ = [
    "EPIDERMIS",
    "FRACTURE",
    "Bark",
    "Elements",
    "Fractures",
    "StripGeometry",
    "Strips",
    "Tears",
]
