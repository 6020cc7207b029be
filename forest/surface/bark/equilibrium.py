"""The equilibrium of a ring of stiff epidermis and soft fractures (Lefebvre and Neyret 3.2.2, 5.1).

Vertices are numbered around the ring; element i lies between vertices i and i + 1, the last one
between the last vertex and the first, a girth farther on. A vertex at x is pulled by the element
before it, by the one after it, and by the spring that ties it to its place a on the substrate:

    - K[i-1] (x[i] - x[i-1] - l[i-1]) + K[i] (x[i+1] - x[i] - l[i]) - Ka[i] (x[i] - a[i]) = 0

Forces are per metre of strip width at the strip's mean, so that the figures do not hang on how
finely an axis is cut into strips.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit


@njit
def solve_ring(stiffness: Any, rest: Any, grip: Any, anchor: Any, girth: Any, x: Any) -> None:
    """Write the vertices at equilibrium into `x`.

    Without grip the tension is the same all around: it follows from the girth alone, and the ring
    lies where weak springs (weighed by `rest`, as grip is) would hold it. With grip the cyclic
    tridiagonal system is solved by elimination: the last vertex is put aside, the others found as
    y + u z for its displacement u, and its own equation gives u.
    """
    n = len(stiffness)
    gripped = False
    for i in range(n):
        gripped = gripped or grip[i] > 0.0
    if not gripped:
        _even_tension(stiffness, rest, anchor, girth, x)
        return
    # Unknowns are displacements from the anchors: their right-hand sides do not cancel digits.
    last = n - 1
    load = np.empty(n)  # K (s - l) of element i, s the substrate's length below it
    for i in range(n):
        below = anchor[i + 1] - anchor[i] if i < last else anchor[0] + girth - anchor[last]
        load[i] = stiffness[i] * (below - rest[i])
    y = np.empty(n)
    z = np.empty(n)
    upper = np.empty(n)
    for i in range(last):
        before = stiffness[i - 1] if i > 0 else stiffness[last]
        diagonal = before + stiffness[i] + grip[i]
        right = load[i] - (load[i - 1] if i > 0 else load[last])
        border = 0.0  # what the last vertex pulls
        if i == 0:
            border += before
        if i == last - 1:
            border += stiffness[i]
        if i > 0:
            diagonal -= before * upper[i - 1]
            right += before * y[i - 1]
            border += before * z[i - 1]
        upper[i] = stiffness[i] / diagonal
        y[i] = right / diagonal
        z[i] = border / diagonal
    for i in range(last - 2, -1, -1):
        y[i] += upper[i] * y[i + 1]
        z[i] += upper[i] * z[i + 1]
    if n == 1:  # one vertex: its element closes on itself and pulls both ways
        x[0] = anchor[0]
        return
    before = stiffness[last - 1]
    after = stiffness[last]
    pulled = load[last] - load[last - 1] + before * y[last - 1] + after * y[0]
    u = pulled / (before + after + grip[last] - before * z[last - 1] - after * z[0])
    for i in range(last):
        x[i] = anchor[i] + y[i] + u * z[i]
    x[last] = anchor[last] + u


@njit
def _even_tension(stiffness: Any, rest: Any, anchor: Any, girth: Any, x: Any) -> None:
    """Place the vertices of a ring that nothing holds: one tension, no net displacement."""
    n = len(stiffness)
    own = 0.0
    compliance = 0.0
    for i in range(n):
        own += rest[i]
        compliance += 1.0 / stiffness[i]
    tension = (girth - own) / compliance
    at = 0.0
    moved = 0.0
    weights = 0.0
    for i in range(n):
        x[i] = at
        weight = rest[i] + (rest[i - 1] if i > 0 else rest[n - 1])
        moved += weight * (at - anchor[i])
        weights += weight
        at += rest[i] + tension / stiffness[i]
    shift = moved / weights
    for i in range(n):
        x[i] -= shift


def equilibrium(
    stiffness: NDArray[np.float64],
    rest: NDArray[np.float64],
    grip: NDArray[np.float64],
    anchor: NDArray[np.float64],
    girth: float,
) -> NDArray[np.float64]:
    """Find the vertices of a ring of elements at equilibrium.

    Parameters
    ----------
    stiffness, rest : float64 (n,)
        K and rest length (m) of element i, from vertex i to the next.
    grip, anchor : float64 (n,)
        Stiffness of the attachment of vertex i (K_a; all 0 for none) and its place a (m).
    girth : float
        Length of the ring, m.

    Returns
    -------
    float64 (n,)
        x of the vertices, m.
    """
    x = np.empty(len(stiffness))
    solve_ring(stiffness, rest, grip, anchor, float(girth), x)
    return x


def residual(
    stiffness: NDArray[np.float64],
    rest: NDArray[np.float64],
    grip: NDArray[np.float64],
    anchor: NDArray[np.float64],
    girth: float,
    x: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Give the force left over at every vertex (the equation above)."""
    width = np.diff(np.append(x, x[0] + girth))
    pull = stiffness * (width - rest)
    left: NDArray[np.float64] = pull - np.roll(pull, 1) - grip * (x - anchor)
    return left
