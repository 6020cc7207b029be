"""Limbs and what they carry: Hart & Baker 2003, sections 3.4 and 4.1, eqs 6-14.

Their limb is an axis: in paper mode a truncated cone from the base of the axis to its tip, which is
as thick as a twig; in mass-balance mode, where rings shape it, the sum of its internodes. The trunk
is limb 0. A living lateral bud is a limb of length 0. What a bud has been promised, the fraction of
an internode that it holds, counts as grown: it is carried.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.growth.bud_fate import lit_buds
from forest.trees.metamers import LATERAL, MAIN, NO_ROOM_TERMINAL, TERMINAL


class Wood(NamedTuple):
    """What a limb is made of.

    Attributes
    ----------
    density : float
        Density d, kg/m3.
    support : float
        k of supports(R, d) = k d R^2, m.
    exponent : float
        n of pipe = diameter^n.
    twig : float
        Radius r of a limb's tip, m.
    cones : bool
        Whether a limb is weighed as a cone; else as the sum of its internodes.
    """

    density: float
    support: float
    exponent: float
    twig: float
    cones: bool


class Limbs(NamedTuple):
    """Scratch of one tree: numbers of its limbs, each at the first metamer of its axis.

    Attributes
    ----------
    head : int32 (n,)
        First metamer of each metamer's axis.
    last : int32 (n,)
        Last metamer of the axis.
    length : float64 (n,)
        Length l, what its bud has been promised included, m.
    supported : float64 (n,)
        Mass M of the limb and of all that it supports, kg.
    light : float64 (n,)
        Lit leaf area P of the limb and of all that it supports, m2; first its own, p.
    rate : float64 (n,)
        Growth rate g.
    total : float64 (n,)
        Growth rate G of the limb and of all that it supports, of what can grow.
    extra : float64 (n,)
        Mass of new growth e, then e', kg.
    bud : float64 (n,)
        At each metamer: growth rate of its lateral bud; 0 where none can start a limb.
    """

    head: NDArray[np.int32]
    last: NDArray[np.int32]
    length: NDArray[np.float64]
    supported: NDArray[np.float64]
    light: NDArray[np.float64]
    rate: NDArray[np.float64]
    total: NDArray[np.float64]
    extra: NDArray[np.float64]
    bud: NDArray[np.float64]


class Tree(NamedTuple):
    """One tree's part of the arena's fields that the limbs are read from."""

    parent: NDArray[np.int32]
    state: NDArray[np.uint8]
    order: NDArray[np.uint8]
    tip: NDArray[np.float32]
    bud: NDArray[np.float32]
    length: NDArray[np.float32]
    pipe: NDArray[np.float32]
    light: NDArray[np.float32]
    resource: NDArray[np.float32]


@njit
def cone_volume(length, base, tip):  # type: ignore[no-untyped-def]
    """Volume of a truncated cone (eq. 9, R - r cancelled): pi l (R^2 + R r + r^2) / 3."""
    return np.pi * length * (base * base + base * tip + tip * tip) / 3.0


@njit
def cone_centre(base, tip):  # type: ignore[no-untyped-def]
    """Place of a truncated cone's centre of mass (eq. 11, cancelled): 0 base, 1 tip."""
    square = base * base + base * tip + tip * tip
    return (base * base + 2.0 * base * tip + 3.0 * tip * tip) / (4.0 * square)


@njit
def supports(radius, wood):  # type: ignore[no-untyped-def]
    """Mass that a limb of this base radius can support, kg (eq. 6)."""
    return wood.support * wood.density * radius * radius


@njit
def needs_to_support(mass, wood):  # type: ignore[no-untyped-def]
    """Least base radius that supports a mass, m (eq. 7)."""
    return np.sqrt(mass / (wood.support * wood.density))


@njit
def base_radius(pipe, wood):  # type: ignore[no-untyped-def]
    """Radius of a metamer, m."""
    return 0.5 * np.float64(pipe) ** (1.0 / wood.exponent)


@njit
def find_limbs(tree, limbs):  # type: ignore[no-untyped-def]
    """Fill `head`, `last` and the grown part of `length`; one forward scan."""
    for i in range(len(tree.parent)):
        h = i
        if i > 0 and tree.state[i] & MAIN:
            h = np.int64(limbs.head[tree.parent[i]])
        else:
            limbs.length[i] = 0.0
        limbs.head[i] = h
        limbs.last[h] = i
        limbs.length[h] += np.float64(tree.length[i])


@njit
def weigh_limbs(tree, units, wood, limbs):  # type: ignore[no-untyped-def]
    """Sum masses and find the centre of mass of the tree (eqs 9-12).

    Parameters
    ----------
    units : float64 (orders, 2)
        Column 1: length of an internode by order, m.

    Returns
    -------
    x, y : float
        The horizontal place of the centre X_0, relative to the tree's base, m.
    """
    n = len(tree.parent)
    top = len(units) - 1
    moment_x = 0.0
    moment_y = 0.0
    for i in range(n):
        limbs.supported[i] = 0.0
    for i in range(n - 1, -1, -1):
        h = np.int64(limbs.head[i])
        order = np.int64(tree.order[i])
        if tree.state[i] & LATERAL:
            promised = np.float64(tree.resource[i, 1]) * units[min(order + 1, top), 1]
            m = wood.density * cone_volume(promised, wood.twig, wood.twig)
            limbs.supported[h] += m
            moment_x += m * np.float64(tree.tip[i, 0])
            moment_y += m * np.float64(tree.tip[i, 1])
        p = np.int64(tree.parent[i])
        x0 = np.float64(tree.tip[p, 0]) if i > 0 else 0.0
        y0 = np.float64(tree.tip[p, 1]) if i > 0 else 0.0
        end = i
        part = 0.5
        radius = base_radius(tree.pipe[i], wood)
        m = wood.density * cone_volume(np.float64(tree.length[i]), radius, radius)
        if tree.state[i] & TERMINAL:
            promised = np.float64(tree.resource[i, 0]) * units[min(order, top), 1]
            limbs.length[h] += promised
            m += wood.density * cone_volume(promised, wood.twig, wood.twig)
        if wood.cones:
            if h != i:
                continue
            m = wood.density * cone_volume(limbs.length[i], radius, wood.twig)
            part = cone_centre(radius, wood.twig)
            end = np.int64(limbs.last[i])
        moment_x += m * (x0 + part * (np.float64(tree.tip[end, 0]) - x0))
        moment_y += m * (y0 + part * (np.float64(tree.tip[end, 1]) - y0))
        limbs.supported[h] += m
        if h == i and i > 0:
            limbs.supported[limbs.head[p]] += limbs.supported[i]
    return moment_x / limbs.supported[0], moment_y / limbs.supported[0]


@njit
def can_grow(tree, limbs, head):  # type: ignore[no-untyped-def]
    """Whether a limb has a terminal bud, and the bud room."""
    state = tree.state[limbs.last[head]]
    return state & TERMINAL and not state & NO_ROOM_TERMINAL


@njit
def own_light(tree, area, limbs):  # type: ignore[no-untyped-def]
    """Fill `light` with each limb's own lit leaf area p.

    `area` is the leaf area of a site per light, m2.
    """
    for i in range(len(tree.parent)):
        limbs.light[i] = 0.0
    for i in range(len(tree.parent)):
        limbs.light[limbs.head[i]] += area * lit_buds(tree.state[i]) * np.float64(tree.light[i])


@njit
def pass_down(tree, limbs, values):  # type: ignore[no-untyped-def]
    """Add what limbs support to each limb's own value (eqs 14, 15); one backward scan."""
    for i in range(len(tree.parent) - 1, 0, -1):
        if limbs.head[i] == i:
            values[limbs.head[tree.parent[i]]] += values[i]
