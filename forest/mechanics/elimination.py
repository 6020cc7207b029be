"""Newton's step for a tree of rods: stiffness and moments, eliminated from the tips to the base.

To second order a metamer's own turn d and its parent's swing s (both rotation vectors) cost

    d (W + P/4 + A) d / 2 + d (P/2 + A + [G]/2) s + s (P + A) s / 2 + g d + ...

where W is its rigidity per length, P the stiffness that the pull F gives to its segment (positive
where it hangs), A that of what lies beyond, G the moment of the loads and [G] its cross product
(finite turns do not commute). The best d is a linear function of s; put in, it leaves a stiffness
against s alone, which is added to the parent's A.
"""

from __future__ import annotations

import numpy as np

from forest._jit import njit
from forest.mechanics.quaternions import cross
from forest.mechanics.work import AXIS, FORCE, LEFT_OVER, MOMENT, PULL, SIDE, STEP, TURN

#: Times that a metamer's rigidity is doubled to make the stiffness positive definite.
_TRIES = np.int64(60)


@njit
def symmetric_inverse(m):  # type: ignore[no-untyped-def]
    """Invert a symmetric 3 x 3 matrix (xx, xy, xz, yy, yz, zz); tell if it is positive definite."""
    xx, xy, xz, yy, yz, zz = m
    ixx = yy * zz - yz * yz
    ixy = xz * yz - xy * zz
    ixz = xy * yz - xz * yy
    det = xx * ixx + xy * ixy + xz * ixz
    minor = xx * yy - xy * xy
    r = 1.0 / det
    iyy = (xx * zz - xz * xz) * r
    iyz = (xy * xz - xx * yz) * r
    inverse = (ixx * r, ixy * r, ixz * r, iyy, iyz, minor * r)
    return inverse, xx > 0.0 and minor > 0.0 and det > 0.0


@njit
def times(m, v):  # type: ignore[no-untyped-def]
    """A symmetric matrix (xx, xy, xz, yy, yz, zz) times a vector."""
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[1] * v[0] + m[3] * v[1] + m[4] * v[2],
        m[2] * v[0] + m[4] * v[1] + m[5] * v[2],
    )


@njit
def _finite_turn(h, seat, beyond):  # type: ignore[no-untyped-def]
    """What a finite turn 2 h adds to the moment at a metamer's middle.

    The rate of a rotation is not the rate of its vector (Jacobian of the exponential map). With
    it the moments are the exact gradient of the energy, at any curvature.
    """
    q = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
    if q < 0.04:
        a = 1 / 2 + q * (-1 / 24 + q * (1 / 720 + q * (-1 / 40320 + q * (1 / 3628800))))
        b = 1 / 6 + q * (-1 / 120 + q * (1 / 5040 + q * (-1 / 362880 + q * (1 / 39916800))))
    else:
        angle = np.sqrt(q)
        a = (1.0 - np.cos(angle)) / q
        b = (angle - np.sin(angle)) / (q * angle)
    u = cross(h, seat)
    x = seat[0] + 2.0 * beyond[0]
    y = seat[1] + 2.0 * beyond[1]
    z = seat[2] + 2.0 * beyond[2]
    v = cross(h, cross(h, (x, y, z)))
    return (
        0.5 * (a * u[0] + b * v[0]),
        0.5 * (a * u[1] + b * v[1]),
        0.5 * (a * u[2] + b * v[2]),
    )


@njit
def balance(tree, work, part, stiffer):  # type: ignore[no-untyped-def]
    """Find Newton's step; one backward scan. Afterwards STEP and PULL give it; see `work`.

    Parameters
    ----------
    part : float
        Part of the last STEP that was taken; it is added to TURN.
    stiffer : float
        Multiple of the rigidity that is added to the stiffness of all metamers.

    Returns
    -------
    bool
        Whether the stiffness is positive definite, that is, the tree stable. Where it is not,
        metamers are taken for stiffer than they are, so that the step leads downhill.
    """
    n = len(tree.parent)
    if part != 0.0:
        for i in range(n):
            for k in range(3):
                work[i, TURN + k] += part * work[i, STEP + k]
    stable = True
    for i in range(n - 1, -1, -1):
        if not _eliminate(tree, work, i, 1.0 + stiffer):
            stable = False
    return stable


@njit
def _outer(a, b):  # type: ignore[no-untyped-def]
    """The symmetric part of a b, twice."""
    return (
        2.0 * a[0] * b[0],
        a[0] * b[1] + a[1] * b[0],
        a[0] * b[2] + a[2] * b[0],
        2.0 * a[1] * b[1],
        a[1] * b[2] + a[2] * b[1],
        2.0 * a[2] * b[2],
    )


@njit
def _plus(a, x, b):  # type: ignore[no-untyped-def]
    """The symmetric matrix a + x b."""
    return (
        a[0] + x * b[0],
        a[1] + x * b[1],
        a[2] + x * b[2],
        a[3] + x * b[3],
        a[4] + x * b[4],
        a[5] + x * b[5],
    )


@njit
def _along(h, c, u, v):  # type: ignore[no-untyped-def]
    """The world vector of components v along H, L, U."""
    return (
        v[0] * h[0] + v[1] * c[0] + v[2] * u[0],
        v[0] * h[1] + v[1] * c[1] + v[2] * u[1],
        v[0] * h[2] + v[1] * c[2] + v[2] * u[2],
    )


@njit
def _firm_inverse(rigid, other, stiff):  # type: ignore[no-untyped-def]
    """Invert stiff * rigid + other, `rigid` doubled until that is positive definite.

    Returns the inverse and whether nothing had to be doubled.
    """
    inverse, sound = symmetric_inverse(_plus(other, stiff, rigid))
    tries = 0
    while not sound and tries < _TRIES:
        tries += 1
        stiff *= 2.0
        inverse, sound = symmetric_inverse(_plus(other, stiff, rigid))
    return inverse, tries == 0


@njit
def _eliminate(tree, work, i, stiff):  # type: ignore[no-untyped-def]
    """Eliminate metamer i: its step from its parent's swing, its stiffness into its parent's."""
    length = np.float64(tree.length[i])
    h = (work[i, AXIS], work[i, AXIS + 1], work[i, AXIS + 2])
    c = (work[i, SIDE], work[i, SIDE + 1], work[i, SIDE + 2])
    u = cross(h, c)
    f = (length * work[i, FORCE], length * work[i, FORCE + 1], length * work[i, FORCE + 2])
    t = (work[i, TURN], work[i, TURN + 1], work[i, TURN + 2])
    beyond = (work[i, MOMENT], work[i, MOMENT + 1], work[i, MOMENT + 2])
    o = LEFT_OVER
    left = (work[i, o], work[i, o + 1], work[i, o + 2])
    seat = cross(f, h)

    # W and the elastic moment; the moment of the loads and what lies beyond
    per_length = 1.0 / length
    wh = np.float64(tree.rigidity[i, 0]) * per_length
    wl = np.float64(tree.rigidity[i, 1]) * per_length
    wu = np.float64(tree.rigidity[i, 2]) * per_length
    rigid = (wu, 0.0, 0.0, wu, 0.0, wu)
    rigid = _plus(_plus(rigid, 0.5 * (wh - wu), _outer(h, h)), 0.5 * (wl - wu), _outer(c, c))
    strain = (
        wh * (t[0] - np.float64(tree.rest[i, 0]) * length),
        wl * (t[1] - np.float64(tree.rest[i, 1]) * length),
        wu * (t[2] - np.float64(tree.rest[i, 2]) * length),
    )
    elastic = _along(h, c, u, strain)
    finite = _finite_turn(_along(h, c, u, (0.5 * t[0], 0.5 * t[1], 0.5 * t[2])), seat, beyond)
    moment = (
        elastic[0] + finite[0] + 0.5 * seat[0] + left[0],
        elastic[1] + finite[1] + 0.5 * seat[1] + left[1],
        elastic[2] + finite[2] + 0.5 * seat[2] + left[2],
    )

    # P, A and the inverse of S = W + P/4 + A
    fh = _dot(f, h)
    pull = _plus((fh, 0.0, 0.0, fh, 0.0, fh), -0.5, _outer(f, h))
    a = PULL
    carried = (
        work[i, a],
        work[i, a + 1],
        work[i, a + 2],
        work[i, a + 3],
        work[i, a + 4],
        work[i, a + 5],
    )
    inverse, sound = _firm_inverse(rigid, _plus(carried, 0.25, pull), stiff)

    # columns of C = P/2 + A + [G]/2; the step is S^-1 (moment + C swing)
    both = _plus(carried, 0.5, pull)
    gx = 0.5 * beyond[0] + 0.25 * seat[0]
    gy = 0.5 * beyond[1] + 0.25 * seat[1]
    gz = 0.5 * beyond[2] + 0.25 * seat[2]
    cx = (both[0], both[1] + gz, both[2] - gy)
    cy = (both[1] - gz, both[3], both[4] + gx)
    cz = (both[2] + gy, both[4] - gx, both[5])
    own = times(inverse, moment)
    dx = times(inverse, cx)
    dy = times(inverse, cy)
    dz = times(inverse, cz)
    for k in range(3):
        work[i, STEP + k] = own[k]
        work[i, a + 3 * k] = dx[k]
        work[i, a + 3 * k + 1] = dy[k]
        work[i, a + 3 * k + 2] = dz[k]

    p = tree.parent[i]
    if p >= 0:
        passed = _plus(carried, 1.0, pull)
        work[p, a] += passed[0] - _dot(cx, dx)
        work[p, a + 1] += passed[1] - _dot(cx, dy)
        work[p, a + 2] += passed[2] - _dot(cx, dz)
        work[p, a + 3] += passed[3] - _dot(cy, dy)
        work[p, a + 4] += passed[4] - _dot(cy, dz)
        work[p, a + 5] += passed[5] - _dot(cz, dz)
        work[p, o] += seat[0] + left[0] - _dot(cx, own)
        work[p, o + 1] += seat[1] + left[1] - _dot(cy, own)
        work[p, o + 2] += seat[2] + left[2] - _dot(cz, own)
        for k in range(3):
            work[p, MOMENT + k] += seat[k] + beyond[k]
    return sound


@njit
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
