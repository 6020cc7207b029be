"""What hangs on a tree, metamer by metamer, from species as the files give them."""

from __future__ import annotations

import math
from collections.abc import Sequence

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


def buried(nodes: Sequence[Node]) -> list[bool]:
    """Tell which nodes lie below the ground."""
    return [bool(node.tip[2] < 0.0) for node in nodes]
