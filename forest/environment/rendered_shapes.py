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

from forest._jit import inline


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
    pixel_x, pixel_y : float
        Edges of a pixel, m.
    shift_x, shift_y : float
        Place of pixel 0's centre, pixels.
    first_x, first_y, wide, deep : int
        First pixel and number of pixels of the window.
    periodic : int
        1 where the window is the whole torus.
    """

    slope_x: float
    slope_y: float
    toward_x: float
    toward_y: float
    stretch_x: float
    stretch_y: float
    pixel_x: float
    pixel_y: float
    shift_x: float
    shift_y: float
    first_x: int
    first_y: int
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


@inline
def _first(at: Any, pixel: Any, shift: Any) -> Any:
    """Find the first pixel whose centre is not before `at`."""
    return np.int64(np.ceil(at / pixel - shift))


@inline
def _between(low: Any, high: Any, pixel: Any, shift: Any, first: Any) -> Any:
    """Find the pixels whose centres lie in [low, high), counted from the window's first."""
    begin = _first(low, pixel, shift)
    return begin - first, _first(high, pixel, shift) - 1 - first


@inline
def leaf_spots(scene: Any, x: Any, y: Any, z: Any, area: Any) -> Any:
    """Find the spots of a horizontal square leaf, and how many pixels it covers.

    A leaf between all centres covers none; its spots are then the pixel that it is nearest to.
    """
    half = 0.5 * np.sqrt(area)
    u = x - z * scene.slope_x
    v = y - z * scene.slope_y
    i0, i1 = _between(u - half, u + half, scene.pixel_x, scene.shift_x, scene.first_x)
    j0, j1 = _between(v - half, v + half, scene.pixel_y, scene.shift_y, scene.first_y)
    if scene.periodic:
        i1 = min(i1, i0 + scene.wide - 1)
        j1 = min(j1, j0 + scene.deep - 1)
    if i1 >= i0 and j1 >= j0:
        return (i0, i1, j0, j1), (i1 - i0 + 1) * (j1 - j0 + 1)
    i0 = np.int64(np.floor(u / scene.pixel_x - scene.shift_x + 0.5)) - scene.first_x
    j0 = np.int64(np.floor(v / scene.pixel_y - scene.shift_y + 0.5)) - scene.first_y
    return (i0, i0, j0, j0), np.int64(0)


@inline
def limb_ends(scene: Any, x: Any, y: Any, tip: Any, parent: Any, k: Any) -> Any:
    """Carry both ends of an internode to the ground: (u, v, z) of its base and of its tip."""
    x0, y0, z0 = x, y, 0.0
    if parent >= 0:
        x0 += np.float64(tip[parent, 0])
        y0 += np.float64(tip[parent, 1])
        z0 += np.float64(tip[parent, 2])
    z1 = np.float64(tip[k, 2])
    x1 = x + np.float64(tip[k, 0])
    y1 = y + np.float64(tip[k, 1])
    return (
        x0 - z0 * scene.slope_x,
        y0 - z0 * scene.slope_y,
        z0,
        x1 - z1 * scene.slope_x,
        y1 - z1 * scene.slope_y,
        z1,
    )


@inline
def limb_spots(scene: Any, ends: Any, radius: Any) -> Any:
    """Bound the pixels of an internode, a capsule around the line between its ends."""
    u0, v0, _, u1, v1, _ = ends
    pad = radius * scene.stretch_x
    i0, i1 = _between(
        min(u0, u1) - pad, max(u0, u1) + pad, scene.pixel_x, scene.shift_x, scene.first_x
    )
    pad = radius * scene.stretch_y
    j0, j1 = _between(
        min(v0, v1) - pad, max(v0, v1) + pad, scene.pixel_y, scene.shift_y, scene.first_y
    )
    return i0, i1, j0, j1


@inline
def column_spots(scene: Any, columns: Any, c: Any) -> Any:
    """Bound the pixels of a column."""
    u0 = columns.foot[c] * scene.slope_x
    u1 = columns.top[c] * scene.slope_x
    v0 = columns.foot[c] * scene.slope_y
    v1 = columns.top[c] * scene.slope_y
    x, y = columns.x[c], columns.y[c]
    i0, i1 = _between(
        x - max(u0, u1),
        x + columns.edge - min(u0, u1),
        scene.pixel_x,
        scene.shift_x,
        scene.first_x,
    )
    j0, j1 = _between(
        y - max(v0, v1),
        y + columns.edge - min(v0, v1),
        scene.pixel_y,
        scene.shift_y,
        scene.first_y,
    )
    return i0, i1, j0, j1


# Painting: `part` are the spots of a shape that lie in one tile, `corner` is what is to be taken
# from a spot to give its place in the tile. What is at equal height stays as it was drawn first.


@inline
def paint_leaf(depth: Any, who: Any, name: Any, part: Any, corner: Any, z: Any) -> None:
    """Draw a leaf into a tile."""
    near = np.float32(z)
    for j in range(part[2] - corner[1], part[3] + 1 - corner[1]):
        for i in range(part[0] - corner[0], part[1] + 1 - corner[0]):
            if near > depth[j, i]:
                depth[j, i] = near
                who[j, i] = name


@inline
def _limb_row(scene: Any, ends: Any, radius: Any, v: Any) -> Any:
    """Bound the pixels of an internode in the row at `v`."""
    u0, v0, _, u1, v1, _ = ends
    pad = radius * scene.stretch_y
    a, b = 0.0, 1.0
    if abs(v1 - v0) > pad:
        ta = (v - pad - v0) / (v1 - v0)
        tb = (v + pad - v0) / (v1 - v0)
        a = min(max(min(ta, tb), 0.0), 1.0)
        b = min(max(max(ta, tb), 0.0), 1.0)
    ua = u0 + a * (u1 - u0)
    ub = u0 + b * (u1 - u0)
    # A little wider than needed, for rounding: every pixel is tried below.
    pad = radius * scene.stretch_x * (1.0 + 1e-9) + 1e-9
    return _between(
        min(ua, ub) - pad, max(ua, ub) + pad, scene.pixel_x, scene.shift_x, scene.first_x
    )


@inline
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
    for j in range(part[2], part[3] + 1):
        v = (j + scene.first_y + scene.shift_y) * scene.pixel_y
        i0, i1 = _limb_row(scene, ends, radius, v)
        for i in range(max(i0, part[0]), min(i1, part[1]) + 1):
            off_u = (i + scene.first_x + scene.shift_x) * scene.pixel_x - u0
            off_v = v - v0
            if square > 1e-12 * flat:
                seen = off_u * along_u + off_v * along_v - (off_u * dx + off_v * dy) * along_d
                t = min(max(seen / square, 0.0), 1.0)
            else:
                t = 1.0 if z1 >= z0 else 0.0
            off_u -= t * along_u
            off_v -= t * along_v
            off_d = off_u * dx + off_v * dy
            if off_u * off_u + off_v * off_v - off_d * off_d > radius * radius:
                continue
            near = np.float32((1.0 - t) * z0 + t * z1)
            if near > depth[j - corner[1], i - corner[0]]:
                depth[j - corner[1], i - corner[0]] = near
                who[j - corner[1], i - corner[0]] = name


@inline
def _stay(at: Any, slope: Any, low: Any, edge: Any, foot: Any, top: Any) -> Any:
    """Find the heights at which a ray from `at` on the ground is between low and low + edge."""
    if abs(slope) < 1e-12:
        if low <= at < low + edge:
            return foot, top
        return 1.0, 0.0
    a = (low - at) / slope
    b = (low + edge - at) / slope
    return max(min(a, b), foot), min(max(a, b), top)


@inline
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
    for j in range(part[2], part[3] + 1):
        v = (j + scene.first_y + scene.shift_y) * scene.pixel_y
        foot, top = _stay(
            v, scene.slope_y, columns.y[c], columns.edge, columns.foot[c], columns.top[c]
        )
        if foot > top:
            continue
        ends = foot * scene.slope_x, top * scene.slope_x
        i0, i1 = _between(
            columns.x[c] - max(ends[0], ends[1]) - 1e-9,
            columns.x[c] + columns.edge - min(ends[0], ends[1]) + 1e-9,
            scene.pixel_x,
            scene.shift_x,
            scene.first_x,
        )
        for i in range(max(i0, part[0]), min(i1, part[1]) + 1):
            u = (i + scene.first_x + scene.shift_x) * scene.pixel_x
            low, high = _stay(u, scene.slope_x, columns.x[c], columns.edge, foot, top)
            near = np.float32(high)
            if low <= high and near > depth[j - corner[1], i - corner[0]]:
                depth[j - corner[1], i - corner[0]] = near
                who[j - corner[1], i - corner[0]] = name
