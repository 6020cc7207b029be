"""Trees for tests of bark: a trunk with one branch, and its wood year by year."""

from __future__ import annotations

import numpy as np

from forest.record.wood import YearlyWood
from forest.trees.skeleton import Skeleton


def forked(
    *, angle_deg: float = 45.0, branch_m: float = 0.8, radius_m: float = 0.15, thin_m: float = 0.07
) -> Skeleton:
    """Give a trunk of 2 m that tapers to two thirds, and a branch from its middle."""
    trunk = np.linspace(0.0, 2.0, 11)
    away = np.array((np.sin(np.radians(angle_deg)), 0.0, np.cos(np.radians(angle_deg))))
    steps = np.linspace(0.0, branch_m, 5)
    foot = np.array((0.0, 0.0, trunk[5]))
    start = np.vstack(
        (np.column_stack((0 * trunk, 0 * trunk, trunk))[:-1], foot + steps[:-1, None] * away)
    )
    end = np.vstack(
        (np.column_stack((0 * trunk, 0 * trunk, trunk))[1:], foot + steps[1:, None] * away)
    )
    parent = np.concatenate((np.arange(-1, 9), [4], np.arange(10, 13)))
    radius = np.concatenate(
        (radius_m * np.linspace(1.0, 2 / 3, 10), thin_m * np.linspace(1.0, 0.8, 4))
    )
    n = len(parent)
    axis = np.repeat([0, 1], [10, 4])
    return Skeleton(
        parent=parent.astype(np.int32),
        start=start,
        end=end,
        radius=radius,
        axis=axis.astype(np.int32),
        order=axis.astype(np.int32),
        birth_year=np.full(n, 2000, np.int32),
        leafy=np.zeros(n, np.bool_),
        serial=np.arange(n, dtype=np.int32),
        tree_id=7,
        species="quercus_robur",
    )


def pole(radius_m: float = 0.1, height_m: float = 1.0, internodes: int = 10) -> Skeleton:
    """Give an upright stem of one radius."""
    z = np.linspace(0.0, height_m, internodes + 1)
    place = np.column_stack((0.0 * z, 0.0 * z, z))
    return Skeleton(
        parent=np.arange(-1, internodes - 1, dtype=np.int32),
        start=place[:-1],
        end=place[1:],
        radius=np.full(internodes, radius_m),
        axis=np.zeros(internodes, np.int32),
        order=np.zeros(internodes, np.int32),
        birth_year=np.full(internodes, 2000, np.int32),
        leafy=np.zeros(internodes, np.bool_),
        serial=np.arange(internodes, dtype=np.int32),
    )


def wood_of(skeleton: Skeleton, years: int = 12, eccentricity: float = 0.0) -> YearlyWood:
    """Give rings that widen all wood alike, thick to the east where eccentric."""
    share = np.arange(1, years + 1) / years
    radius = share[:, None] * skeleton.radius
    side = np.zeros_like(radius)
    return YearlyWood(
        np.arange(2001, 2001 + years), radius, np.full_like(radius, eccentricity), side
    )
