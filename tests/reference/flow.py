"""Relinking as Table 2 of Hart & Baker 2003 lists it, and a step of the chain, said slowly."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

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
