"""Slow twins of fracture bark: dense equilibrium, and one ring grown in plain Python."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


def equilibrium(
    stiffness: NDArray[np.float64],
    rest: NDArray[np.float64],
    grip: NDArray[np.float64],
    anchor: NDArray[np.float64],
    girth: float,
) -> NDArray[np.float64]:
    """Solve 5.1 as it is printed (grip with the sign of a spring), as a dense system.

    A ring that nothing holds gets one more equation: no net displacement, vertices weighed by the
    rest lengths beside them.
    """
    n = len(rest)
    matrix, right = np.zeros((n, n)), np.zeros(n)
    for i in range(n):
        before, after = (i - 1) % n, (i + 1) % n
        # - K[before] (x[i] - x[before] - l[before]) + K[i] (x[after] - x[i] - l[i]) - Ka (x - a)
        matrix[i, i] -= stiffness[before] + stiffness[i] + grip[i]
        matrix[i, before] += stiffness[before]
        matrix[i, after] += stiffness[i]
        right[i] += -stiffness[before] * rest[before] + stiffness[i] * rest[i] - grip[i] * anchor[i]
        if i == 0:  # x[before] lies a girth back
            right[i] += stiffness[before] * girth
        if i == n - 1:  # x[after] a girth on
            right[i] -= stiffness[i] * girth
    if not grip.any():
        weight = rest + np.roll(rest, 1)
        matrix = np.vstack([matrix, weight])
        right = np.append(right, weight @ anchor)
    return np.linalg.lstsq(matrix, right, rcond=None)[0]


class Grain(NamedTuple):
    """A place that may break."""

    place: float
    drawn: float


def grow_ring(
    length: float,
    girths: list[float],
    grains: list[Grain],
    *,
    spacing: float,
    jitter: float,
    least_piece: float,
) -> dict[float, float]:
    """Grow one ring that nothing holds: places of fractures and their widths in the end.

    Figure 8 for one strip, with the growth ratio as base criterion. The tension of the epidermis
    per stiffness is its strain; a fracture opens by `spacing` times the strain.
    """
    opened: dict[float, float] = {}
    for before, girth in pairwise(girths):
        limit = girth / before - 1.0
        rest = dict(opened)
        while True:
            excess = girth - length - sum(rest.values())
            strain = excess / (length + spacing * len(rest))
            breaking = []
            edges = [*sorted(rest), length]
            for left, right in zip([0.0, *sorted(rest)], edges, strict=True):
                free = [
                    grain
                    for grain in grains
                    if left < grain.place < right
                    and all(
                        abs((grain.place - p + length / 2) % length - length / 2) > least_piece
                        for p in rest
                    )
                ]
                if free:
                    weakest = min(free, key=lambda grain: grain.drawn)
                    load = strain / limit / np.exp(jitter * weakest.drawn)
                    breaking.append((load, weakest.place))
            worst = max(breaking, default=(0.0, 0.0))
            if worst[0] <= 1.0 + 1e-9:
                break
            rest[worst[1]] = 0.0
        opened = {place: width + spacing * strain for place, width in rest.items()}
    return opened
