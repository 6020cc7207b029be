"""Thicken: pipes with memory (Palubicki et al. 2009, section 4.5), and the year's ring.

In paper mode every new leaf adds d0^n to each internode below it and nothing is ever taken away:
d^n = d1^n + d2^n with a memory of past leaves. In mass-balance mode pipes add by area (n = 2):
new metamers get their primary wood and first pipes, limbs too thin for their load are thickened,
and the rest of the year's spend is laid down as pipes from the sites that earned it. Under the
balance model in paper mode axes are cones (Hart & Baker 2003).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.allocate import income_rate, tree_part, unit_costs
from forest.growth.balance import know_limbs, lay_cones, wood_of
from forest.growth.budget import (
    EXTENSION,
    RESERVE_CHANGE,
    RING,
    SPEND,
    light_response,
    path_lengths,
    site_income,
)
from forest.growth.dealing import BINS, FLOATS, INTEGERS, Deal, Scratch
from forest.growth.limbs import Limbs
from forest.growth.parameters import SpeciesTraits, Year
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees

#: Means: growth knows no wind.
NO_NEED: NDArray[np.float32] = np.empty(0, np.float32)


@njit
def add_pipes(parent, birth, step, pipe, strand, flow):  # type: ignore[no-untyped-def]
    """Lead `strand` (d0^n) from each metamer of this step to the ground; one backward scan."""
    n = len(parent)
    for i in range(n):
        flow[i] = strand if birth[i] == step else 0.0
    for i in range(n - 1, -1, -1):
        pipe[i] = np.float32(np.float64(pipe[i]) + flow[i])
        if i > 0:
            flow[parent[i]] += flow[i]


@njit
def reinforce(parent, length, pipe, state, wood, fresh, least, budget, work):  # type: ignore[no-untyped-def]
    """Thicken first what is thinner than its load needs.

    Every metamer must support the mass that it carries: needs_to_support(M, d) = sqrt(M / (k d))
    (Hart & Baker 2003, eqs 6, 7, 10, 18). Where trees bend, no limb may sag too far either: with
    the weight W beyond a metamer, at the distance h along the limb, the tip of the level limb turns
    by W h^2 / E I, which elastic similarity keeps the same for limbs of all sizes (McMahon &
    Kronauer 1976).

    Parameters
    ----------
    wood : (density, support, leaf_mass)
        d, kg/m3; k, m; dry mass of a site's leaves, kg.
    fresh : (wood, leaf, sag)
        Fresh per dry mass of wood and of leaves; d^4 per fresh mass and squared distance that
        keeps the sag at its limit, m2/kg; 0 where trees do not bend.
    least : float32 (n,)
        d^2 that the wind asks for, m2; empty where growth knows no wind.
    budget : float
        Dry mass at hand, kg; the reinforcement is scaled down to it.
    work : float64 (4, n)
        Scratch: dry mass supported, kg; missing d^2, m2; fresh mass, and its moment about the
        metamer's upper end, kg m.

    Returns
    -------
    float
        Dry mass laid down, kg.
    """
    n = len(parent)
    density, support, leaf_mass = wood
    fresh_wood, fresh_leaf, sag = fresh
    mass, lack, weight, moment = work[0], work[1], work[2], work[3]
    volume = 0.25 * np.pi * density
    for i in range(n):
        s = state[i]
        leaves = ((1 if s & TERMINAL else 0) + (1 if s & LATERAL else 0)) * leaf_mass
        dry = volume * np.float64(pipe[i]) * np.float64(length[i])
        mass[i] = dry + leaves
        weight[i] = fresh_wood * dry + fresh_leaf * leaves
        moment[i] = -0.5 * np.float64(length[i]) * fresh_wood * dry
    for i in range(n - 1, 0, -1):
        p = parent[i]
        mass[p] += mass[i]
        if sag > 0.0:
            weight[p] += weight[i]
            moment[p] += moment[i] + weight[i] * np.float64(length[i])
    cost = 0.0
    for i in range(n):
        needed = 4.0 * mass[i] / (support * density)
        if sag > 0.0 and weight[i] > 0.0:
            turning = max(moment[i] + weight[i] * np.float64(length[i]), 0.0)
            needed = max(needed, np.sqrt(sag / weight[i]) * turning)
        if len(least) > 0:
            needed = max(needed, np.float64(least[i]))
        lack[i] = max(0.0, needed - np.float64(pipe[i]))
        cost += volume * lack[i] * np.float64(length[i])
    if cost <= 0.0:
        return 0.0
    part = min(1.0, budget / cost)
    for i in range(n):
        if lack[i] > 0.0:
            pipe[i] = np.float32(np.float64(pipe[i]) + part * lack[i])
    return part * cost


@njit
def lay_ring(parent, order, pipe, sapwood, branch_pipe, keep, flow):  # type: ignore[no-untyped-def]
    """Lay down pipes from their sites to the ground; one backward scan.

    Parameters
    ----------
    branch_pipe : float
        Thickness along branches relative to the stem (kappa).
    keep : float
        Share of the sapwood that is still sapwood after the year.
    flow : float64 (n,)
        d^2 of the pipes that start at each node; changed to what passes it.
    """
    for i in range(len(parent) - 1, -1, -1):
        here = flow[i] if order[i] == 0 else flow[i] * branch_pipe
        pipe[i] = np.float32(np.float64(pipe[i]) + here)
        sapwood[i] = np.float32(min(np.float64(sapwood[i]) * keep + here, np.float64(pipe[i])))
        if i > 0:
            flow[parent[i]] += flow[i]


@njit
def _favour_light_side(arena, s, e, t, sp, year, surplus, work, ints):  # type: ignore[no-untyped-def]
    """Weight each site's surplus by the growth rate of its limb.

    In the paper a limb's thickening is paid out of what growth rates hand up (eqs 18, 19).
    """
    limbs = Limbs(ints[0], ints[1], work[6], work[7], work[8], work[9], work[10], work[11], work[4])
    for i in range(e - s):
        limbs.bud[i] = 0.0
    know_limbs(tree_part(arena, s, e), t, sp, year, unit_costs(t, sp), limbs)
    for i in range(e - s):
        surplus[i] *= limbs.rate[limbs.head[i]]


@njit
def _thicken_balanced(arena, trees, row, t, year, wind_need, accounts, work, ints):  # type: ignore[no-untyped-def]
    """Book the extension, then lay down this year's ring out of the rest of the spend."""
    s = trees.start[row]
    n = trees.size[row]
    e = s + n
    sp = trees.species[row]
    parent = arena.parent[s:e]
    order = arena.order[s:e]
    length = arena.length[s:e]
    pipe = arena.pipe[s:e]
    state = arena.state[s:e]
    birth = arena.birth[s:e]
    path, pipe_path, flow, surplus = work[0], work[1], work[2], work[3]
    path_lengths(parent, order, length, t.of[sp].branch_pipe, path, pipe_path)
    volume = 0.25 * np.pi * t.of[sp].density
    strand = t.of[sp].first_pipe ** 2
    primary = t.of[sp].twig_diameter ** 2
    rate = income_rate(t, sp, np.float64(trees.vigour[row]), year)
    leaf = t.of[sp].leaf_mass / t.of[sp].leaf_lifespan
    extension = 0.0
    total = 0.0
    for i in range(n):
        flow[i] = 0.0
        surplus[i] = 0.0
        if birth[i] == year.step:
            pipe[i] = primary
            flow[i] = strand
            extension += volume * (primary * np.float64(length[i]) + strand * pipe_path[i])
            extension += t.of[sp].leaf_mass
            if i > 0 and birth[parent[i]] != year.step:
                surplus[parent[i]] += 1.0  # a bud that shot was a site when the year began
        else:
            surplus[i] += (1 if state[i] & TERMINAL else 0) + (1 if state[i] & LATERAL else 0)
    for i in range(n):
        if surplus[i] > 0.0:
            light = np.float64(arena.light[s + i])
            light = light_response(light, year.full_light, t.of[sp].light_half)
            earned = site_income(light, path[i], rate, t.of[sp].hydraulic_length)
            surplus[i] *= max(earned - leaf, 0.0)
    if year.balance:
        _favour_light_side(arena, s, e, t, sp, year, surplus, work, ints)
    for i in range(n):
        total += surplus[i]
    rest = max(accounts[row, SPEND] - extension, 0.0)
    wood = (t.of[sp].density, t.of[sp].support, t.of[sp].leaf_mass)
    fresh = (t.of[sp].fresh_wood, t.of[sp].fresh_leaf, t.of[sp].sag)
    least = wind_need[s:e]
    support = reinforce(parent, length, pipe, state, wood, fresh, least, rest, work[4:8])
    ring = rest - support
    if total > 0.0:
        per_surplus = ring / (volume * total)
        for i in range(n):
            flow[i] += per_surplus * surplus[i] / pipe_path[i]
    else:
        trees.reserve[row] += ring
        accounts[row, RESERVE_CHANGE] += ring
        ring = 0.0
    accounts[row, EXTENSION] = extension
    accounts[row, RING] = ring + support
    short = extension - accounts[row, SPEND]
    if short > 0.0:  # rounding of the search for s: a few metamers more than the spend
        trees.reserve[row] -= short
        accounts[row, RESERVE_CHANGE] -= short
    lay_ring(
        parent,
        order,
        pipe,
        arena.sapwood[s:e],
        t.of[sp].branch_pipe,
        1.0 - 1.0 / t.of[sp].sapwood_years,
        flow,
    )


@driver
def _thicken_chunks(first, step, arena, trees, shared, scratch, traits, year, wind_need, accounts):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            n = np.int64(trees.size[row])
            f = shared.place[b] * FLOATS
            work = scratch.floats[f : f + FLOATS * n].reshape((FLOATS, n))
            s = trees.start[row]
            sp = trees.species[row]
            if year.paper and year.balance:
                lay_cones(
                    arena.parent[s : s + n],
                    arena.state[s : s + n],
                    arena.length[s : s + n],
                    arena.pipe[s : s + n],
                    wood_of(traits, sp, year.paper),
                    work[0],
                    work[1],
                )
            elif year.paper:
                add_pipes(
                    arena.parent[s : s + n],
                    arena.birth[s : s + n],
                    year.step,
                    arena.pipe[s : s + n],
                    traits.of[sp].twig_diameter ** traits.of[sp].pipe_exponent,
                    work[0],
                )
            else:
                g = shared.place[b] * INTEGERS
                ints = scratch.integers[g : g + INTEGERS * n].reshape((INTEGERS, n))
                _thicken_balanced(arena, trees, row, traits, year, wind_need, accounts, work, ints)


def thicken(
    arena: Metamers,
    trees: Trees,
    shared: Deal,
    scratch: Scratch,
    traits: SpeciesTraits,
    year: Year,
    accounts: NDArray[np.float64],
    wind_need: NDArray[np.float32] = NO_NEED,
) -> None:
    """Thicken all trees; in mass-balance mode book extension and ring in `accounts`.

    `wind_need` (capacity of the arena,) is the d^2 that the wind asks of each metamer, m2.
    """
    in_threads(_thicken_chunks, arena, trees, shared, scratch, traits, year, wind_need, accounts)
