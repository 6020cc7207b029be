"""The tree's surface as one blended whole (Hart & Baker 2003, sections 5.1 and 5.2)."""

from forest.surface.blend.crossings import crossings
from forest.surface.blend.field import Blend, OnLimb
from forest.surface.blend.foot import Flare
from forest.surface.blend.limbs import Reaction
from forest.surface.blend.odd import GapWarning
from forest.surface.blend.reaction import reaction_wood
from forest.surface.blend.whole import CrossingWarning, blend_of, blended

__all__ = [
    "Blend",
    "CrossingWarning",
    "Flare",
    "GapWarning",
    "OnLimb",
    "Reaction",
    "blend_of",
    "blended",
    "crossings",
    "reaction_wood",
]
