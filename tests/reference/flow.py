"""Relinking as Table 2 of Hart & Baker 2003 lists it, and the chain's steps, said slowly."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from forest.surface.blend.field import Blend, cone, joint, smooth_least

Point = Sequence[float]


def square(a: Point, b: Point) -> float:
    """Squared distance."""
    return sum((p - q) ** 2 for p, q in zip(a, b, strict=True))


def part(ahead: dict[int, int], first: int, last: int) -> list[int]:
    """List the particles from one to another along the chain."""
    found = [first]
    while found[-1] != last:
        found.append(ahead[found[-1]])
    return found


def turns(way: list[Point], middle: Point, heading: Point) -> float:
    """How often a closed way goes around a line (signed)."""
    along = math.sqrt(square(heading, (0.0, 0.0, 0.0)))
    h = [k / along for k in heading]

    def flat(p: Point) -> list[float]:
        away = [a - b for a, b in zip(p, middle, strict=True)]
        d = sum(a * b for a, b in zip(away, h, strict=True))
        return [a - d * b for a, b in zip(away, h, strict=True)]

    total = 0.0
    for p, q in zip(way, way[1:] + way[:1], strict=True):
        a, b = flat(p), flat(q)
        cross = (
            h[0] * (a[1] * b[2] - a[2] * b[1])
            + h[1] * (a[2] * b[0] - a[0] * b[2])
            + h[2] * (a[0] * b[1] - a[1] * b[0])
        )
        total += math.atan2(cross, sum(x * y for x, y in zip(a, b, strict=True)))
    return total / (2.0 * math.pi)


def relink(
    a: int,
    b: int,
    limb: Sequence[int],
    x: Sequence[Point],
    ahead: dict[int, int],
    allowed: Callable[[list[int], list[int]], bool],
) -> int:
    """Table 2, line by line; `allowed` is asked of both parts before they are made loops."""
    relinked = 0
    b0, a0 = b, a
    while limb[a0] != limb[b0]:
        while True:
            a = b
            b = ahead[b]
            if b == a0:
                return relinked
            if (
                limb[a] != limb[b]
                and square(x[b0], x[a]) < square(x[b], x[a])
                and allowed(part(ahead, b0, a), part(ahead, b, a0))
            ):
                break
        relinked += 1
        ahead[a] = b0
        ahead[a0] = b
        b0 = b
    return relinked


def push(
    x: Sequence[Point], v: Sequence[Point], i: int, *, spring: float, damping: float
) -> list[float]:
    """Force of the two links of particle i of a ring, of springs without length."""
    n = len(x)
    return [
        sum(
            spring * (x[j % n][k] - x[i][k]) + damping * (v[j % n][k] - v[i][k])
            for j in (i - 1, i + 1)
        )
        for k in range(3)
    ]


def seen(blend: Blend, axes: set[int], x: Point) -> tuple[float, int]:
    """The surface of some limbs alone, and the nearest cone: all of it is looked at."""
    field, cones, joints = blend.kernel, blend.limbs.cones, blend.limbs.joints
    here = [k for k in range(len(cones.axis)) if cones.axis[k] in axes]
    plain, which = min((cone(cones, k, *x)[0], k) for k in here)
    best = plain
    for place in range(len(joints.place) - 1):
        least = math.inf
        for j in range(joints.place[place], joints.place[place + 1]):
            if axes.isdisjoint(cones.axis[joints.first[j]].tolist()):
                continue
            value, _, share = joint(field, j, *x)
            if share > 0.0:
                least = smooth_least(least, value, 0.3 * joints.thin[j] * share)
        best = min(best, least)
    return best, which


def grain_heading(normal: Point, heading: Point, lean: float) -> list[float]:
    """The heading's tangent, turned to the right about the normal; rad."""
    n, h = np.array(normal), np.array(heading)
    flat = h - (h @ n) * n
    if np.linalg.norm(flat) < 1e-6:
        return [0.0, 0.0, 0.0]
    turned = Rotation.from_rotvec(-lean * n).apply(flat / np.linalg.norm(flat))
    return [float(k) for k in turned]


def settle(value: Callable[[Point], float], x: Point) -> tuple[Point, Point]:
    """Follow the slope to where the value is zero; give the place and the unit normal there."""
    place = np.array(x)

    def slope() -> NDArray[np.float64]:
        steps = 1e-6 * np.eye(3)
        return np.array([(value(place + s) - value(place - s)) / 2e-6 for s in steps])

    for _ in range(100):
        f, g = value(place), slope()
        if abs(f) < 1e-10:
            return place.tolist(), (g / np.linalg.norm(g)).tolist()
        place = place - f * g / (g @ g)
    raise AssertionError("no surface")


class Bead(NamedTuple):
    """A particle: where it is, how fast, and whether it is at a tip."""

    place: Point
    velocity: Point
    done: bool


def mend(
    loop: list[int], beads: dict[int, Bead], least: float, greatest: float
) -> tuple[list[int], dict[int, Bead]]:
    """Go over the links of a loop as they were; split the long, merge the short.

    New particles lie in the middle of their link, off the surface; velocities are not turned.
    """
    loop, beads = list(loop), dict(beads)
    for a in sorted(loop):
        if a not in loop:
            continue
        b = loop[(loop.index(a) + 1) % len(loop)]
        if beads[a].done and beads[b].done:
            continue
        long = math.sqrt(square(beads[a].place, beads[b].place))
        place = [(p + q) / 2.0 for p, q in zip(beads[a].place, beads[b].place, strict=True)]
        mean = [(p + q) / 2.0 for p, q in zip(beads[a].velocity, beads[b].velocity, strict=True)]
        if long > greatest:
            new = max(beads) + 1
            loop.insert(loop.index(a) + 1, new)
            beads[new] = Bead(place, mean, False)
        elif long < least and len(loop) > 3:
            stays = min(a, b)
            loop.remove(max(a, b))
            done = beads[a].done or beads[b].done
            beads[stays] = Bead(beads[stays].place, [0.0] * 3 if done else mean, done)
        elif long < least:
            ends = [beads[k].place for k in loop]
            third = loop[(loop.index(a) + 2) % 3]
            if square(beads[third].place, beads[a].place) < least**2:
                for k, p in zip(loop, ends, strict=True):
                    beads[k] = Bead(p, [0.0] * 3, True)
    return loop, beads
