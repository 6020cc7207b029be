"""The blended surface as an implicit function: negative inside the wood (Hart & Baker 2003, 5.2).

Far from joints the function is the least of `distance - radius` over all cones. Near a joint two
axes blend: x1 and x2 are the points of either nearest to x, and the blend is the surface of the
spheres that stand on the line from x1 to x2 with radii from r1 to r2 (see docs/surfaces.md for
why eq. 30 is read so, and what its print does).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.mechanics.branch_points import fall_off
from forest.surface.blend.cones import Cones
from forest.surface.blend.joints import Joints
from forest.surface.blend.limbs import Limbs
from forest.surface.blend.tree_of_boxes import Boxes, boxes_of, visit

_Floats = NDArray[np.float64]

_CHUNKS = 64  # fixed, so that nothing depends on the number of threads
_TINY = 1e-12
#: A point so near to the surface is on it, m.
_CLOSE = 1e-8
#: How far from the nearest foot others count, times the thinner radius: feet do not jump at bends.
_SOFT = 0.1
#: Step of differences for the gradient, m.
_STEP = 1e-6


class Field(NamedTuple):
    """All that a kernel needs to know of the surface."""

    cones: Cones
    joints: Joints
    boxes: Boxes  # of cones, wood included
    places: Boxes  # of joints' places, reach included
    printed: NDArray[np.bool_]  # (1,) eq. 30 as printed


@njit
def cone(cones: Any, i: Any, x: Any, y: Any, z: Any) -> Any:
    """Measure a point against one cone (eqs 26, 27 and 31).

    Returns
    -------
    tuple
        Distance minus radius, the radius, the point of the axis nearest to x (3), and how far it
        lies along the cone, 0 to 1.
    """
    ax, ay, az = cones.start[i, 0], cones.start[i, 1], cones.start[i, 2]
    lx, ly, lz = cones.end[i, 0] - ax, cones.end[i, 1] - ay, cones.end[i, 2] - az
    square = lx * lx + ly * ly + lz * lz
    t = ((x - ax) * lx + (y - ay) * ly + (z - az) * lz) / square
    behind = -t * np.sqrt(square)
    t = min(max(t, 0.0), 1.0)
    fx, fy, fz = ax + t * lx, ay + t * ly, az + t * lz
    dx, dy, dz = x - fx, y - fy, z - fz
    d = np.sqrt(dx * dx + dy * dy + dz * dz)
    r = cones.low[i] + t * (cones.high[i] - cones.low[i])
    axis = cones.axis[i]
    along = cones.along[i] + t * np.sqrt(square)
    if along < cones.reach[axis]:
        lean = dx * cones.side[i, 0] + dy * cones.side[i, 1] + dz * cones.side[i, 2]
        lean = lean / d if d > _TINY else 0.0
        wide = cones.widened[axis] * fall_off(along / cones.reach[axis])
        if behind > 0.0:  # within its parent: not through that one's far side
            wide *= fall_off(behind / cones.low[i])
        r += 0.5 * wide * (1.0 + lean)
    ground = cones.ground[axis] - max(along - 2.0 * r, 0.0)  # a stem that lies is not cut in two
    if along < cones.flare[axis, 0]:
        size = np.sqrt(square)
        r += _flare(cones.flare[axis], along, lx / size, ly / size, lz / size, dx, dy, dz)
    return max(d - r, ground - z), r, fx, fy, fz, t


@njit
def _flare(flare: Any, along: Any, hx: Any, hy: Any, hz: Any, dx: Any, dy: Any, dz: Any) -> Any:
    """How much the foot is widened there: towards the ground, and more in its lobes, m.

    The azimuth is that after the shortest turn that sets the stem, of direction h, upright.
    """
    rise = 1.0 - along / flare[0]
    k = 1.0 / (1.0 + hz)
    x = (1.0 - hx * hx * k) * dx - hx * hy * k * dy - hx * dz
    y = -hx * hy * k * dx + (1.0 - hy * hy * k) * dy - hy * dz
    lobed = 0.5 * (1.0 + np.cos(flare[2] * np.arctan2(y, x) + flare[4]))
    return flare[1] * rise * rise * rise * (1.0 - flare[3] * (1.0 - lobed))


@njit
def _side(cones: Any, first: Any, last: Any, soft: Any, x: Any, y: Any, z: Any) -> Any:
    """One axis near a joint: least distance minus radius, and a foot that moves without jumps."""
    least, r, fx, fy, fz, _ = cone(cones, first, x, y, z)
    if last == first + 1:
        return least, r, fx, fy, fz
    for i in range(first + 1, last):
        least = min(least, cone(cones, i, x, y, z)[0])
    total = r = fx = fy = fz = 0.0
    for i in range(first, last):
        value, ri, xi, yi, zi, _ = cone(cones, i, x, y, z)
        weight = max(1.0 - (value - least) / soft, 0.0)
        weight *= weight
        total += weight
        r += weight * ri
        fx += weight * xi
        fy += weight * yi
        fz += weight * zi
    return least, r / total, fx / total, fy / total, fz / total


@njit
def hull(x: Any, y: Any, z: Any, a: Any, b: Any) -> Any:
    """Distance to the spheres along a line, of radii from one end's to the other's.

    `a` and `b` are (value, radius, place x, y, z) of the ends.
    """
    lx, ly, lz = b[2] - a[2], b[3] - a[3], b[4] - a[4]
    px, py, pz = x - a[2], y - a[3], z - a[4]
    length = np.sqrt(lx * lx + ly * ly + lz * lz)
    slope = a[1] - b[1]
    if length <= abs(slope) + _TINY:  # one end's sphere holds the other's
        first = np.sqrt(px * px + py * py + pz * pz) - a[1]
        px, py, pz = x - b[2], y - b[3], z - b[4]
        return min(first, np.sqrt(px * px + py * py + pz * pz) - b[1])
    lx, ly, lz = lx / length, ly / length, lz / length
    slope /= length
    p = px * lx + py * ly + pz * lz
    h = np.sqrt(max(px * px + py * py + pz * pz - p * p, 0.0))
    s = min(max(p - h * slope / np.sqrt(1.0 - slope * slope), 0.0), length)
    return np.sqrt((p - s) ** 2 + h * h) - a[1] + s * slope


@njit
def printed_blend(x: Any, y: Any, z: Any, a: Any, b: Any) -> Any:
    """Distance to the line from x1 to x2, less r of eq. 30 as printed."""
    lx, ly, lz = b[2] - a[2], b[3] - a[3], b[4] - a[4]
    px, py, pz = x - a[2], y - a[3], z - a[4]
    qx, qy, qz = x - b[2], y - b[3], z - b[4]
    d1 = np.sqrt(px * px + py * py + pz * pz)
    d2 = np.sqrt(qx * qx + qy * qy + qz * qz)
    square = lx * lx + ly * ly + lz * lz
    s = (px * lx + py * ly + pz * lz) / square if square > _TINY * _TINY else 0.0
    s = min(max(s, 0.0), 1.0)
    d = np.sqrt((px - s * lx) ** 2 + (py - s * ly) ** 2 + (pz - s * lz) ** 2)
    return d - (d2 * a[1] + d1 * b[1]) / max(d1 + d2, _TINY)


@njit
def smooth_least(a: Any, b: Any, width: Any) -> Any:
    """The lesser of two, rounded where they differ by less than `width`."""
    if width <= 0.0:
        return min(a, b)
    near = max(1.0 - abs(a - b) / width, 0.0)
    return min(a, b) - 0.25 * width * near * near


@njit
def joint(field: Any, j: Any, x: Any, y: Any, z: Any) -> Any:
    """Blend one pair of limbs; gives the value, the plain one, and how much of the blend is in."""
    joints = field.joints
    dx = x - joints.point[j, 0]
    dy = y - joints.point[j, 1]
    dz = z - joints.point[j, 2]
    share = fall_off(np.sqrt(dx * dx + dy * dy + dz * dz) / joints.reach[j])
    if share <= 0.0:
        return np.inf, np.inf, 0.0
    soft = _SOFT * joints.thin[j]
    b = _side(field.cones, joints.first[j, 1], joints.last[j, 1], soft, x, y, z)
    if not field.printed[0]:
        share *= fall_off(max(b[0], 0.0) / joints.near[j])
    if share <= 0.0:
        return np.inf, np.inf, 0.0
    a = _side(field.cones, joints.first[j, 0], joints.last[j, 0], soft, x, y, z)
    if not field.printed[0]:
        share *= fall_off(max(a[0], 0.0) / joints.near[j])
    if share <= 0.0:
        return np.inf, np.inf, 0.0
    plain = min(a[0], b[0])
    if field.printed[0]:
        return (1.0 - share) * plain + share * printed_blend(x, y, z, a, b), plain, share
    blended = max(hull(x, y, z, a, b), _under_ground(field.cones, joints.first[j], z))
    rounded = smooth_least(a[0], b[0], 0.5 * joints.thin[j] * share)
    return (1.0 - share) * rounded + share * min(blended, rounded), plain, share


@njit
def _under_ground(cones: Any, first: Any, z: Any) -> Any:
    """How far below the ground a point is, where one of two axes is cut there."""
    return max(cones.ground[cones.axis[first[0]]], cones.ground[cones.axis[first[1]]]) - z


@njit
def _blend(field: Any, plain: Any, x: Any, y: Any, z: Any) -> Any:
    """Let the joints in reach change the plain value."""
    joints = field.joints
    best = plain
    moved = total = 0.0
    node = np.int64(1)
    while node > 0:
        first, last, node = visit(field.places, node, x, y, z, 0.0)
        for k in range(first, last):
            place = field.places.item[k]
            here = np.inf
            for j in range(joints.place[place], joints.place[place + 1]):
                value, unblended, share = joint(field, j, x, y, z)
                if share > 0.0:
                    here = smooth_least(here, value, 0.3 * joints.thin[j] * share)
                    moved += share * (value - unblended)
                    total += share
            best = min(best, here)
    if field.printed[0]:
        return plain + moved / total if total > 0.0 else plain
    return best


@njit
def nearest(field: Any, x: Any, y: Any, z: Any, hint: Any) -> Any:
    """Least distance minus radius over all cones, and which it is; `hint` is tried first."""
    best = cone(field.cones, hint, x, y, z)[0]
    which = np.int64(hint)
    node = np.int64(1)
    while node > 0:
        first, last, node = visit(field.boxes, node, x, y, z, max(best, 0.0))
        for k in range(first, last):
            i = field.boxes.item[k]
            value = cone(field.cones, i, x, y, z)[0]
            if value < best or (value == best and i < which):
                best = value
                which = i
    return best, which


@njit
def value(field: Any, x: Any, y: Any, z: Any, hint: Any) -> Any:
    """The implicit function at a point, and the cone nearest to it."""
    plain, which = nearest(field, x, y, z, hint)
    return _blend(field, plain, x, y, z), which


@njit
def gradient(field: Any, x: Any, y: Any, z: Any, hint: Any) -> Any:
    """The function's slope by central differences (3), unitless."""
    gx = value(field, x + _STEP, y, z, hint)[0] - value(field, x - _STEP, y, z, hint)[0]
    gy = value(field, x, y + _STEP, z, hint)[0] - value(field, x, y - _STEP, z, hint)[0]
    gz = value(field, x, y, z + _STEP, hint)[0] - value(field, x, y, z - _STEP, hint)[0]
    scale = 0.5 / _STEP
    return gx * scale, gy * scale, gz * scale


@njit
def slope_alone(cones: Any, x: Any, y: Any, z: Any, f: Any, i: Any) -> Any:
    """The slope (3) of a cone, and before it whether that alone makes the function's value f."""
    ax, ay, az = cones.start[i, 0], cones.start[i, 1], cones.start[i, 2]
    lx, ly, lz = cones.end[i, 0] - ax, cones.end[i, 1] - ay, cones.end[i, 2] - az
    square = lx * lx + ly * ly + lz * lz
    t = ((x - ax) * lx + (y - ay) * ly + (z - az) * lz) / square
    s = min(max(t, 0.0), 1.0)
    dx, dy, dz = x - ax - s * lx, y - ay - s * ly, z - az - s * lz
    d = np.sqrt(dx * dx + dy * dy + dz * dz)
    change = cones.high[i] - cones.low[i]
    if abs(d - cones.low[i] - s * change - f) > 1e-12 or d <= _TINY:
        return False, 0.0, 0.0, 0.0
    taper = change / square if s == t else 0.0
    return True, dx / d - taper * lx, dy / d - taper * ly, dz / d - taper * lz


@njit
def slope(field: Any, x: Any, y: Any, z: Any, f: Any, i: Any) -> Any:
    """The function's slope (3): the nearest cone's where that alone makes f, else differences."""
    alone, gx, gy, gz = slope_alone(field.cones, x, y, z, f, i)
    if not alone:
        gx = (value(field, x + _STEP, y, z, i)[0] - f) / _STEP
        gy = (value(field, x, y + _STEP, z, i)[0] - f) / _STEP
        gz = (value(field, x, y, z + _STEP, i)[0] - f) / _STEP
    return gx, gy, gz


@njit
def on_surface(field: Any, x: Any, y: Any, z: Any, hint: Any, steps: Any, most: Any) -> Any:
    """Move a point onto the surface by Newton steps of at most `most` metres each.

    Gives where it is then (3), the function there, and the cone nearest to it.
    The slope is taken anew only where the last step brought less than three quarters of the way.
    """
    f, which = value(field, x, y, z, hint)
    gx = gy = gz = 0.0
    square = 1.0
    fresh = True
    for _ in range(steps):
        if abs(f) < _CLOSE:
            break
        if fresh:
            gx, gy, gz = slope(field, x, y, z, f, which)
            square = max(gx * gx + gy * gy + gz * gz, 0.01)
        step = f / square
        size = abs(step) * np.sqrt(gx * gx + gy * gy + gz * gz)
        if size > most:
            step *= most / size
        x, y, z = x - step * gx, y - step * gy, z - step * gz
        before = abs(f)
        f, which = value(field, x, y, z, which)
        fresh = abs(f) > 0.25 * before
    return x, y, z, f, which


@driver
def _values(first: Any, step: Any, field: Any, points: Any, out: Any, which: Any) -> None:
    for c in range(first, _CHUNKS, step):
        hint = np.int64(0)
        for i in range(len(points) * c // _CHUNKS, len(points) * (c + 1) // _CHUNKS):
            p = points[i]
            out[i], hint = value(field, p[0], p[1], p[2], hint)
            which[i] = hint


@driver
def _gradients(first: Any, step: Any, field: Any, points: Any, out: Any) -> None:
    for c in range(first, _CHUNKS, step):
        hint = np.int64(0)
        for i in range(len(points) * c // _CHUNKS, len(points) * (c + 1) // _CHUNKS):
            p = points[i]
            hint = nearest(field, p[0], p[1], p[2], hint)[1]
            g = gradient(field, p[0], p[1], p[2], hint)
            out[i, 0], out[i, 1], out[i, 2] = g


@driver
def _project(first: Any, step: Any, field: Any, points: Any, steps: Any, most: Any) -> None:
    for c in range(first, _CHUNKS, step):
        hint = np.int64(0)
        for i in range(len(points) * c // _CHUNKS, len(points) * (c + 1) // _CHUNKS):
            p = points[i]
            x, y, z, _, hint = on_surface(field, p[0], p[1], p[2], hint, steps, most)
            p[0], p[1], p[2] = x, y, z


@driver
def _places_on_limbs(
    first: Any, step: Any, field: Any, points: Any, which: Any, t: Any, radius: Any
) -> None:
    for c in range(first, _CHUNKS, step):
        hint = np.int64(0)
        for i in range(len(points) * c // _CHUNKS, len(points) * (c + 1) // _CHUNKS):
            p = points[i]
            hint = nearest(field, p[0], p[1], p[2], hint)[1]
            _, radius[i], _, _, _, t[i] = cone(field.cones, hint, p[0], p[1], p[2])
            which[i] = hint


class OnLimb(NamedTuple):
    """Where points lie on the limbs nearest to them; one entry per point."""

    axis: NDArray[np.int32]  # the skeleton's number of the axis
    along: _Floats  # distance from the axis' base, m
    radius: _Floats  # of the limb there, m
    cone: NDArray[np.int64]  # which of the cones


@dataclass(frozen=True)
class Blend:
    """The blended surface of a tree as an implicit function.

    Attributes
    ----------
    limbs : Limbs
        Its cones and joints.
    kernel : Field
        The same for kernels: `value(kernel, x, y, z, hint)` and its like.
    """

    limbs: Limbs
    kernel: Field

    @classmethod
    def of(cls, limbs: Limbs, *, printed: bool = False) -> Blend:
        """Sort cones and joints into boxes; `printed` keeps eq. 30 as it is printed."""
        cones, joints = limbs.cones, limbs.joints
        wide = np.maximum(cones.low, cones.high) + cones.widened[cones.axis]
        wide = (wide + cones.flare[cones.axis, 1])[:, None]
        low = np.minimum(cones.start, cones.end) - wide
        high = np.maximum(cones.start, cones.end) + wide
        starts = joints.place[:-1]
        if len(starts):
            lower, upper = _joint_boxes(joints, low, high, printed)
            place_low = np.minimum.reduceat(lower, starts, axis=0)
            place_high = np.maximum.reduceat(upper, starts, axis=0)
        else:
            place_low = place_high = np.zeros((0, 3))
        boxes, places = boxes_of(low, high), boxes_of(place_low, place_high)
        return cls(limbs, Field(cones, joints, boxes, places, np.array([printed])))

    def value(self, points: ArrayLike) -> _Floats:
        """Give the function at points, float64 (n, 3): negative inside, in metres."""
        points = _as_points(points)
        out = np.empty(len(points))
        in_threads(_values, self.kernel, points, out, np.empty(len(points), np.int64))
        return out

    def gradient(self, points: ArrayLike) -> _Floats:
        """Give its slope at points, float64 (n, 3); on the surface it points outward."""
        points = _as_points(points)
        out = np.empty_like(points)
        in_threads(_gradients, self.kernel, points, out)
        return out

    def project(self, points: ArrayLike, *, steps: int = 8, most_m: float = np.inf) -> _Floats:
        """Move points onto the surface by Newton steps along the slope."""
        points = _as_points(points).copy()
        in_threads(_project, self.kernel, points, np.int64(steps), float(most_m))
        return points

    def limb(self, points: ArrayLike) -> OnLimb:
        """Find the limb nearest to each point (by distance minus radius) and where on it."""
        points = _as_points(points)
        which = np.empty(len(points), np.int64)
        t, radius = np.empty(len(points)), np.empty(len(points))
        in_threads(_places_on_limbs, self.kernel, points, which, t, radius)
        cones = self.limbs.cones
        length = np.linalg.norm(cones.end[which] - cones.start[which], axis=1)
        return OnLimb(cones.axis[which], cones.along[which] + t * length, radius, which)


def _joint_boxes(
    joints: Joints, low: _Floats, high: _Floats, printed: bool
) -> tuple[_Floats, _Floats]:
    """Boxes in which pairs of limbs can blend: in reach of the joint, and near either limb."""
    lower, upper = joints.point - joints.reach[:, None], joints.point + joints.reach[:, None]
    for j in range(0 if printed else len(joints.reach)):
        for k in range(2):
            own = slice(joints.first[j, k], joints.last[j, k])
            lower[j] = np.maximum(lower[j], low[own].min(axis=0) - joints.near[j])
            upper[j] = np.minimum(upper[j], high[own].max(axis=0) + joints.near[j])
    return lower, upper


def _as_points(points: ArrayLike) -> _Floats:
    return np.ascontiguousarray(points, np.float64).reshape(-1, 3)
