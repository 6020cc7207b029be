"""Detail at range, said slowly: one range, one element, one internode at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest.trees.skeleton import Skeleton


def loop(total: int, number: float, mass_size: int) -> list[int]:
    """Run the loop that Weber and Penn print; `number` counts elements of a mass."""
    found = []
    int_number = int(number)
    masses = total / mass_size
    change = masses * (number - int_number)
    mass = 0
    while mass < masses:
        start = mass * mass_size
        end = start + int_number
        if mass < change:
            end += 1
        for index in range(start, end):
            if index < total:  # the last mass may be short
                found.append(index)
        mass += 1
    return found


def bracket(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def stem_shares(level: int, r2: float, s: float) -> tuple[float, float]:
    """Shares of polygons and lines of a level of stems."""
    if level == 0:
        lines = 0.0 if r2 < 100.0 else 1.0
        if r2 < 300.0:
            return 1.0, lines
        return (bracket(1.5 - r2 / 600.0) if r2 < 800.0 else 0.0), lines
    if level == 1:
        if r2 < 200.0 * s:
            return 1.0, 1.0
        return 0.0, (bracket(2.2 - 1.2 * (r2 / (200.0 * s)) ** 0.3) if r2 < 2000.0 * s else 0.0)
    if r2 < 50.0 * s:
        return 1.0, 1.0
    if r2 < 100.0 * s:
        return bracket(2.0 - r2 / (50.0 * s)), 1.0
    return 0.0, (bracket(2.0 - (r2 / (100.0 * s)) ** 0.5) if r2 < 500.0 * s else 0.0)


def leaf_shares(r2: float, season: str, evergreen: bool) -> tuple[float, float]:
    """Shares of polygons and points of the leaves."""
    if season == "winter" and not evergreen:
        return 0.0, 0.0
    d = 100.0 if season == "spring" else 200.0
    if r2 < d / 4.0:
        return 1.0, 1.0
    if r2 < d:
        return bracket(4.0 / 3.0 - r2 / (3.0 * d / 4.0)), 1.0
    return 0.0, max(bracket(1.5 - r2 / (2.0 * d)), 1.0 / 8.0)


def frames(tree: Skeleton) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Direction and side of each internode."""
    found: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    for i, p in enumerate(tree.parent):
        along = tree.end[i] - tree.start[i]
        before = found[p] if p >= 0 else (np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))
        heading = along / np.linalg.norm(along) if np.linalg.norm(along) > 1e-9 else before[0]
        side = before[1] - np.dot(before[1], heading) * heading
        if np.linalg.norm(side) < 1e-3:
            axis = np.eye(3)[np.argmin(np.abs(heading))]
            side = axis - np.dot(axis, heading) * heading
        found.append((heading, side / np.linalg.norm(side)))
    return found
