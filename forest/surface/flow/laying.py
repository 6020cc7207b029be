"""Rings of particles: at the feet of stems, and anew past places where a chain hangs.

Where many limbs leave a stem close together, or cross farther out, the strands of a chain may
never meet in the crotches, so that Table 2 does not part it: it hangs there and pays out particles
for ever. Hart & Baker 2003, 5.3, do not say what then. Here such a loop is taken out, and a ring of
its own is laid on each limb that the loop was on and that no ring has been on farther up.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.surface.flow.chain import (
    DONE,
    FLOWING,
    GONE,
    Chain,
    Forces,
    empty_chain,
    grain_heading,
    put,
    with_room,
)
from forest.surface.flow.relink import winding
from forest.surface.flow.surface import Limbed

_Floats = NDArray[np.float64]

#: A particle hangs when it has crept less than so many longest links, in the time in which a free
#: one goes so many radii of the thickest limb: strands that wait for each other meet before.
_CREPT, _WAIT = 2.5, 8.0
#: Height of the ring at the start above the ground, in longest links.
_START = 0.1 / 0.15
#: Distance of the places on a limb where a ring is tried, in radii of the limb.
_TRIED = 0.5
#: Fewest particles of a ring that is laid.
_FEWEST = 6


class Watch(NamedTuple):
    """What is kept to know where chains hang and where rings have been."""

    rest: _Floats  # (n, 3) place that a particle has been near
    since: NDArray[np.int64]  # (n,) step at which it came there
    walked: NDArray[np.int64]  # (n,) scratch: step at which it was walked over
    front: _Floats  # (axes,) farthest from its base that a ring was or was tried, m; below 0: none


def new_watch(surface: Limbed, chain: Chain) -> Watch:
    """Start to watch a chain."""
    n = len(chain.live)
    front = np.full(len(surface.field.cones.reach), -1.0)
    return Watch(chain.place.copy(), np.zeros(n, np.int64), np.full(n, -1), front)


def with_room_to_watch(watch: Watch, room: int) -> Watch:
    """Copy what is kept into longer arrays."""
    n = len(watch.since)
    rest = np.zeros((room, 3))
    since, walked = np.zeros(room, np.int64), np.full(room, -1)
    rest[:n], since[:n], walked[:n] = watch.rest, watch.since, watch.walked
    return Watch(rest, since, walked, watch.front)


@njit
def along(cones: Any, chain: Any, i: Any) -> Any:
    """Distance of a particle's foot from the base of its limb, m."""
    k = chain.cone[i]
    square = 0.0
    for m in range(3):
        square += (chain.foot[i, m] - cones.start[k, m]) ** 2
    return cones.along[k] + np.sqrt(square)


@njit
def look(surface: Any, chain: Any, watch: Any, first: Any, now: Any, wait: Any, crept: Any) -> Any:
    """Note how far rings have come, and find a particle that hangs; -1 if none does.

    Particles from `first` on are new. One begins with its mother's rest if it is near that.
    """
    cones = surface.field.cones
    for i in range(first, chain.tally[0]):
        mother = chain.mother[i]
        watch.since[i] = now if mother < 0 else watch.since[mother]
        watch.rest[i] = chain.place[i] if mother < 0 else watch.rest[mother]
    hung = np.int64(-1)
    for j in range(chain.tally[1]):
        i = chain.live[j]
        square = 0.0
        for k in range(3):
            square += (chain.place[i, k] - watch.rest[i, k]) ** 2
        if square > crept * crept or chain.state[i] != FLOWING:
            watch.since[i] = now
            watch.rest[i] = chain.place[i]
        elif now - watch.since[i] > wait and hung < 0:
            hung = i
    for j in range(chain.tally[1]):
        i = chain.live[j]
        if watch.walked[i] == now:
            continue
        least, last, alone = np.inf, i, True
        k = i
        while watch.walked[k] != now:
            watch.walked[k] = now
            alone = alone and chain.limb[k] == chain.limb[i]
            least = min(least, along(cones, chain, k))
            last = k
            k = chain.ahead[k]
        if alone and least > watch.front[chain.limb[i]]:
            turn = winding(chain.place, chain.ahead, chain.foot, chain.heading, i, i, last)
            if abs(turn) > np.pi:
                watch.front[chain.limb[i]] = least
    return hung


def loop_of(chain: Chain, i: int) -> list[int]:
    """List the particles of a loop."""
    found = [i]
    while int(chain.ahead[found[-1]]) != i:
        found.append(int(chain.ahead[found[-1]]))
    return found


def take_out_loop(surface: Limbed, chain: Chain, watch: Watch, hung: int) -> dict[int, float]:
    """Take out the loop of a particle; list the limbs on which a ring must follow.

    Returns
    -------
    dict of int to float
        For each limb that no ring has been on beyond where the loop comes onto it, that distance
        from its base, m.
    """
    loop = loop_of(chain, hung)
    reached: dict[int, float] = {}
    for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
        if chain.limb[a] != chain.limb[b] or a == hung:
            for i in (a, b):
                axis = int(chain.limb[i])
                at = float(along(surface.field.cones, chain, np.int64(i)))
                reached[axis] = max(reached.get(axis, 0.0), at)
    chain.state[loop] = GONE
    live = chain.live[: chain.tally[1]]
    left = live[chain.state[live] != GONE]
    chain.live[: len(left)] = left
    chain.tally[1] = len(left)
    return {axis: at for axis, at in sorted(reached.items()) if watch.front[axis] <= at}


def start(surface: Limbed, forces: Forces) -> Chain:
    """Lay a ring of particles around the foot of each stem."""
    cones = surface.field.cones
    feet = np.flatnonzero(np.isfinite(cones.ground[cones.axis]) & (cones.along == 0.0))
    feet = feet if len(feet) else np.zeros(1, np.int64)
    radius = cones.low[feet] + cones.flare[cones.axis[feet], 1]
    sizes = [max(_FEWEST, math.ceil(2.0 * math.pi * r / _link(forces))) for r in radius]
    chain = empty_chain(16 * sum(sizes))
    for foot, r, n in zip(feet.tolist(), radius.tolist(), sizes, strict=True):
        _ring(surface, chain, forces, foot, _START * forces.greatest, r, n)
    return chain


def _link(forces: Forces) -> float:
    return 0.5 * (forces.greatest + forces.least)


def lay(surface: Limbed, chain: Chain, forces: Forces, axis: int, beyond: float) -> Chain:
    """Lay a ring on a limb at the first place, beyond a distance from its base, that is its own.

    Nothing is laid where other limbs are in the way up to the limb's tip.
    """
    cones = surface.field.cones
    of = np.flatnonzero(cones.axis == axis)
    length = cones.along[of[-1]] + float(np.linalg.norm(cones.end[of[-1]] - cones.start[of[-1]]))
    at = beyond
    while True:
        k = int(of[np.searchsorted(cones.along[of], at, side="right") - 1])
        span = float(np.linalg.norm(cones.end[k] - cones.start[k]))
        up = at - float(cones.along[k])
        radius = float(cones.low[k] + up / span * (cones.high[k] - cones.low[k]))
        finer = min(1.0, forces.finest * radius / forces.greatest)
        n = max(_FEWEST, math.ceil(2.0 * math.pi * radius / (_link(forces) * finer)))
        if at >= length - radius:
            return chain
        if chain.tally[0] + 2 * n > len(chain.live):
            chain = with_room(chain, 2 * len(chain.live) + 2 * n)
        first, live = int(chain.tally[0]), int(chain.tally[1])
        _ring(surface, chain, forces, k, up, radius, n)
        new = np.arange(first, first + n)
        i, last = np.int64(first), np.int64(first + n - 1)
        turn = winding(chain.place, chain.ahead, chain.foot, chain.heading, i, i, last)
        if (chain.limb[new] == axis).all() and abs(turn) > math.pi:
            return chain
        chain.tally[0], chain.tally[1] = first, live
        chain.around.axis[new] = -1
        at += _TRIED * radius


def _ring(
    surface: Limbed, chain: Chain, forces: Forces, foot: int, up: float, radius: float, n: int
) -> None:
    """Add `n` particles, linked in a ring, around a cone at a distance from its lower end."""
    cones = surface.field.cones
    line = cones.end[foot] - cones.start[foot]
    line /= np.linalg.norm(line)
    side = np.cross(line, np.eye(3)[int(np.argmin(np.abs(line)))])
    side /= np.linalg.norm(side)
    other = np.cross(line, side)
    base = cones.start[foot] + up * line
    first, live = int(chain.tally[0]), int(chain.tally[1])
    for k in range(n):
        i = first + k
        turn = 2.0 * math.pi * k / n
        x, y, z = base + radius * (math.cos(turn) * side + math.sin(turn) * other)
        chain.cone[i] = foot
        chain.limb[i] = cones.axis[foot]
        chain.state[i] = FLOWING
        chain.velocity[i] = chain.normal[i] = 0.0
        put(surface, chain, forces, np.int64(i), float(x), float(y), float(z))
        if chain.state[i] != DONE:
            way = grain_heading(chain.normal[i], line, forces.lean_cos, forces.lean_sin)
            chain.velocity[i] = forces.speed * np.array(way)
        chain.ahead[i], chain.behind[i] = first + (k + 1) % n, first + (k - 1) % n
        chain.live[live + k] = i
        chain.mother[i] = -1
    chain.tally[0], chain.tally[1] = first + n, live + n


def not_reached(surface: Limbed, watch: Watch) -> list[int]:
    """List limbs that no ring has been on, but for those joined to one before them.

    A ring on that one may still part onto them.
    """
    kin = surface.kin
    axes = np.unique(surface.field.cones.axis)
    left = set(axes[watch.front[axes] < 0.0].tolist())
    found = []
    for axis in sorted(left):
        joined = kin.other[kin.first[axis] : kin.first[axis + 1]]
        if not any(k < axis and k in left for k in joined):
            found.append(axis)
    return found


def waits(surface: Limbed, forces: Forces) -> tuple[np.int64, float]:
    """Give after how many steps a particle hangs that has crept less than so far, m."""
    radius = float(surface.field.cones.low.max())
    return np.int64(_WAIT * radius / (forces.speed * forces.step)), _CREPT * forces.greatest


class Rings:
    """Watches a chain, takes out loops that hang, and lays rings in their stead."""

    def __init__(self, surface: Limbed, chain: Chain, forces: Forces) -> None:
        self._surface, self._forces = surface, forces
        self._watch = new_watch(surface, chain)
        self._seen = int(chain.tally[0])
        self.laid = 0
        self.fresh = False

    def tend(self, chain: Chain, step: int, flowing: int) -> Chain:
        """Look at the chain; `fresh` tells whether a ring was laid."""
        if len(self._watch.since) < len(chain.live):
            self._watch = with_room_to_watch(self._watch, len(chain.live))
        wait, crept = waits(self._surface, self._forces)
        first, now = np.int64(self._seen), np.int64(step)
        hung = int(look(self._surface, chain, self._watch, first, now, wait, crept))
        self._seen = int(chain.tally[0])
        self.fresh = False
        if hung >= 0:
            chain = self._lay(chain, take_out_loop(self._surface, chain, self._watch, hung))
        while not flowing and not self.fresh:
            axes = not_reached(self._surface, self._watch)
            if not axes:
                break
            chain = self._lay(chain, dict.fromkeys(axes, 0.0))
        return chain

    def _lay(self, chain: Chain, places: dict[int, float]) -> Chain:
        """Lay a ring on each limb beyond its place."""
        for axis, beyond in places.items():
            ever = int(chain.tally[0])
            chain = lay(self._surface, chain, self._forces, axis, beyond)
            if int(chain.tally[0]) > ever:
                self.laid += 1
                self.fresh = True
            self._watch.front[axis] = max(self._watch.front[axis], beyond)
        return chain
