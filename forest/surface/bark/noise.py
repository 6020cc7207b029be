"""Noise that repeats: smooth waves, and flakes that overlap like roof tiles.

Gradient noise after Perlin (1985, 2002) on a lattice that closes on itself; flakes are the cells
of scattered points (Worley 1996) with an order in which they cover each other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.random import STREAM_DRESSING, uniforms

_CHUNKS = 16
_TURN = 2.0 * np.pi


@njit
def _draw(seed: Any, serial: Any, out: Any) -> None:
    """Four uniform numbers for each cell of a lattice."""
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            a, b, c, d = uniforms(seed, STREAM_DRESSING, y, x, serial)
            out[y, x, 0] = a
            out[y, x, 1] = b
            out[y, x, 2] = c
            out[y, x, 3] = d


def draws(seed: int, serial: int, rows: int, columns: int) -> NDArray[np.float64]:
    """Draw four uniform numbers for each cell of a lattice, (rows, columns, 4)."""
    out = np.empty((rows, columns, 4))
    _draw(seed, serial, out)
    return out


def noise(n: int, around: int, along: int, *, octaves: int, seed: int, serial: int) -> NDArray[Any]:
    """Give a square of gradient noise that continues over its edges.

    Parameters
    ----------
    n : int
        Pixels along each side.
    around, along : int
        Waves of the first octave across its columns and its rows.
    octaves : int
        Each has twice the waves and half the height of the one before.
    seed, serial : int
        Which noise.

    Returns
    -------
    float32 (n, n)
        About -1 to 1, mean about 0.
    """
    out = np.zeros((n, n), np.float32)
    height = 1.0
    for octave in range(octaves):
        columns, rows = max(1, around) << octave, max(1, along) << octave
        if 2 * max(columns, rows) > n and octave:  # finer than pixels
            break
        lattice = draws(seed, serial * 16 + octave, rows, columns)
        gradient = np.stack((np.cos(_TURN * lattice[..., 0]), np.sin(_TURN * lattice[..., 0])), -1)
        in_threads(_add_noise, gradient, height, out)
        height *= 0.5
    return out


@driver
def _add_noise(first: Any, step: Any, gradient: Any, height: Any, out: Any) -> None:
    n = out.shape[0]
    rows, columns = gradient.shape[0], gradient.shape[1]
    for chunk in range(first, _CHUNKS, step):
        for y in range(chunk, n, _CHUNKS):
            v = (y + 0.5) / n * rows
            k0 = np.int64(v)
            k1 = (k0 + 1) % rows
            t = v - k0
            smooth_t = t * t * t * (t * (6.0 * t - 15.0) + 10.0)
            for x in range(n):
                u = (x + 0.5) / n * columns
                j0 = np.int64(u)
                j1 = (j0 + 1) % columns
                s = u - j0
                smooth_s = s * s * s * (s * (6.0 * s - 15.0) + 10.0)
                a = gradient[k0, j0, 0] * s + gradient[k0, j0, 1] * t
                b = gradient[k0, j1, 0] * (s - 1.0) + gradient[k0, j1, 1] * t
                c = gradient[k1, j0, 0] * s + gradient[k1, j0, 1] * (t - 1.0)
                d = gradient[k1, j1, 0] * (s - 1.0) + gradient[k1, j1, 1] * (t - 1.0)
                low = a + smooth_s * (b - a)
                high = c + smooth_s * (d - c)
                # Plane gradients of length 1 reach 0.71.
                out[y, x] += np.float32(1.4 * height * (low + smooth_t * (high - low)))


class Flakes(NamedTuple):
    """Flakes over a square: float32 (n, n) each."""

    height: NDArray[np.float32]  # 0 to 1: how many lie below, and how far they stand off
    tint: NDArray[np.float32]  # 0 to 1, one number for each flake
    edge: NDArray[np.float32]  # 0 at a flake's edge, 1 at its middle


def flakes(
    n: int, around: int, along: int, warp: NDArray[Any], *, seed: int, serial: int
) -> Flakes:
    """Cover a square with flakes that continue over its edges.

    Parameters
    ----------
    n : int
        Pixels along each side.
    around, along : int
        Flakes across its columns and its rows.
    warp : float32 (n, n, 2)
        By how much of a flake's size the outlines are pushed about.
    seed, serial : int
        Which flakes.
    """
    lattice = draws(seed, serial * 16, max(3, along), max(3, around))
    out = Flakes(*(np.empty((n, n), np.float32) for _ in range(3)))
    in_threads(_fill_flakes, lattice, warp, out)
    return out


@driver
def _fill_flakes(first: Any, step: Any, lattice: Any, warp: Any, out: Any) -> None:
    n = out.height.shape[0]
    for chunk in range(first, _CHUNKS, step):
        for y in range(chunk, n, _CHUNKS):
            for x in range(n):
                _flake_at(lattice, warp[y, x], y, x, out)


@njit
def _flake_at(lattice: Any, push: Any, y: Any, x: Any, out: Any) -> None:
    """Find the uppermost flake at a pixel."""
    n = out.height.shape[0]
    rows, columns = lattice.shape[0], lattice.shape[1]
    v = (y + 0.5) / n * rows + push[1]
    u = (x + 0.5) / n * columns + push[0]
    k, j = np.int64(np.floor(v)), np.int64(np.floor(u))
    top = -1.0
    tint = 0.0
    edge = 0.0
    lift = 0.0
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            cell = lattice[(k + dy) % rows, (j + dx) % columns]
            away_y = v - (k + dy + 0.15 + 0.7 * cell[1])
            away_x = u - (j + dx + 0.15 + 0.7 * cell[0])
            near = 1.0 - np.sqrt(away_x * away_x + away_y * away_y) / (0.75 + 0.2 * cell[3])
            # Those that do not reach here can still be the nearest: lowest in order.
            order = cell[2] + 1.0 if near > 0.0 else near
            if order > top:
                top = order
                tint = cell[2]
                edge = min(1.0, max(0.0, near) * 2.5)
                lift = 0.5 - 0.5 * away_y  # they hang from above
    out.height[y, x] = np.float32(min(1.0, max(0.0, 0.55 * tint + 0.45 * min(1.0, max(0.0, lift)))))
    out.tint[y, x] = np.float32(tint)
    out.edge[y, x] = np.float32(edge)
