"""Extend: buds make shoots. Palubicki et al. 2009, section 4.3.

A metamer's direction is the weighted sum of its default direction, the optimal direction V found
by the environment (weight xi) and the tropism (weight eta). Growth stops at the ground and at
obstacles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest import random
from forest._jit import driver, njit
from forest._threads import in_threads
from forest.environment.obstacles import Solid, inside
from forest.growth.budget import extension
from forest.growth.curves import curve
from forest.growth.dealing import BINS, Deal
from forest.growth.parameters import (
    LENGTH_BY_ORDER,
    MAX_ORDERS,
    TROPISM_BY_AGE,
    TROPISM_BY_ORDER,
    SpeciesTraits,
    Year,
)
from forest.random import STREAM_PHYLLOTAXIS, STREAM_SHOOT
from forest.trees.buds import LATERAL_BUD, TERMINAL_BUD, Shoots, bud_heading
from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import Trees

_STACK = 64


@njit
def _made(v, most):  # type: ignore[no-untyped-def]
    return min(np.int64(v), most)


@njit
def _fraction(v):  # type: ignore[no-untyped-def]
    """The part of a resource that makes no whole metamer, below 1 in float32 too."""
    return min(v - np.floor(v), 0.9999999)


@driver
def _count(first, step, arena, trees, shared, traits, shoots, new):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            most = np.int64(traits.of[trees.species[row]].max_metamers)
            buds = 0
            metamers = 0
            for i in range(trees.start[row], trees.start[row] + trees.size[row]):
                for bud in range(2):
                    if arena.resource[i, bud] >= 1.0:
                        buds += 1
                        metamers += _made(arena.resource[i, bud], most)
            shoots[row] = buds
            new[row] = metamers


@driver
def _list(begin, step, arena, trees, shared, first, metamer, bud_kind):  # type: ignore[no-untyped-def]
    for b in range(begin, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            at = first[row]
            s = trees.start[row]
            for i in range(trees.size[row]):
                for bud in range(2):
                    if arena.resource[s + i, bud] >= 1.0:
                        metamer[at] = i
                        bud_kind[at] = bud
                        at += 1


def shooting_buds(arena: Metamers, trees: Trees, shared: Deal, traits: SpeciesTraits) -> Shoots:
    """List the buds whose resource makes at least one metamer: n = floor(v) >= 1 (4.2)."""
    n = len(trees.tree_id)
    count = np.zeros(n, np.int64)
    new = np.zeros(n, np.int64)
    in_threads(_count, arena, trees, shared, traits, count, new)
    first = np.zeros(n + 1, np.int64)
    np.cumsum(count, out=first[1:])
    metamer = np.empty(first[-1], np.int32)
    bud = np.empty(first[-1], np.uint8)
    in_threads(_list, arena, trees, shared, first, metamer, bud)
    return Shoots(first, metamer, bud, new)


@njit
def perpendicular(hx, hy, hz, rx, ry, rz):  # type: ignore[no-untyped-def]
    """The unit part of r at right angles to the unit vector h (any, if there is none)."""
    along = hx * rx + hy * ry + hz * rz
    x = rx - along * hx
    y = ry - along * hy
    z = rz - along * hz
    norm = np.sqrt(x * x + y * y + z * z)
    if norm > 1e-6:
        return x / norm, y / norm, z / norm
    if abs(hx) < 0.7:
        return perpendicular_axis(hx, hy, hz, 1.0, 0.0)
    return perpendicular_axis(hx, hy, hz, 0.0, 1.0)


@njit
def perpendicular_axis(hx, hy, hz, ax, ay):  # type: ignore[no-untyped-def]
    """The unit part of a horizontal axis at right angles to h."""
    along = hx * ax + hy * ay
    x = ax - along * hx
    y = ay - along * hy
    z = -along * hz
    norm = np.sqrt(x * x + y * y + z * z)
    return x / norm, y / norm, z / norm


@njit
def turned(hx, hy, hz, px, py, pz, angle):  # type: ignore[no-untyped-def]
    """Turn p (at right angles to h) around h by an angle."""
    c = np.cos(angle)
    s = np.sin(angle)
    return (
        c * px + s * (hy * pz - hz * py),
        c * py + s * (hz * px - hx * pz),
        c * pz + s * (hx * py - hy * px),
    )


@njit
def _blocked(solid, trees, row, x0, y0, z0, x1, y1, z1, voxel_m):  # type: ignore[no-untyped-def]
    """Whether an internode would enter the ground or an obstacle, asked every half voxel."""
    if z1 <= 0.0:
        return True
    if solid.mask.size == 1:
        return False
    length = np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2 + (z1 - z0) ** 2)
    steps = max(np.int64(np.ceil(2.0 * length / voxel_m)), 1)
    for k in range(1, steps + 1):
        part = k / steps
        place = (x0 + part * (x1 - x0), y0 + part * (y1 - y0), z0 + part * (z1 - z0))
        if inside(solid, trees, row, place, voxel_m):
            return True
    return False


@njit
def _draws(trees, row, n, seed):  # type: ignore[no-untyped-def]
    """Draw three numbers for each of the next n metamers of a tree.

    All at once: the loop uses the processor's wide registers, ten times as fast as one by one.
    """
    draws = np.empty((3, n))
    tree_id = trees.tree_id[row]
    serial = trees.next_serial[row]
    shoot, phyllotaxis, never = np.int64(STREAM_SHOOT), np.int64(STREAM_PHYLLOTAXIS), np.int64(0)
    for k in range(n):
        a, b, _, _ = random.uniforms(seed, shoot, tree_id, serial + k, never)
        draws[0, k] = a
        draws[1, k] = b
    for k in range(n):
        u, _, _, _ = random.uniforms(seed, phyllotaxis, tree_id, serial + k, never)
        draws[2, k] = u
    return draws


@njit
def _add(arena, trees, row, at, p, main, hx, hy, hz, length, order, t, year, height, draw):  # type: ignore[no-untyped-def]
    """Write the metamer `at` of a tree: geometry, lateral bud by phyllotaxis, first state.

    `draw` are the metamer's three random numbers: for the two angles, and for an axis' first turn.
    """
    s = trees.start[row]
    sp = trees.species[row]
    i = s + at
    for k in range(3):
        below = np.float64(arena.tip[s + p, k]) if p >= 0 else 0.0
        arena.tip[i, k] = below + length * (hx if k == 0 else (hy if k == 1 else hz))
    serial = trees.next_serial[row]
    trees.next_serial[row] = serial + 1
    if main and p >= 0:
        px, py, pz = perpendicular(
            hx, hy, hz, arena.bud[s + p, 0], arena.bud[s + p, 1], arena.bud[s + p, 2]
        )
        turn = t.of[sp].divergence_angle + (2.0 * draw[0] - 1.0) * t.of[sp].angle_jitter
    else:
        px, py, pz = perpendicular(hx, hy, hz, 1.0, 0.0, 0.0)
        turn = 2.0 * np.pi * draw[2]
    px, py, pz = turned(hx, hy, hz, px, py, pz, turn)
    angle = t.of[sp].branching_angle + (2.0 * draw[1] - 1.0) * t.of[sp].angle_jitter
    c = np.cos(angle)
    d = np.sin(angle)
    arena.bud[i, 0] = c * hx + d * px
    arena.bud[i, 1] = c * hy + d * py
    arena.bud[i, 2] = c * hz + d * pz
    arena.parent[i] = p
    arena.serial[i] = serial
    arena.length[i] = length
    arena.pipe[i] = 0.0
    arena.sapwood[i] = 0.0
    # not exposed yet: until next year it is measured by the light of the bud it came from
    arena.light[i] = arena.light[s + p] if p >= 0 else np.float32(0.0)
    arena.resource[i, 0] = 0.0
    arena.resource[i, 1] = 0.0
    arena.birth[i] = year.step
    arena.order[i] = min(order, 255)
    arena.state[i] = (MAIN if main else 0) | LATERAL
    arena.deficit[i] = 0
    arena.shoot_height[i] = height


@njit
def _steered(t, sp, eta, hx, hy, hz, vx, vy, vz):  # type: ignore[no-untyped-def]
    """Default direction + xi V + eta tropism, normalized (4.3)."""
    xi = t.of[sp].light_weight
    x = hx + xi * vx + eta * t.of[sp].tropism_x
    y = hy + xi * vy + eta * t.of[sp].tropism_y
    z = hz + xi * vz + eta * t.of[sp].tropism_z
    norm = np.sqrt(x * x + y * y + z * z)
    if norm < 1e-9:
        return hx, hy, hz
    return x / norm, y / norm, z / norm


@njit
def _bear(arena, s, p, bud):  # type: ignore[no-untyped-def]
    """Note on the parent that its bud has become a shoot."""
    if bud == TERMINAL_BUD:
        arena.state[s + p] = (arena.state[s + p] & (255 - TERMINAL)) | CONTINUED
    else:
        arena.state[s + p] = (arena.state[s + p] & (255 - LATERAL)) | BRANCHED


@njit
def _extend_tree(arena, trees, row, shoots, toward, t, year, solid, voxel_m):  # type: ignore[no-untyped-def]
    """Grow all shoots of one tree at the end of its extent; new parents precede new children."""
    s = trees.start[row]
    sp = trees.species[row]
    size = np.int64(trees.size[row])
    end = size
    draws = _draws(trees, row, shoots.new[row], year.seed)
    age = np.float64(year.step - trees.birth[row])
    by_age = t.of[sp].tropism_weight * curve(
        t.curve_n, t.curve_x, t.curve_y, sp, TROPISM_BY_AGE, age
    )
    most = np.int64(t.of[sp].max_metamers)
    tropism = np.empty(MAX_ORDERS)
    internode = np.empty(MAX_ORDERS)
    control = np.empty(MAX_ORDERS)
    for o in range(MAX_ORDERS):
        x = np.float64(o)
        tropism[o] = by_age * curve(t.curve_n, t.curve_x, t.curve_y, sp, TROPISM_BY_ORDER, x)
        internode[o] = t.of[sp].internode_length * curve(
            t.curve_n, t.curve_x, t.curve_y, sp, LENGTH_BY_ORDER, x
        )
        control[o] = t.of[sp].apical_bias if age < t.apical_until[sp, o] else 0.5
    # a sylleptic shoot branches as it grows: (parent, bud, resource) still to be grown
    wait_p = np.empty(_STACK, np.int64)
    wait_bud = np.empty(_STACK, np.int64)
    wait_v = np.empty(_STACK)
    for j in range(shoots.first[row], shoots.first[row + 1]):
        p = np.int64(shoots.metamer[j])
        bud = np.int64(shoots.bud[j])
        v = np.float64(arena.resource[s + p, bud])
        n = _made(v, most)
        vx, vy, vz = (
            np.float64(toward[j, 0]),
            np.float64(toward[j, 1]),
            np.float64(toward[j, 2]),
        )
        wait_p[0], wait_bud[0], wait_v[0] = p, bud, n + (v - np.floor(v))
        waiting = 1
        while waiting > 0:
            waiting -= 1
            p, bud, left = wait_p[waiting], wait_bud[waiting], wait_v[waiting]
            order = np.int64(arena.order[s + p]) + (1 if bud == LATERAL_BUD else 0)
            told = min(order, MAX_ORDERS - 1)
            bias, eta, unit = control[told], tropism[told], internode[told]
            if year.paper and t.of[sp].sylleptic == 0.0:
                # l = v / n (4.2); only a shoot cut off at its maximum could get longer internodes
                unit *= min(v / n, 2.0)
            if not year.paper:
                unit *= extension(np.float64(arena.tip[s + p, 2]), t.of[sp].turgor_limit)
            hx, hy, hz = bud_heading(arena, s, p, bud)
            arena.resource[s + p, bud] = 0.0
            made = 0
            while left >= 1.0:
                hx, hy, hz = _steered(t, sp, eta, hx, hy, hz, vx, vy, vz)
                x0 = np.float64(arena.tip[s + p, 0])
                y0 = np.float64(arena.tip[s + p, 1])
                z0 = np.float64(arena.tip[s + p, 2])
                x1, y1, z1 = x0 + unit * hx, y0 + unit * hy, z0 + unit * hz
                if _blocked(solid, trees, row, x0, y0, z0, x1, y1, z1, voxel_m):
                    break
                made += 1
                height = np.uint8(255 * made // n) if made < n else np.uint8(255)
                main = bud == TERMINAL_BUD or made > 1
                _bear(arena, s, p, TERMINAL_BUD if main else LATERAL_BUD)
                k = end - size
                draw = (draws[0, k], draws[1, k], draws[2, k])
                _add(
                    arena, trees, row, end, p, main, hx, hy, hz, unit, order, t, year, height, draw
                )
                p = np.int64(end)
                end += 1
                left -= 1.0
                if t.of[sp].sylleptic > 0.0:
                    # all buds are equivalent: what is left goes on to both buds of the node
                    side = (1.0 - bias) * left
                    left = bias * left
                    if order >= t.of[sp].max_order:
                        continue
                    if side >= 1.0 and waiting < _STACK:
                        wait_p[waiting], wait_bud[waiting], wait_v[waiting] = p, LATERAL_BUD, side
                        waiting += 1
                    elif not year.paper:
                        arena.resource[s + p, LATERAL_BUD] = _fraction(side)
            if made > 0 and t.of[sp].sympodial == 0.0:
                arena.state[s + p] |= np.uint8(TERMINAL)
            if not year.paper:  # what makes no whole metamer stays with the bud that ends the shoot
                apex = LATERAL_BUD if t.of[sp].sympodial > 0.0 else TERMINAL_BUD
                arena.resource[s + p, apex if made > 0 else bud] = _fraction(left)
    trees.size[row] = end


@driver
def _extend_chunks(first, step, arena, trees, shared, shoots, toward, traits, year, solid, voxel_m):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            _extend_tree(arena, trees, shared.rows[k], shoots, toward, traits, year, solid, voxel_m)


def extend(
    arena: Metamers,
    trees: Trees,
    shared: Deal,
    shoots: Shoots,
    toward: NDArray[np.float32],
    traits: SpeciesTraits,
    year: Year,
    solid: Solid,
    voxel_m: float,
) -> None:
    """Grow the shoots of all trees. Every extent must have room for `shoots.new` more metamers.

    Parameters
    ----------
    toward : float32 (shoots, 3)
        Optimal direction V of each shooting bud; zero where the environment has none.
    voxel_m : float
        Edge of the voxels of `solid`, m.
    """
    in_threads(_extend_chunks, arena, trees, shared, shoots, toward, traits, year, solid, voxel_m)


@njit
def first_internode(traits, species):  # type: ignore[no-untyped-def]
    """Length of the internodes of a new tree's stem, m; unvaried."""
    return traits.of[species].internode_length * curve(
        traits.curve_n, traits.curve_x, traits.curve_y, species, LENGTH_BY_ORDER, 0.0
    )


@njit
def sprout(  # type: ignore[no-untyped-def]
    arena: Metamers, trees: Trees, first_row, heading, metamers, traits: SpeciesTraits, year: Year
):
    """Give each tree from `first_row` on its first metamers: a straight stem with buds.

    Parameters
    ----------
    heading : float64 (new trees, 3)
        Direction of each new tree's stem, a unit vector.
    metamers : int64 (new trees,)
        Number of metamers of each stem, one at least.
    """
    for row in range(first_row, len(trees.tree_id)):
        sp = trees.species[row]
        s = trees.start[row]
        unit = first_internode(traits, sp)
        n = metamers[row - first_row]
        # typed as where shoots go on, so that numba compiles no second _add
        order, main, last = np.int64(0), np.bool_(True), np.uint8(255)
        draws = _draws(trees, row, n, year.seed)
        h = heading[row - first_row]
        x, y, z = h[0], h[1], h[2]
        pipe = traits.of[sp].twig_diameter ** traits.of[sp].pipe_exponent
        for k in range(n):
            draw = (draws[0, k], draws[1, k], draws[2, k])
            _add(arena, trees, row, k, k - 1, main, x, y, z, unit, order, traits, year, last, draw)
            above = TERMINAL if k == n - 1 else CONTINUED
            arena.state[s + k] = above | LATERAL | (MAIN if k > 0 else 0)
            arena.pipe[s + k] = (n - k) * pipe
        trees.size[row] = n
