"""The allocation of Hart & Baker 2003, section 4.1, eqs 13-22: growth that keeps a tree in balance.

Each limb has a growth rate: something at least, more on the side from which the tree's centre of
mass has strayed, more where its leaves are lit. What the trunk can support and does not yet carry
is new mass. It is handed up from limb to limb by the growth rates; each limb first takes what
makes it thick enough for its share.

A lateral bud is a limb of length 0 whose heading is the bud's. It gets its share as any limb does.
"""

from __future__ import annotations

import numpy as np

from forest._jit import njit
from forest.growth.limbs import (
    Wood,
    base_radius,
    can_grow,
    cone_volume,
    find_limbs,
    needs_to_support,
    own_light,
    pass_down,
    supports,
    weigh_limbs,
)
from forest.trees.metamers import MAIN


@njit
def wood_of(t, sp, paper):  # type: ignore[no-untyped-def]
    """The wood of a species, as `forest.growth.limbs` reads it."""
    return Wood(
        t.of[sp].density,
        t.of[sp].support,
        t.of[sp].pipe_exponent,
        0.5 * t.of[sp].twig_diameter,
        paper,
    )


@njit
def growth_rate(gains, heading, centre, ell, light):  # type: ignore[no-untyped-def]
    """g = least + gain (1 + o) + gain of light p; the offset o is eq. 13 as read.

    Growth goes to the light side of the tree: o = -(heading . X_0) / ell, clamped to [-1, 1].

    Parameters
    ----------
    gains : (min_growth, offset_gain, light_gain)
    heading, centre : (x, y)
        Horizontal parts of the limb's direction and of the centre of mass, relative to the base.
    ell : float
        Length that scales the offset, m.
    light : float
        Lit leaf area p of the limb, m2.
    """
    offset = -(heading[0] * centre[0] + heading[1] * centre[1]) / ell
    offset = min(max(offset, -1.0), 1.0)
    return gains[0] + gains[1] * (1.0 + offset) + gains[2] * light


@njit
def growth_rates(tree, centre, gains, ell, area, limbs):  # type: ignore[no-untyped-def]
    """Fill the growth rates g of limbs and lateral buds, and G (eqs 13, 15).

    `limbs.bud` marks the lateral buds that may start a limb by 1; it is filled with their rates.
    `limbs.light` holds p.
    """
    for i in range(len(tree.parent)):
        h = np.int64(limbs.head[i])
        if h == i:
            p = np.int64(tree.parent[i])
            last = np.int64(limbs.last[i])
            x = np.float64(tree.tip[last, 0])
            y = np.float64(tree.tip[last, 1])
            z = np.float64(tree.tip[last, 2])
            if i > 0:
                x -= np.float64(tree.tip[p, 0])
                y -= np.float64(tree.tip[p, 1])
                z -= np.float64(tree.tip[p, 2])
            reach = max(np.sqrt(x * x + y * y + z * z), 1e-9)
            heading = (x / reach, y / reach)
            limbs.rate[i] = growth_rate(gains, heading, centre, ell, limbs.light[i])
            limbs.total[i] = limbs.rate[i] if can_grow(tree, limbs, i) else 0.0
        if limbs.bud[i] > 0.0:
            heading = (np.float64(tree.bud[i, 0]), np.float64(tree.bud[i, 1]))
            own = area * np.float64(tree.light[i])
            limbs.bud[i] = growth_rate(gains, heading, centre, ell, own)
            limbs.total[h] += limbs.bud[i]
    pass_down(tree, limbs, limbs.total)


@njit
def trunk_growth(tree, limbs, wood, gain):  # type: ignore[no-untyped-def]
    """Mass that the trunk makes room for by growing thicker, e_0, kg (eqs 16, 17).

    R_0' = R_0 + alpha P_0 / M_0; e_0 = supports(R_0') - M_0, and at least what the thickening
    itself weighs, so that an overloaded trunk can recover.

    Parameters
    ----------
    gain : float
        alpha, m kg/m2. `limbs.light[0]` holds P_0.
    """
    old = base_radius(tree.pipe[0], wood)
    new = old + gain * limbs.light[0] / limbs.supported[0]
    length = limbs.length[0]
    thickening = cone_volume(length, new, wood.twig) - cone_volume(length, old, wood.twig)
    return max(supports(new, wood) - limbs.supported[0], wood.density * thickening)


@njit
def thickened(mass, load, length, radius, wood):  # type: ignore[no-untyped-def]
    """Base radius of a limb that is to support `load` more (eq. 18), never more than `mass` pays.

    R' = max(R, needs_to_support(M + e)). While a limb supports what it carries and is shorter
    than half the height limit, e pays for it.
    """
    twig = wood.twig
    paid = radius * radius + radius * twig + 3.0 * mass / (np.pi * wood.density * length)
    most = 0.5 * (np.sqrt(twig * twig + 4.0 * paid) - twig)
    return max(radius, min(needs_to_support(load + mass, wood), most))


@njit
def hand_up(tree, e_0, units, most, wood, limbs, v_main, v_side):  # type: ignore[no-untyped-def]
    """Hand the new mass from limb to limb, as wood alone (eqs 18-22); one forward scan.

    The mass of a limb's extension becomes length by eq. 21, for a cone that ends in a twig. A
    lateral bud shoots if its share pays for a whole metamer; else it gets nothing.

    Parameters
    ----------
    e_0 : float
        New mass at the base, kg.
    units : float64 (orders, 2)
        Column 1: length of an internode by order, m.
    most : float
        Metamers that a shoot can have at most.
    v_main, v_side : float64 (n,)
        Filled: metamers for the terminal and the lateral buds. `tree.pipe` of each limb's first
        metamer is set to its new base radius.

    Returns
    -------
    float
        Mass that no limb could take, kg.
    """
    left = 0.0
    top = len(units) - 1
    twig = wood.twig
    for i in range(len(tree.parent)):
        v_main[i] = 0.0
        v_side[i] = 0.0
    for i in range(len(tree.parent)):
        h = np.int64(limbs.head[i])
        order = np.int64(tree.order[i])
        if h == i:
            radius = base_radius(tree.pipe[i], wood)
            length = limbs.length[i]
            if i == 0:
                e = e_0
            else:
                below = np.int64(limbs.head[tree.parent[i]])
                share = limbs.total[i] / limbs.total[below] if limbs.total[i] > 0.0 else 0.0
                e = share * limbs.extra[below]
            new = thickened(e, limbs.supported[i], length, radius, wood)
            if new > radius:
                tree.pipe[i] = np.float32((2.0 * new) ** wood.exponent)
                grown = cone_volume(length, new, twig) - cone_volume(length, radius, twig)
                e = max(e - wood.density * grown, 0.0)
            limbs.extra[i] = e
            if limbs.rate[i] > 0.0 and can_grow(tree, limbs, i):
                last = np.int64(limbs.last[i])
                own = limbs.rate[i] / limbs.total[i] * e
                metamer = wood.density * cone_volume(units[min(order, top), 1], new, twig)
                room = max(most - np.float64(tree.resource[last, 0]), 0.0)
                v_main[last] = min(own / metamer, room)
                left += own - v_main[last] * metamer
            elif limbs.total[i] == 0.0:
                left += e
        if limbs.bud[i] > 0.0:
            share = limbs.bud[i] / limbs.total[h] * limbs.extra[h]
            metamer = wood.density * cone_volume(units[min(order + 1, top), 1], twig, twig)
            v = min(share / metamer, most)
            v_side[i] = v if v >= 1.0 else 0.0
            left += share - v_side[i] * metamer
    return left


@njit
def hand_up_priced(tree, e_0, price, prices, wood, limbs, v_main, v_side):  # type: ignore[no-untyped-def]
    """Hand the new mass from limb to limb where metamers have a price (eqs 17, 20, 22).

    Rings thicken limbs here, out of another part of the budget; a limb gets what it can support
    as it stands, and what is left over stays with the budget.

    Parameters
    ----------
    price : float64 (orders, 2)
        Cost (kg) and length (m) of one metamer by order.
    prices : (pipe_path, pipe_cost, branch_pipe)
        Length that each metamer's pipe to the ground counts as, m; cost of a new metamer's first
        pipe, kg/m; kappa.
    """
    pipe_path, pipe_cost, branch_pipe = prices
    top = len(price) - 1
    for i in range(len(tree.parent)):
        v_main[i] = 0.0
        v_side[i] = 0.0
    for i in range(len(tree.parent)):
        h = np.int64(limbs.head[i])
        order = np.int64(tree.order[i])
        if h == i:
            e = e_0
            if i > 0:
                below = np.int64(limbs.head[tree.parent[i]])
                share = limbs.total[i] / limbs.total[below] if limbs.total[i] > 0.0 else 0.0
                e = share * limbs.extra[below]
            spare = supports(base_radius(tree.pipe[i], wood), wood) - limbs.supported[i]
            e = min(e, max(spare, 0.0))
            limbs.extra[i] = e
            if limbs.rate[i] > 0.0 and can_grow(tree, limbs, i):
                last = np.int64(limbs.last[i])
                o = min(order, top)
                step = price[o, 1] * (branch_pipe if order > 0 else 1.0)
                cost = price[o, 0] + pipe_cost * (pipe_path[last] + step)
                v_main[last] = limbs.rate[i] / limbs.total[i] * e / cost
        if limbs.bud[i] > 0.0:
            o = min(order + 1, top)
            cost = price[o, 0] + pipe_cost * (pipe_path[i] + price[o, 1] * branch_pipe)
            v_side[i] = limbs.bud[i] / limbs.total[h] * limbs.extra[h] / cost


@njit
def survey(tree, units, wood, gains, shape, limbs):  # type: ignore[no-untyped-def]
    """Know a tree's limbs: masses, centre, light and growth rates (steps 1 to 4 of 4.1).

    Parameters
    ----------
    gains : (min_growth, offset_gain, light_gain)
    shape : (offset_length, area)
        The clamp length ell in radii of the trunk's base; leaf area of a site per light, m2.
    limbs : Limbs
        `bud` marks the lateral buds that may start a limb; all else is filled.
    """
    find_limbs(tree, limbs)
    centre = weigh_limbs(tree, units, wood, limbs)
    own_light(tree, shape[1], limbs)
    ell = max(shape[0] * base_radius(tree.pipe[0], wood), 1e-6)
    growth_rates(tree, centre, gains, ell, shape[1], limbs)
    pass_down(tree, limbs, limbs.light)


@njit
def know_limbs(tree, t, sp, year, units, limbs):  # type: ignore[no-untyped-def]
    """Survey a tree by the parameters of its species."""
    gains = (t.of[sp].min_growth, t.of[sp].offset_gain, t.of[sp].light_gain)
    shape = (t.of[sp].offset_length, t.of[sp].leaf_area / year.full_light)
    survey(tree, units, wood_of(t, sp, year.paper), gains, shape, limbs)


@njit
def lay_cones(parent, state, length, pipe, wood, reach, head):  # type: ignore[no-untyped-def]
    """Give every axis the diameters of a cone from its base to a twig; nothing gets thinner.

    Parameters
    ----------
    reach : float64 (n,)
        Scratch: length of the axis above each metamer's lower end, m.
    head : float64 (n,)
        Scratch: first metamer of the axis.
    """
    n = len(parent)
    twig = np.float64(2.0 * wood.twig) ** wood.exponent
    for i in range(n):
        reach[i] = 0.0
        head[i] = i
        if i > 0 and state[i] & MAIN:
            head[i] = head[parent[i]]
        reach[np.int64(head[i])] += np.float64(length[i])
        pipe[i] = max(pipe[i], np.float32(twig))
    for i in range(n):
        h = np.int64(head[i])
        if h == i:
            continue
        p = np.int64(parent[i])
        reach[i] = reach[p] - np.float64(length[p])
        whole = base_radius(pipe[h], wood)
        radius = wood.twig + (whole - wood.twig) * max(reach[i], 0.0) / reach[h]
        pipe[i] = max(pipe[i], np.float32((2.0 * radius) ** wood.exponent))
