"""Allocate: each bud learns how many metamers it may make and how long they are.

One driver runs over the trees; what happens to one tree reads from top to bottom in
`_allocate_balanced` (mass balance) and `_allocate_paper` (no costs).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest import random
from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.balance import hand_up, hand_up_priced, know_limbs, trunk_growth, wood_of
from forest.growth.bud_fate import gather_light, share_borchert_honda, share_priority
from forest.growth.budget import (
    INCOME,
    LEAVES,
    RESERVE_CHANGE,
    SPEND,
    UPKEEP,
    affordable_scale,
    extension,
    light_response,
    path_lengths,
    site_income,
)
from forest.growth.curves import curve
from forest.growth.dealing import BINS, FLOATS, INTEGERS, Deal, Scratch
from forest.growth.limbs import Limbs, Tree
from forest.growth.parameters import (
    LENGTH_BY_ORDER,
    MAX_ORDERS,
    SHOOTS_BY_HEIGHT,
    SHOOTS_BY_ORDER,
    SHOOTS_BY_PARENT_LENGTH,
    SpeciesTraits,
    Year,
)
from forest.random import STREAM_ABORT, STREAM_FATE
from forest.trees.metamers import LATERAL, NO_ROOM_LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees


@njit
def income_rate(traits, sp, vigour, year):  # type: ignore[no-untyped-def]
    """Income of one site of a species in full light at the ground, kg a year."""
    per_site = traits.of[sp].light_use * traits.of[sp].leaf_area
    return per_site * vigour * year.income_factor[sp] / year.full_light


@njit
def unit_costs(traits, sp):  # type: ignore[no-untyped-def]
    """Cost (kg), length (m) and primary wood (kg) of one new metamer at the ground, by order.

    The cost is that of its primary wood and first leaves.
    """
    units = np.empty((MAX_ORDERS, 3))
    wood = traits.of[sp].density * 0.25 * np.pi * traits.of[sp].twig_diameter ** 2
    for o in range(MAX_ORDERS):
        factor = curve(
            traits.curve_n, traits.curve_x, traits.curve_y, sp, LENGTH_BY_ORDER, np.float64(o)
        )
        units[o, 1] = traits.of[sp].internode_length * factor
        units[o, 0] = wood * units[o, 1] + traits.of[sp].leaf_mass
        units[o, 2] = wood * units[o, 1]
    return units


@njit
def _share(t, sp, age, tree, v_base, priority, work, ints):  # type: ignore[no-untyped-def]
    """Share v_base among the buds by the scenario's bud-fate model.

    `priority` is True or None: numba compiles no branch that hangs on a None.
    """
    parent, state, order = tree.parent, tree.state, tree.order
    q_main, q_side, v_main, v_side = work[0], work[1], work[2], work[3]
    control = np.empty(MAX_ORDERS)
    if priority is None:
        for o in range(MAX_ORDERS):
            control[o] = t.of[sp].apical_bias if age < t.apical_until[sp, o] else 0.5
        share_borchert_honda(
            parent,
            state,
            order,
            q_main,
            q_side,
            control,
            t.of[sp].max_order,
            v_base,
            v_main,
            v_side,
        )
    else:
        for o in range(MAX_ORDERS):
            control[o] = 1.0 if age < t.apical_until[sp, o] else 0.0
        share_priority(
            parent,
            state,
            order,
            q_main,
            q_side,
            control,
            (t.of[sp].w_max, t.of[sp].w_min, t.of[sp].kappa),
            t.of[sp].max_order,
            v_base,
            v_main,
            v_side,
            ints,
        )


@njit
def _shoots(t, sp, year, tree_id, serial, height, order, length):  # type: ignore[no-untyped-def]
    """Taylor-Hell 3.1: a bud shoots if f1(height in year) f2(order) f3(parent length) R > 1."""
    product = curve(t.curve_n, t.curve_x, t.curve_y, sp, SHOOTS_BY_HEIGHT, height / 255.0)
    product *= curve(t.curve_n, t.curve_x, t.curve_y, sp, SHOOTS_BY_ORDER, np.float64(order))
    product *= curve(
        t.curve_n, t.curve_x, t.curve_y, sp, SHOOTS_BY_PARENT_LENGTH, np.float64(length)
    )
    r, _, _, _ = random.uniforms(year.seed, np.int64(STREAM_FATE), tree_id, serial, year.step)
    return product * r > 1.0


@njit
def _has_shoot_curves(t, sp):  # type: ignore[no-untyped-def]
    return (
        t.curve_n[sp, SHOOTS_BY_HEIGHT]
        + t.curve_n[sp, SHOOTS_BY_ORDER]
        + t.curve_n[sp, SHOOTS_BY_PARENT_LENGTH]
        > 0
    )


@njit
def _hold_back(arena, s, e, t, sp, year, tree_id):  # type: ignore[no-untyped-def]
    """Let the user-drawn curves keep lateral buds from shooting this year."""
    for i in range(s, e):
        v = arena.resource[i, 1]
        if v < 1.0 or not arena.state[i] & LATERAL:
            continue
        order = np.int64(arena.order[i]) + 1
        if not _shoots(
            t, sp, year, tree_id, arena.serial[i], arena.shoot_height[i], order, arena.length[i]
        ):
            arena.resource[i, 1] = v - np.floor(v)


@njit
def tree_part(arena, s, e):  # type: ignore[no-untyped-def]
    """One tree's part of the fields that bud fate and balance read."""
    return Tree(
        arena.parent[s:e],
        arena.state[s:e],
        arena.order[s:e],
        arena.tip[s:e],
        arena.bud[s:e],
        arena.length[s:e],
        arena.pipe[s:e],
        arena.light[s:e],
        arena.resource[s:e],
    )


@njit
def _survey(arena, s, tree, t, sp, year, tree_id, units, work, ints):  # type: ignore[no-untyped-def]
    """Find the buds that may start a limb, and know the limbs with their growth rates."""
    limbs = Limbs(ints[0], ints[1], work[6], work[7], work[8], work[9], work[10], work[11], work[0])
    drawn = _has_shoot_curves(t, sp)
    for i in range(len(tree.parent)):
        state = tree.state[i]
        order = np.int64(tree.order[i])
        may = state & LATERAL and not state & NO_ROOM_LATERAL and order < t.of[sp].max_order
        if may and drawn:
            k = s + i
            may = _shoots(
                t,
                sp,
                year,
                tree_id,
                arena.serial[k],
                arena.shoot_height[k],
                order + 1,
                arena.length[k],
            )
        limbs.bud[i] = 1.0 if may else 0.0
    know_limbs(tree, t, sp, year, units, limbs)
    return limbs


@njit
def _allocate_paper(arena, trees, row, t, year, priority, balance, work, ints):  # type: ignore[no-untyped-def]
    """Without costs: Palubicki's v_base = alpha Q_base (4.2), or what the trunk can support."""
    s = trees.start[row]
    n = trees.size[row]
    e = s + n
    sp = trees.species[row]
    tree = tree_part(arena, s, e)
    tree_id = trees.tree_id[row]
    if balance is None:
        q_base = gather_light(tree.parent, tree.state, tree.light, work[0], work[1])
        age = np.float64(year.step - trees.birth[row])
        _share(t, sp, age, tree, t.of[sp].alpha * q_base, priority, work, ints)
        for i in range(n):
            arena.resource[s + i, 0] = work[2, i] if arena.state[s + i] & TERMINAL else 0.0
            arena.resource[s + i, 1] = work[3, i] if arena.state[s + i] & LATERAL else 0.0
        if _has_shoot_curves(t, sp):
            _hold_back(arena, s, e, t, sp, year, tree_id)
    else:
        units = unit_costs(t, sp)
        wood = wood_of(t, sp, year.paper)
        limbs = _survey(arena, s, tree, t, sp, year, tree_id, units, work, ints)
        e_0 = trunk_growth(tree, limbs, wood, t.of[sp].thickening)
        hand_up(tree, e_0, units, t.of[sp].max_metamers, wood, limbs, work[2], work[3])
        for i in range(n):
            arena.resource[s + i, 0] += np.float32(work[2, i])
            arena.resource[s + i, 1] = np.float32(work[3, i])


@njit
def _keep_sites(arena, s, n, t, sp, year, tree_id, rate, path, pipe_path):  # type: ignore[no-untyped-def]
    """Book the sites' income and costs; sites that do not pay for some years abort.

    Returns income, leaf cost and upkeep of the tree, kg.
    """
    income = 0.0
    leaves = 0.0
    upkeep = 0.0
    leaf = t.of[sp].leaf_mass / t.of[sp].leaf_lifespan
    to_volume = 0.25 * np.pi * t.of[sp].density
    minimal = to_volume * t.of[sp].first_pipe ** 2
    retention = t.of[sp].leaf_retention
    for k in range(n):
        i = s + k
        upkeep += np.float64(arena.sapwood[i]) * np.float64(arena.length[i])
        state = arena.state[i]
        sites = (1 if state & TERMINAL else 0) + (1 if state & LATERAL else 0)
        if sites == 0:
            continue
        light = np.float64(arena.light[i])
        light = light_response(light, year.full_light, t.of[sp].light_half)
        earned = site_income(light, path[k], rate, t.of[sp].hydraulic_length)
        income += sites * earned
        leaves += sites * leaf
        if earned < leaf + minimal * pipe_path[k]:
            arena.deficit[i] = np.uint8(min(255, np.int64(arena.deficit[i]) + 1))
            if arena.deficit[i] > t.of[sp].deficit_years:
                draw, other, _, _ = random.uniforms(
                    year.seed, np.int64(STREAM_ABORT), tree_id, arena.serial[i], year.step
                )
                if state & TERMINAL and draw < t.of[sp].abortion:
                    arena.state[i] &= np.uint8(255 - TERMINAL)
                if state & LATERAL and other < t.of[sp].abortion:
                    arena.state[i] &= np.uint8(255 - LATERAL)
        else:
            arena.deficit[i] = 0
        if retention > 0.0 and year.step - arena.birth[i] >= retention:
            arena.state[i] &= np.uint8(255 - LATERAL)
    return income, leaves, t.of[sp].maintenance * to_volume * upkeep


@njit
def _allocate_balanced(arena, trees, row, t, year, accounts, priority, balance, work, ints):  # type: ignore[no-untyped-def]
    """The annual mass balance of one tree: income, costs, spend, and what buds may make.

    The wind's stress beyond its limit cuts what buds may spend: loaded stems stay shorter.
    """
    s = trees.start[row]
    n = trees.size[row]
    e = s + n
    sp = trees.species[row]
    tree = tree_part(arena, s, e)
    path, pipe_path, stretch = work[4], work[5], work[6]
    path_lengths(tree.parent, tree.order, tree.length, t.of[sp].branch_pipe, path, pipe_path)
    rate = income_rate(t, sp, np.float64(trees.vigour[row]), year)
    income, leaves, upkeep = _keep_sites(
        arena, s, n, t, sp, year, trees.tree_id[row], rate, path, pipe_path
    )
    have = trees.reserve[row] + income - leaves - upkeep
    spend = (1.0 - t.of[sp].reserve_fraction) * max(have, 0.0)
    accounts[row, INCOME] = income
    accounts[row, LEAVES] = leaves
    accounts[row, UPKEEP] = upkeep
    accounts[row, SPEND] = spend
    accounts[row, RESERVE_CHANGE] = have - spend - trees.reserve[row]
    trees.reserve[row] = have - spend
    poor = income - leaves - upkeep < t.of[sp].suppression_ratio * income or income <= 0.0
    trees.bad_years[row] = trees.bad_years[row] + 1 if poor else 0

    price = unit_costs(t, sp)
    pipe_cost = 0.25 * np.pi * t.of[sp].density * t.of[sp].first_pipe ** 2
    budget = (1.0 - t.of[sp].ring_fraction) * spend / max(1.0, np.float64(trees.wind_stress[row]))
    if balance is None:
        q_base = gather_light(tree.parent, tree.state, tree.light, work[0], work[1])
        age = np.float64(year.step - trees.birth[row])
        v_base = t.of[sp].alpha * q_base / year.full_light
        _share(t, sp, age, tree, v_base, priority, work, ints)
    else:
        tree_id = trees.tree_id[row]
        limbs = _survey(arena, s, tree, t, sp, year, tree_id, price, work, ints)
        prices = (pipe_path, pipe_cost, t.of[sp].branch_pipe)
        hand_up_priced(
            tree, budget, price, prices, wood_of(t, sp, year.paper), limbs, work[2], work[3]
        )
    for i in range(n):
        if not arena.state[s + i] & TERMINAL:
            work[2, i] = 0.0
        if not arena.state[s + i] & LATERAL:
            work[3, i] = 0.0
    resource = tree.resource
    for i in range(n):
        stretch[i] = extension(np.float64(tree.tip[i, 2]), t.of[sp].turgor_limit)
    scale = affordable_scale(
        resource,
        work[2],
        work[3],
        pipe_path,
        stretch,
        tree.order,
        price,
        pipe_cost,
        t.of[sp].branch_pipe,
        int(t.of[sp].max_metamers),
        budget,
    )
    for i in range(n):
        resource[i, 0] += np.float32(scale * work[2, i])
        resource[i, 1] += np.float32(scale * work[3, i])
    if balance is None and _has_shoot_curves(t, sp):
        _hold_back(arena, s, e, t, sp, year, trees.tree_id[row])


@driver
def _allocate_chunks(
    first, step, arena, trees, shared, scratch, traits, year, accounts, paper, priority, balance
):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            n = np.int64(trees.size[row])
            f = shared.place[b] * FLOATS
            g = shared.place[b] * INTEGERS
            work = scratch.floats[f : f + FLOATS * n].reshape((FLOATS, n))
            ints = scratch.integers[g : g + INTEGERS * n].reshape((INTEGERS, n))
            if paper is None:
                _allocate_balanced(
                    arena, trees, row, traits, year, accounts, priority, balance, work, ints
                )
            else:
                _allocate_paper(arena, trees, row, traits, year, priority, balance, work, ints)


def allocate(
    arena: Metamers,
    trees: Trees,
    shared: Deal,
    scratch: Scratch,
    traits: SpeciesTraits,
    year: Year,
    accounts: NDArray[np.float64],
    paper: bool | None,
    priority: bool | None,
    balance: bool | None,
) -> None:
    """Allocate the year's resource in every tree.

    `paper` is True, or None for the mass balance; `priority` and `balance` are True for these
    models, None both for Borchert-Honda. What hangs on a None is not compiled.

    Sets `arena.resource` (v of each bud; in mass-balance mode with the carried fraction) and, in
    mass-balance mode, books income, leaves, upkeep and spend in `accounts` (trees, ACCOUNTS).
    """
    in_threads(
        _allocate_chunks,
        arena,
        trees,
        shared,
        scratch,
        traits,
        year,
        accounts,
        paper,
        priority,
        balance,
    )
