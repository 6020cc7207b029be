"""The annual mass balance of a tree in plain Python: kg dry mass, site by site."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from tests.reference.plant import Node


@dataclass(frozen=True)
class Prices:
    """What a tree of a species earns and pays."""

    rate: float  # income of a site in full light at the ground, kg
    leaf_mass: float
    leaf_lifespan: float
    density: float
    maintenance: float
    branch_pipe: float
    hydraulic_length: float
    light_half: float
    full_light: float
    first_pipe: float
    twig_diameter: float
    sapwood_years: float

    def wood(self, square: float, length: float) -> float:
        """Dry mass of a cylinder of squared diameter `square`."""
        return self.density * math.pi / 4.0 * square * length


def path(node: Node) -> float:
    """Length of the way from a node to the ground, m."""
    return sum(n.length for n in node.down())


def pipe_path(node: Node, kappa: float) -> float:
    """The same, a branch's part counted kappa times: there a pipe is kappa times as thick."""
    return sum(n.length * (1.0 if n.order == 0 else kappa) for n in node.down())


def response(light: float, prices: Prices) -> float:
    """The light that counts: saturating, so that shade costs less than its share of light."""
    half = prices.light_half
    if half == 0.0:
        return light
    share = light / prices.full_light
    return prices.full_light * share * (1.0 + half) / (share + half)


def income(node: Node, prices: Prices) -> float:
    """What one site at a node earns: less at the end of a long way (Ryan & Yoder 1997)."""
    return prices.rate * response(node.light, prices) / (1.0 + path(node) / prices.hydraulic_length)


def extension(height: float, turgor_limit: float) -> float:
    """Length of a new internode at a height, of one at the ground's (Koch et al. 2004)."""
    return max(0.1, 1.0 - height / turgor_limit)


def leaf_cost(prices: Prices) -> float:
    """What a site's leaves cost a year."""
    return prices.leaf_mass / prices.leaf_lifespan


def books(nodes: Sequence[Node], prices: Prices) -> tuple[float, float, float]:
    """Income, leaves and upkeep of a tree."""
    earned = sum(n.buds * income(n, prices) for n in nodes)
    leaves = sum(n.buds for n in nodes) * leaf_cost(prices)
    upkeep = sum(prices.maintenance * prices.wood(n.sapwood, n.length) for n in nodes)
    return earned, leaves, upkeep


def does_pay(node: Node, prices: Prices) -> bool:
    """Whether a site pays for its leaves and its minimal pipe to the ground."""
    pipe = prices.wood(prices.first_pipe**2, pipe_path(node, prices.branch_pipe))
    return income(node, prices) >= leaf_cost(prices) + pipe


@dataclass(frozen=True)
class Bud:
    """A bud that is offered `v` at s = 1 and holds the fraction `carried`."""

    v: float
    carried: float
    costs: tuple[float, ...]  # of its first, second, ... metamer; no more can be made

    def cost(self, s: float) -> float:
        """What it spends at a scale s."""
        made = math.floor(s * self.v + self.carried)
        return sum(self.costs[: max(0, made)])

    def thresholds(self) -> list[float]:
        """Scales at which it makes one more metamer."""
        if self.v <= 0.0:
            return []
        return [(k + 1 - self.carried) / self.v for k in range(len(self.costs))]


def affordable(buds: Sequence[Bud], budget: float) -> float:
    """The largest s in (0, 1] below which everything can be paid: try every threshold."""
    for s in sorted(t for bud in buds for t in bud.thresholds() if t <= 1.0):
        just_above = s * (1.0 + 1e-9)
        if sum(bud.cost(just_above) for bud in buds) > budget:
            return s
    return 1.0
