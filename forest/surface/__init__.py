"""What a tree looks like from outside, at a given distance."""

from forest.surface.description import Description, Drawing, Primitives, describe
from forest.surface.detail import Fractions, Sight, fractions

__all__ = [
    "Description",
    "Drawing",
    "Fractions",
    "Primitives",
    "Sight",
    "describe",
    "fractions",
]
