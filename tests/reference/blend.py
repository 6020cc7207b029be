"""The blended surface's function in plain Python, from the equations (Hart & Baker 2003, 5.2)."""

from __future__ import annotations

import math

import numpy as np

from forest.surface.blend.cones import Cones
from forest.surface.blend.field import _SOFT
from forest.surface.blend.joints import Joints


def fade(t: float) -> float:
    return 1.0 - 3.0 * t * t + 2.0 * t**3 if t < 1.0 else 0.0


def cone(c: Cones, i: int, x: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Value, radius and foot of a point on one cone; no root flare."""
    line = c.end[i] - c.start[i]
    length = float(np.linalg.norm(line))
    raw = float((x - c.start[i]) @ line) / length
    s = min(max(raw, 0.0), length)
    foot = c.start[i] + s / length * line
    d = float(np.linalg.norm(x - foot))
    r = c.low[i] + s / length * (c.high[i] - c.low[i])
    a = c.axis[i]
    if c.along[i] + s < c.reach[a]:
        wide = c.widened[a] * fade((c.along[i] + s) / c.reach[a]) * fade(max(-raw, 0.0) / c.low[i])
        cosine = float((x - foot) @ c.side[i]) / d if d > 1e-12 else 0.0
        r += wide * (1.0 + cosine) / 2.0
    ground = c.ground[a] - max(c.along[i] + s - 2.0 * r, 0.0)
    return max(d - r, ground - float(x[2])), r, foot


def side(
    c: Cones, first: int, last: int, soft: float, x: np.ndarray
) -> tuple[float, float, np.ndarray]:
    each = [cone(c, i, x) for i in range(first, last)]
    least = min(e[0] for e in each)
    weight = [max(1.0 - (e[0] - least) / soft, 0.0) ** 2 for e in each]
    total = sum(weight)
    r = sum(w * e[1] for w, e in zip(weight, each, strict=True)) / total
    foot = sum(w * e[2] for w, e in zip(weight, each, strict=True)) / total
    return least, r, foot


def rounded(a: float, b: float, width: float) -> float:
    if width <= 0.0:
        return min(a, b)
    return min(a, b) - 0.25 * width * max(1.0 - abs(a - b) / width, 0.0) ** 2


def spheres(x: np.ndarray, x1: np.ndarray, r1: float, x2: np.ndarray, r2: float) -> float:
    """Least over the line from x1 to x2 of distance minus radius: a convex function, by thirds."""

    def f(s: float) -> float:
        return float(np.linalg.norm(x - (x1 + s * (x2 - x1)))) - (r1 + s * (r2 - r1))

    low, high = 0.0, 1.0
    for _ in range(120):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        if f(a) <= f(b):
            high = b
        else:
            low = a
    return min(f(0.0), f(1.0), f(0.5 * (low + high)))


def printed(x: np.ndarray, x1: np.ndarray, r1: float, x2: np.ndarray, r2: float) -> float:
    """Eqs 26 to 30 as they are printed."""
    d1, d2 = float(np.linalg.norm(x - x1)), float(np.linalg.norm(x - x2))
    r = (d2 * r1 + d1 * r2) / max(d1 + d2, 1e-12)
    return spheres(x, x1, 0.0, x2, 0.0) - r


def value(c: Cones, joints: Joints, x: np.ndarray, paper: bool = False) -> float:
    """The whole function at a point."""
    plain = min(cone(c, i, x)[0] for i in range(len(c.low)))
    best, moved, total = plain, 0.0, 0.0
    for p in range(len(joints.place) - 1):
        here = math.inf
        for j in range(joints.place[p], joints.place[p + 1]):
            share = fade(float(np.linalg.norm(x - joints.point[j])) / joints.reach[j])
            if share <= 0.0:
                continue
            thin = joints.thin[j]
            (f1, r1, x1), (f2, r2, x2) = (
                side(c, joints.first[j, k], joints.last[j, k], _SOFT * thin, x) for k in range(2)
            )
            if not paper:
                share *= fade(max(f1, 0.0) / joints.near[j]) * fade(max(f2, 0.0) / joints.near[j])
            if share <= 0.0:
                continue
            if paper:
                moved += share * share * (printed(x, x1, r1, x2, r2) - min(f1, f2))
                total += share
                continue
            ground = max(c.ground[c.axis[joints.first[j, k]]] for k in range(2)) - x[2]
            union = rounded(f1, f2, 0.5 * thin * share)
            blend = min(max(spheres(x, x1, r1, x2, r2), ground), union)
            here = rounded_or(here, (1.0 - share) * union + share * blend, 0.3 * thin * share)
        best = min(best, here)
    return plain + moved / total if paper and total > 0.0 else best


def rounded_or(a: float, b: float, width: float) -> float:
    return b if math.isinf(a) else rounded(a, b, width)
