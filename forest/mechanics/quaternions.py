"""Rotations as unit quaternions (w, x, y, z), in tuples that live in registers.

A quaternion q turns a vector v to q v q^-1 and holds a frame H, L, U: its first axis is the heading
H, its second L, its third U (Taylor-Hell 2005, section 4; section 5.1 prints the inverse product).
"""

from __future__ import annotations

import numpy as np

from forest._jit import njit


@njit
def product(a, b):  # type: ignore[no-untyped-def]
    """The rotation b followed, in the frame that b is given in, by a: the matrix product A B."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@njit
def inverse(q):  # type: ignore[no-untyped-def]
    """The inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@njit
def unit(q):  # type: ignore[no-untyped-def]
    """Take a rounding error off the length of an almost unit quaternion."""
    scale = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


@njit
def turn(x, y, z):  # type: ignore[no-untyped-def]
    """The rotation about (x, y, z) by its length in rad (Taylor-Hell 2005, eq. 10)."""
    half = 0.25 * (x * x + y * y + z * z)
    if half < 0.02:  # the next terms are below 1e-16; powers of half over factorials
        c = 1.0 + half * (-1 / 2 + half * (1 / 24 + half * (-1 / 720 + half * (1 / 40320))))
        s = 1.0 + half * (-1 / 6 + half * (1 / 120 + half * (-1 / 5040 + half * (1 / 362880))))
    else:
        angle = np.sqrt(half)
        c = np.cos(angle)
        s = np.sin(angle) / angle
    s *= 0.5
    return c, s * x, s * y, s * z


@njit
def rotated(q, v):  # type: ignore[no-untyped-def]
    """The vector q v q^-1."""
    x = 2.0 * (q[2] * v[2] - q[3] * v[1])
    y = 2.0 * (q[3] * v[0] - q[1] * v[2])
    z = 2.0 * (q[1] * v[1] - q[2] * v[0])
    return (
        v[0] + q[0] * x + q[2] * z - q[3] * y,
        v[1] + q[0] * y + q[3] * x - q[1] * z,
        v[2] + q[0] * z + q[1] * y - q[2] * x,
    )


@njit
def heading(q):  # type: ignore[no-untyped-def]
    """The first axis H of the frame q."""
    return (
        1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]),
        2.0 * (q[1] * q[2] + q[0] * q[3]),
        2.0 * (q[1] * q[3] - q[0] * q[2]),
    )


@njit
def side(q):  # type: ignore[no-untyped-def]
    """The second axis L of the frame q."""
    return (
        2.0 * (q[1] * q[2] - q[0] * q[3]),
        1.0 - 2.0 * (q[1] * q[1] + q[3] * q[3]),
        2.0 * (q[2] * q[3] + q[0] * q[1]),
    )


@njit
def cross(a, b):  # type: ignore[no-untyped-def]
    """The vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit
def between(a, b):  # type: ignore[no-untyped-def]
    """The smallest rotation that takes the unit vector a to b; about any axis if they oppose."""
    x, y, z = cross(a, b)
    w = 1.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    norm = np.sqrt(w * w + x * x + y * y + z * z)
    if norm > 1e-7:
        return w / norm, x / norm, y / norm, z / norm
    if abs(a[0]) < 0.7:
        norm = np.sqrt(a[1] * a[1] + a[2] * a[2])
        return 0.0, 0.0, a[2] / norm, -a[1] / norm
    norm = np.sqrt(a[0] * a[0] + a[1] * a[1])
    return 0.0, a[1] / norm, -a[0] / norm, 0.0
