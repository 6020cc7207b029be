"""Canopy gaps the slow way: every cell asks every crown, and a flood fills each gap."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def under_disc(dx: float, dy: float, radius: float) -> bool:
    """Say whether a point lies under a crown of this radius."""
    return math.hypot(dx, dy) <= radius


def under_octagon(dx: float, dy: float, reach: list[float]) -> bool:
    """Say whether a point lies in one of the eight triangles between neighbouring corners."""
    corners = [
        (r * math.cos((k + 0.5) * math.pi / 4), r * math.sin((k + 0.5) * math.pi / 4))
        for k, r in enumerate(reach)
    ]
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        whole = ax * by - ay * bx
        if whole <= 0.0:
            continue
        along_a = (dx * by - dy * bx) / whole
        along_b = (ax * dy - ay * dx) / whole
        if along_a >= 0.0 and along_b >= 0.0 and along_a + along_b <= 1.0:
            return True
    return False


def open_cells(
    places: list[tuple[float, float]],
    crowns: list[float] | list[list[float]],
    size: tuple[float, float],
    cells: tuple[int, int],
    periodic: bool,
) -> NDArray[np.bool_]:
    """Mark the cells, (ny, nx), whose centre lies under no crown; a crown wraps once a side."""
    nx, ny = cells
    free = np.ones((ny, nx), bool)
    shifts = (-1, 0, 1) if periodic else (0,)
    for j in range(ny):
        for i in range(nx):
            cx, cy = (i + 0.5) * size[0] / nx, (j + 0.5) * size[1] / ny
            for (x, y), crown in zip(places, crowns, strict=True):
                for a in shifts:
                    for b in shifts:
                        dx, dy = cx - x + a * size[0], cy - y + b * size[1]
                        inside = (
                            under_octagon(dx, dy, crown)
                            if isinstance(crown, list)
                            else under_disc(dx, dy, crown)
                        )
                        if inside:
                            free[j, i] = False
    return free


def patches(marked: NDArray[np.bool_], periodic: bool) -> list[set[tuple[int, int]]]:
    """Flood the marked cells over their edges, one patch after the other."""
    ny, nx = marked.shape
    left = {(j, i) for j in range(ny) for i in range(nx) if marked[j, i]}
    found = []
    while left:
        patch: set[tuple[int, int]] = set()
        border = [left.pop()]
        while border:
            j, i = border.pop()
            patch.add((j, i))
            for to in ((j + 1, i), (j - 1, i), (j, i + 1), (j, i - 1)):
                if periodic:
                    to = (to[0] % ny, to[1] % nx)
                if to in left:
                    left.remove(to)
                    border.append(to)
        found.append(patch)
    return found
