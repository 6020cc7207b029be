"""Fitting a nursery tree, number by number: slow twins of `forest.inventory.fitting`."""

from __future__ import annotations

import math


def thickened(
    pipe: list[float], parent: list[int], breast: int, wanted: float, primary: float, most: float
) -> list[float]:
    """Multiply each metamer's rings by one factor; add what is missing down to the ground."""
    factor = 1.0
    if pipe[breast] > primary:
        factor = min(most, (wanted - primary) / (pipe[breast] - primary))
    new = [primary + factor * (p - primary) if p > primary else p for p in pipe]
    missing = wanted - new[breast]
    below = breast
    while below != -1:
        new[below] += missing
        below = parent[below]
    return new


def aged(years: list[int], age: int, wanted_age: int, kept: int) -> list[int]:
    """Give ages of metamers: recent ones stay, older ones are spread over the rest of the life."""
    new = []
    for y in years:
        recent = min(kept, age, wanted_age)
        if y > recent:
            y = recent + round((y - recent) * (wanted_age - recent) / (age - recent))
        new.append(min(y, wanted_age))
    return new


def turned(v: tuple[float, float, float], azimuth: float) -> tuple[float, float, float]:
    """Turn a vector about the vertical by way of its own azimuth."""
    reach, own = math.hypot(v[0], v[1]), math.atan2(v[1], v[0])
    return reach * math.cos(own + azimuth), reach * math.sin(own + azimuth), v[2]
