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


@njit
def symmetric_inverse(xx, xy, xz, yy, yz, zz):  # type: ignore[no-untyped-def]
    """Invert a symmetric 3 x 3 matrix; tell whether it is positive definite."""
    cxx = yy * zz - yz * yz
    cxy = xz * yz - xy * zz
    cxz = xy * yz - xz * yy
    det = xx * cxx + xy * cxy + xz * cxz
    minor = xx * yy - xy * xy
    sound = xx > 0.0 and minor > 0.0 and det > 0.0
    r = 1.0 / det
    inverse = (
        cxx * r,
        cxy * r,
        cxz * r,
        (xx * zz - xz * xz) * r,
        (xy * xz - xx * yz) * r,
        minor * r,
    )
    return inverse, sound


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
        a = 0.5 - q / 24.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0)))
        b = (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0)))) / 6.0
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
        Multiple of the rigidity that is added to the stiffness.

    Returns
    -------
    bool
        Whether the stiffness is positive definite; if not, the scan stopped.
    """
    n = len(tree.parent)
    if part != 0.0:
        for i in range(n):
            for k in range(3):
                work[i, TURN + k] += part * work[i, STEP + k]
    for i in range(n - 1, -1, -1):
        if not _eliminate(tree, work, i, 1.0 + stiffer):
            for j in range(n):
                for k in range(3):
                    work[j, STEP + k] = 0.0
            return False
    return True


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
    seat = cross(f, h)
    half = (
        0.5 * (t[0] * h[0] + t[1] * c[0] + t[2] * u[0]),
        0.5 * (t[0] * h[1] + t[1] * c[1] + t[2] * u[1]),
        0.5 * (t[0] * h[2] + t[1] * c[2] + t[2] * u[2]),
    )
    finite = _finite_turn(half, seat, beyond)
    r = 1.0 / length
    wh = np.float64(tree.rigidity[i, 0]) * r
    wl = np.float64(tree.rigidity[i, 1]) * r
    wu = np.float64(tree.rigidity[i, 2]) * r
    eh = wh * (t[0] - np.float64(tree.rest[i, 0]) * length)
    el = wl * (t[1] - np.float64(tree.rest[i, 1]) * length)
    eu = wu * (t[2] - np.float64(tree.rest[i, 2]) * length)
    o = LEFT_OVER
    left = (work[i, o], work[i, o + 1], work[i, o + 2])
    gx = eh * h[0] + el * c[0] + eu * u[0] + finite[0] + 0.5 * seat[0] + left[0]
    gy = eh * h[1] + el * c[1] + eu * u[1] + finite[1] + 0.5 * seat[1] + left[1]
    gz = eh * h[2] + el * c[2] + eu * u[2] + finite[2] + 0.5 * seat[2] + left[2]

    # P of the pull, A of what lies beyond, S = W + P/4 + A
    fh = f[0] * h[0] + f[1] * h[1] + f[2] * h[2]
    pxx = fh - f[0] * h[0]
    pyy = fh - f[1] * h[1]
    pzz = fh - f[2] * h[2]
    pxy = -0.5 * (f[0] * h[1] + f[1] * h[0])
    pxz = -0.5 * (f[0] * h[2] + f[2] * h[0])
    pyz = -0.5 * (f[1] * h[2] + f[2] * h[1])
    a = PULL
    axx, axy, axz = work[i, a], work[i, a + 1], work[i, a + 2]
    ayy, ayz, azz = work[i, a + 3], work[i, a + 4], work[i, a + 5]
    wu *= stiff
    wh = wh * stiff - wu
    wl = wl * stiff - wu
    s, sound = symmetric_inverse(
        wu + wh * h[0] * h[0] + wl * c[0] * c[0] + 0.25 * pxx + axx,
        wh * h[0] * h[1] + wl * c[0] * c[1] + 0.25 * pxy + axy,
        wh * h[0] * h[2] + wl * c[0] * c[2] + 0.25 * pxz + axz,
        wu + wh * h[1] * h[1] + wl * c[1] * c[1] + 0.25 * pyy + ayy,
        wh * h[1] * h[2] + wl * c[1] * c[2] + 0.25 * pyz + ayz,
        wu + wh * h[2] * h[2] + wl * c[2] * c[2] + 0.25 * pzz + azz,
    )
    if not sound:
        return False

    # columns of C = P/2 + A + [G]/2, then D = S^-1 C
    mx = 0.5 * beyond[0] + 0.25 * seat[0]
    my = 0.5 * beyond[1] + 0.25 * seat[1]
    mz = 0.5 * beyond[2] + 0.25 * seat[2]
    cx = (0.5 * pxx + axx, 0.5 * pxy + axy + mz, 0.5 * pxz + axz - my)
    cy = (0.5 * pxy + axy - mz, 0.5 * pyy + ayy, 0.5 * pyz + ayz + mx)
    cz = (0.5 * pxz + axz + my, 0.5 * pyz + ayz - mx, 0.5 * pzz + azz)
    g = times(s, (gx, gy, gz))
    dx = times(s, cx)
    dy = times(s, cy)
    dz = times(s, cz)
    for k in range(3):
        work[i, STEP + k] = g[k]
        work[i, a + 3 * k] = dx[k]
        work[i, a + 3 * k + 1] = dy[k]
        work[i, a + 3 * k + 2] = dz[k]
    p = tree.parent[i]
    if p >= 0:
        work[p, a] += pxx + axx - _dot(cx, dx)
        work[p, a + 1] += pxy + axy - _dot(cx, dy)
        work[p, a + 2] += pxz + axz - _dot(cx, dz)
        work[p, a + 3] += pyy + ayy - _dot(cy, dy)
        work[p, a + 4] += pyz + ayz - _dot(cy, dz)
        work[p, a + 5] += pzz + azz - _dot(cz, dz)
        work[p, o] += seat[0] + left[0] - _dot(cx, g)
        work[p, o + 1] += seat[1] + left[1] - _dot(cy, g)
        work[p, o + 2] += seat[2] + left[2] - _dot(cz, g)
        for k in range(3):
            work[p, MOMENT + k] += seat[k] + beyond[k]
    return True


@njit
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
