"""The chain of particles that flows up the surface (Hart & Baker 2003, section 5.3).

Each particle has a number for life; `ahead` and `behind` hold its neighbours in its loop. Lengths
are in m, time in s, forces per mass of a particle.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.surface.blend.around import Around, empty_around, gather
from forest.surface.flow.relink import apart, relink
from forest.surface.flow.surface import Seen, foot, settle

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

GONE = 0  # merged with a neighbour
FLOWING = 1
DONE = 2  # at a tip
#: Fewest particles of a loop.
LEAST_LOOP = 3
#: How far around a particle its lists reach, in longest links, and when they are gathered anew.
_REACH, _WORN = 1.0, 0.75


class Forces(NamedTuple):
    """What moves particles, in m and s."""

    step: float
    greatest: float  # longest link
    least: float  # shortest link
    finest: float  # longest link, in radii of the limb
    spring: float  # between links
    damping: float
    skeleton_spring: float
    skeleton_damping: float
    speed: float  # of the flow
    steering: float  # rate at which particles turn to their limb, 1/s
    lean_cos: float  # of the angle between grain and limb
    lean_sin: float
    printed: bool  # whether Table 2 is taken as printed


class Chain(NamedTuple):
    """All particles there have been; the last few rows are not used yet."""

    place: _Floats  # (n, 3)
    velocity: _Floats  # (n, 3)
    normal: _Floats  # (n, 3)
    off: _Floats  # (n,) distance from the surface that was left after projection
    foot: _Floats  # (n, 3) nearest point of the limb's axis
    heading: _Floats  # (n, 3) of the axis there
    radius: _Floats  # (n,) of the limb there
    ahead: _Ints  # (n,)
    behind: _Ints  # (n,)
    limb: NDArray[np.int32]  # (n,)
    cone: _Ints  # (n,)
    state: NDArray[np.int8]  # (n,)
    mother: _Ints  # (n,) the particle ahead of which it was put in; -1 at the start
    push: _Floats  # (n, 3) scratch
    live: _Ints  # (n,) numbers of those that are not gone
    tally: _Ints  # (3,) particles ever, live ones, relinkings
    around: Around  # what of the surface is near each


def empty_chain(room: int) -> Chain:
    """Make room for particles."""
    ints = [np.zeros(room, np.int64) for _ in range(5)]
    return Chain(
        place=np.zeros((room, 3)),
        velocity=np.zeros((room, 3)),
        normal=np.zeros((room, 3)),
        off=np.zeros(room),
        foot=np.zeros((room, 3)),
        heading=np.zeros((room, 3)),
        radius=np.zeros(room),
        ahead=ints[0],
        behind=ints[1],
        limb=np.zeros(room, np.int32),
        cone=ints[2],
        state=np.zeros(room, np.int8),
        mother=ints[3],
        push=np.zeros((room, 3)),
        live=ints[4],
        tally=np.zeros(3, np.int64),
        around=empty_around(room),
    )


def with_room(chain: Chain, room: int) -> Chain:
    """Copy a chain into longer arrays."""
    longer = empty_chain(room)
    old: list[NDArray[Any]] = [*chain[:-1], *chain.around]
    new: list[NDArray[Any]] = [*longer[:-1], *longer.around]
    for before, after in zip(old, new, strict=True):
        after[: len(before)] = before
    return longer


@njit
def _look_around(surface: Any, chain: Any, i: Any, reach: Any, x: Any, y: Any, z: Any) -> None:
    """Gather what is near a particle if it has left the middle of its lists, or its limb."""
    middle = chain.around.middle[i]
    square = (x - middle[0]) ** 2 + (y - middle[1]) ** 2 + (z - middle[2]) ** 2
    axis = chain.limb[i]
    if square > (_WORN * reach) ** 2 or chain.around.axis[i] != axis:
        gather(surface.field, surface.kin, chain.around, i, axis, x, y, z, reach)


@njit
def put(surface: Any, chain: Any, forces: Any, i: Any, x: Any, y: Any, z: Any) -> None:
    """Put a particle on the surface; its velocity keeps what is tangential."""
    _look_around(surface, chain, i, _REACH * forces.greatest, x, y, z)
    seen = Seen(surface.field, surface.kin, chain.around, i)
    x, y, z, nx, ny, nz, off, which = settle(seen, x, y, z, chain.cone[i], chain.normal[i])
    v = chain.velocity[i]
    across = v[0] * nx + v[1] * ny + v[2] * nz
    v[0] -= across * nx
    v[1] -= across * ny
    v[2] -= across * nz
    chain.place[i, 0], chain.place[i, 1], chain.place[i, 2] = x, y, z
    chain.normal[i, 0], chain.normal[i, 1], chain.normal[i, 2] = nx, ny, nz
    chain.off[i] = off
    chain.cone[i] = which
    chain.limb[i] = surface.field.cones.axis[which]
    fx, fy, fz, hx, hy, hz, radius, at_tip = foot(surface, which, x, y, z)
    chain.radius[i] = radius
    chain.foot[i, 0], chain.foot[i, 1], chain.foot[i, 2] = fx, fy, fz
    chain.heading[i, 0], chain.heading[i, 1], chain.heading[i, 2] = hx, hy, hz
    if at_tip:
        chain.state[i] = DONE
        v[:] = 0.0


@njit
def grain_heading(normal: Any, heading: Any, lean_cos: Any, lean_sin: Any) -> Any:
    """Direction on the surface that leans from the limb's heading to the right, seen from outside.

    Returns zeros where the surface is at right angles to the limb.
    """
    nx, ny, nz = normal[0], normal[1], normal[2]
    along = heading[0] * nx + heading[1] * ny + heading[2] * nz
    tx, ty, tz = heading[0] - along * nx, heading[1] - along * ny, heading[2] - along * nz
    size = np.sqrt(tx * tx + ty * ty + tz * tz)
    if size < 1e-6:
        return 0.0, 0.0, 0.0
    tx, ty, tz = tx / size, ty / size, tz / size
    rx, ry, rz = ty * nz - tz * ny, tz * nx - tx * nz, tx * ny - ty * nx
    return (
        lean_cos * tx + lean_sin * rx,
        lean_cos * ty + lean_sin * ry,
        lean_cos * tz + lean_sin * rz,
    )


@njit
def _push(chain: Any, forces: Any, i: Any) -> None:
    """Sum the forces on a particle: springs to its neighbours and to the skeleton."""
    a, b = chain.ahead[i], chain.behind[i]
    v, n = chain.velocity[i], chain.normal[i]
    outward = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    hold = -forces.skeleton_spring * chain.off[i] - forces.skeleton_damping * outward
    for k in range(3):
        stretch = chain.place[a, k] + chain.place[b, k] - 2.0 * chain.place[i, k]
        drag = chain.velocity[a, k] + chain.velocity[b, k] - 2.0 * v[k]
        chain.push[i, k] = forces.spring * stretch + forces.damping * drag + hold * n[k]
    if forces.steering > 0.0:
        way = grain_heading(n, chain.heading[i], forces.lean_cos, forces.lean_sin)
        for k in range(3):
            chain.push[i, k] += forces.steering * (forces.speed * way[k] - v[k])


@njit
def _move(surface: Any, chain: Any, forces: Any) -> None:
    """Take a semi-implicit step: first velocities, then places with the new ones."""
    live = chain.tally[1]
    for j in range(live):
        if chain.state[chain.live[j]] == FLOWING:
            _push(chain, forces, chain.live[j])
    for j in range(live):
        i = chain.live[j]
        if chain.state[i] != FLOWING:
            continue
        for k in range(3):
            chain.velocity[i, k] += forces.step * chain.push[i, k]
        x = chain.place[i, 0] + forces.step * chain.velocity[i, 0]
        y = chain.place[i, 1] + forces.step * chain.velocity[i, 1]
        z = chain.place[i, 2] + forces.step * chain.velocity[i, 2]
        put(surface, chain, forces, i, x, y, z)


@njit
def _put_between(surface: Any, chain: Any, forces: Any, a: Any, b: Any) -> None:
    """Put a new particle into the middle of a link."""
    m = chain.tally[0]
    chain.tally[0] += 1
    chain.live[chain.tally[1]] = m
    chain.tally[1] += 1
    chain.state[m] = FLOWING
    chain.cone[m] = chain.cone[a]
    chain.limb[m] = chain.limb[a]
    chain.mother[m] = a
    for k in range(3):
        chain.velocity[m, k] = 0.5 * (chain.velocity[a, k] + chain.velocity[b, k])
        chain.normal[m, k] = chain.normal[a, k]
    x = 0.5 * (chain.place[a, 0] + chain.place[b, 0])
    y = 0.5 * (chain.place[a, 1] + chain.place[b, 1])
    z = 0.5 * (chain.place[a, 2] + chain.place[b, 2])
    put(surface, chain, forces, m, x, y, z)
    chain.ahead[a] = chain.behind[b] = m
    chain.behind[m], chain.ahead[m] = a, b


@njit
def _take_out(chain: Any, stays: Any, goes: Any) -> None:
    """Merge a particle with a neighbour, which keeps its place and gets the mean velocity."""
    for k in range(3):
        chain.velocity[stays, k] = 0.5 * (chain.velocity[stays, k] + chain.velocity[goes, k])
    n = chain.normal[stays]
    across = np.sum(chain.velocity[stays] * n)
    for k in range(3):
        chain.velocity[stays, k] -= across * n[k]
    if chain.state[stays] == DONE or chain.state[goes] == DONE:
        chain.state[stays] = DONE
        chain.velocity[stays] = 0.0
    before, after = chain.behind[goes], chain.ahead[goes]
    chain.ahead[before] = after
    chain.behind[after] = before
    chain.state[goes] = GONE


@njit
def _mend_links(surface: Any, chain: Any, forces: Any) -> None:
    """Split links that are too long and merge those too short, but for the smallest loops."""
    for j in range(chain.tally[1]):
        a = chain.live[j]
        if chain.state[a] == GONE:
            continue
        b = chain.ahead[a]
        if chain.state[a] == DONE and chain.state[b] == DONE:
            continue
        square = 0.0
        for k in range(3):
            square += (chain.place[a, k] - chain.place[b, k]) ** 2
        finer = min(1.0, forces.finest * min(chain.radius[a], chain.radius[b]) / forces.greatest)
        if square > (finer * forces.greatest) ** 2:
            _put_between(surface, chain, forces, a, b)
        elif square < (finer * forces.least) ** 2:
            third = chain.ahead[b]
            if chain.ahead[third] != a and third != a:  # more than LEAST_LOOP
                _take_out(chain, min(a, b), max(a, b))
            elif apart(chain.place, third, a) < (finer * forces.least) ** 2:
                for i in (a, b, third):  # nothing is left within the loop
                    chain.state[i] = DONE
                    chain.velocity[i] = 0.0
    kept = 0
    for j in range(chain.tally[1]):
        if chain.state[chain.live[j]] != GONE:
            chain.live[kept] = chain.live[j]
            kept += 1
    chain.tally[1] = kept


@njit
def _part(chain: Any, forces: Any) -> None:
    """Try to relink wherever two neighbours are on different limbs."""
    for j in range(chain.tally[1]):
        a = chain.live[j]
        b = chain.ahead[a]
        if chain.limb[a] != chain.limb[b]:
            chain.tally[2] += relink(
                a,
                b,
                chain.limb,
                chain.place,
                chain.ahead,
                chain.behind,
                chain.foot,
                chain.heading,
                forces.printed,
            )


@njit
def advance(surface: Any, chain: Any, forces: Any, steps: Any) -> Any:
    """Take steps until they are done, the chain is at the tips, or there is no room.

    Returns
    -------
    tuple
        Steps taken; particles that still flow.
    """
    for taken in range(steps):
        flowing = 0
        for j in range(chain.tally[1]):
            if chain.state[chain.live[j]] == FLOWING:
                flowing += 1
        if flowing == 0 or chain.tally[0] + chain.tally[1] > len(chain.live):
            return taken, flowing
        _move(surface, chain, forces)
        _mend_links(surface, chain, forces)
        _part(chain, forces)
    return steps, flowing
