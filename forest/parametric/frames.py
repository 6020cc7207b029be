"""Frames of three axes, turned in place: the rotations that a stem is made of.

A frame is a float64 (9,): the unit vectors x, y, z one after the other, in the tree's
coordinates; z runs along the stem. Turns are right-handed, angles in radians.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import njit


@njit
def _mix(f: Any, a: Any, b: Any, angle: Any) -> None:
    """Turn axis a towards axis b, and b away from a."""
    c, s = np.cos(angle), np.sin(angle)
    for k in range(3):
        u, v = f[a + k], f[b + k]
        f[a + k] = c * u + s * v
        f[b + k] = c * v - s * u


@njit
def turn_x(f: Any, angle: Any) -> None:
    """Turn about the frame's x: z leans towards -y."""
    _mix(f, np.int64(3), np.int64(6), angle)


@njit
def turn_y(f: Any, angle: Any) -> None:
    """Turn about the frame's y: z leans towards x."""
    _mix(f, np.int64(6), np.int64(0), angle)


@njit
def turn_z(f: Any, angle: Any) -> None:
    """Turn about the frame's z: x moves towards y."""
    _mix(f, np.int64(0), np.int64(3), angle)


@njit
def turn_about(f: Any, u: Any, v: Any, w: Any, angle: Any, size: Any) -> None:
    """Turn `size` numbers of f, vectors one after the other, about the unit vector (u, v, w)."""
    c, s = np.cos(angle), np.sin(angle)
    for k in range(0, size, 3):
        x, y, z = f[k], f[k + 1], f[k + 2]
        along = (u * x + v * y + w * z) * (1.0 - c)
        f[k] = x * c + (v * z - w * y) * s + u * along
        f[k + 1] = y * c + (w * x - u * z) * s + v * along
        f[k + 2] = z * c + (u * y - v * x) * s + w * along


@njit
def copy(to: Any, source: Any) -> None:
    """Set `to` to `source`, number by number: an assignment of slices would make an array."""
    for k in range(len(to)):
        to[k] = source[k]


@njit
def load_frame(f: Any, side: Any, heading: Any, row: Any) -> None:
    """Set f from a side (its x) and a heading (its z); y is z cross x."""
    for k in range(3):
        f[k] = side[row, k]
        f[6 + k] = heading[row, k]
    f[3] = f[7] * f[2] - f[8] * f[1]
    f[4] = f[8] * f[0] - f[6] * f[2]
    f[5] = f[6] * f[1] - f[7] * f[0]


@njit
def declination(f: Any) -> Any:
    """Angle of the frame's z from the vertical (4.2)."""
    return np.arccos(min(1.0, max(-1.0, f[8])))
