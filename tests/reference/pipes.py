"""Pipes in plain Python: Palubicki et al. 2009, section 4.5, and the year's ring."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from tests.reference.budget import Prices, income, leaf_cost, pipe_path
from tests.reference.plant import Node

SUPPORT = math.pi * 100 * 0.3048  # Hart & Baker 2003, eq. 8, m


def thicken_paper(nodes: Sequence[Node], step: int, strand: float) -> dict[int, float]:
    """Each new leaf adds d0^n to its internode and to every one below; nothing is taken away."""
    pipe = {n.index: n.pipe for n in nodes}
    for leaf in nodes:
        if leaf.birth == step:
            for lower in leaf.down():
                pipe[lower.index] += strand
    return pipe


@dataclass
class Ring:
    """What a year lays down: squared diameters by index, and the accounts in kg."""

    pipe: dict[int, float]
    sapwood: dict[int, float]
    extension: float
    ring: float
    kept: float  # left for the reserve, if no site earned more than its leaves


def needs_to_support(load: float, density: float) -> float:
    """Least radius of a limb that carries a load (Hart & Baker 2003, eq. 7)."""
    return math.sqrt(load / (SUPPORT * density))


def thicken_balanced(
    nodes: Sequence[Node],
    step: int,
    prices: Prices,
    spend: float,
    favour: Callable[[Sequence[Node]], Mapping[int, float]] | None = None,
) -> Ring:
    """New metamers, then what is too thin for its load, then the ring out of the rest.

    `favour` gives the growth rate of each metamer's limb, by which the ring is weighted.
    """
    pipe = {n.index: n.pipe for n in nodes}
    flow = {n.index: 0.0 for n in nodes}  # squared diameter that sets out from a node
    extension = 0.0
    for n in nodes:
        if n.birth == step:
            pipe[n.index] = prices.twig_diameter**2
            flow[n.index] += prices.first_pipe**2
            extension += prices.wood(prices.twig_diameter**2, n.length) + prices.leaf_mass
            extension += prices.wood(prices.first_pipe**2, pipe_path(n, prices.branch_pipe))
    for n in nodes:
        n.pipe = pipe[n.index]
    weight = favour(nodes) if favour else None
    rest = max(0.0, spend - extension)

    def load(n: Node) -> float:
        own = prices.wood(pipe[n.index], n.length) + n.buds * prices.leaf_mass
        return own + sum(load(child) for child in n.children())

    lack = {
        n.index: max(0.0, 4.0 * needs_to_support(load(n), prices.density) ** 2 - pipe[n.index])
        for n in nodes
    }
    wanted = sum(prices.wood(lack[n.index], n.length) for n in nodes)
    part = min(1.0, rest / wanted) if wanted > 0.0 else 0.0
    for n in nodes:
        pipe[n.index] += part * lack[n.index]
    ring = rest - part * wanted

    surplus: dict[int, float] = {}
    for n in nodes:
        if n.birth == step:
            continue
        sites = n.buds + sum(child.birth == step for child in n.children())
        surplus[n.index] = sites * max(0.0, income(n, prices) - leaf_cost(prices))
        if weight is not None:
            surplus[n.index] *= weight[n.index]
    total = sum(surplus.values())
    for n in nodes:
        if total > 0.0 and surplus.get(n.index, 0.0) > 0.0:
            paid = ring * surplus[n.index] / total
            flow[n.index] += paid / prices.wood(1.0, pipe_path(n, prices.branch_pipe))

    sapwood = {n.index: n.sapwood for n in nodes}  # rings alone: primary wood serves no site
    for lower in nodes:
        passing = sum(flow[n.index] for n in lower.above())
        here = passing * (1.0 if lower.order == 0 else prices.branch_pipe)
        pipe[lower.index] += here
        old = sapwood[lower.index] * (1.0 - 1.0 / prices.sapwood_years)
        sapwood[lower.index] = min(old + here, pipe[lower.index])
    laid = rest if total > 0.0 else part * wanted
    return Ring(pipe, sapwood, extension, laid, rest - laid)
