"""An increment core found by walking along the bore: which ring does each point lie in?"""

from __future__ import annotations

import math
from collections.abc import Sequence


def inside(x: float, y: float, rings: Sequence[tuple[float, float, float]], year: int) -> bool:
    """Whether a point lies in the wood that `year` rings (width, e, thick side) make."""
    radius = sum(width for width, _, _ in rings[:year])
    cx = sum(w * e * math.cos(math.radians(a)) for w, e, a in rings[:year])
    cy = sum(w * e * math.sin(math.radians(a)) for w, e, a in rings[:year])
    return math.hypot(x - cx, y - cy) < radius


def walk(
    rings: Sequence[tuple[float, float, float]],
    azimuth_deg: float,
    aim_deg: float,
    step_mm: float,
) -> list[float]:
    """Measure by steps the rings that the bore comes out of on their inner side, from the bark."""
    n = len(rings)
    side = math.radians(azimuth_deg)
    within, bark = 0.0, 2.0 * sum(width for width, _, _ in rings)
    for _ in range(60):
        middle = (within + bark) / 2.0
        if inside(middle * math.cos(side), middle * math.sin(side), rings, n):
            within = middle
        else:
            bark = middle
    x, y = bark * math.cos(side), bark * math.sin(side)
    heading = side + math.pi + math.radians(aim_deg)
    widths = [0.0] * n
    ring = n  # the ring in which we are
    while ring > 0:
        x += step_mm * math.cos(heading)
        y += step_mm * math.sin(heading)
        if not inside(x, y, rings, ring):
            break  # out again on the other side
        while ring > 1 and inside(x, y, rings, ring - 1):
            ring -= 1
        widths[ring - 1] += step_mm
    return [widths[k] for k in range(n - 1, ring - 1, -1)]
