"""The joints of a tree's limbs: which axes blend with each other, where, and how far.

A limb blends with its parent, and with the limbs that start at the same point of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.surface.blend.cones import Cones
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

#: Siblings whose bases lie nearer than this, times the thinner radius, share one joint.
SAME_BASE = 0.25
#: Most limbs that share a joint, without their parent.
MOST_SIBLINGS = 8
#: The sine of half the angle between two limbs is taken as at least this.
_NARROWEST = 0.15
#: A blend fades within this distance of either limb, times the mean (geometric) of their radii.
NEAR = 2.0


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


def joints_of(skeleton: Skeleton, cones: Cones, chains: list[_Ints], first: _Ints) -> Joints:
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
