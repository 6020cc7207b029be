"""Leaves, internodes and obstacles as shapes in a picture of the stand, and how they are drawn.

The picture lies on the ground. A point (x, y, z) is carried along the light's direction d to
(x - z dx/dz, y - z dy/dz): a shear, in which a horizontal leaf keeps its shape and area. What
stands higher on a ray is nearer to the light, so z is the depth. On a periodic plot the ground
itself is the picture. A pixel is the ray through its centre, which makes a shape of any size cover,
on average over the pixels' random shift, exactly its share of the rays.

Spots are pixels (first and last along x, first and last along y), counted from the corner of the
picture's window; on a torus they need not be wrapped. Last below first means no pixel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit


class Scene(NamedTuple):
    """One picture: where its light comes from and where its pixels lie.

    Attributes
    ----------
    slope_x, slope_y : float
        Shift of a point on the ground per metre of height, dx/dz and dy/dz.
    toward_x, toward_y : float
        Horizontal parts of the unit vector towards the light.
    stretch_x, stretch_y : float
        Half the extents along x and y of the image of a ball of radius 1.
    per_x, per_y : float
        Pixels per metre.
    shift_x, shift_y : float
        Place of the centre of the window's first pixel, pixels.
    wide, deep : int
        Number of pixels of the window.
    periodic : int
        1 where the window is the whole torus.
    """

    slope_x: float
    slope_y: float
    toward_x: float
    toward_y: float
    stretch_x: float
    stretch_y: float
    per_x: float
    per_y: float
    shift_x: float
    shift_y: float
    wide: int
    deep: int
    periodic: int


class Columns(NamedTuple):
    """Upright columns of solid voxels: lower corners, heights of foot and top, edge, m."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    foot: NDArray[np.float64]
    top: NDArray[np.float64]
    edge: float


@njit
def _between(low: Any, high: Any, per: Any, shift: Any) -> Any:
    """Find the pixels whose centres lie in [low, high)."""
    return np.int64(np.ceil(low * per - shift)), np.int64(np.ceil(high * per - shift)) - 1


@njit
def leaf_spots(scene: Any, x: Any, y: Any, z: Any, half: Any) -> Any:
    """Find the spots of a horizontal square leaf of half the edge, and how many pixels it covers.

    A leaf between all centres covers none; its spots are then the pixel that it is nearest to.
    """
    u = x - z * scene.slope_x
    v = y - z * scene.slope_y
    i0, i1 = _between(u - half, u + half, scene.per_x, scene.shift_x)
    j0, j1 = _between(v - half, v + half, scene.per_y, scene.shift_y)
    if scene.periodic:
        i1 = min(i1, i0 + scene.wide - 1)
        j1 = min(j1, j0 + scene.deep - 1)
    if i1 >= i0 and j1 >= j0:
        return (i0, i1, j0, j1), (i1 - i0 + 1) * (j1 - j0 + 1)
    i0 = np.int64(np.floor(u * scene.per_x - scene.shift_x + 0.5))
    j0 = np.int64(np.floor(v * scene.per_y - scene.shift_y + 0.5))
    return (i0, i0, j0, j0), np.int64(0)


@njit
def limb_ends(scene: Any, x: Any, y: Any, tip: Any, parent: Any, k: Any) -> Any:
    """Carry both ends of an internode to the ground: (u, v, z) of its base and of its tip."""
    x0, y0, z0 = x, y, 0.0
    if parent >= 0:
        x0 += np.float64(tip[parent, 0])
        y0 += np.float64(tip[parent, 1])
        z0 += np.float64(tip[parent, 2])
    x1 = x + np.float64(tip[k, 0])
    y1 = y + np.float64(tip[k, 1])
    z1 = np.float64(tip[k, 2])
    u0, v0 = x0 - z0 * scene.slope_x, y0 - z0 * scene.slope_y
    return u0, v0, z0, x1 - z1 * scene.slope_x, y1 - z1 * scene.slope_y, z1


@njit
def limb_spots(scene: Any, ends: Any, radius: Any) -> Any:
    """Bound the pixels of an internode, a capsule around the line between its ends."""
    u0, v0, _, u1, v1, _ = ends
    pad_x = radius * scene.stretch_x
    pad_y = radius * scene.stretch_y
    i0, i1 = _between(min(u0, u1) - pad_x, max(u0, u1) + pad_x, scene.per_x, scene.shift_x)
    j0, j1 = _between(min(v0, v1) - pad_y, max(v0, v1) + pad_y, scene.per_y, scene.shift_y)
    return i0, i1, j0, j1


@njit
def column_spots(scene: Any, columns: Any, c: Any) -> Any:
    """Bound the pixels of a column."""
    u0, u1 = columns.foot[c] * scene.slope_x, columns.top[c] * scene.slope_x
    v0, v1 = columns.foot[c] * scene.slope_y, columns.top[c] * scene.slope_y
    x, y = columns.x[c], columns.y[c]
    right, back = x + columns.edge, y + columns.edge
    i0, i1 = _between(x - max(u0, u1), right - min(u0, u1), scene.per_x, scene.shift_x)
    j0, j1 = _between(y - max(v0, v1), back - min(v0, v1), scene.per_y, scene.shift_y)
    return i0, i1, j0, j1


# Painting: `part` are the spots of a shape that lie in one tile, `corner` is what is to be taken
# from a spot to give its place in the tile. What is at equal height stays as it was drawn first.


@njit
def paint_leaf(depth: Any, who: Any, name: Any, part: Any, corner: Any, z: Any) -> None:
    """Draw a leaf into a tile."""
    near = np.float32(z)
    for j in range(part[2] - corner[1], part[3] + 1 - corner[1]):
        for i in range(part[0] - corner[0], part[1] + 1 - corner[0]):
            if near > depth[j, i]:
                depth[j, i] = near
                who[j, i] = name


@njit
def _strip(ends: Any, along_d: Any, square: Any, radius: Any, scene: Any) -> Any:
    """Describe where an internode's line crosses rows of pixels.

    Returns the line's place in row 0 and its step per row, pixels, and half the width, in pixels
    and along a row, of the strip within the radius of the line; endless for a line along the row.
    """
    u0, v0, _, u1, v1, _ = ends
    endless = 1e9
    seen = u1 - u0 - scene.toward_x * along_d
    width = (1.0 - scene.toward_x * scene.toward_x) * square - seen * seen
    if abs(v1 - v0) * endless <= abs(u1 - u0) or width <= 1e-9 * square:
        return 0.0, 0.0, endless
    step = (u1 - u0) / (v1 - v0) * scene.per_x / scene.per_y
    at = u0 * scene.per_x - scene.shift_x - step * (v0 * scene.per_y - scene.shift_y)
    # A little wider than needed, for rounding: every pixel is tried.
    return at, step, radius * scene.per_x * np.sqrt(square / width) + 1e-6


@njit
def paint_limb(
    depth: Any,
    who: Any,
    name: Any,
    part: Any,
    corner: Any,
    scene: Any,
    ends: Any,
    radius: Any,
) -> None:
    """Draw an internode into a tile: the rays that pass its axis within its radius.

    For two vectors a, b on the ground, a . b - (a . d)(b . d) is their product seen along the unit
    vector d, so that distances are those between rays. A pixel has the height of the axis at
    the ray, so that an internode does not cover the leaf at its own tip.
    """
    u0, v0, z0, u1, v1, z1 = ends
    dx, dy = scene.toward_x, scene.toward_y
    along_u, along_v = u1 - u0, v1 - v0
    along_d = along_u * dx + along_v * dy
    flat = along_u * along_u + along_v * along_v
    square = flat - along_d * along_d
    upright = square <= 1e-12 * flat
    inverse = 0.0 if upright else 1.0 / square
    begin, step, half = _strip(ends, along_d, square, radius, scene)
    edge_x, edge_y = 1.0 / scene.per_x, 1.0 / scene.per_y
    for j in range(part[2], part[3] + 1):
        off_v = (j + scene.shift_y) * edge_y - v0
        at = begin + j * step
        i0 = max(np.int64(np.ceil(at - half)), part[0])
        i1 = min(np.int64(np.floor(at + half)), part[1])
        for i in range(i0, i1 + 1):
            off_u = (i + scene.shift_x) * edge_x - u0
            seen = off_u * along_u + off_v * along_v - (off_u * dx + off_v * dy) * along_d
            t = min(max(seen * inverse, 0.0), 1.0)
            if upright:
                t = 1.0 if z1 >= z0 else 0.0
            rest_u = off_u - t * along_u
            rest_v = off_v - t * along_v
            rest_d = rest_u * dx + rest_v * dy
            if rest_u * rest_u + rest_v * rest_v - rest_d * rest_d > radius * radius:
                continue
            near = np.float32((1.0 - t) * z0 + t * z1)
            if near > depth[j - corner[1], i - corner[0]]:
                depth[j - corner[1], i - corner[0]] = near
                who[j - corner[1], i - corner[0]] = name


@njit
def _stay(at: Any, slope: Any, low: Any, edge: Any, foot: Any, top: Any) -> Any:
    """Find the heights at which a ray from `at` on the ground is between low and low + edge."""
    if abs(slope) < 1e-12:
        if low <= at < low + edge:
            return foot, top
        return 1.0, 0.0
    a = (low - at) / slope
    b = (low + edge - at) / slope
    return max(min(a, b), foot), min(max(a, b), top)


@njit
def paint_column(
    depth: Any,
    who: Any,
    name: Any,
    part: Any,
    corner: Any,
    scene: Any,
    columns: Any,
    c: Any,
) -> None:
    """Draw a column into a tile, at the height where each ray leaves it."""
    x, y, edge = columns.x[c], columns.y[c], columns.edge
    for j in range(part[2], part[3] + 1):
        v = (j + scene.shift_y) / scene.per_y
        foot, top = _stay(v, scene.slope_y, y, edge, columns.foot[c], columns.top[c])
        if foot > top:
            continue
        u0, u1 = foot * scene.slope_x, top * scene.slope_x
        # A little wider than needed, for rounding: every pixel is tried.
        low, high = x - max(u0, u1) - 1e-9, x + edge - min(u0, u1) + 1e-9
        i0, i1 = _between(low, high, scene.per_x, scene.shift_x)
        for i in range(max(i0, part[0]), min(i1, part[1]) + 1):
            u = (i + scene.shift_x) / scene.per_x
            low, high = _stay(u, scene.slope_x, x, edge, foot, top)
            near = np.float32(high)
            if low <= high and near > depth[j - corner[1], i - corner[0]]:
                depth[j - corner[1], i - corner[0]] = near
                who[j - corner[1], i - corner[0]] = name
