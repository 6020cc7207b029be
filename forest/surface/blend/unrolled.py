"""Texture coordinates of the blended surface: each triangle is unrolled from the limb it is on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.surface.blend.field import cone
from forest.surface.blend.limbs import Limbs

_Floats = NDArray[np.float64]
_CHUNKS = 64
_TURN = 2.0 * np.pi


@njit
def _on_cone(cones: Any, low: Any, high: Any, i: Any, p: Any) -> Any:
    """Give a point's azimuth around a cone, the radius there, and how far along the axis it is."""
    sx, sy, sz = cones.start[i, 0], cones.start[i, 1], cones.start[i, 2]
    hx, hy, hz = cones.end[i, 0] - sx, cones.end[i, 1] - sy, cones.end[i, 2] - sz
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / length, hy / length, hz / length
    dx, dy, dz = p[0] - sx, p[1] - sy, p[2] - sz
    along = dx * hx + dy * hy + dz * hz
    t = min(max(along / length, 0.0), 1.0)
    ax = (1.0 - t) * low[i, 0] + t * high[i, 0]
    ay = (1.0 - t) * low[i, 1] + t * high[i, 1]
    az = (1.0 - t) * low[i, 2] + t * high[i, 2]
    lean = ax * hx + ay * hy + az * hz
    ax, ay, az = ax - lean * hx, ay - lean * hy, az - lean * hz
    bx, by, bz = hy * az - hz * ay, hz * ax - hx * az, hx * ay - hy * ax
    angle = np.arctan2(dx * bx + dy * by + dz * bz, dx * ax + dy * ay + dz * az)
    return angle, cones.low[i] + t * (cones.high[i] - cones.low[i]), cones.along[i] + along


@njit
def _limb(cones: Any, point: Any, own: Any, corner: Any) -> Any:
    """Choose of the corners' cones the one nearest to a triangle's middle."""
    a, b, c = point[corner[0]], point[corner[1]], point[corner[2]]
    x, y, z = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
    best, nearest = np.inf, np.int64(0)
    for k in range(3):
        i = own[corner[k]]
        away = cone(cones, i, x, y, z)[0]
        if away < best or (away == best and i < nearest):
            best, nearest = away, i
    return nearest


@driver
def _unroll(
    first: Any, step: Any, cones: Any, low: Any, high: Any, point: Any, own: Any, which: Any,
    triangle: Any, uv: Any,
) -> None:  # fmt: skip
    for c in range(first, _CHUNKS, step):
        for j in range(len(which) * c // _CHUNKS, len(which) * (c + 1) // _CHUNKS):
            corner = triangle[which[j]]
            nearest = _limb(cones, point, own, corner)
            start = 0.0
            for k in range(3):
                i = own[corner[k]]
                if cones.axis[i] != cones.axis[nearest]:
                    i = nearest
                angle, radius, along = _on_cone(cones, low, high, i, point[corner[k]])
                if k == 0:
                    start = angle
                angle -= _TURN * np.round((angle - start) / _TURN)
                uv[which[j], k, 0] = radius * angle
                uv[which[j], k, 1] = along


def unroll(
    limbs: Limbs,
    side: _Floats,
    points: _Floats,
    own: NDArray[np.int64],
    triangles: NDArray[np.int32],
    which: NDArray[np.bool_],
    uv: _Floats,
) -> None:
    """Fill in texture coordinates of triangles, each on the limb nearest to its middle.

    Parameters
    ----------
    limbs : Limbs
        What the surface is made of.
    side : float64 (internodes, 3)
        A direction across each internode, carried along the axes: there u is 0.
    points : float64 (n, 3)
        m.
    own : int64 (n,)
        The cone nearest to each point.
    triangles : int32 (m, 3)
        Corners.
    which : bool (m,)
        Triangles to fill in.
    uv : float64 (m, 3, 2)
        Filled: u around the girth and v along the axis, m.
    """
    cones = limbs.cones
    length = np.linalg.norm(cones.end - cones.start, axis=1)
    small = 1e-6 * length + 2e-9
    low = side[limbs.internode(cones.axis, cones.along + small)]
    high = side[limbs.internode(cones.axis, cones.along + length + small)]
    in_threads(_unroll, cones, low, high, points, own, np.flatnonzero(which), triangles, uv)
