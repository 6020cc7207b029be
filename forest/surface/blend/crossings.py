"""Limbs that cross without sharing a joint: their surface, made one, has a handle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.surface.blend.field import Blend, nearest
from forest.surface.blend.tree_of_boxes import visit

#: Meetings this near to one of the limbs' joints, in its reach, are part of the branching.
_AT_JOINT = 1.0


@njit
def _closest(a: Any, b: Any, c: Any, d: Any) -> Any:
    """Where along two segments they are nearest (Ericson 2005, 5.1.9)."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = np.sum(u * u), np.sum(v * v), np.sum(u * v)
    uw, vw = np.sum(u * w), np.sum(v * w)
    bottom = uu * vv - uv * uv
    s = min(max((uv * vw - uw * vv) / bottom, 0.0), 1.0) if bottom > 1e-12 * uu * vv else 0.0
    t = (uv * s + vw) / vv
    if t < 0.0:
        t = 0.0
        s = min(max(-uw / uu, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((uv - uw) / uu, 0.0), 1.0)
    return s, t


@njit
def _near_joint(joints: Any, starts: Any, listed: Any, axis: Any, p: Any) -> Any:
    for k in range(starts[axis], starts[axis + 1]):
        j = listed[k]
        d = joints.point[j] - p
        if np.sum(d * d) <= (_AT_JOINT * joints.reach[j]) ** 2:
            return True
    return False


@njit
def _cross(field: Any, starts: Any, listed: Any, pair: Any) -> Any:
    """Fill `pair` with the axes of cones that meet away from joints; gives how many there are."""
    cones = field.cones
    boxes = field.boxes
    found = np.int64(0)
    for i in range(len(cones.low)):
        m = 0.5 * (cones.start[i] + cones.end[i])
        span = cones.end[i] - cones.start[i]
        reach = 0.5 * np.sqrt(np.sum(span * span)) + max(cones.low[i], cones.high[i])
        node = np.int64(1)
        while node > 0:
            first, last, node = visit(boxes, node, m[0], m[1], m[2], reach)
            for k in range(first, last):
                o = boxes.item[k]
                if cones.axis[o] <= cones.axis[i]:
                    continue
                s, t = _closest(cones.start[i], cones.end[i], cones.start[o], cones.end[o])
                p = cones.start[i] + s * (cones.end[i] - cones.start[i])
                q = cones.start[o] + t * (cones.end[o] - cones.start[o])
                one = cones.low[i] + s * (cones.high[i] - cones.low[i])
                other = cones.low[o] + t * (cones.high[o] - cones.low[o])
                away = np.sqrt(np.sum((p - q) ** 2))
                if away >= one + other:
                    continue
                middle = p + (q - p) * (one / (one + other))
                if _near_joint(field.joints, starts, listed, cones.axis[i], middle):
                    continue
                if _near_joint(field.joints, starts, listed, cones.axis[o], middle):
                    continue
                which = cones.axis[nearest(field, middle[0], middle[1], middle[2], i)[1]]
                if which != cones.axis[i] and which != cones.axis[o]:
                    continue  # both lie within a third limb
                if found < len(pair):
                    pair[found, 0], pair[found, 1] = cones.axis[i], cones.axis[o]
                found += 1
    return found


def crossings(blend: Blend, most: int = 10000) -> NDArray[np.int64]:
    """List pairs of axes (k, 2) whose wood meets away from any joint of theirs.

    Where their surfaces are made one, a ring of wood is closed: the mesh has a handle.
    """
    joints = blend.limbs.joints
    axes = len(blend.limbs.member_first) - 1
    cones = blend.limbs.cones
    ends = cones.axis[joints.first].astype(np.int64)
    flat = ends.ravel()
    order = np.argsort(flat, kind="stable")
    starts = np.searchsorted(flat[order], np.arange(axes + 1))
    pair = np.zeros((most, 2), np.int64)
    count = int(_cross(blend.kernel, starts, order // 2, pair))
    return np.unique(pair[: min(count, most)], axis=0)
