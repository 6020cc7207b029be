"""Winds of one direction and what trees withstand, in plain Python, tree by tree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from forest.mechanics.shelter import Plot
from tests.reference.plant import Node
from tests.reference.stems import G, Wood, leaf_area, load, moment, stem_of

STRETCH, STRETCHES = 0.25, 80
LAYERS, FRICTION = 32, 0.3


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
) -> list[tuple[float, float, float]]:
    """Spacing, E and the gusts' moment per that far within, of each tree; NaN for the fallen."""
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
            found.append((math.nan,) * 3)
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
        gusts = gust_load(spacing[a] / canopy, edge) / gust_load(spacing[a] / canopy, 0.0)
        found.append((spacing[a], edge, gusts))
    return found


def gust_load(spacing: float, edge: float) -> float:
    """Moment of gusts on a tree; Gardiner et al. 1997."""
    s = min(max(spacing, 0.075), 0.45)
    return 2.7193 * s - 0.061 + (-1.273 * s + 0.9701) * edge


def behind_an_edge(spacing: float, distance: float, gap: float) -> float:
    """E behind one gap and one edge, all in heights of the canopy, as published."""
    return (1.1127 * spacing + 0.0311) ** distance * (min(gap, 10.0) / 10.0) ** 0.3467


def crown_layers(
    nodes: Sequence[Node], area: float, along: np.ndarray, thick: float
) -> tuple[np.ndarray, np.ndarray]:
    """Area shown to the wind per area of the leaves, and area shown, in layers of the canopy."""
    sites: list[list[float]] = [[] for _ in range(LAYERS)]
    for node in nodes:
        k = min(max(int(node.tip[2] / thick), 0), LAYERS - 1)
        sites[k] += [node.tip[1] * along[0] - node.tip[0] * along[1]] * node.buds
    shares, areas = np.zeros(LAYERS), np.zeros(LAYERS)
    for k, aside in enumerate(sites):
        if aside:
            section = (4.0 * float(np.std(aside)) + math.sqrt(area)) * thick
            areas[k] = section * (1.0 - math.exp(-0.5 * len(aside) * area / section))
            shares[k] = areas[k] / (len(aside) * area)
    return shares, areas


def canopy(
    x: Sequence[float],
    y: Sequence[float],
    drag: np.ndarray,
    standing: Sequence[bool],
    height: float,
    direction: float,
    plot: Plot,
) -> np.ndarray:
    """Crowns around each tree per ground, by layers; NaN for the fallen. All pairs, all images."""
    to = (math.cos(direction), math.sin(direction))
    density = np.full(drag.shape, math.nan)
    for a in range(len(x)):
        if not standing[a]:
            continue
        near, behind, ahead = drag[a].copy(), np.zeros(LAYERS), np.zeros(LAYERS)
        for b, there_x, there_y in places(x, y, height, plot):
            dx, dy = there_x - x[a], there_y - y[a]
            if standing[b] and 0.0 < math.hypot(dx, dy) <= 0.5 * height:
                lee = dx * to[0] + dy * to[1]
                (ahead if lee > 0.0 else behind if lee < 0.0 else near)[:] += drag[b]
        more = ahead if ahead.sum() > behind.sum() else behind
        density[a] = (near + 2.0 * more) / (math.pi * (0.5 * height) ** 2)
    return density


def streams(u: float) -> float:
    """Share of a crown that faces a wind; Peltola et al. 1999."""
    return 10.0 / min(max(u, 11.0), 20.0) - 0.1


class Layer(NamedTuple):
    """Wind in a layer, m/s, and its S(u) u^2 at a tree and far within, m2/s2."""

    wind: float
    here: float
    inside: float


def winds(
    speed: float, height: float, thick: float, density: Sequence[float], edge: float
) -> list[Layer]:
    """The wind in the layers of a canopy, from the ground up, by the momentum that is left."""
    found = []
    left = 1.0  # of the momentum, which goes by the square of the wind
    for k in reversed(range(LAYERS)):
        z = (k + 0.5) * thick / height
        above = math.log((z - 2 / 3) / 0.1) / math.log(10 / 3) if z > 1.0 else 1.0
        shown = streams(speed * above * math.sqrt(left))
        below = left * math.exp(-0.5 * shown * above**2 * density[k] / FRICTION**2)
        mean = left
        if below < left:
            mean = (left - below) / math.log(left / below)
        u = speed * above * math.sqrt(mean ** (1.0 - edge))
        at_top = speed * above * math.sqrt(left ** (1.0 - edge))
        found.append(Layer(u, streams(at_top) * u**2, shown * (speed * above) ** 2 * mean))
        left = below
    return found[::-1]


def pressure(layers: Sequence[Layer], density: Sequence[float], gusts: float) -> list[float]:
    """S(u) u^2 in each layer, so that the canopy's moment is `gusts` times that far within."""
    inside = sum(
        d * layer.inside * (k + 0.5)
        for k, (d, layer) in enumerate(zip(density, layers, strict=True))
    )
    here = sum(
        d * layer.here * (k + 0.5) for k, (d, layer) in enumerate(zip(density, layers, strict=True))
    )
    scale = gusts * inside / here if here > 0.0 else gusts
    return [scale * layer.here for layer in layers]


class Place(NamedTuple):
    """Where a tree stands in a canopy."""

    along: np.ndarray
    height: float  # of the canopy, m
    thick: float  # of a layer, m
    density: Sequence[float]
    edge: float
    gusts: float


def strain(
    nodes: Sequence[Node], of: Wood, speed: float, place: Place, drag: float, gust: float
) -> tuple[float, float]:
    """Stress at breast height, and moment at the ground."""
    stem = stem_of(nodes)
    shares, _ = crown_layers(nodes, of.leaf_area, place.along, place.thick)
    layers = winds(speed, place.height, place.thick, place.density, place.edge)
    pushes = pressure(layers, place.density, place.gusts)
    forces = []
    for k in range(len(stem)):
        area, height = leaf_area(stem, k, of)
        layer = min(max(int(height / place.thick), 0), LAYERS - 1)
        forces.append(gust * 0.5 * 1.25 * drag * area * shares[layer] * pushes[layer])
    bent = swayed(nodes, of, forces, place.along)
    limit = min(1.3, stem[-1].tip[2] / 3.0)
    feet = [0.0, *(node.tip[2] for node in stem[:-1])]
    at = next((k - 1 for k in range(1, len(stem)) if feet[k] > limit), len(stem) - 1)
    return 4.0 * bent[at] / (math.pi * of.radius(stem[at]) ** 3), bent[0]


def swayed(
    nodes: Sequence[Node], of: Wood, forces: Sequence[float], along: np.ndarray
) -> list[float]:
    """Moments at the feet of the stations, with those of the weight that the wind moves aside."""
    stem = stem_of(nodes)
    calm = [0.0] * len(stem)
    blown = [moment(nodes, k, of, forces, along) for k in range(len(stem))]
    more = [m - moment(nodes, k, of, calm, along) for k, m in enumerate(blown)]
    lean, place = 0.0, 0.0
    feet, weights = [], []
    for k, node in enumerate(stem):
        mean = 0.5 * (more[k] + (more[k + 1] if k + 1 < len(stem) else 0.0))
        turn = mean * node.length / of.rigidity(node)
        feet.append(place)
        middle = min(max(lean + 0.5 * turn, -0.5 * math.pi), 0.5 * math.pi)
        upper = place + math.sin(middle) * node.length
        weights.append([(of.wood(node), 0.5 * (place + upper)), (load(stem, k, of)[0], upper)])
        place, lean = upper, lean + turn
    return [
        blown[k] + sum(G * m * (at - feet[k]) for pair in weights[k:] for m, at in pair)
        for k in range(len(stem))
    ]


def anchor(nodes: Sequence[Node], of: Wood, turning: float) -> float:
    """Moment that uproots a tree, N m."""
    return turning * sum(of.wood(node) for node in stem_of(nodes))


def images(
    x: np.ndarray, y: np.ndarray, canopy: float, to: tuple[float, float], plot: Plot
) -> list[tuple[float, float, int]]:
    """Places along and across a wind, and rows, of all that may shelter: image by image."""
    along, across = x * to[0] + y * to[1], y * to[0] - x * to[1]
    found: list[tuple[float, float, int]] = []
    if not len(x):
        return found
    low, high = across.min() - 0.5 * canopy, across.max() + 0.5 * canopy
    near, far = along.min() - 20.0 * canopy, along.max() + 0.5 * canopy
    columns, lines = (math.ceil(20.5 * canopy / size) + 1 for size in (plot.width, plot.depth))
    for i in range(-columns, columns + 1):
        for j in range(-lines, lines + 1):
            dx, dy = i * plot.width, j * plot.depth
            u = along + (dx * to[0] + dy * to[1])
            v = across + (dy * to[0] - dx * to[1])
            for row in np.flatnonzero((v >= low) & (v <= high) & (u >= near) & (u <= far)):
                found.append((u[row], v[row], int(row)))
    return found
