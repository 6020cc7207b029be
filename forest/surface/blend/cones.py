"""A skeleton as polylines of cones, and the joints at which they blend.

Straight runs of internodes become one cone each. An internode's radius is that at its middle; two
that follow each other on an axis meet with the mean of their radii. What is thinner than a limit,
with all that it bears, is left out: it stays tubes (see `weld`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
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
#: Siblings whose bases lie nearer than this, times the thinner radius, share one joint.
SAME_BASE = 0.25
#: Most limbs that share a joint, without their parent.
MOST_SIBLINGS = 8
#: The sine of half the angle between two limbs is taken as at least this.
_NARROWEST = 0.15
#: A blend fades within this distance of either limb, times the mean (geometric) of their radii.
NEAR = 2.0
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


class Joints(NamedTuple):
    """Pairs of axes that blend; pairs of one place stand together, as a `place`."""

    point: _Floats  # (j, 3) where they part
    reach: _Floats  # (j,) distance at which the blend has faded, m
    thin: _Floats  # (j,) radius of the thinner limb there, m
    near: _Floats  # (j,) distance from either limb's surface at which the blend has faded, m
    first: _Ints  # (j, 2) first cone of either axis within reach
    last: _Ints  # (j, 2) one past the last
    place: _Ints  # (places + 1,) first joint of each place


@dataclass(frozen=True)
class Limbs:
    """The cones and joints of a skeleton, and what leads back to its internodes.

    Attributes
    ----------
    cones, joints : Cones, Joints
        Packed arrays for kernels.
    members : int64 (m,)
        Internodes of each axis, base first, one axis after the other; only those kept as cones.
    member_end : float64 (m,)
        Distance of each one's end from the base of its axis, m.
    member_first : int64 (axes + 1,)
        First of `members` of each axis.
    kept : bool (n,)
        By internode: whether it is part of a cone.
    """

    cones: Cones
    joints: Joints
    members: _Ints
    member_end: _Floats
    member_first: _Ints
    kept: NDArray[np.bool_]

    def internode(self, axis: NDArray[np.int32], along: _Floats) -> _Ints:
        """Give the internode at a distance from the base of an axis."""
        lengths = self.member_end.max(initial=0.0) + 1.0
        owner = np.repeat(np.arange(len(self.member_first) - 1), np.diff(self.member_first))
        key = owner * lengths + self.member_end  # rises, axis after axis
        at = np.searchsorted(key, axis * lengths + along - 1e-9)
        last = self.member_first[axis.astype(np.int64) + 1] - 1
        return np.asarray(self.members[np.minimum(at, last)], np.int64)


@njit
def _merge(point: Any, radius: Any, tolerance: Any, keep: Any) -> None:
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


def _chains(skeleton: Skeleton, kept: NDArray[np.bool_]) -> list[_Ints]:
    """List the kept internodes of each axis, base first."""
    axes = int(skeleton.axis.max()) + 1
    index = np.flatnonzero(kept)
    order = index[np.argsort(skeleton.axis[index], kind="stable")]
    cuts = np.searchsorted(skeleton.axis[order], np.arange(1, axes))
    return [np.asarray(chain, np.int64) for chain in np.split(order, cuts)]


def _polyline(skeleton: Skeleton, chain: _Ints) -> tuple[_Floats, _Floats, _Floats]:
    """Give an axis' points, the radii there, and how far along it each lies.

    Points that fall on the one before are left out, but for their radius.
    """
    point = np.concatenate((skeleton.start[chain[:1]], skeleton.end[chain]))
    radius = skeleton.radius[chain]
    radius = np.concatenate((radius[:1], 0.5 * (radius[:-1] + radius[1:]), radius[-1:]))
    step = np.linalg.norm(np.diff(point, axis=0), axis=1)
    along = np.concatenate(([0.0], np.cumsum(step)))
    new = np.concatenate(([True], step > SHORTEST))
    return point[new], radius[new], along[new]


def limbs_of(
    skeleton: Skeleton,
    *,
    thinnest_m: float = 0.0,
    reaction: Reaction | None = None,
    flare: _Floats | None = None,
    tolerance: float = STRAIGHT,
) -> Limbs:
    """Turn a skeleton into cones and joints.

    Parameters
    ----------
    skeleton : Skeleton
        A tree.
    thinnest_m : float
        Internodes thinner than this radius that bear none so thick are left out.
    reaction : Reaction, optional
        Reaction wood by axis (see `forest.surface.blend.reaction_wood`).
    flare : float64 (axes, FLARE), optional
        The root flare of axes from the ground.
    tolerance : float
        How far a cone may lie from what it stands for, times the radius.

    Raises
    ------
    InputError
        If the skeleton has no surface, or nothing in it is so thick.
    """
    skeleton = sound(skeleton)
    kept = thick_enough(skeleton, thinnest_m)
    long = skeleton.length > SHORTEST
    if not kept.any() and long.any():
        raise InputError(
            f"the thickest internode has a radius of {skeleton.radius[long].max():.3g} m",
            where="cell_m",
            expected=f"cells at most a part of that radius, here thinnest {thinnest_m:.3g} m",
        )
    axes = int(skeleton.axis.max()) + 1
    chains = _chains(skeleton, kept)
    lines = [_polyline(skeleton, chain) if len(chain) else None for chain in chains]
    parts: list[tuple[_Floats, ...]] = []
    count = np.zeros(axes + 1, np.int64)
    for a, line in enumerate(lines):
        if line is None or len(line[0]) < 2:
            continue
        keep = np.empty(len(line[0]), np.bool_)
        _merge(line[0], line[1], tolerance, keep)
        point, radius, along = (column[keep] for column in line)
        parts.append((point[:-1], point[1:], radius[:-1], radius[1:], along[:-1]))
        count[a + 1] = len(point) - 1
    if not parts:
        raise InputError("no internode has a length", where="skeleton.start, end")
    start, end, low, high, along = (np.concatenate(column) for column in zip(*parts, strict=True))
    first = np.cumsum(count)
    axis = np.repeat(np.arange(axes, dtype=np.int32), count[1:])
    grounded = [c[0] for c in chains if len(c) and skeleton.parent[c[0]] < 0]
    ground = np.full(axes, -np.inf)
    ground[skeleton.axis[grounded]] = skeleton.start[grounded, 2]
    cones = Cones(
        start=start,
        end=end,
        low=low,
        high=high,
        along=along,
        side=_sides(start, end, reaction, axis),
        axis=axis,
        reach=np.zeros(axes) if reaction is None else np.asarray(reaction.reach_m, np.float64),
        widened=np.zeros(axes) if reaction is None else np.asarray(reaction.widening_m, np.float64),
        ground=ground,
        flare=np.zeros((axes, FLARE)) if flare is None else flare,
    )
    ends = [
        np.cumsum(np.linalg.norm(np.diff(_corners(skeleton, c), axis=0), axis=1)) for c in chains
    ]
    return Limbs(
        cones=cones,
        joints=_joints(skeleton, cones, chains, first),
        members=np.concatenate(chains),
        member_end=np.concatenate(ends),
        member_first=np.concatenate(([0], np.cumsum([len(c) for c in chains]))),
        kept=kept,
    )


@dataclass(frozen=True)
class Reaction:
    """Reaction wood by axis (Hart & Baker 2003, section 5.1).

    Attributes
    ----------
    reach_m : float64 (axes,)
        delta: how far from its base a limb is widened.
    widening_m : float64 (axes,)
        Delta r: by how much, at its base, on the thick side.
    below : bool
        Whether the thick side is the lower one (conifers), or the upper (broadleaves).
    """

    reach_m: _Floats
    widening_m: _Floats
    below: bool


def _corners(skeleton: Skeleton, chain: _Ints) -> _Floats:
    return np.concatenate((skeleton.start[chain[:1]], skeleton.end[chain]))


def _sides(
    start: _Floats, end: _Floats, reaction: Reaction | None, axis: NDArray[np.int32]
) -> _Floats:
    """Give y of eq. 31: the part of down (or up) at right angles to each cone, of length 1."""
    side = np.zeros_like(start)
    if reaction is None:
        return side
    heading = (end - start) / np.linalg.norm(end - start, axis=1)[:, None]
    side = -heading[:, 2:] * heading
    side[:, 2] += 1.0
    size = np.linalg.norm(side, axis=1)
    side[size > 1e-6] /= size[size > 1e-6, None]
    side[(size <= 1e-6) | (reaction.widening_m[axis] <= 0.0)] = 0.0
    return np.asarray(-side if reaction.below else side)


@dataclass(frozen=True)
class _Base:
    """The base of a limb on its parent."""

    point: _Floats
    child: int
    parent: int
    along: float  # on the parent, m
    parent_radius: float
    radius: float


def _bases(
    skeleton: Skeleton, cones: Cones, chains: list[_Ints], first: _Ints
) -> dict[int, list[_Base]]:
    """Find where limbs start, by parent axis and in order along it."""
    by_parent: dict[int, list[_Base]] = {}
    for child, chain in enumerate(chains):
        if first[child] == first[child + 1]:
            continue
        below = int(skeleton.parent[chain[0]])
        while below >= 0 and first[skeleton.axis[below]] == first[skeleton.axis[below] + 1]:
            below = int(skeleton.parent[chains[skeleton.axis[below]][0]])
        if below < 0:
            continue
        parent = int(skeleton.axis[below])
        if parent == child:
            continue
        point = cones.start[first[child]]
        here = slice(first[parent], first[parent + 1])
        line = cones.end[here] - cones.start[here]
        square = (line**2).sum(1)
        t = np.clip(((point - cones.start[here]) * line).sum(1) / square, 0.0, 1.0)
        away = ((cones.start[here] + t[:, None] * line - point) ** 2).sum(1)
        k = int(np.argmin(away))
        s = first[parent] + k
        base = _Base(
            point=point,
            child=child,
            parent=parent,
            along=float(cones.along[s] + t[k] * np.sqrt(square[k])),
            parent_radius=float(cones.low[s] + t[k] * (cones.high[s] - cones.low[s])),
            radius=float(cones.low[first[child]]),
        )
        by_parent.setdefault(parent, []).append(base)
    for bases in by_parent.values():
        bases.sort(key=lambda base: (base.along, base.child))
    return by_parent


def _places(bases: list[_Base]) -> list[list[_Base]]:
    """Put limbs that start at nearly the same point of their parent together."""
    places: list[list[_Base]] = []
    for base in bases:
        if places and len(places[-1]) < MOST_SIBLINGS:
            near = min(base.radius, places[-1][0].radius) * SAME_BASE
            if np.linalg.norm(base.point - places[-1][0].point) <= near:
                places[-1].append(base)
                continue
        places.append([base])
    return places


def _headings(cones: Cones, first: _Ints, axis: int, point: _Floats, ahead: float) -> _Floats:
    """Directions in which an axis leaves a point on it, towards its tip and its base."""
    a, b = int(first[axis]), int(first[axis + 1])
    corner = np.concatenate((cones.start[a:b], cones.end[b - 1 : b])) - point
    size = np.linalg.norm(corner, axis=1)
    line = np.diff(corner, axis=0)
    t = np.clip(-(corner[:-1] * line).sum(1) / (line**2).sum(1), 0.0, 1.0)
    at = int(np.argmin(((corner[:-1] + t[:, None] * line) ** 2).sum(1)))
    far = size > ahead
    ahead_of, behind = at + 1 + np.flatnonzero(far[at + 1 :]), np.flatnonzero(far[: at + 1])
    ways = [corner[k] / size[k] for k in (*ahead_of[:1], *behind[-1:])]
    return np.array(ways).reshape(len(ways), 3)


def _joints(skeleton: Skeleton, cones: Cones, chains: list[_Ints], first: _Ints) -> Joints:
    """List the pairs of axes that share a joint: limb and parent, and limbs of one base."""
    rows: list[tuple[_Floats, float, float, int, int, float]] = []
    place = [0]
    for bases in _bases(skeleton, cones, chains, first).values():
        for together in _places(bases):
            for base in together:
                thick, thin = sorted((base.parent_radius, base.radius), reverse=True)
                reach = _reach(cones, first, base.child, base.parent, base.point, thick, thin)
                near = NEAR * float(np.sqrt(thick * thin))
                rows.append((base.point, reach, thin, base.parent, base.child, near))
            for k, one in enumerate(together):
                for other in together[k + 1 :]:
                    thick, thin = sorted((one.radius, other.radius), reverse=True)
                    reach = _reach(cones, first, one.child, other.child, one.point, thick, thin)
                    near = NEAR * float(np.sqrt(thick * thin))
                    rows.append((one.point, reach, thin, one.child, other.child, near))
            place.append(len(rows))
    n = len(rows)
    point = np.array([row[0] for row in rows]).reshape(n, 3)
    reaches = np.array([row[1] for row in rows])
    lower, upper = np.zeros((n, 2), np.int64), np.zeros((n, 2), np.int64)
    for j, row in enumerate(rows):
        for k, axis in enumerate(row[3:5]):
            lower[j, k], upper[j, k] = _within(cones, first, int(axis), point[j], float(reaches[j]))
    return Joints(
        point=point,
        reach=reaches,
        thin=np.array([row[2] for row in rows]),
        near=np.array([row[5] for row in rows]),
        first=lower,
        last=upper,
        place=np.array(place, np.int64),
    )


def _reach(
    cones: Cones,
    first: _Ints,
    one: int,
    other: int,
    point: _Floats,
    thick: float,
    thin: float,
) -> float:
    """How far the blend of two limbs reaches: (R + r) / sin(half the angle between them).

    For equal limbs this is twice the distance at which the plain ones part.
    """
    a = _headings(cones, first, one, point, 0.5 * thick)
    b = _headings(cones, first, other, point, 0.5 * thick)
    closest = float(np.max(a @ b.T)) if len(a) and len(b) else 0.0
    half = np.sqrt(max(0.5 * (1.0 - closest), 0.0))
    return (thick + thin) / max(float(half), _NARROWEST)


def _within(cones: Cones, first: _Ints, axis: int, point: _Floats, reach: float) -> tuple[int, int]:
    """Range of an axis' cones that come within reach of their joint."""
    a, b = int(first[axis]), int(first[axis + 1])
    line = cones.end[a:b] - cones.start[a:b]
    t = np.clip(((point - cones.start[a:b]) * line).sum(1) / (line**2).sum(1), 0.0, 1.0)
    away = np.linalg.norm(cones.start[a:b] + t[:, None] * line - point, axis=1)
    near = np.flatnonzero(away - np.maximum(cones.low[a:b], cones.high[a:b]) <= reach)
    if len(near) == 0:
        near = np.array([int(np.argmin(away))])
    return a + int(near[0]), a + int(near[-1]) + 1
