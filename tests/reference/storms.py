"""Winds of one direction and what trees withstand, in plain Python, tree by tree."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from forest.mechanics.shelter import Plot
from tests.reference.plant import Node
from tests.reference.stems import G, Wood, leaf_area, load, moment, stem_of

STRETCH, STRETCHES = 0.25, 80


def places(
    x: Sequence[float], y: Sequence[float], canopy: float, plot: Plot
) -> list[tuple[int, float, float]]:
    """Rows and places of all trees and of their images within 21 canopy heights."""
    images = [(0, 0)]
    if plot.periodic:
        far_x, far_y = (math.ceil(21.0 * canopy / side) + 1 for side in (plot.width, plot.depth))
        images = [(i, j) for i in range(-far_x, far_x + 1) for j in range(-far_y, far_y + 1)]
    return [
        (k, x[k] + i * plot.width, y[k] + j * plot.depth) for k in range(len(x)) for i, j in images
    ]


def counts(other: float, own: float) -> float:
    """How much a tree counts as shelter of another."""
    return min(max(2.0 * other / own - 1.0, 0.0), 1.0)


def exposure(
    x: Sequence[float],
    y: Sequence[float],
    height: Sequence[float],
    standing: Sequence[bool],
    canopy: float,
    direction: float,
    plot: Plot,
) -> list[tuple[float, float, float, float]]:
    """Spacing, E, share at the canopy's top and attenuation of each tree; NaN for the fallen."""
    everywhere = [place for place in places(x, y, canopy, plot) if standing[place[0]]]
    to = (math.cos(direction), math.sin(direction))
    spacing = [math.nan] * len(x)
    for a in range(len(x)):
        ahead = behind = beside = 0.0
        for b, there_x, there_y in everywhere:
            dx, dy = there_x - x[a], there_y - y[a]
            if 0.0 < math.hypot(dx, dy) <= 0.5 * canopy:
                one = counts(height[b], height[a])
                lee = dx * to[0] + dy * to[1]
                ahead, behind = ahead + one * (lee > 0.0), behind + one * (lee < 0.0)
                beside += one * (lee == 0.0)
        around = 1.0 + beside + 2.0 * max(ahead, behind)
        spacing[a] = min(0.5 * canopy * math.sqrt(math.pi / around), 0.45 * canopy)
    found = []
    for a in range(len(x)):
        if not standing[a]:
            found.append((math.nan,) * 4)
            continue
        cover = [0.0] * STRETCHES
        decay = [0.0] * STRETCHES
        for b, there_x, there_y in everywhere:
            dx, dy = x[a] - there_x, y[a] - there_y
            upwind = dx * to[0] + dy * to[1]
            aside = abs(dx * to[1] - dy * to[0])
            if not 0.0 < upwind <= 20.0 * canopy or aside > 0.5 * canopy:
                continue
            ground = counts(height[b], height[a]) * spacing[b] ** 2 / canopy
            s = max(spacing[b] / canopy, 0.075)
            rate = math.log(1.1127 * s + 0.0311) / canopy
            middle = min(max(upwind / (STRETCH * canopy) - 0.5, 0.0), STRETCHES - 1.0)
            near = min(int(middle), STRETCHES - 2)
            for k, part in ((near, 1.0 - middle + near), (near + 1, middle - near)):
                cover[k] += part * ground
                decay[k] += part * ground * rate
        edge = 1.0
        for k in reversed(range(STRETCHES)):
            share = cover[k] / (STRETCH * canopy)
            if share < 0.5:
                gap = STRETCH * (1.0 - 2.0 * share) + 10.0 * edge ** (1.0 / 0.3467)
                edge = min(gap / 10.0, 1.0) ** 0.3467
            edge *= math.exp(decay[k] / max(share, 1.0))
        load = gust_load(spacing[a] / canopy, edge) / gust_load(0.45, 1.0)
        fall = 2.0 * (1.0 - edge)
        found.append((spacing[a], edge, math.sqrt(load) * math.exp(0.25 * fall), fall))
    return found


def gust_load(spacing: float, edge: float) -> float:
    """Moment of gusts on a tree; Gardiner et al. 1997."""
    s = min(max(spacing, 0.075), 0.45)
    return 2.7193 * s - 0.061 + (-1.273 * s + 0.9701) * edge


def behind_an_edge(spacing: float, distance: float, gap: float) -> float:
    """E behind one gap and one edge, all in heights of the canopy, as published."""
    return (1.1127 * spacing + 0.0311) ** distance * (min(gap, 10.0) / 10.0) ** 0.3467


def crown_shares(nodes: Sequence[Node], area: float, along: np.ndarray) -> list[float]:
    """Area shown to the wind per area of the leaves, in 16 layers of a tree's height."""
    top = max(0.0, *(node.tip[2] for node in nodes))
    thick = max(top, 1e-3) / 16
    sites: list[list[float]] = [[] for _ in range(16)]
    for node in nodes:
        k = min(max(int(node.tip[2] / thick), 0), 15)
        sites[k] += [node.tip[1] * along[0] - node.tip[0] * along[1]] * node.buds
    shares = []
    for aside in sites:
        if not aside:
            shares.append(0.0)
            continue
        section = (4.0 * float(np.std(aside)) + math.sqrt(area)) * thick
        leaves = len(aside) * area
        shares.append(section * (1.0 - math.exp(-0.5 * leaves / section)) / leaves)
    return shares


def strain(
    nodes: Sequence[Node],
    of: Wood,
    speed: float,
    wind: tuple[np.ndarray, float, float],
    drag: float,
    gust: float,
) -> tuple[float, float]:
    """Largest stress in the lower half of the stem, and moment at the ground.

    `wind` is its heading, the canopy's height and the attenuation; `speed` is that at its top.
    """
    along, canopy, fall = wind
    stem = stem_of(nodes)
    shares = crown_shares(nodes, of.leaf_area, along)
    thick = max(max(0.0, *(node.tip[2] for node in nodes)), 1e-3) / 16
    forces = []
    for k in range(len(stem)):
        area, height = leaf_area(stem, k, of)
        if height < canopy:
            u = speed * math.exp(-fall * (1.0 - height / canopy))
        else:
            u = speed * math.log((height / canopy - 2 / 3) / 0.1) / math.log(10 / 3)
        shown = area * shares[min(max(int(height / thick), 0), 15)]
        streams = 10.0 / min(max(u, 11.0), 20.0) - 0.1
        forces.append(gust * 0.5 * 1.25 * drag * streams * shown * u**2)
    still = [moment(nodes, k, of, forces, along) for k in range(len(stem))]
    bent = swayed(nodes, of, still)
    stress = 0.0
    for k, node in enumerate(stem):
        if k > 0 and stem[k - 1].tip[2] > stem[-1].tip[2] / 3:
            break
        stress = max(stress, 4.0 * bent[k] / (math.pi * of.radius(node) ** 3))
    return stress, bent[0]


def swayed(nodes: Sequence[Node], of: Wood, still: Sequence[float]) -> list[float]:
    """Moments at the feet of the stations, with those of the weight beside them; six rounds."""
    stem = stem_of(nodes)
    bent = list(still)
    for _ in range(6):
        lean, place = 0.0, 0.0
        feet, weights = [], []
        for k, node in enumerate(stem):
            mean = 0.5 * (bent[k] + (bent[k + 1] if k + 1 < len(stem) else 0.0))
            turn = mean * node.length / of.rigidity(node)
            feet.append(place)
            upper = place + math.sin(min(lean + 0.5 * turn, 0.5 * math.pi)) * node.length
            weights.append([(of.wood(node), 0.5 * (place + upper)), (load(stem, k, of)[0], upper)])
            place, lean = upper, lean + turn
        bent = [
            still[k] + sum(G * m * (at - feet[k]) for pair in weights[k:] for m, at in pair)
            for k in range(len(stem))
        ]
    return bent


def anchor(nodes: Sequence[Node], of: Wood, turning: float) -> float:
    """Moment that uproots a tree, N m."""
    return turning * sum(of.wood(node) for node in stem_of(nodes))
