"""User-drawn curves, piecewise linear: Taylor-Hell 2005, section 3.1."""

from __future__ import annotations

from forest._jit import njit


@njit
def curve(curve_n, curve_x, curve_y, species, which, x):  # type: ignore[no-untyped-def]
    """Value of a species' curve at x: linear between its points, constant outside; 1 if absent."""
    n = curve_n[species, which]
    if n == 0:
        return 1.0
    xs = curve_x[species, which]
    ys = curve_y[species, which]
    if x <= xs[0]:
        return ys[0]
    for k in range(1, n):
        if x <= xs[k]:
            return ys[k - 1] + (ys[k] - ys[k - 1]) * (x - xs[k - 1]) / (xs[k] - xs[k - 1])
    return ys[n - 1]
