"""Shelter and what stems need in the wind, in plain Python, tree by tree."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from forest.mechanics.shelter import PARTITION, REACH, Plot
from tests.reference.plant import Node
from tests.reference.stems import Wood, leaf_area, moment, stem_of


def upwind_depth(
    x: Sequence[float],
    y: Sequence[float],
    height: Sequence[float],
    frontal: Sequence[float],
    plot: Plot,
) -> np.ndarray:
    """Crowns that stand in each of eight sectors around each tree; all pairs, all images."""
    depth = np.zeros((len(x), 8))
    for a in range(len(x)):
        reach = REACH * height[a]
        images = [(0, 0)]
        if plot.periodic:
            far_x, far_y = (math.ceil(reach / side) + 1 for side in (plot.width, plot.depth))
            images = [(i, j) for i in range(-far_x, far_x + 1) for j in range(-far_y, far_y + 1)]
        for b in range(len(x)):
            for i, j in images:
                dx = x[b] + i * plot.width - x[a]
                dy = y[b] + j * plot.depth - y[a]
                distance = math.hypot(dx, dy)
                if (a == b and i == j == 0) or distance > reach:
                    continue
                shade = frontal[b] * min(max(2.0 * height[b] / height[a] - 1.0, 0.0), 1.0)
                if shade > 0.0:
                    sector = round(math.atan2(dy, dx) / (math.pi / 4)) % 8
                    width = max(distance * math.pi / 4, math.sqrt(frontal[b]))
                    depth[a, sector] += shade / (width * height[a])
    return depth


def sheltered(depth: Sequence[float]) -> tuple[float, float]:
    """Share of the open wind at the top of one tree, and how fast it falls below."""
    square = [1.0 / (1.0 + PARTITION * d) for d in depth]
    fall = sum(w * 2.0 * (1.0 - w) for w in square) / sum(square)
    return math.sqrt(sum(square) / len(square)), fall


def need_of_stem(
    nodes: Sequence[Node],
    of: Wood,
    drag: float,
    limit: float,
    wind: tuple[float, float, float],
) -> tuple[dict[int, float], float]:
    """d^2 that each metamer of the stem needs, and the stress at the foot per limit.

    `wind` is its speed at the canopy's top, the canopy's height and the attenuation below.
    """
    speed, canopy, fall = wind
    stem = stem_of(nodes)
    forces = []
    for k in range(len(stem)):
        area, height = leaf_area(stem, k, of)
        if height < canopy:
            u = speed * math.exp(-fall * (1.0 - height / canopy))
        else:
            u = speed * math.log((height / canopy - 2 / 3) / 0.1) / math.log(10 / 3)
        crown = 0.5 * area * (10.0 / min(max(u, 11.0), 20.0) - 0.1)
        forces.append(0.5 * 1.25 * drag * crown * u**2)
    hangs = np.zeros(3)
    for node in nodes:
        hangs += of.leaves(node) * node.tip
        if node not in stem:
            hangs += of.wood(node) * 0.5 * (node.start + node.tip)
    hangs[2] = 0.0
    blows = hangs / np.linalg.norm(hangs) if hangs.any() else np.array([1.0, 0.0, 0.0])
    need = {}
    for k, node in enumerate(stem):
        cube = 32.0 * moment(nodes, k, of, forces, blows) / (math.pi * limit)
        need[node.index] = cube ** (2.0 / 3.0)
    return need, need[0] ** 1.5 / (2.0 * of.radius(stem[0])) ** 3
