"""Balance in plain Python: Hart & Baker 2003, section 4.1, eqs 10-15; a limb is an axis.

Mass and moment are summed over metamers. Eq. 13 is read so that growth goes to the light side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tests.reference.plant import Node


@dataclass(frozen=True)
class Gains:
    """Numbers of a species that the growth rate depends on."""

    density: float
    min_growth: float
    offset_gain: float
    light_gain: float
    offset_length: float
    pipe_exponent: float


def diameter(node: Node, exponent: float) -> float:
    """Diameter of an internode, d = pipe^(1/n)."""
    return float(node.pipe ** (1.0 / exponent))


def mass(node: Node, gains: Gains) -> float:
    """M: mass of a metamer and of all that it supports (eq. 10)."""
    own = gains.density * math.pi / 4.0 * diameter(node, gains.pipe_exponent) ** 2 * node.length
    return own + sum(mass(child, gains) for child in node.children())


def centre(node: Node, gains: Gains) -> np.ndarray:
    """X: centre of mass of a metamer and of all that it supports (eq. 12)."""
    total = mass(node, gains)
    own = total - sum(mass(child, gains) for child in node.children())
    moment = own * (node.start + node.tip) / 2.0
    for child in node.children():
        moment = moment + mass(child, gains) * centre(child, gains)
    return np.asarray(moment / total)


def growth_rate(head: Node, base: Node, gains: Gains) -> float:
    """g of a limb: at least something, more towards the light side (eq. 13) and for its light."""
    limb = head.axis()
    heading = limb[-1].tip - head.start
    out_of_line = centre(base, gains)
    out_of_line[2] = 0.0
    ell = max(gains.offset_length * diameter(base, gains.pipe_exponent) / 2.0, 1e-6)
    norm = float(np.linalg.norm(heading))
    offset = -float(heading @ out_of_line) / (norm * ell) if norm > 0.0 else 0.0
    offset = max(-1.0, min(1.0, offset))
    p = sum(node.lit_buds * node.light for node in limb)
    everything = sum(node.lit_buds * node.light for node in base.above())
    share = p / everything if everything > 0.0 else 0.0
    return (
        gains.min_growth + gains.offset_gain + gains.offset_gain * offset + gains.light_gain * share
    )


def limbs_beyond(node: Node) -> list[Node]:
    """Metamers at which the limbs that this one belongs to or supports begin, its own as itself."""
    own = [node]
    for further in node.axis():
        if further.branch:
            own += limbs_beyond(further.branch)
    return own


def mean_growth(node: Node, base: Node, gains: Gains) -> float:
    """Mean of g over the limb (from this metamer on) and all limbs that it bears: G / number."""
    rates = [growth_rate(_head(limb), base, gains) for limb in limbs_beyond(node)]
    return sum(rates) / len(rates)


def weights(base: Node, gains: Gains) -> dict[tuple[int, str], float]:
    """Factors of both arms of every node; a bud has the rate of the limb that bears it."""
    found: dict[tuple[int, str], float] = {}
    for node in base.above():
        for arm, child in (("main", node.onward), ("side", node.branch)):
            if child is not None:
                found[node.index, arm] = mean_growth(child, base, gains)
            else:
                found[node.index, arm] = growth_rate(_head(node), base, gains)
    return found


def _head(node: Node) -> Node:
    while node.below is not None and node.below.onward is node:
        node = node.below
    return node
