"""Trees as plain bodies, from a year's rows of `/trees` alone: a tapered stem, a crown around it.

They show a stand of thousands of trees at once, of any run file and any year.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

_BREAST_HEIGHT_M = 1.3
_LEAST_HEIGHT_M = 0.05  # of a tree with no height on record
_LEAST_SLENDERNESS = 120.0  # height over base diameter, of a stem with no diameter on record
_BUTT = 1.15  # base diameter over dbh where only the dbh is on record
_MOST_LEAN_DEG = 80.0
_WIDEST_AT = 0.15  # of a conifer's crown, from its base up: widest there, then a cone
_ROUND_AT = 0.36  # of other crowns, where they are widest
_CONE = 0.85  # power of that cone; below 1 it bulges a little
_GOLDEN = 0.6180339887498949


class Bodies(NamedTuple):
    """Closed surfaces of stems and crowns; triangles turn counterclockwise seen from outside.

    Attributes
    ----------
    points : float32 (n, 3)
        m, in the plot's coordinates.
    triangles : int32 (m, 3)
        Numbers of points; no two bodies share one.
    tree : int32 (n,)
        Row of the frame that the point belongs to, counted from 0.
    crown : bool (n,)
        True on crowns, False on stems.
    """

    points: NDArray[np.float32]
    triangles: NDArray[np.int32]
    tree: NDArray[np.int32]
    crown: NDArray[np.bool_]


def no_bodies() -> Bodies:
    """Give the bodies of no tree."""
    return Bodies(
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.int32),
        np.zeros(0, np.int32),
        np.zeros(0, np.bool_),
    )


def tree_bodies(
    trees: pd.DataFrame,
    *,
    stem_sides: int = 8,
    crown_sides: int = 12,
    crown_rings: int = 5,
    conifers: Collection[str] = (),
) -> Bodies:
    """Give each tree a stem and, where it has one, a crown.

    A stem is as thick at its base and at 1.3 m as measured, and ends in a point at the tree's
    height. A crown reaches from the crown's base to the top, and is at its widest as wide as the
    crown's mean radius: a cone with a rounded foot for conifers, for others the halves
    of two ellipsoids, the upper one the higher. A tree that leans has its top where the lean puts
    it; the direction is not on record, and is drawn from the tree's number.

    Parameters
    ----------
    trees : DataFrame
        Columns `tree_id`, `species`, `x_m`, `y_m`, `height_m`, `dbh_cm`, `base_diameter_cm`,
        `crown_base_m` and `crown_radius_m` of `/trees`, and `lean_deg` if known. A value that is
        missing is taken from the others.
    stem_sides, crown_sides : int
        Corners around a stem and around a crown, at least 3.
    crown_rings : int
        Levels of corners between the crown's two ends, at least 1.
    conifers : collection of str
        Species that are conifers.

    Returns
    -------
    Bodies
        All stems, then all crowns, each in the frame's order.
    """
    height = _known(trees, "height_m", _LEAST_HEIGHT_M)
    tree_id = trees["tree_id"].to_numpy(np.float64)
    foot = np.column_stack((trees["x_m"], trees["y_m"])).astype(np.float64).reshape(-1, 2)
    lean = np.zeros(len(trees))
    if "lean_deg" in trees:
        lean = np.nan_to_num(trees["lean_deg"].to_numpy(np.float64)).clip(0.0, _MOST_LEAN_DEG)
    azimuth = 2.0 * np.pi * np.modf(tree_id * _GOLDEN)[0]
    shift = np.tan(np.radians(lean))[:, None] * np.column_stack((np.cos(azimuth), np.sin(azimuth)))

    levels, radius = _stem_levels(trees, height)
    stems = _rounds(foot, shift, levels, radius, stem_sides, azimuth)

    base = np.minimum(np.nan_to_num(trees["crown_base_m"].to_numpy(np.float64)), height).clip(0.0)
    reach = np.nan_to_num(trees["crown_radius_m"].to_numpy(np.float64))
    has = np.flatnonzero((reach > 0.0) & (base < height))
    needles = np.isin(trees["species"].astype(str).to_numpy(), list(conifers))[has]
    level, width = (
        np.where(needles[:, None], cone, round_)
        for cone, round_ in zip(_cone(crown_rings), _ellipsoid(crown_rings), strict=True)
    )
    levels = base[has, None] + level * (height - base)[has, None]
    crowns = _rounds(
        foot[has], shift[has], levels, width * reach[has, None], crown_sides, azimuth[has]
    )
    n_stem = len(stems[0])
    return Bodies(
        np.concatenate((stems[0], crowns[0])),
        np.concatenate((stems[1], crowns[1] + np.int32(n_stem))),
        np.concatenate((stems[2], has.astype(np.int32)[crowns[2]])),
        np.arange(n_stem + len(crowns[0])) >= n_stem,
    )


def _known(trees: pd.DataFrame, column: str, least: float) -> NDArray[np.float64]:
    """Give a column with `least` where a number is missing or smaller."""
    return np.asarray(np.fmax(trees[column].to_numpy(np.float64), least))


def _stem_levels(
    trees: pd.DataFrame, height: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Heights and radii (n, 4) of a stem's levels: foot, foot's rim, breast height, top.

    A tree not higher than twice 1.3 m has its third level at half its height, on a straight taper.
    """
    base = trees["base_diameter_cm"].to_numpy(np.float64)
    dbh = trees["dbh_cm"].to_numpy(np.float64)
    base = np.where(base > 0.0, base, _BUTT * dbh)
    base = 0.01 * np.where(base > 0.0, base, 100.0 * height / _LEAST_SLENDERNESS)
    middle = np.minimum(_BREAST_HEIGHT_M, 0.5 * height)
    straight = base * (1.0 - middle / height)
    measured = (height > 2.0 * _BREAST_HEIGHT_M) & (dbh > 0.0)
    at_middle = np.minimum(np.where(measured, 0.01 * dbh, straight), base)
    none = np.zeros(len(height))
    return (
        np.column_stack((none, none, middle, height)),
        0.5 * np.column_stack((none, base, at_middle, none)),
    )


def _ellipsoid(rings: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give levels (0 to 1) and widths (0 to 1) of a round crown's rings, with both ends."""
    turn = np.linspace(0.0, np.pi, rings + 2)
    width = np.sin(turn)
    width[[0, -1]] = 0.0
    rise = -np.cos(turn)
    level = _ROUND_AT + np.where(rise < 0.0, _ROUND_AT, 1.0 - _ROUND_AT) * rise
    return level, width / width.max()


def _cone(rings: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the same of a cone with a rounded foot."""
    level = np.concatenate(([0.0], np.linspace(_WIDEST_AT, 1.0, rings + 1)))
    width = ((1.0 - level) / (1.0 - _WIDEST_AT)).clip(0.0) ** _CONE
    width[0] = 0.0
    return level, width


def _rounds(
    foot: NDArray[np.float64],
    shift: NDArray[np.float64],
    levels: NDArray[np.float64],
    radius: NDArray[np.float64],
    sides: int,
    turned: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.int32]]:
    """Make n bodies of rings around an axis: points, triangles, and the body of each point.

    Parameters
    ----------
    foot, shift : float64 (n, 2)
        Where the axis meets the ground, m; how far it moves aside, m per m of height.
    levels, radius : float64 (n, k)
        Height and radius of each ring, from below; the first and the last ring are points. Rings
        stand across the axis; what would lie below the ground lies on it.
    sides : int
        Corners of a ring.
    turned : float64 (n,)
        Angle of the first corner.
    """
    n, k = levels.shape
    angle = turned[:, None] + 2.0 * np.pi * np.arange(sides) / sides
    around = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    axis = foot[:, None] + shift[:, None] * levels[:, :, None]
    per = 2 + (k - 2) * sides
    points = np.empty((n, per, 3), np.float32)
    tilt = np.hypot(*shift.T)
    cosine = 1.0 / np.sqrt(1.0 + tilt**2)
    way = shift / np.maximum(tilt, 1e-12)[:, None]
    along = np.einsum("nsi,ni->ns", around, way)
    around = around + ((cosine - 1.0)[:, None] * along)[..., None] * way[:, None]
    drop = (tilt * cosine)[:, None] * along
    inner = axis[:, 1:-1, None] + radius[:, 1:-1, None, None] * around[:, None]
    points[:, 2:, :2] = inner.reshape(n, per - 2, 2)
    height = levels[:, 1:-1, None] - radius[:, 1:-1, None] * drop[:, None]
    points[:, 2:, 2] = np.maximum(height, 0.0).reshape(n, per - 2)
    points[:, :2, :2], points[:, :2, 2] = axis[:, [0, -1]], levels[:, [0, -1]]

    side = np.arange(sides)
    following = (side + 1) % sides
    ring = 2 + sides * np.arange(k - 2)
    low, high = ring[:-1, None], ring[1:, None]
    parts = [
        np.column_stack((np.zeros(sides, np.int64), 2 + following, 2 + side)),
        np.stack((low + side, low + following, high + following), axis=-1).reshape(-1, 3),
        np.stack((low + side, high + following, high + side), axis=-1).reshape(-1, 3),
        np.column_stack((np.ones(sides, np.int64), ring[-1] + side, ring[-1] + following)),
    ]
    one = np.concatenate(parts)
    triangles = (per * np.arange(n)[:, None, None] + one).astype(np.int32)
    body = np.repeat(np.arange(n, dtype=np.int32), per)
    return points.reshape(-1, 3), triangles.reshape(-1, 3), body
