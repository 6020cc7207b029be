"""The annual carbon budget of a tree and what it lets its buds make.

Palubicki's resource v_base = alpha Q_base has no cost side. Here light earns dry mass, leaves and
sapwood cost it, and the resource is scaled by the largest s at which the new metamers can be
paid for. v is linear in s, so one acropetal scan and a histogram of thresholds find s.
"""

from __future__ import annotations

import math

import numpy as np

from forest._jit import njit

# Columns of the yearly accounts of a tree, kg dry mass.
INCOME = 0
LEAVES = 1
UPKEEP = 2
EXTENSION = 3
RING = 4
RESERVE_CHANGE = 5
SPEND = 6
ACCOUNTS = 7


#: An internode at the turgor limit, relative to one at the ground: leaves still need their nodes.
LEAST_EXTENSION = 0.1

# The histogram of thresholds: s from 2**-_OCTAVES to 1 in _STEPS bins per octave.
_OCTAVES = 20
_STEPS = 32


@njit
def path_lengths(parent, order, length, branch_pipe, path, pipe_path):  # type: ignore[no-untyped-def]
    """Length from each node to the ground, and the length that its pipe counts as.

    Along branches a pipe is `branch_pipe` (kappa) times as thick as along the stem.
    """
    for i in range(len(parent)):
        step = np.float64(length[i])
        pipe_step = step if order[i] == 0 else step * branch_pipe
        if i > 0:
            step += path[parent[i]]
            pipe_step += pipe_path[parent[i]]
        path[i] = step
        pipe_path[i] = pipe_step


@njit
def light_response(light, full_light, half):  # type: ignore[no-untyped-def]
    """The light that leaves make full use of: all of it, or what income saturating with light uses.

    Leaves earn l (1 + c) / (l + c) of what they earn in full light, l being their share of it
    (Pacala et al. 1996, G1 l / (G1 / S + l)); the smaller c, the `half`, the less shade takes.
    """
    if half <= 0.0:
        return light
    at = half * full_light
    return light * (full_light + at) / (light + at)


@njit
def site_income(light, path, rate, hydraulic_length):  # type: ignore[no-untyped-def]
    """Income of one site, kg: light times rate, less with height (Ryan & Yoder 1997)."""
    return rate * light / (1.0 + path / hydraulic_length)


@njit
def extension(height, turgor_limit):  # type: ignore[no-untyped-def]
    """Length of a new internode relative to one at the ground, at a height (m).

    Water hangs from the top of a tree: its tension grows with height, and the turgor that
    stretches new cells falls, down to nothing at `turgor_limit` (Koch et al. 2004; m).
    """
    return max(1.0 - height / turgor_limit, LEAST_EXTENSION)


@njit
def lowest_scale(thresholds_cost, budget):  # type: ignore[no-untyped-def]
    """The largest s whose events cost at most `budget`, from the histogram of their costs."""
    spent = 0.0
    for k in range(len(thresholds_cost)):
        spent += thresholds_cost[k]
        if spent > budget:
            octave = k // _STEPS
            part = k - octave * _STEPS
            edge = math.ldexp(0.5 + 0.5 * part / _STEPS, octave - _OCTAVES + 1)
            return edge * (1.0 - 1e-12)
    return 1.0


@njit
def threshold_bin(s):  # type: ignore[no-untyped-def]
    """The histogram bin of a threshold s in (0, 1]."""
    mantissa, exponent = math.frexp(s)
    octave = exponent + _OCTAVES - 1
    if octave < 0:
        return 0
    bin_of = octave * _STEPS + int((mantissa - 0.5) * 2.0 * _STEPS)
    return min(bin_of, (_OCTAVES + 1) * _STEPS - 1)


@njit
def affordable_scale(  # type: ignore[no-untyped-def]
    resource,
    v_main,
    v_side,
    pipe_path,
    stretch,
    order,
    unit_cost,
    pipe_cost,
    branch_pipe,
    most,
    budget,
):
    """Find the largest s in (0, 1] whose new metamers cost at most `budget`.

    A bud that is offered v at s = 1 and holds the fraction c makes its k-th metamer as soon as
    s v + c >= k; the k-th metamer costs `unit_cost` + `pipe_cost` x (length of its pipe).

    Parameters
    ----------
    resource : float32 (n, 2)
        Fractions carried by the terminal and lateral buds.
    stretch : float64 (n,)
        Length of new internodes relative to those at the ground.
    unit_cost : float64 (orders, 3)
        Cost (kg), length (m) and primary wood (kg, part of the cost) of one metamer by order.
    pipe_cost : float
        Cost of the first pipe, kg per m.
    most : int
        Metamers that a shoot can have at most.
    """
    histogram = np.zeros((_OCTAVES + 1) * _STEPS)
    top = len(unit_cost) - 1
    for i in range(len(v_main)):
        for bud in range(2):
            v = v_main[i] if bud == 0 else v_side[i]
            carried = np.float64(resource[i, bud])
            if v + carried < 1.0 or v <= 0.0:
                continue
            made = min(int(v + carried), most)
            o = np.int64(order[i]) + bud
            cost = unit_cost[min(o, top), 0] - (1.0 - stretch[i]) * unit_cost[min(o, top), 2]
            step = unit_cost[min(o, top), 1] * stretch[i]
            if o > 0:
                step *= branch_pipe
            for k in range(1, made + 1):
                s = min(max((k - carried) / v, 1e-9), 1.0)
                histogram[threshold_bin(s)] += cost + pipe_cost * (pipe_path[i] + k * step)
    return lowest_scale(histogram, budget)
