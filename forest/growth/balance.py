"""Hart & Baker 2003, section 4.1: mass, centre of mass and the growth rates that restore balance.

Their limb is an axis. Sums run over metamers (same sums, eqs 10, 12, 14) and are read per axis.
The rates act on the shares of the bud-fate model: what a branch is weighted with is the mean
growth rate of the limbs it supports.
"""

from __future__ import annotations

import numpy as np

from forest._jit import njit
from forest.growth.bud_fate import lit_buds
from forest.trees.metamers import CONTINUED, MAIN


@njit
def growth_shares(  # type: ignore[no-untyped-def]
    parent, state, tip, length, pipe, light, traits, weights, work, axis_of
):
    """Fill `weights` with the mean growth rates of what stands beyond each node.

    Parameters
    ----------
    parent, state, tip, length, pipe, light : arrays (n,)
        One tree's extent of the arena.
    traits : (density, min_growth, offset_gain, light_gain, offset_length, pipe_exponent)
        kg/m3; g_i at least; gain on (1 + o_i) (0.45 in the paper); gain on p_i; the clamp length
        ell as a multiple of the trunk's base radius; n of pipe = d^n.
    weights : float64 (2, n)
        Filled: mean growth rate of the limbs on the continuing axis (or of the limb itself, for
        a terminal bud) and on the branch (or of the limb itself, for a lateral bud) at each node.
    work : float64 (3, n)
        Scratch: growth rate g of each axis at its first metamer; G (eq. 15); light of the limb.
    axis_of : int32 (2, n)
        Scratch: first metamer of the axis; number of limbs beyond, its own included.
    """
    density, min_growth, offset_gain, light_gain, offset_length, exponent = traits
    n = len(parent)
    rate, total, limb_light = work[0], work[1], work[2]
    head, count = axis_of[0], axis_of[1]
    # eqs 10-12 for the whole tree: the horizontal centre of mass X_0, relative to the base
    mass = 0.0
    moment_x = 0.0
    moment_y = 0.0
    all_light = 0.0
    square = 2.0 / exponent  # d^2 = pipe^square
    for i in range(n):
        area = np.float64(pipe[i]) if square == 1.0 else np.float64(pipe[i]) ** square
        m = density * 0.25 * np.pi * area * np.float64(length[i])
        p = parent[i]
        x0 = np.float64(tip[p, 0]) if i > 0 else 0.0
        y0 = np.float64(tip[p, 1]) if i > 0 else 0.0
        mass += m
        moment_x += m * 0.5 * (x0 + np.float64(tip[i, 0]))
        moment_y += m * 0.5 * (y0 + np.float64(tip[i, 1]))
        head[i] = head[p] if i > 0 and state[i] & MAIN else i
        rate[i] = 0.0
        limb_light[i] = 0.0
        q = lit_buds(state[i]) * np.float64(light[i])
        limb_light[head[i]] += q
        all_light += q
    for i in range(n):
        total[head[i]] = np.float64(i)  # the last metamer of each axis
    centre_x = moment_x / mass if mass > 0.0 else 0.0
    centre_y = moment_y / mass if mass > 0.0 else 0.0
    ell = max(offset_length * 0.5 * np.float64(pipe[0]) ** (0.5 * square), 1e-6)
    for i in range(n):
        if head[i] != i:
            continue
        # eq. 13 as read: growth goes to the light side, o = -(T y) . X_0 / ell, clamped
        end = np.int64(total[i])
        p = parent[i]
        dx = np.float64(tip[end, 0]) - (np.float64(tip[p, 0]) if i > 0 else 0.0)
        dy = np.float64(tip[end, 1]) - (np.float64(tip[p, 1]) if i > 0 else 0.0)
        dz = np.float64(tip[end, 2]) - (np.float64(tip[p, 2]) if i > 0 else 0.0)
        reach = np.sqrt(dx * dx + dy * dy + dz * dz)
        offset = 0.0
        if reach > 0.0:
            offset = -(dx * centre_x + dy * centre_y) / (reach * ell)
        offset = min(max(offset, -1.0), 1.0)
        share = limb_light[i] / all_light if all_light > 0.0 else 0.0
        rate[i] = min_growth + offset_gain * (1.0 + offset) + light_gain * share
    for i in range(n):
        total[i] = 0.0
        count[i] = 0
        weights[0, i] = rate[head[i]]
        weights[1, i] = rate[head[i]]
    # eq. 15: G sums over limbs; a limb counts where it ends, so once beyond each of its nodes
    for i in range(n - 1, -1, -1):
        if not state[i] & CONTINUED:
            total[i] += rate[head[i]]
            count[i] += 1
        if i == 0:
            break
        p = parent[i]
        mean = total[i] / count[i]
        if state[i] & MAIN:
            weights[0, p] = mean
        else:
            weights[1, p] = mean
        total[p] += total[i]
        count[p] += count[i]
