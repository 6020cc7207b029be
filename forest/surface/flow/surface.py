"""Particles on the blended surface: how one is put there, and what it then knows of its limb."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.surface.blend.around import Around, Kin, kin_of, value_around
from forest.surface.blend.field import Blend, cone, slope_alone

_Floats = NDArray[np.float64]

#: A particle is on the surface if it is off by less than this, times the limb's radius.
CLOSE = 1e-4
_NEWTON_STEPS = 12
_HALVINGS = 30
#: Step of differences for the slope, m.
_STEP = 1e-6
#: Least and greatest slope that a smooth blend has.
_FLATTEST, _STEEPEST = 0.5, 4.0


class Surface(Protocol):
    """A surface on which particles live; `Blend` and a healing stem are such."""

    def value(self, points: _Floats) -> _Floats:
        """Give about the distance from the surface (n,), m, negative inside."""

    def gradient(self, points: _Floats) -> _Floats:
        """Give the slope of `value` (n, 3)."""

    def project(self, points: _Floats) -> _Floats:
        """Move points onto the surface."""


class Limbed(NamedTuple):
    """What a kernel needs of a surface with limbs."""

    field: Any  # of `forest.surface.blend.field`
    kin: Kin
    free: NDArray[np.bool_]  # (axes,) whether the axis ends in a tip, not in a fork


class Seen(NamedTuple):
    """The surface as one particle sees it (`blend.around`)."""

    field: Any
    kin: Kin
    around: Around
    number: Any


def limbed(blend: Blend) -> Limbed:
    """Add to a blended surface which of its axes end in a tip.

    An axis ends in a fork if another starts within one and a half of its radii from its end.
    """
    cones = blend.limbs.cones
    last = np.flatnonzero(np.append(np.diff(cones.axis) != 0, True))
    first = np.concatenate(([0], last[:-1] + 1))
    free = np.ones(len(cones.reach), np.bool_)
    for k, end in enumerate(last):
        away = np.linalg.norm(cones.start[first] - cones.end[end], axis=1)
        away[k] = np.inf
        free[cones.axis[end]] = away.min() > 1.5 * cones.high[end]
    return Limbed(blend.kernel, kin_of(blend.limbs), free)


@njit
def _value(on: Any, x: Any, y: Any, z: Any, which: Any) -> Any:
    """The implicit function as a particle sees it, and the cone nearest there."""
    return value_around(on.field, on.kin, on.around, on.number, x, y, z, which)


@njit
def _along_ray(on: Any, x: Any, y: Any, z: Any, which: Any) -> Any:
    """Find the surface on the ray from the limb's axis through a point, by halving."""
    _, r, fx, fy, fz, _ = cone(on.field.cones, which, x, y, z)
    dx, dy, dz = x - fx, y - fy, z - fz
    size = max(np.sqrt(dx * dx + dy * dy + dz * dz), 1e-12)
    dx, dy, dz = dx / size, dy / size, dz / size
    inside, outside = 0.0, size
    while _value(on, fx + outside * dx, fy + outside * dy, fz + outside * dz, which)[0] < 0.0:
        inside = outside
        outside += 0.25 * r
    for _ in range(_HALVINGS):
        middle = 0.5 * (inside + outside)
        if _value(on, fx + middle * dx, fy + middle * dy, fz + middle * dz, which)[0] < 0.0:
            inside = middle
        else:
            outside = middle
    return fx + outside * dx, fy + outside * dy, fz + outside * dz, outside - inside


@njit
def _slope(on: Any, x: Any, y: Any, z: Any, f: Any, which: Any) -> Any:
    """Give the slope at a point whose value is known: a cone's own, or by differences ahead."""
    alone, gx, gy, gz = slope_alone(on.field.cones, x, y, z, f, which)
    if not alone:
        gx = (_value(on, x + _STEP, y, z, which)[0] - f) / _STEP
        gy = (_value(on, x, y + _STEP, z, which)[0] - f) / _STEP
        gz = (_value(on, x, y, z + _STEP, which)[0] - f) / _STEP
    return gx, gy, gz


@njit
def settle(on: Any, x: Any, y: Any, z: Any, hint: Any, normal: Any) -> Any:
    """Move a point onto the surface by Newton steps along the slope.

    The first step is along `normal`, that of the place which the point comes from. The slope is
    taken anew only where the last step brought less than three quarters of the way.

    Returns
    -------
    tuple
        The place (3), the unit normal there (3), how far it still is off, and its cone.
    """
    cones = on.field.cones
    f, which = _value(on, x, y, z, hint)
    gx, gy, gz = normal[0], normal[1], normal[2]
    stale = gx * gx + gy * gy + gz * gz < 0.5
    for _ in range(_NEWTON_STEPS):
        close = CLOSE * min(cones.low[which], cones.high[which])
        if stale or abs(f) <= close:
            gx, gy, gz = _slope(on, x, y, z, f, which)
        square = max(gx * gx + gy * gy + gz * gz, _FLATTEST * _FLATTEST)
        if abs(f) <= close * min(np.sqrt(square), 1.0):  # a normal's slope is 1, a blend's less
            off = f
            break
        step = f / square
        x, y, z = x - step * gx, y - step * gy, z - step * gz
        before = abs(f)
        f, which = _value(on, x, y, z, which)
        stale = abs(f) > 0.25 * before
    else:  # a crease: slopes lead from one side to the other
        x, y, z, off = _along_ray(on, x, y, z, which)
        f, which = _value(on, x, y, z, which)
        off = min(abs(f), off)  # where the function jumps, the surface is in the jump
        gx, gy, gz = _slope(on, x, y, z, f, which)
    if gx * gx + gy * gy + gz * gz > _STEEPEST * _STEEPEST:
        _, _, fx, fy, fz, _ = cone(cones, which, x, y, z)
        gx, gy, gz = x - fx, y - fy, z - fz
    size = max(np.sqrt(gx * gx + gy * gy + gz * gz), 1e-12)
    return x, y, z, gx / size, gy / size, gz / size, off, which


@njit
def foot(surface: Any, which: Any, x: Any, y: Any, z: Any) -> Any:
    """Give the nearest point on the limb's axis, its heading, radius, and whether it is a tip."""
    cones = surface.field.cones
    _, radius, fx, fy, fz, t = cone(cones, which, x, y, z)
    lx = cones.end[which, 0] - cones.start[which, 0]
    ly = cones.end[which, 1] - cones.start[which, 1]
    lz = cones.end[which, 2] - cones.start[which, 2]
    size = np.sqrt(lx * lx + ly * ly + lz * lz)
    axis = cones.axis[which]
    last = which + 1 == len(cones.axis) or cones.axis[which + 1] != axis
    at_tip = last and t >= 1.0 and surface.free[axis]
    return fx, fy, fz, lx / size, ly / size, lz / size, radius, at_tip
