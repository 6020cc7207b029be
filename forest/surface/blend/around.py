"""The surface as seen by what creeps over one limb: that limb and those that start with it.

Limbs that cross elsewhere are not seen; what creeps goes through their wood. And a walk through
the trees of boxes costs more than the few cones and joints that it finds, so that they are kept, as
lists that hold everywhere within a reach of the place where they were gathered.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.surface.blend.field import cone, joint, smooth_least, value
from forest.surface.blend.limbs import Limbs
from forest.surface.blend.tree_of_boxes import visit

#: Most cones, and most joints, that a list holds; where more are near, the whole surface is seen.
ROOM = 32


class Kin(NamedTuple):
    """The axes that each axis sees besides itself, one axis after the other."""

    first: NDArray[np.int64]  # (axes + 1,) first of `other` of each axis
    other: NDArray[np.int64]


def kin_of(limbs: Limbs) -> Kin:
    """List the axes that share a joint, or blend with a third in joints whose reaches touch."""
    joints = limbs.joints
    pair = limbs.cones.axis[joints.first].astype(np.int64).reshape(-1, 2)
    found = [pair]
    order = np.argsort(pair.ravel(), kind="stable")  # ends of joints, by axis
    ends = np.split(order, np.flatnonzero(np.diff(pair.ravel()[order])) + 1)
    for end in ends:
        joint_of, other = end // 2, pair.ravel()[end ^ 1]
        apart = np.linalg.norm(joints.point[joint_of][:, None] - joints.point[joint_of], axis=2)
        reach = joints.reach[joint_of]
        i, j = np.nonzero(apart < reach[:, None] + reach)
        found.append(np.column_stack((other[i], other[j])))
    both = np.concatenate(found)
    both = np.unique(np.concatenate((both, both[:, ::-1])), axis=0)
    both = both[both[:, 0] != both[:, 1]]
    count = np.bincount(both[:, 0], minlength=len(limbs.cones.reach))
    return Kin(np.concatenate(([0], np.cumsum(count))), np.ascontiguousarray(both[:, 1]))


class Around(NamedTuple):
    """Cones and joints near points, a row for each point."""

    cones: NDArray[np.int32]  # (n, ROOM)
    joints: NDArray[np.int32]  # (n, ROOM) twice the joint, and 1 more for the first of a place
    held: NDArray[np.int32]  # (n, 2) cones and joints; below 0: too many
    middle: NDArray[np.float64]  # (n, 3) where they were gathered
    reach: NDArray[np.float64]  # (n,) how far from there they hold, m
    axis: NDArray[np.int32]  # (n,) the limb for which; -1: for none yet


def empty_around(room: int) -> Around:
    """Make room for lists; all have to be gathered yet."""
    return Around(
        cones=np.zeros((room, ROOM), np.int32),
        joints=np.zeros((room, ROOM), np.int32),
        held=np.full((room, 2), -1, np.int32),
        middle=np.zeros((room, 3)),
        reach=np.zeros(room),
        axis=np.full(room, -1, np.int32),
    )


@njit
def _sees(kin: Any, axis: Any, other: Any) -> Any:
    """Whether one limb is another, or joined to it."""
    seen = axis == other
    for k in range(kin.first[axis], kin.first[axis + 1]):
        seen = seen or kin.other[k] == other
    return seen


@njit
def _at_least(cones: Any, i: Any, x: Any, y: Any, z: Any) -> Any:
    """Bound a cone's value from below by one that changes by no more than x is moved."""
    ax, ay, az = cones.start[i, 0], cones.start[i, 1], cones.start[i, 2]
    lx, ly, lz = cones.end[i, 0] - ax, cones.end[i, 1] - ay, cones.end[i, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    t = (px * lx + py * ly + pz * lz) / (lx * lx + ly * ly + lz * lz)
    t = min(max(t, 0.0), 1.0)
    px, py, pz = px - t * lx, py - t * ly, pz - t * lz
    axis = cones.axis[i]
    wide = max(cones.low[i], cones.high[i]) + cones.widened[axis] + cones.flare[axis, 1]
    return np.sqrt(px * px + py * py + pz * pz) - wide


@njit
def _axis_at_least(cones: Any, first: Any, last: Any, x: Any, y: Any, z: Any) -> Any:
    least = np.inf
    for i in range(first, last):
        least = min(least, _at_least(cones, i, x, y, z))
    return least


@njit
def _may_blend(field: Any, j: Any, x: Any, y: Any, z: Any, reach: Any) -> Any:
    """Whether a joint can have a share anywhere within the reach of a point."""
    joints = field.joints
    dx = x - joints.point[j, 0]
    dy = y - joints.point[j, 1]
    dz = z - joints.point[j, 2]
    if np.sqrt(dx * dx + dy * dy + dz * dz) > joints.reach[j] + reach:
        return False
    if field.printed[0]:
        return True
    far = joints.near[j] + reach
    for k in range(2):
        first, last = joints.first[j, k], joints.last[j, k]
        if _axis_at_least(field.cones, first, last, x, y, z) > far:
            return False
    return True


@njit
def _gather_cones(
    field: Any, kin: Any, axis: Any, x: Any, y: Any, z: Any, reach: Any, row: Any
) -> Any:
    """List the cones seen whose value can be least within the reach.

    Gives how many; -1 if too many.
    """
    count = 0
    node = np.int64(1)
    while node > 0:
        first, last, node = visit(field.boxes, node, x, y, z, reach)
        for k in range(first, last):
            i = field.boxes.item[k]
            near = _at_least(field.cones, i, x, y, z) <= reach
            if near and _sees(kin, axis, field.cones.axis[i]):
                if count == ROOM:
                    return -1
                row[count] = i
                count += 1
    return count


@njit
def _gather_joints(
    field: Any, kin: Any, axis: Any, x: Any, y: Any, z: Any, reach: Any, row: Any
) -> Any:
    """List the joints of limbs seen that can blend within the reach.

    Gives how many; -1 if too many.
    """
    count = 0
    joints = field.joints
    axes = field.cones.axis
    node = np.int64(1)
    while node > 0:
        first, last, node = visit(field.places, node, x, y, z, reach)
        for k in range(first, last):
            place = field.places.item[k]
            fresh = 1
            for j in range(joints.place[place], joints.place[place + 1]):
                if not _may_blend(field, j, x, y, z, reach):
                    continue
                one, other = axes[joints.first[j, 0]], axes[joints.first[j, 1]]
                if not (_sees(kin, axis, one) or _sees(kin, axis, other)):
                    continue
                if count == ROOM:
                    return -1
                row[count] = 2 * j + fresh
                fresh = 0
                count += 1
    return count


@njit
def gather(
    field: Any, kin: Any, around: Any, n: Any, axis: Any, x: Any, y: Any, z: Any, reach: Any
) -> None:
    """List for point n, on a limb, what matters within a reach, m, of a place."""
    cones = _gather_cones(field, kin, axis, x, y, z, reach, around.cones[n])
    joints = _gather_joints(field, kin, axis, x, y, z, reach, around.joints[n])
    around.held[n, 0] = cones if joints >= 0 else -1
    around.held[n, 1] = joints
    around.middle[n, 0], around.middle[n, 1], around.middle[n, 2] = x, y, z
    around.reach[n] = reach
    around.axis[n] = axis


@njit
def _blend_around(field: Any, around: Any, n: Any, plain: Any, x: Any, y: Any, z: Any) -> Any:
    """As `field` lets all joints change the plain value, but with those of the list."""
    best = plain
    here = np.inf
    moved = total = 0.0
    for k in range(around.held[n, 1]):
        j = around.joints[n, k] // 2
        if around.joints[n, k] & 1:
            best = min(best, here)
            here = np.inf
        blended, unblended, share = joint(field, j, x, y, z)
        if share > 0.0:
            here = smooth_least(here, blended, 0.3 * field.joints.thin[j] * share)
            moved += share * (blended - unblended)
            total += share
    if field.printed[0]:
        return plain + moved / total if total > 0.0 else plain
    return min(best, here)


@njit
def value_around(
    field: Any, kin: Any, around: Any, n: Any, x: Any, y: Any, z: Any, hint: Any
) -> Any:
    """The implicit function as point n sees it, and the cone nearest of those seen.

    Where the lists of point n do not hold, they are gathered anew.
    """
    while around.held[n, 0] >= 0:
        dx, dy, dz = x - around.middle[n, 0], y - around.middle[n, 1], z - around.middle[n, 2]
        best = np.inf
        which = np.int64(hint)
        for k in range(around.held[n, 0]):
            i = np.int64(around.cones[n, k])
            one = cone(field.cones, i, x, y, z)[0]
            if one < best or (one == best and i < which):
                best = one
                which = i
        if np.sqrt(dx * dx + dy * dy + dz * dz) + max(best, 0.0) <= around.reach[n]:
            return _blend_around(field, around, n, best, x, y, z), which
        reach = max(around.reach[n], 1.01 * best) if best < np.inf else 2.0 * around.reach[n]
        gather(field, kin, around, n, around.axis[n], x, y, z, reach)
    return value(field, x, y, z, hint)
