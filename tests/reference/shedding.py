"""Shedding in plain Python: Palubicki et al. 2009, section 4.4."""

from __future__ import annotations

from dataclasses import dataclass

from tests.reference.plant import Node


@dataclass
class Shed:
    """What is left of a tree."""

    kept: list[Node]
    sapwood: dict[int, float]  # by serial
    lost_main: set[int]  # serials whose axis is cut off above them
    lost_branch: set[int]


def shed(base: Node, threshold: float, drop_bare: bool, kappa: float) -> Shed:
    """Compare each branch's light with its internodes; in the stand drop parts without a site."""
    all_nodes = sorted(base.above(), key=lambda n: n.index)
    sapwood = {n.serial: n.sapwood for n in all_nodes}
    gone: set[Node] = set()
    lost_main: set[int] = set()
    lost_branch: set[int] = set()
    for node in all_nodes:
        if node.below is None or node in gone:
            continue
        part = list(node.above())
        light = sum(n.lit_buds * n.light for n in part)
        starts_branch = node.below.branch is node
        poor = starts_branch and light / len(part) < threshold
        bare = drop_bare and sum(n.buds for n in part) == 0
        if poor or bare:
            gone |= set(part)
            (lost_branch if starts_branch else lost_main).add(node.below.serial)
            served = node.sapwood / (kappa if node.order > 0 else 1.0)
            for lower in node.below.down():
                sapwood[lower.serial] -= served * (kappa if lower.order > 0 else 1.0)
    kept = [n for n in all_nodes if n not in gone]
    return Shed(kept, {k: max(0.0, v) for k, v in sapwood.items()}, lost_main, lost_branch)
