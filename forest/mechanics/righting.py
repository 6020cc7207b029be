"""Reaction wood: which axes right themselves, and how the ring that does it differs.

Two ways. `BETA` is printed (Taylor-Hell 2005, section 6.2): a metamer that its load bends away
from its rest curvature lays an elliptical ring that prefers the rest curvature. It slows a lean and
cannot right a straight tilted stem. `STRAIN` does: a metamer whose heading departs from the angle
that it seeks lays a ring that contracts or expands more on one side as it matures (Fournier,
Bailleres and Chanson 1994), and so bends the rest shape back.

A reaction is a strength, 0 to 1, and a turn: the components along L and U of the unit rotation
vector that leads back.
"""

from __future__ import annotations

import math

import numpy as np

from forest._jit import njit

# Ways of righting. Not plain numbers: numba compiles a kernel anew for each of those.
NONE = np.int64(0)
BETA = np.int64(1)
STRAIN = np.int64(2)

# Gauss-Legendre nodes and weights on [-1, 1], five points.
_NODE_1 = 0.5384693101056831
_NODE_2 = 0.906179845938664
_WEIGHT_0 = 0.5688888888888889
_WEIGHT_1 = 0.47862867049936647
_WEIGHT_2 = 0.23692688505618908


@njit
def answer_to_deviation(curvature, rest, limit):  # type: ignore[no-untyped-def]
    """Find the reaction of a metamer that its load has bent (Taylor-Hell 2005, 6.2).

    The equilibrium position is the rest curvature. Twist does not count: no side of a ring
    answers it.

    Parameters
    ----------
    curvature, rest : float32 (3,)
        About H, L, U, rad/m.
    limit : float
        Deviation that triggers reaction wood, rad/m (xi).

    Returns
    -------
    strength, turn_l, turn_u : float
        1 or 0; unit rotation vector from the curvature to the rest curvature.
    """
    about_l = np.float64(rest[1]) - np.float64(curvature[1])
    about_u = np.float64(rest[2]) - np.float64(curvature[2])
    deviation = math.sqrt(about_l * about_l + about_u * about_u)
    if deviation <= limit or deviation == 0.0:
        return 0.0, 0.0, 0.0
    return 1.0, about_l / deviation, about_u / deviation


@njit
def answer_to_lean(frame, sought, limit, span):  # type: ignore[no-untyped-def]
    """Find the reaction of a metamer whose heading is not where it seeks to be.

    It turns in the vertical plane through its heading: up where it leans more than it seeks,
    down where less. The strength rises over `span`, so that an axis that comes home stops.

    Parameters
    ----------
    frame : float32 (4,)
        Unit quaternion, world from body.
    sought, limit, span : float
        Angle to the vertical that it seeks; departure at which reaction sets in; departure
        beyond that at which it is full; rad.

    Returns
    -------
    strength, turn_l, turn_u : float
        0 to 1; unit rotation vector, H x up or its opposite.
    """
    w, x = np.float64(frame[0]), np.float64(frame[1])
    y, z = np.float64(frame[2]), np.float64(frame[3])
    up_h = 2.0 * (x * z - w * y)
    up_l = 2.0 * (y * z + w * x)
    up_u = 1.0 - 2.0 * (x * x + y * y)
    across = math.sqrt(up_l * up_l + up_u * up_u)
    if across < 1e-6:  # upright or hanging straight down: no plane to turn in
        return 0.0, 0.0, 0.0
    excess = math.atan2(across, up_h) - sought
    strength = min(max((abs(excess) - limit) / span, 0.0), 1.0)
    way = 1.0 if excess > 0.0 else -1.0
    return strength, -way * up_u / across, way * up_l / across


@njit
def thick_side(turn_l, turn_u, conifer):  # type: ignore[no-untyped-def]
    """Tell on which side a reaction ring is thick.

    Tension wood pulls on the side to which the axis turns; compression wood pushes on the other.

    Returns
    -------
    float
        Angle about H from L towards U, rad, in (-pi, pi].
    """
    if conifer:
        return math.atan2(turn_l, -turn_u)
    return math.atan2(-turn_l, turn_u)


@njit
def strained_turn(inner, outer, core, modulus, strain):  # type: ignore[no-untyped-def]
    """Give the curvature by which a maturing ring bends a round stem.

    Each thin layer of radius r that matures bends what is there already: its moment is
    pi E strain r^2 dr, and the rigidity is the core's and that of the layers before it. With equal
    moduli this sums to 4 strain (1/R1 - 1/R2), in however many rings it is laid. A layer
    e0 + (D/2) cos theta of width dr (1 + e cos theta) has strain = D/2 + e0 e. The shift of the
    neutral axis by an eccentric ring is of second order and left out.

    Parameters
    ----------
    inner, outer : float
        R1 > 0 and R2, m.
    core : float
        Rigidity of the wood inside R1, N m2.
    modulus : float
        Young's modulus of the ring, Pa.
    strain : float
        Amplitude of the maturation strain's first harmonic, weighted by width.

    Returns
    -------
    float
        Curvature, rad/m.
    """
    # With u = 1/r the integrand is flat where the moduli are equal, and smooth elsewhere.
    low, high = 1.0 / outer, 1.0 / inner
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    own = 0.25 * math.pi * modulus
    other = core - own * inner**4
    total = _WEIGHT_0 / (own + other * middle**4)
    total += _WEIGHT_1 / (own + other * (middle - half * _NODE_1) ** 4)
    total += _WEIGHT_1 / (own + other * (middle + half * _NODE_1) ** 4)
    total += _WEIGHT_2 / (own + other * (middle - half * _NODE_2) ** 4)
    total += _WEIGHT_2 / (own + other * (middle + half * _NODE_2) ** 4)
    return math.pi * modulus * strain * half * total
