"""How the resource is shared among buds: Palubicki et al. 2009, section 4.2.

Light flows basipetally, resource flows back acropetally. Both models fill `v_main` and `v_side`:
the resource that leaves each node towards the continuation of its axis (or its terminal bud) and
towards its branch (or its lateral bud).
"""

from __future__ import annotations

import numpy as np

from forest._jit import njit
from forest.trees.metamers import (
    BRANCHED,
    LATERAL,
    MAIN,
    NO_ROOM_LATERAL,
    NO_ROOM_TERMINAL,
    TERMINAL,
)


@njit
def lit_buds(state):  # type: ignore[no-untyped-def]
    """Count the living buds of a node that have room: those whose light counts."""
    n = 0
    if state & TERMINAL and not state & NO_ROOM_TERMINAL:
        n += 1
    if state & LATERAL and not state & NO_ROOM_LATERAL:
        n += 1
    return n


@njit
def gather_light(parent, state, light, q_main, q_side):  # type: ignore[no-untyped-def]
    """Sum the light Q of buds basipetally (first pass of 4.2); one backward scan.

    Parameters
    ----------
    parent, state, light : arrays (n,)
        One tree's extent of the arena.
    q_main, q_side : float64 (n,)
        Filled: light of the continuing axis (Q_m) and of the branch (Q_l) at each node.

    Returns
    -------
    float
        Q_base, the light of the whole tree.
    """
    n = len(parent)
    for i in range(n):
        s = state[i]
        q = np.float64(light[i])
        q_main[i] = q if (s & TERMINAL) and not (s & NO_ROOM_TERMINAL) else 0.0
        q_side[i] = q if (s & LATERAL) and not (s & NO_ROOM_LATERAL) else 0.0
    for i in range(n - 1, 0, -1):
        q = q_main[i] + q_side[i]
        if state[i] & MAIN:
            q_main[parent[i]] += q
        else:
            q_side[parent[i]] += q
    return q_main[0] + q_side[0]


@njit
def share_borchert_honda(  # type: ignore[no-untyped-def]
    parent, state, order, q_main, q_side, bias, max_order, v_base, v_main, v_side
):
    """Share the resource by the extended Borchert-Honda model; one forward scan (4.2, Fig. 8a).

    v_m = v lambda Q_m / (lambda Q_m + (1 - lambda) Q_l), v_l = v - v_m.

    Parameters
    ----------
    bias : float64 (orders,)
        lambda of each order; the last holds for higher orders.
    max_order : int
        Lateral buds on axes of this order bear leaves (their light counts) but get nothing.
    v_base : float
        Resource at the base, alpha Q_base.
    """
    n = len(parent)
    last = len(bias) - 1
    for i in range(n):
        if i == 0:
            v = v_base
        elif state[i] & MAIN:
            v = v_main[parent[i]]
        else:
            v = v_side[parent[i]]
        lam = bias[min(np.int64(order[i]), last)]
        main = lam * q_main[i]
        side = (1.0 - lam) * q_side[i]
        if order[i] >= max_order and state[i] & LATERAL:
            side = 0.0
        total = main + side
        if total > 0.0:
            v_main[i] = v * (main / total)
            v_side[i] = v - v_main[i]
        else:
            v_main[i] = 0.0
            v_side[i] = 0.0


@njit
def _weight(position, n, w_max, w_min, kappa):  # type: ignore[no-untyped-def]
    """Weight of a place in the priority list (Fig. 8c): falls linearly until kappa N."""
    end = kappa * n
    if position >= end:
        return w_min
    return w_max + (w_min - w_max) * (position / end)


@njit
def _sort_by_light(items, count, mean_light):  # type: ignore[no-untyped-def]
    """Sort the first `count` items by falling mean light; equals keep their order."""
    if count > 24:
        by_light = np.argsort(-mean_light[items[:count]], kind="mergesort")
        items[:count] = items[:count][by_light]
        return
    for k in range(1, count):
        item = items[k]
        j = k
        while j > 0 and mean_light[items[j - 1]] < mean_light[item]:
            items[j] = items[j - 1]
            j -= 1
        items[j] = item


@njit
def share_priority(  # type: ignore[no-untyped-def]
    parent,
    state,
    order,
    q_main,
    q_side,
    control,
    shape,
    max_order,
    v_base,
    v_main,
    v_side,
    ints,
):
    """Share the resource by the priority model, axis by axis (4.2, Fig. 8b, 8c).

    On each axis the supported branches and buds are sorted by their mean light; under apical
    control the terminal bud stands first. Place k of N gets v_k = v Q_k w_k / sum(Q_j w_j).

    Parameters
    ----------
    control : float64 (orders,)
        1 where axes of that order are under apical control, else 0.
    shape : (w_max, w_min, kappa)
        The weight function.
    ints : int32 (4, n)
        Scratch.
    """
    n = len(parent)
    last = len(control) - 1
    buds = ints[0]  # living buds beyond each node, its own included
    follower = ints[1]  # next metamer of the axis, or -1
    items = ints[2]
    on_branch = ints[3]  # living buds of the branch at each node
    w_max, w_min, kappa = shape
    for i in range(n):
        buds[i] = 0
        on_branch[i] = 0
        follower[i] = -1
    for i in range(n - 1, -1, -1):
        s = state[i]
        buds[i] += (1 if s & TERMINAL else 0) + (1 if s & LATERAL else 0)
        if i > 0:
            buds[parent[i]] += buds[i]
            if s & MAIN:
                follower[parent[i]] = i
            else:
                on_branch[parent[i]] = buds[i]
    for head in range(n):
        if head > 0 and state[head] & MAIN:
            continue
        v = v_base if head == 0 else v_side[parent[head]]
        count = 0
        unlit = 0  # stand at the end of the list: they get nothing, but count in N
        i = np.int32(head)
        tip = i
        while i >= 0:
            s = state[i]
            v_main[i] = 0.0
            v_side[i] = 0.0
            living = (s & BRANCHED and on_branch[i] > 0) or (s & LATERAL and order[i] < max_order)
            if living and q_side[i] > 0.0:
                items[count] = i
                count += 1
            elif living:
                unlit += 1
            tip = i
            i = follower[i]
        # while the axis is walked v_side holds the mean light of each item, the sorting key
        for k in range(count):
            j = items[k]
            v_side[j] = q_side[j] / max(1, on_branch[j])
        has_tip = state[tip] & TERMINAL
        _sort_by_light(items, count, v_side)
        total_items = count + unlit + (1 if has_tip else 0)
        tip_place = 0
        if has_tip and not control[min(np.int64(order[head]), last)] > 0.0:
            while tip_place < count and v_side[items[tip_place]] >= q_main[tip]:
                tip_place += 1
        total = 0.0
        for k in range(count):
            j = items[k]
            place = k + 1 if has_tip and k >= tip_place else k
            share = q_side[j] * _weight(place, total_items, w_max, w_min, kappa)
            v_side[j] = share
            total += share
        if has_tip:
            share = q_main[tip] * _weight(tip_place, total_items, w_max, w_min, kappa)
            v_main[tip] = share
            total += share
        scale = v / total if total > 0.0 else 0.0
        for k in range(count):
            v_side[items[k]] *= scale
        v_main[tip] *= scale
