"""Small trees of straight limbs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from forest.trees.skeleton import Skeleton


class Limb(NamedTuple):
    """A straight limb: where it grows from, and its shape."""

    parent: int  # axis; -1 from the ground
    at: int  # internode of the parent at whose end it starts
    start: ArrayLike
    end: ArrayLike
    base_radius: float
    tip_radius: float
    internodes: int = 8


def tree(*limbs: Limb) -> Skeleton:
    """Put limbs together."""
    parent, start, end, radius, axis, order = [], [], [], [], [], []
    first: list[int] = []
    for number, limb in enumerate(limbs):
        below = -1 if limb.parent < 0 else first[limb.parent] + limb.at
        first.append(len(parent))
        t = np.linspace(0.0, 1.0, limb.internodes + 1)[:, None]
        points = (1.0 - t) * np.asarray(limb.start) + t * np.asarray(limb.end)
        middle = 0.5 * (t[1:, 0] + t[:-1, 0])
        for k in range(limb.internodes):
            parent.append(below if k == 0 else len(parent) - 1)
            start.append(points[k])
            end.append(points[k + 1])
            radius.append(limb.base_radius + middle[k] * (limb.tip_radius - limb.base_radius))
            axis.append(number)
            order.append(0 if limb.parent < 0 else 1)
    n = len(parent)
    return Skeleton(
        parent=np.array(parent, np.int32),
        start=np.array(start),
        end=np.array(end),
        radius=np.array(radius),
        axis=np.array(axis, np.int32),
        order=np.array(order, np.int32),
        birth_year=np.full(n, 2000, np.int32),
        leafy=np.zeros(n, np.bool_),
        serial=np.arange(n, dtype=np.int32),
    )


def pole(radius: float = 0.15, height: float = 2.0) -> Skeleton:
    """Give a trunk without limbs, hardly tapering."""
    return tree(Limb(-1, 0, (0, 0, 0), (0, 0, height), radius, 0.95 * radius))


def branched(angle_deg: float = 45.0, *, radius: float = 0.1, branch: float = 0.06) -> Skeleton:
    """Give a trunk with one limb at an angle from upright, three eighths up."""
    angle = np.radians(angle_deg)
    base = np.array([0.0, 0.0, 0.3])
    tip = base + 0.7 * np.array([np.sin(angle), 0.0, np.cos(angle)])
    return tree(
        Limb(-1, 0, (0, 0, 0), (0, 0, 0.8), radius, 0.9 * radius),
        Limb(0, 2, base, tip, branch, 0.7 * branch),
    )
