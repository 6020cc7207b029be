"""Where trees are planted, and which species stands where."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.species.schema import Refusal

#: Two trees nearer than this are on the same spot.
SAME_SPOT_M = 0.01
MOST_TREES = 1_000_000
#: Discs of half the least distance may cover this share of a plot; random placing jams at 0.55.
_MOST_COVER = 0.4
_MOST_TRIES = 100_000


class Spots:
    """The spots taken so far, in cells as wide as the least distance, for quick look-up."""

    def __init__(self, size_m: tuple[float, float], distance_m: float, *, periodic: bool) -> None:
        self._size = size_m
        self._distance = distance_m
        self._periodic = periodic
        self._cells = [max(int(edge / distance_m), 1) for edge in size_m]
        self._taken: dict[tuple[int, int], list[tuple[float, float, int]]] = {}

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        nx, ny = self._cells
        return (
            min(int(x / self._size[0] * nx), nx - 1),
            min(int(y / self._size[1] * ny), ny - 1),
        )

    def neighbour(self, x: float, y: float) -> int | None:
        """Give the number of a spot nearer than the least distance, or None."""
        cx, cy = self._cell(x, y)
        for i in {cx - 1, cx, cx + 1}:
            for j in {cy - 1, cy, cy + 1}:
                key = (i % self._cells[0], j % self._cells[1]) if self._periodic else (i, j)
                for other_x, other_y, number in self._taken.get(key, ()):
                    dx, dy = abs(x - other_x), abs(y - other_y)
                    if self._periodic:
                        dx, dy = min(dx, self._size[0] - dx), min(dy, self._size[1] - dy)
                    if math.hypot(dx, dy) < self._distance:
                        return number
        return None

    def take(self, x: float, y: float, number: int) -> None:
        """Note that a tree stands here."""
        self._taken.setdefault(self._cell(x, y), []).append((x, y, number))


def regular_spots(
    size_m: tuple[float, float], spacing_m: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Place trees in rows, half a spacing from the plot's edge."""
    columns, rows = (
        max(int(edge / step + 1e-9), 1) for edge, step in zip(size_m, spacing_m, strict=True)
    )
    x, y = np.meshgrid(
        (np.arange(columns) + 0.5) * min(spacing_m[0], size_m[0]),
        (np.arange(rows) + 0.5) * min(spacing_m[1], size_m[1]),
    )
    return x.ravel(), y.ravel()


def random_count(size_m: tuple[float, float], density_ha: float, min_distance_m: float) -> int:
    """Count the trees of a random planting; refuse what cannot be placed."""
    area = size_m[0] * size_m[1]
    count = max(round(density_ha * area / 10000), 1)
    if count > MOST_TREES:
        raise Refusal(
            f"{count} trees on the plot",
            key="planting.density_ha",
            expected=f"at most {MOST_TREES}",
        )
    cover = count * math.pi / 4 * max(min_distance_m, SAME_SPOT_M) ** 2 / area
    if count > 1 and cover > _MOST_COVER:
        most = math.sqrt(_MOST_COVER * area / count * 4 / math.pi)
        raise Refusal(
            f"{count} trees do not fit {min_distance_m:g} m apart",
            key="planting.min_distance_m",
            expected=f"at most {math.floor(most * 1000) / 1000:g}",
        )
    return count


def random_spots(
    size_m: tuple[float, float],
    count: int,
    min_distance_m: float,
    seed: int,
    *,
    periodic: bool,
    time: int = 0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Place trees uniformly at random, each at least `min_distance_m` from those before it.

    Plantings at another `time` draw other places; that of the start is at time 0.
    """
    from forest.random import STREAM_PLACE, uniforms

    distance = max(min_distance_m, SAME_SPOT_M)
    spots = Spots(size_m, distance, periodic=periodic)
    x, y = np.empty(count), np.empty(count)
    for tree in range(count):
        for attempt in range(_MOST_TRIES):
            u, v, _, _ = uniforms(seed, STREAM_PLACE, tree, attempt, time)
            x[tree], y[tree] = u * size_m[0], v * size_m[1]
            if spots.neighbour(x[tree], y[tree]) is None:
                spots.take(x[tree], y[tree], tree)
                break
        else:
            raise InputError(
                f"no room for tree {tree + 1} of {count}",
                where="planting.min_distance_m",
                expected="a smaller distance or density",
            )
    return x, y


def draw_species(shares: list[float], count: int, seed: int, time: int = 0) -> NDArray[np.int64]:
    """Draw each tree's species by share; the n-th tree's depends on nothing but the `time`."""
    from forest.random import STREAM_SPECIES, uniforms

    upper = np.cumsum(shares) / np.sum(shares)
    drawn = np.array([uniforms(seed, STREAM_SPECIES, tree, 0, time)[0] for tree in range(count)])
    return np.minimum(np.searchsorted(upper, drawn, side="right"), len(shares) - 1).astype(np.int64)
