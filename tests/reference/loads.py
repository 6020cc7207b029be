"""What hangs on a tree, metamer by metamer, from species as the files give them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from forest.environment.obstacles import Box
from forest.species import Species
from tests.reference.plant import Node

GRAVITY = 9.80665


def wood_weight(node: Node, species: Species, exponent: float) -> float:
    """Weight of an internode, a cylinder of fresh wood, N."""
    diameter = node.pipe ** (1.0 / exponent)
    volume = math.pi / 4.0 * diameter**2 * node.length
    return GRAVITY * species.mechanics.green_density_kg_m3 * volume


def site_weight(node: Node, species: Species, *, winter: bool) -> float:
    """Weight of leaves and fruit at a node, N; in winter only leaves older than a year hang."""
    dry = species.leaves.area_m2 / species.leaves.sla_m2_kg
    mass = dry * species.mechanics.leaf_water_factor
    if winter and species.leaves.lifespan_years <= 1.0:
        mass = 0.0
    if not winter:
        mass += species.mechanics.fruit_mass_kg
    return GRAVITY * mass * node.buds


def buried(nodes: Sequence[Node], base: np.ndarray, boxes: Sequence[Box]) -> list[bool]:
    """Tell which nodes lie below the ground or in a box; `base` is the place of the tree, m."""

    def dead(x: np.ndarray) -> bool:
        held = [np.all((x + base > b.min_m) & (x + base < b.max_m)) for b in boxes]
        return bool(x[2] < 0.0 or any(held))

    return [dead(node.tip) for node in nodes]
