"""Shoots in plain Python: Palubicki et al. 2009, section 4.3."""

from __future__ import annotations

import numpy as np

Vector = np.ndarray


def unit(vector: Vector) -> Vector:
    """A vector of length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def shoot_tips(
    foot: Vector,
    heading: Vector,
    toward: Vector,
    tropism: Vector,
    *,
    xi: float,
    eta: float,
    v: float,
    most: int,
    unit_length: float,
) -> list[Vector]:
    """Tips of the metamers that a bud makes of v: n = floor(v), l = v / n, each bent anew."""
    n = min(int(v), most)
    tips = []
    for _ in range(n):
        heading = unit(heading + xi * toward + eta * tropism)
        foot = foot + unit_length * v / n * heading
        tips.append(foot)
    return tips


def sylleptic_count(v: float, bias: float) -> int:
    """Metamers made of v when both buds of a new node shoot at once with what is left."""
    if v < 1.0:
        return 0
    left = v - 1.0
    return 1 + sylleptic_count(bias * left, bias) + sylleptic_count((1.0 - bias) * left, bias)
