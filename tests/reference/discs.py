"""Discs and knots point by point: in which ring or knot does a point lie?"""

from __future__ import annotations

from collections.abc import Sequence

from tests.reference.cores import inside

Vector = tuple[float, float, float]


def reach(rings: Sequence[tuple[float, float, float]], year: int, x: float, y: float) -> float:
    """How far the wood of `year` rings (width, e, thick side) reaches towards x, y."""
    within, beyond = 0.0, 2.0 * sum(width for width, _, _ in rings) + 1.0
    for _ in range(60):
        middle = (within + beyond) / 2.0
        if inside(middle * x, middle * y, rings, year):
            within = middle
        else:
            beyond = middle
    return within


def in_cones(
    point: Vector, apex: Vector, direction: Vector, along: Sequence[float], radius: Sequence[float]
) -> float:
    """How deep a point lies in a row of cones about an axis; negative outside of them."""
    away = [p - a for p, a in zip(point, apex, strict=True)]
    s = sum(a * d for a, d in zip(away, direction, strict=True))
    aside = sum((a - s * d) ** 2 for a, d in zip(away, direction, strict=True)) ** 0.5
    for k in range(len(along) - 1):
        if along[k] <= s <= along[k + 1]:
            share = (s - along[k]) / (along[k + 1] - along[k])
            return radius[k] + share * (radius[k + 1] - radius[k]) - aside
    return -1.0


def in_polygon(x: float, y: float, corners: Sequence[tuple[float, float]]) -> bool:
    """Count how often a ray from the point crosses the outline."""
    odd = False
    for k in range(len(corners)):
        (ax, ay), (bx, by) = corners[k - 1], corners[k]
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            odd = not odd
    return odd
