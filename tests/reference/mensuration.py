"""Stems, crowns and bucking the slow way: children lists, one slice at a time, every cut tried."""

from __future__ import annotations

import itertools
import math

import numpy as np

from forest.trees.metamers import CONTINUED, LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import Trees

Point = tuple[float, float]


def stem_path(m: Metamers, trees: Trees, row: int) -> list[int]:
    """List the metamers of a tree's stem, from the base up."""
    n, first = int(trees.size[row]), int(trees.start[row])
    path: list[int] = []
    here = -1
    while True:
        children = [j for j in range(n) if m.parent[first + j] == here]
        if here >= 0 and m.state[first + here] & CONTINUED:
            children = [j for j in children if m.state[first + j] & MAIN]
        if not children:
            return path
        (here,) = children
        path.append(here)


def tips(m: Metamers, trees: Trees, row: int) -> list[tuple[float, float, float]]:
    """List a tree's leaf-bearing tips, from the stem base."""
    first = int(trees.start[row])
    return [
        tuple(float(c) for c in m.tip[i])
        for i in range(first, first + int(trees.size[row]))
        if m.state[i] & (TERMINAL | LATERAL)
    ]


def octagon_area(reach: list[float]) -> float:
    """Add up the eight triangles of 45 degrees between neighbouring radii."""
    around = zip(reach, reach[1:] + reach[:1], strict=True)
    return sum(0.5 * a * b * math.sin(math.pi / 4) for a, b in around)


def radii(points: list[tuple[float, float, float]]) -> list[float]:
    """Give the reach in eight sectors, the first from x towards y."""
    reach = [0.0] * 8
    for x, y, _ in points:
        sector = int((math.atan2(y, x) % (2 * math.pi)) / (math.pi / 4)) % 8
        reach[sector] = max(reach[sector], math.hypot(x, y))
    return reach


def crown_volume(points: list[tuple[float, float, float]], slices: int) -> float:
    """Stack octagons, each as wide as the lesser of the widest at or above and at or below it."""
    if not points:
        return 0.0
    low, high = min(p[2] for p in points), max(p[2] for p in points)
    if high == low:
        return 0.0
    cut: list[list[tuple[float, float, float]]] = [[] for _ in range(slices)]
    for p in points:
        cut[min(int((p[2] - low) * (slices / (high - low))), slices - 1)].append(p)
    own = [radii(part) for part in cut]
    total = 0.0
    for k in range(slices):
        filled = [
            min(max(r[s] for r in own[: k + 1]), max(r[s] for r in own[k:])) for s in range(8)
        ]
        total += octagon_area(filled) * (high - low) / slices
    return total


def hull_area(points: list[Point]) -> float:
    """Wrap a string around the points: from each corner to the one farthest to the right."""
    points = sorted(set(points))
    if len(points) < 3:
        return 0.0
    corner, corners = points[0], []
    while True:
        corners.append(corner)
        following = next(p for p in points if p != corner)
        for p in points:
            side = (following[0] - corner[0]) * (p[1] - corner[1]) - (following[1] - corner[1]) * (
                p[0] - corner[0]
            )
            farther = math.dist(corner, p) > math.dist(corner, following)
            if side < 0 or (side == 0 and farther):
                following = p
        corner = following
        if corner == points[0] or len(corners) > len(points):
            break
    around = zip(corners, corners[1:] + corners[:1], strict=True)
    return abs(sum(a[0] * b[1] - a[1] * b[0] for a, b in around)) / 2


def cylinder_volume(ends: list[float], diameters: list[float], low: float, high: float) -> float:
    """Integrate a stem of cylinders between two distances along it."""
    total, start = 0.0, 0.0
    for end, d in zip(ends, diameters, strict=True):
        total += math.pi / 4 * d * d * max(0.0, min(end, high) - max(start, low))
        start = end
    return total


def best_value(
    ends: list[float],
    diameters: list[float],
    products: list[tuple[list[int], float, float]],
    stump: float,
    module: float,
) -> float:
    """Try every sequence of logs and waste; products are (modules, least top diameter, price)."""
    places = max(int((ends[-1] - stump) / module + 1e-9), 0)
    choices = [(1, math.inf, 0.0)]
    choices += [(k, top, price) for lengths, top, price in products for k in lengths]
    best = 0.0
    for pieces in range(places + 1):
        for cut in itertools.product(choices, repeat=pieces):
            if sum(k for k, _, _ in cut) != places:
                continue
            here, value = 0, 0.0
            for k, top, price in cut:
                low, high = stump + here * module, stump + (here + k) * module
                thin = next((d for e, d in zip(ends, diameters, strict=True) if e >= high), 0.0)
                if price and thin < top:
                    break
                value += price * cylinder_volume(ends, diameters, low, high)
                here += k
            else:
                best = max(best, value)
    return best


def hegyi(x, y, dbh, size, periodic, radius) -> np.ndarray:
    """Visit every competitor, and on a torus each of its images near enough."""
    n = len(x)
    out = np.full(n, np.nan)
    for i in range(n):
        if math.isnan(dbh[i]):
            continue
        out[i] = 0.0
        around = range(-4, 5) if periodic else [0]
        for j, a, b in itertools.product(range(n), around, around):
            if math.isnan(dbh[j]) or (i == j and a == b == 0):
                continue
            away = math.hypot(x[j] + a * size[0] - x[i], y[j] + b * size[1] - y[i])
            if away <= radius:
                out[i] += dbh[j] / dbh[i] / max(away, 0.1)
    return out
