"""Where the points of triangles come to lie: evenly along the surface, and for the right volume.

Triangles with corners on a round limb cut it short. Over a triangle whose corners lie on a smooth
surface that one rises by (n_j - n_i) . (p_j - p_i) / 24, summed over the edges from p_i to p_j with
normals n: this is exact for a surface of the second degree. Each point moves outward by the mean
over the triangles around it, as tubes have polygons of the area of their circle. Where the surface
is hollow, points move inward. The error of the volume then falls as the fourth power of the cell.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.surface.blend.field import Blend, on_surface, slope

_Floats = NDArray[np.float64]
_CHUNKS = 64
#: Rounds in which points move towards the middle of their neighbours, along the surface.
_ROUNDS = 4
#: Newton steps to the surface.
_STEPS = 6
#: Normals of a smooth surface turn less along an edge: the least cosine.
_SMOOTH = 0.5


@driver
def _settle(
    first: Any, step: Any, field: Any, points: Any, most: Any, steps: Any, hints: Any, normals: Any
) -> None:
    """Move points onto the surface; fill in the slopes there."""
    for c in range(first, _CHUNKS, step):
        for i in range(len(points) * c // _CHUNKS, len(points) * (c + 1) // _CHUNKS):
            x, y, z, f, hints[i] = on_surface(
                field, points[i, 0], points[i, 1], points[i, 2], hints[i], steps, most[i]
            )
            points[i, 0], points[i, 1], points[i, 2] = x, y, z
            gx, gy, gz = slope(field, x, y, z, f, hints[i])
            size = max(np.sqrt(gx * gx + gy * gy + gz * gz), 1e-12)
            normals[i, 0], normals[i, 1], normals[i, 2] = gx / size, gy / size, gz / size


@njit
def _rises(points: Any, normals: Any, triangles: Any, rise: Any, area: Any) -> None:
    """Add up around each point what is missing under the surface (m3), and its area (m2)."""
    edge, before = np.empty((3, 3)), np.empty(3)
    for t in range(len(triangles)):
        missing, smooth = 0.0, True
        for c in range(3):
            i, j = triangles[t, c], triangles[t, (c + 1) % 3]
            cosine = 0.0
            for k in range(3):
                edge[c, k] = points[j, k] - points[i, k]
                missing += (normals[j, k] - normals[i, k]) * edge[c, k]
                cosine += normals[i, k] * normals[j, k]
            smooth = smooth and cosine > _SMOOTH
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            before[k] = 0.5 * (edge[0, m] * edge[1, n] - edge[0, n] * edge[1, m])
        size = np.sqrt(before[0] ** 2 + before[1] ** 2 + before[2] ** 2)
        for c in range(3):
            i = triangles[t, c]
            if smooth:
                rise[i] += size * missing / 24.0
            for k in range(3):
                area[i] += before[k] * normals[i, k]


def settled(
    blend: Blend,
    points: _Floats,
    triangles: NDArray[np.int32],
    room: _Floats,
    hints: NDArray[np.int64],
) -> _Floats:
    """Even out triangles near the surface, pull their points onto it, and make up for the volume.

    Parameters
    ----------
    blend : Blend
        The surface.
    points, triangles : float64 (n, 3), int32 (m, 3)
        m; anticlockwise from outside.
    room : float64 (n,)
        How far each point may be moved at a time, m.
    hints : int64 (n,)
        A cone near each point; changed to the nearest one.

    Returns
    -------
    float64 (n, 3)
        The points. None is moved below the ground at which its stem is cut.
    """
    points = _even(points, triangles, room)
    normals = np.empty_like(points)
    in_threads(_settle, blend.kernel, points, room, np.int64(_STEPS), hints, normals)
    rise, area = np.zeros(len(points)), np.zeros(len(points))
    _rises(points, normals, triangles, rise, area)
    out = np.where(area > 0.0, rise / np.where(area > 0.0, area, 1.0), 0.0)
    moved = points + np.clip(out, -0.5 * room, 0.5 * room)[:, None] * normals
    cones = blend.limbs.cones
    floor = np.minimum(points[:, 2], cones.ground[cones.axis[hints]])
    moved[:, 2] = np.maximum(moved[:, 2], floor)
    return moved


def _even(points: _Floats, triangles: NDArray[np.int32], room: _Floats) -> _Floats:
    """Move points towards the middle of their neighbours."""
    count = np.bincount(triangles.ravel(), minlength=len(points))[:, None].astype(np.float64)
    for _ in range(_ROUNDS):
        middle = np.zeros_like(points)
        for k in range(3):
            for axis in range(3):
                around = points[triangles[:, (k + 1) % 3], axis]
                around = around + points[triangles[:, (k + 2) % 3], axis]
                middle[:, axis] += np.bincount(triangles[:, k], around, minlength=len(points))
        step = 0.5 * (middle / (2.0 * count) - points)
        size = np.linalg.norm(step, axis=1)
        step *= np.minimum(1.0, 0.5 * room / np.maximum(size, 1e-12))[:, None]
        points = points + step
    return points
