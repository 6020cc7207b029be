"""Particles on the surface of a tree: grain, healing wounds, spots and ribbons of bark.

Hart & Baker 2003, sections 5.3, 5.4 and 6.2 (see docs/bark.md).
"""

from __future__ import annotations

from forest.surface.flow.cover import Cover, Near, cover
from forest.surface.flow.features import FlowBark, features
from forest.surface.flow.flowing import Flow, FlowRules, Loops, flow
from forest.surface.flow.healing import HealedYear, WoundedStem, WoundRules, heal
from forest.surface.flow.presets import (
    FeaturePreset,
    feature_preset,
    preset_for,
    preset_names,
    read_preset,
)
from forest.surface.flow.pruning import Wound, prune
from forest.surface.flow.trails import Trails, angle_to_limb, grain

__all__ = [
    "Cover",
    "FeaturePreset",
    "Flow",
    "FlowBark",
    "FlowRules",
    "HealedYear",
    "Loops",
    "Near",
    "Trails",
    "Wound",
    "WoundRules",
    "WoundedStem",
    "angle_to_limb",
    "cover",
    "feature_preset",
    "features",
    "flow",
    "grain",
    "heal",
    "preset_for",
    "preset_names",
    "prune",
    "read_preset",
]
