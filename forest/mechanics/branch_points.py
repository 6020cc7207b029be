"""Reaction wood at branch points (Hart & Baker 2003, sections 3.2, 3.3 and 5.1).

A limb is an axis: from its lateral bud to its tip; the trunk is one too. The weight it carries
turns it about its base. Wood of the strength of its base, put a way delta along it, holds against
that turn (eqs 23 to 25); it widens the limb from its base to delta on one side (eq. 31).

Which side is *thick* is an azimuth: turn the metamer upright by the shortest turn, and the
section's points have the azimuths of the world, rad from x to y. For an upright stem this is the
world's azimuth itself; on a limb that leans towards azimuth a, a is its lower side and a + pi its
upper side.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.dealing import FLOATS, INTEGERS, Workbench, deal
from forest.mechanics.stems import StemSpecies, wood_radius
from forest.trees.metamers import LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import Trees

#: A direction this close to vertical has no lean.
_UPRIGHT = 1e-6


@njit
def fall_off(t):  # type: ignore[no-untyped-def]
    """c of eq. 31: from 1 at the base smoothly to 0 at delta."""
    return (1.0 - t) * (1.0 - t) * (1.0 + 2.0 * t) if t < 1.0 else 0.0


@njit
def support_offset(mass, arm, supports, lean, length):  # type: ignore[no-untyped-def]
    """How far along a limb its reaction wood reaches (eq. 25), m.

    delta = W X sin(theta_X) / (F_R sin(theta_d)), in [0, length]; W = g M, F_R = g supports(R).

    Parameters
    ----------
    mass : float
        M: all that the limb carries and itself, kg.
    arm : float
        X sin(theta_X): how far its centre of mass lies from its base in the horizontal direction
        in which the limb leads, m; negative behind the base.
    supports : float
        Mass that the limb's base supports (eq. 6), kg.
    lean : float
        sin(theta_d), theta_d the angle between the limb and the vertical.
    length : float
        Of the limb, m.
    """
    if lean < _UPRIGHT:
        return 0.0
    return min(max(mass * arm / (supports * lean), 0.0), length)


@njit
def widening(radius, lean):  # type: ignore[no-untyped-def]
    """Delta r, m, for which supports(R + Delta r) - supports(R) = F_R / (g cos(theta_R)).

    theta_R is the angle between the vertical and the direction in which the limb is widened, at
    right angles to it: cos(theta_R) = sin(theta_d). Since F_R = g supports(R) and supports grows
    with R^2, Delta r = R (sqrt(1 + 1 / cos(theta_R)) - 1).
    """
    if lean < _UPRIGHT:
        return 0.0
    return radius * (np.sqrt(1.0 + 1.0 / lean) - 1.0)


@njit
def ring_eccentricity(radius, widened, lean):  # type: ignore[no-untyped-def]
    """The eccentricity of rings that add up to a widened section.

    Eq. 31 moves the surface out by w (1 + y . n) / 2, n the direction from the pith, |y| the lean's
    sine: y is the part of up (or down) at right angles to the limb. All rings of one
    eccentricity e reach to R' (1 + e cos): so R' = R + w / 2 and e = w |y| / (2 R + w), below 1.
    """
    return widened * lean / (2.0 * radius + widened)


@njit
def weigh_limbs(arena, trees, row, species, work, tips):  # type: ignore[no-untyped-def]
    """Mass, first moments and length of the axis from each metamer on; one backward scan.

    Fills rows 0 to 3 of `work` with the mass (kg) above the lower end of each metamer and its
    moments (kg m), row 4 with the rest of its axis (m), `tips` with the axis' last metamer.
    """
    s = trees.start[row]
    sp = trees.species[row]
    n = np.int64(trees.size[row])
    for i in range(n):
        state = arena.state[s + i]
        sites = (1 if state & TERMINAL else 0) + (1 if state & LATERAL else 0)
        leaves = sites * species.leaf_mass[sp]
        length = np.float64(arena.length[s + i])
        r = wood_radius(arena.pipe[s + i], species.pipe_exponent[sp])
        wood = np.pi * r * r * length * species.green_density[sp]
        x = np.float64(arena.tip[s + i, 0])
        y = np.float64(arena.tip[s + i, 1])
        z = np.float64(arena.tip[s + i, 2])
        below_x = below_y = below_z = 0.0
        if i > 0:
            p = s + arena.parent[s + i]
            below_x = np.float64(arena.tip[p, 0])
            below_y = np.float64(arena.tip[p, 1])
            below_z = np.float64(arena.tip[p, 2])
        work[0, i] = wood + leaves
        work[1, i] = wood * 0.5 * (below_x + x) + leaves * x
        work[2, i] = wood * 0.5 * (below_y + y) + leaves * y
        work[3, i] = wood * 0.5 * (below_z + z) + leaves * z
        work[4, i] = length
        tips[i] = i
    for i in range(n - 1, 0, -1):
        p = arena.parent[s + i]
        for c in range(4):
            work[c, p] += work[c, i]
        if arena.state[s + i] & MAIN:
            work[4, p] += work[4, i]
            tips[p] = tips[i]


@njit
def _brace(work, tip, i, p, end, radius, strength):  # type: ignore[no-untyped-def]
    """Give delta and Delta r of the limb from metamer `i` on parent `p` to metamer `end`.

    `strength` is the mass that the limb's base supports per square of its radius, kg/m2.

    A limb's direction is that from its base to its tip. The trunk's is the direction from its
    base to the tree's centre of mass: an upright trunk under a crown that leans needs wood too.
    """
    mass = work[0, i]
    x = y = z = 0.0
    if i > 0:
        x = np.float64(tip[p, 0])
        y = np.float64(tip[p, 1])
        z = np.float64(tip[p, 2])
    centre_x = work[1, i] / mass - x
    centre_y = work[2, i] / mass - y
    along_x = centre_x
    along_y = centre_y
    along_z = work[3, i] / mass - z
    if i > 0:
        along_x = np.float64(tip[end, 0]) - x
        along_y = np.float64(tip[end, 1]) - y
        along_z = np.float64(tip[end, 2]) - z
    flat = np.sqrt(along_x**2 + along_y**2)
    span = np.sqrt(flat**2 + along_z**2)
    lean = flat / span if span > 0.0 else 0.0
    arm = (centre_x * along_x + centre_y * along_y) / flat if flat > 0.0 else 0.0
    supports = strength * radius * radius
    return support_offset(mass, arm, supports, lean, work[4, i]), widening(radius, lean)


@njit
def _shape_rings(arena, trees, row, species, work, tips, rings):  # type: ignore[no-untyped-def]
    """Fill a tree's rows of `rings`; one forward scan after `weigh_limbs`."""
    s = trees.start[row]
    sp = trees.species[row]
    tip = arena.tip[s : s + np.int64(trees.size[row])]
    turned = 0.0 if species.compression_wood[sp] > 0.0 else np.pi
    strength = species.support[sp] * species.green_density[sp]
    reach, widened, along = work[5], work[6], work[7]
    mass = work[0, 0]
    centre_x = work[1, 0] / mass
    centre_y = work[2, 0] / mass
    centre_z = work[3, 0] / mass
    for i in range(np.int64(trees.size[row])):
        p = arena.parent[s + i]
        length = np.float64(arena.length[s + i])
        if i > 0 and (arena.state[s + i] & MAIN) != 0:
            reach[i] = reach[p]
            widened[i] = widened[p]
            along[i] = along[p] + length
        else:
            r = wood_radius(arena.pipe[s + i], species.pipe_exponent[sp])
            reach[i], widened[i] = _brace(work, tip, i, p, tips[i], r, strength)
            along[i] = length
        rings[s + i, 0] = 0.0
        rings[s + i, 1] = 0.0
        middle = along[i] - 0.5 * length
        if middle >= reach[i]:
            continue
        hx, hy, hz = centre_x, centre_y, centre_z
        if arena.order[s + i] > 0:
            hx = np.float64(tip[i, 0]) - np.float64(tip[p, 0])
            hy = np.float64(tip[i, 1]) - np.float64(tip[p, 1])
            hz = np.float64(tip[i, 2]) - np.float64(tip[p, 2])
        flat = np.sqrt(hx**2 + hy**2)
        span = np.sqrt(flat**2 + hz**2)
        lean = flat / span if span > 0.0 else 0.0
        r = wood_radius(arena.pipe[s + i], species.pipe_exponent[sp])
        azimuth = np.arctan2(hy, hx) + turned
        if azimuth > np.pi:
            azimuth -= 2.0 * np.pi
        wide = fall_off(middle / reach[i]) * widened[i]
        rings[s + i, 0] = ring_eccentricity(r, wide, lean)
        rings[s + i, 1] = azimuth


@driver
def shape_rings(first, step, arena, trees, shared, scratch, species, rings):  # type: ignore[no-untyped-def]
    """Fill `rings` for all metamers of all trees (see `reaction_rings`)."""
    for b in range(first, len(shared.place) - 1, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            n = np.int64(trees.size[row])
            if n == 0:
                continue
            f = shared.place[b] * FLOATS
            i = shared.place[b] * INTEGERS
            work = scratch.floats[f : f + FLOATS * n].reshape((FLOATS, n))
            tips = scratch.integers[i : i + n]
            weigh_limbs(arena, trees, row, species, work, tips)
            _shape_rings(arena, trees, row, species, work, tips, rings)


def reaction_rings(metamers: Metamers, trees: Trees, species: StemSpecies) -> NDArray[np.float32]:
    """Shape this year's rings by the reaction wood that limbs and leaning trunks need.

    Parameters
    ----------
    metamers, trees : Metamers, Trees
        Arena and tree table.
    species : StemSpecies
        One entry per species; conifers are thick below, broadleaves above.

    Returns
    -------
    float32 array (capacity of the arena, 2)
        By metamer: the eccentricity e in [0, 1), and the azimuth of the thick side, rad in
        (-pi, pi]. A ring of mean width w is w (1 + e cos(azimuth - thick side)) wide. Azimuths
        on a leaning metamer are those after the shortest turn that sets it upright: a
        leaning metamer's lower side has the azimuth towards which it leans. Where there is no
        reaction wood both are 0.

    Notes
    -----
    Hart & Baker 2003, eqs 23 to 25 and 31. The trunk's lean is that of the line from its base to
    the tree's centre of mass.
    """
    rings = np.zeros((len(metamers.parent), 2), np.float32)
    shared = deal(trees.size)
    scratch = Workbench().scratch(shared)
    in_threads(shape_rings, metamers, trees, shared, scratch, species, rings)
    return rings
