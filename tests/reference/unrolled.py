"""Texture coordinates of one triangle of the blended surface: a twin of `blend.unrolled`."""

from __future__ import annotations

import math

import numpy as np

from forest.surface.blend.limbs import Limbs
from tests.reference.blend import cone


def on_cone(limbs: Limbs, side: np.ndarray, i: int, p: np.ndarray) -> tuple[float, float, float]:
    """Azimuth of a point around a cone from where u is 0, the radius, and the place along."""
    c = limbs.cones
    length = float(np.linalg.norm(c.end[i] - c.start[i]))
    heading = (c.end[i] - c.start[i]) / length
    along = float((p - c.start[i]) @ heading)
    t = min(max(along / length, 0.0), 1.0)
    small = 1e-6 * length + 2e-9
    low, high = (
        side[limbs.internode(c.axis[i : i + 1], c.along[i : i + 1] + s)[0]]
        for s in (small, length + small)
    )
    ahead = (1.0 - t) * low + t * high
    ahead = ahead - (ahead @ heading) * heading
    across = np.cross(heading, ahead)
    angle = math.atan2((p - c.start[i]) @ across, (p - c.start[i]) @ ahead)
    return angle, float(c.low[i] + t * (c.high[i] - c.low[i])), float(c.along[i]) + along


def uv(limbs: Limbs, side: np.ndarray, corner: np.ndarray, own: np.ndarray) -> np.ndarray:
    """u and v of the corners (3, 3), whose nearest cones are `own`; shape (3, 2), m."""
    c = limbs.cones
    middle = corner.mean(axis=0)
    nearest = min(sorted(own), key=lambda i: cone(c, int(i), middle)[0])
    found, start = np.empty((3, 2)), 0.0
    for k, point in enumerate(corner):
        i = own[k] if c.axis[own[k]] == c.axis[nearest] else nearest
        angle, radius, found[k, 1] = on_cone(limbs, side, int(i), point)
        start = angle if k == 0 else start
        angle -= 2.0 * math.pi * round((angle - start) / (2.0 * math.pi))
        found[k, 0] = radius * angle
    return found
