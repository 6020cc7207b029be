"""User-drawn curves (Taylor-Hell 2005, section 3.1): straight lines between control points."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise


def value_at(points: Sequence[tuple[float, float]], x: float) -> float:
    """Value at x; as at the nearest end outside; 1 where no curve is drawn."""
    if not points:
        return 1.0
    if x <= points[0][0]:
        return points[0][1]
    for (x0, y0), (x1, y1) in pairwise(points):
        if x0 <= x <= x1:
            return y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    return points[-1][1]
