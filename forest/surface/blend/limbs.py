"""A skeleton as polylines of cones, and the joints at which they blend.

Straight runs of internodes become one cone each. An internode's radius is that at its middle; two
that follow each other on an axis meet with the mean of their radii. What is thinner than a limit,
with all that it bears, is left out: it stays tubes (see `weld`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.blend.cones import (
    FLARE,
    SHORTEST,
    STRAIGHT,
    Cones,
    merge,
    sound,
    thick_enough,
)
from forest.surface.blend.joints import Joints, joints_of
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


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
        merge(line[0], line[1], tolerance, keep)
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
        joints=joints_of(skeleton, cones, chains, first),
        members=np.concatenate(chains),
        member_end=np.concatenate(ends),
        member_first=np.concatenate(([0], np.cumsum([len(c) for c in chains]))),
        kept=kept,
    )


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
