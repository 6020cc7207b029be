"""Relinking: a chain that straddles a branching parts into loops (Hart & Baker 2003, Table 2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import njit


@njit
def winding(
    place: Any, ahead: Any, foot: Any, heading: Any, about: Any, first: Any, last: Any
) -> Any:
    """Angle by which the closed way first .. last, first turns about the limb of `about`, rad.

    A way around the limb turns by one full circle, one that lies on its side by none.
    """
    ox, oy, oz = foot[about, 0], foot[about, 1], foot[about, 2]
    hx, hy, hz = heading[about, 0], heading[about, 1], heading[about, 2]
    total = 0.0
    a = first
    while True:
        b = ahead[a] if a != last else first
        px, py, pz = place[a, 0] - ox, place[a, 1] - oy, place[a, 2] - oz
        qx, qy, qz = place[b, 0] - ox, place[b, 1] - oy, place[b, 2] - oz
        p = px * hx + py * hy + pz * hz
        q = qx * hx + qy * hy + qz * hz
        px, py, pz = px - p * hx, py - p * hy, pz - p * hz
        qx, qy, qz = qx - q * hx, qy - q * hy, qz - q * hz
        turn = hx * (py * qz - pz * qy) + hy * (pz * qx - px * qz) + hz * (px * qy - py * qx)
        total += np.arctan2(turn, px * qx + py * qy + pz * qz)
        if a == last:
            return total
        a = b


@njit
def _goes_around(
    limb: Any, place: Any, ahead: Any, foot: Any, heading: Any, first: Any, last: Any
) -> Any:
    """Whether the part first .. last, closed, turns about a limb that it is on."""
    about = first
    while True:
        turn = winding(place, ahead, foot, heading, about, first, last)
        if abs(turn) > np.pi:
            return True
        on = limb[about]
        while limb[about] == on:
            if about == last:
                return False
            about = ahead[about]


@njit
def apart(place: Any, a: Any, b: Any) -> Any:
    """Squared distance of two particles."""
    x = place[a, 0] - place[b, 0]
    y = place[a, 1] - place[b, 1]
    z = place[a, 2] - place[b, 2]
    return x * x + y * y + z * z


@njit
def relink(
    a: Any,
    b: Any,
    limb: Any,
    place: Any,
    ahead: Any,
    behind: Any,
    foot: Any,
    heading: Any,
    printed: Any,
) -> Any:
    """Part the chain that runs from a to b = ahead[a], as Table 2 lists it.

    As printed, a single particle that steps on a limb would become a loop of its own. So either
    part must also go around a limb that it is on (not if `printed`).

    Returns
    -------
    int
        How often the chain was relinked.
    """
    relinked = 0
    b0 = b
    a0 = a
    while limb[a0] != limb[b0]:
        while True:
            a = b
            b = ahead[b]
            if b == a0:
                return relinked
            if limb[a] != limb[b] and apart(place, b0, a) < apart(place, b, a):
                if printed:
                    break
                one = _goes_around(limb, place, ahead, foot, heading, b0, a)
                if one and _goes_around(limb, place, ahead, foot, heading, b, a0):
                    break
        relinked += 1
        ahead[a] = b0
        behind[b0] = a
        ahead[a0] = b
        behind[b] = a0
        b0 = b
    return relinked
