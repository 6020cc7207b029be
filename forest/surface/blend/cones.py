"""The cones of a tree's limbs: which wood is one, and where straight runs of it are joined."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.errors import InputError
from forest.surface.tubes import LEAST_RADIUS_M
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

#: How far a merged cone may lie from the axis and the radii it stands for, times the radius.
STRAIGHT = 0.05
#: Shortest part of an axis that is a cone, m.
SHORTEST = 1e-9
#: Columns of `Cones.flare`: height and widening of the foot (m), lobes, their depth and phase.
FLARE = 5


class Cones(NamedTuple):
    """Cones of all axes; those of an axis stand one after the other, base first."""

    start: _Floats  # (s, 3)
    end: _Floats  # (s, 3)
    low: _Floats  # (s,) radius at the start, m
    high: _Floats  # (s,) radius at the end, m
    along: _Floats  # (s,) distance of the start from the axis' base, along the axis, m
    side: _Floats  # (s, 3) y of eq. 31: unit vector across the cone; 0 without reaction wood
    axis: NDArray[np.int32]  # (s,) the skeleton's number of the axis
    reach: _Floats  # (axes,) delta of eq. 25, m; 0 without reaction wood
    widened: _Floats  # (axes,) Delta r of eq. 31, m
    ground: _Floats  # (axes,) height at which an axis from the ground is cut; -inf elsewhere
    flare: _Floats  # (axes, FLARE) root flare; the widening is 0 where there is none


@njit
def merge(point: Any, radius: Any, tolerance: Any, keep: Any) -> None:
    """Mark the points of a polyline at which its cones end (Hart's 'limb' as few cones)."""
    n = len(point)
    keep[:] = False
    keep[0] = True
    base = 0
    while base < n - 1:
        far = base + 1
        while far + 1 < n and far + 1 - base <= 64:
            if not _is_straight(point, radius, base, far + 1, tolerance):
                break
            far += 1
        keep[far] = True
        base = far


@njit
def _is_straight(point: Any, radius: Any, a: Any, b: Any, tolerance: Any) -> Any:
    line = point[b] - point[a]
    square = np.sum(line * line)
    if square <= 0.0:
        return False
    before = 0.0
    for k in range(a + 1, b):
        t = np.sum((point[k] - point[a]) * line) / square
        if t < before or t > 1.0:
            return False
        before = t
        off = point[k] - point[a] - t * line
        limit = tolerance * radius[k]
        if np.sum(off * off) > limit * limit:
            return False
        if abs(radius[k] - (radius[a] + t * (radius[b] - radius[a]))) > limit:
            return False
    return True


def check(skeleton: Skeleton) -> None:
    """Refuse what has no surface.

    Raises
    ------
    InputError
        If the skeleton is empty, a radius is below 0 or no number, or an internode has no place.
    """
    if len(skeleton) == 0:
        raise InputError("a skeleton without internodes has no surface", where="skeleton")
    bad = ~(np.isfinite(skeleton.radius) & (skeleton.radius >= 0.0))
    if bad.any():
        i = int(np.flatnonzero(bad)[0])
        raise InputError(
            f"internode {i} has radius {skeleton.radius[i]:g} m ({int(bad.sum())} such)",
            where="skeleton.radius",
            expected="0 or more",
        )
    if not (np.isfinite(skeleton.start).all() and np.isfinite(skeleton.end).all()):
        raise InputError("an internode's place is not a number", where="skeleton.start, end")


def sound(skeleton: Skeleton) -> Skeleton:
    """Refuse what has no surface; raise radii below that of the thinnest wood, as tubes do."""
    check(skeleton)
    return replace(skeleton, radius=np.maximum(skeleton.radius, LEAST_RADIUS_M))


def thick_enough(skeleton: Skeleton, thinnest_m: float) -> NDArray[np.bool_]:
    """Mark the internodes that are, or bear, one of at least this radius that has a length."""
    keep = (skeleton.radius >= thinnest_m) & (skeleton.length > SHORTEST)
    for i in range(len(skeleton) - 1, 0, -1):
        if keep[i] and skeleton.parent[i] >= 0:
            keep[skeleton.parent[i]] = True
    return np.asarray(keep, np.bool_)
