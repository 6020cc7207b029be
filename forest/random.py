"""Random numbers that are a pure function of where they are used.

A draw is named by (seed, stream, tree id, metamer serial, year); it depends neither on the
order of evaluation nor on the number of threads, and a resumed run draws the same numbers.
The generator is Philox4x32-10 (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3").
"""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import njit

# Streams: one per use, so that a new use never shifts the numbers of an old one.
STREAM_PLACE = 1
STREAM_VIGOUR = 2
STREAM_PHYLLOTAXIS = 3
STREAM_SHOOT = 4
STREAM_ABORT = 5
STREAM_FATE = 6
STREAM_CLIMATE = 7
STREAM_SPECIES = 8
STREAM_MARKER = 9
STREAM_LIGHT = 10
STREAM_CORE = 12
STREAM_MAST = 13
STREAM_GERMINATION = 14
STREAM_MOTHER = 15
STREAM_SEEDLING = 16
STREAM_ROOM = 17
STREAM_RECRUIT = 18
STREAM_SPROUT = 19
STREAM_DEATH = 20
STREAM_DISTURBANCE = 21
STREAM_SNAG = 22
STREAM_THINNING = 23
STREAM_NURSERY = 26
STREAM_STORM = 27
STREAM_PARAMETRIC = 28
STREAM_SCENERY = 29
STREAM_GRASS = 30
STREAM_BARK_FLOW = 31
STREAM_BARK = 33
STREAM_DRESSING = 34
STREAM_BRUSH = 35

_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint64(0x9E3779B9)
_W1 = np.uint64(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_SHIFT = np.uint64(32)


@njit
def philox(c0: Any, c1: Any, c2: Any, c3: Any, k0: Any, k1: Any) -> Any:
    """Encrypt a 128-bit counter with a 64-bit key: ten rounds of Philox4x32.

    All arguments are taken modulo 2**32; returns four uint64 that hold 32 random bits each.
    """
    x0 = np.uint64(c0) & _LOW
    x1 = np.uint64(c1) & _LOW
    x2 = np.uint64(c2) & _LOW
    x3 = np.uint64(c3) & _LOW
    y0 = np.uint64(k0) & _LOW
    y1 = np.uint64(k1) & _LOW
    for _ in range(10):
        p0 = _M0 * x0
        p1 = _M1 * x2
        n0 = (p1 >> _SHIFT) ^ x1 ^ y0
        n2 = (p0 >> _SHIFT) ^ x3 ^ y1
        x1 = p1 & _LOW
        x3 = p0 & _LOW
        x0 = n0
        x2 = n2
        y0 = (y0 + _W0) & _LOW
        y1 = (y1 + _W1) & _LOW
    return x0, x1, x2, x3


@njit
def uniforms(seed: Any, stream: Any, tree_id: Any, serial: Any, year: Any) -> Any:
    """Draw four numbers, uniform in (0, 1), for one place and year."""
    a, b, c, d = philox(tree_id, serial, year, stream, seed, np.uint64(seed) >> _SHIFT)
    scale = 1.0 / 4294967296.0
    return (
        (np.float64(a) + 0.5) * scale,
        (np.float64(b) + 0.5) * scale,
        (np.float64(c) + 0.5) * scale,
        (np.float64(d) + 0.5) * scale,
    )


@njit
def normals(seed: Any, stream: Any, tree_id: Any, serial: Any, year: Any) -> Any:
    """Draw two independent standard normal numbers (Box and Muller 1958)."""
    a, b, _, _ = uniforms(seed, stream, tree_id, serial, year)
    radius = np.sqrt(-2.0 * np.log(a))
    angle = 2.0 * np.pi * b
    return radius * np.cos(angle), radius * np.sin(angle)
