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
from forest.surface.blend.field import Blend, cone, on_surface, slope, value

_Floats = NDArray[np.float64]
_CHUNKS = 64
#: Rounds in which points move towards the middle of their neighbours, along the surface.
_ROUNDS = 4
#: Newton steps to the surface.
_STEPS = 6
#: Normals of a smooth surface turn less along an edge: the least cosine.
_SMOOTH = 0.5
#: A foot's points look down so far at least, and lie so near to the ground, m.
_DOWN, _AT_GROUND = 0.9, 1e-6
_RIM_STEPS = 4


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
def _smooth(normals: Any, a: Any, b: Any, c: Any) -> Any:
    """Whether the surface has no edge between the corners of a triangle."""
    ab = bc = ca = 0.0
    for k in range(3):
        ab += normals[a, k] * normals[b, k]
        bc += normals[b, k] * normals[c, k]
        ca += normals[c, k] * normals[a, k]
    return min(ab, bc, ca) > _SMOOTH


@njit
def _to_rim(field: Any, points: Any, normals: Any, triangles: Any, room: Any, hints: Any) -> None:
    """Move points of a stem's foot that are next to its side onto the rim between the two.

    Else triangles would cut the rim off. They are then points of the side.
    """
    cones = field.cones
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if min(normals[a, 2], normals[b, 2], normals[c, 2]) > -_DOWN:
            continue
        if _smooth(normals, a, b, c):
            continue
        for k in range(3):
            i = triangles[t, k]
            x, y, z = points[i, 0], points[i, 1], points[i, 2]
            off = z - cones.ground[cones.axis[hints[i]]]
            if normals[i, 2] > -_DOWN or not abs(off) < _AT_GROUND:
                continue
            nx = ny = 0.0
            for _ in range(_RIM_STEPS):
                _, r, fx, fy, fz, _ = cone(cones, hints[i], x, y, z)
                nx, ny = x - fx, y - fy
                d = np.sqrt(nx * nx + ny * ny + (z - fz) ** 2)
                grown = r / max(d, 1e-12)
                x, y = fx + grown * nx, fy + grown * ny
            moved = np.sqrt((x - points[i, 0]) ** 2 + (y - points[i, 1]) ** 2)
            if moved > 4.0 * room[i] or value(field, x, y, z + _AT_GROUND, hints[i])[0] < -1e-5:
                continue  # other wood is there
            points[i, 0], points[i, 1] = x, y
            size = max(np.sqrt(nx * nx + ny * ny), 1e-12)
            normals[i, 0], normals[i, 1], normals[i, 2] = nx / size, ny / size, 0.0


@njit
def _rises(points: Any, normals: Any, triangles: Any, rise: Any, area: Any) -> None:
    """Add up around each point what is missing under the surface (m3), and its area (m2).

    A triangle's area counts as a point sees it along its normal: that is what moving it adds.
    """
    edge, before = np.empty((3, 3)), np.empty(3)
    for t in range(len(triangles)):
        smooth = _smooth(normals, triangles[t, 0], triangles[t, 1], triangles[t, 2])
        missing = 0.0
        for c in range(3):
            i, j = triangles[t, c], triangles[t, (c + 1) % 3]
            for k in range(3):
                edge[c, k] = points[j, k] - points[i, k]
                missing += (normals[j, k] - normals[i, k]) * edge[c, k]
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            before[k] = 0.5 * (edge[0, m] * edge[1, n] - edge[0, n] * edge[1, m])
        for c in range(3):
            i = triangles[t, c]
            faced = 0.0
            for k in range(3):
                faced += before[k] * normals[i, k]
            faced = max(faced, 0.0)
            area[i] += faced
            if smooth:
                rise[i] += faced * missing / 24.0


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
    _to_rim(blend.kernel, points, normals, triangles, room, hints)
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
