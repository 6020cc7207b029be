"""Bending stresses in a stem: under what hangs on it while it leans, and in the wind.

The wind follows the usual profile of a closed stand: logarithmic above the canopy, exponential
within it (Cionco 1965); the less so, the more open the stand is. Crowns give way as it grows
(Mayhead 1973; Peltola et al. 1999).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.mechanics.stems import GRAVITY

#: Density of air at 10 degrees Celsius and sea level, kg/m3.
AIR_DENSITY = 1.25
#: Zero-plane displacement and roughness length of a closed canopy, shares of its height.
DISPLACEMENT = 2.0 / 3.0
ROUGHNESS = 0.1
#: Attenuation of the wind within the canopy; about 2 in closed stands.
ATTENUATION = 2.0
#: Projected area of leaves of all directions, as a share of their area (Cauchy's theorem).
PROJECTION = 0.5


class Wind(NamedTuple):
    """A wind over a stand.

    Attributes
    ----------
    speed : float64 (trees,)
        At the top of the canopy, m/s, for each row of the tree table.
    canopy_height : float
        m, more than 0.
    azimuth : float
        Direction towards which it blows, rad from x to y.
    attenuation : float64 (trees,)
        How fast it falls below the canopy's top around each tree; `ATTENUATION` in closed stands.
    """

    speed: NDArray[np.float64]
    canopy_height: float
    azimuth: float
    attenuation: NDArray[np.float64]


@njit
def wind_profile(height, canopy_height, attenuation):  # type: ignore[no-untyped-def]
    """Wind at a height as a share of that at the canopy's top.

    ln((z - d) / z0) / ln((h - d) / z0) above the top, exp(-a (1 - z / h)) below it.
    """
    relative = height / canopy_height
    if relative < 1.0:
        return np.exp(-attenuation * (1.0 - relative))
    above = np.log((relative - DISPLACEMENT) / ROUGHNESS)
    return above / np.log((1.0 - DISPLACEMENT) / ROUGHNESS)


@njit
def streamlining(speed):  # type: ignore[no-untyped-def]
    """The share of a crown's area that faces a wind of `speed` m/s.

    10 / u - 0.1 between 11 and 20 m/s, constant outside (Peltola et al. 1999, after the tunnel
    measurements of Mayhead 1973).
    """
    return 10.0 / min(max(speed, 11.0), 20.0) - 0.1


@njit
def wind_forces(height, crown_area, speed, profile, drag, force):  # type: ignore[no-untyped-def]
    """Fill the force of the wind on the crown at each station, F = rho/2 C_d S(u) A u^2.

    Parameters
    ----------
    height : float64 (k,)
        Mean height of the leaves that hang at the station, m: there the force acts.
    crown_area : float64 (k,)
        Their area projected against the wind, m2; leaves do not shelter each other here.
    speed : float
        Wind at the canopy's top, m/s.
    profile : (float, float)
        Height of the canopy's top, m; attenuation below it.
    drag : float
        Drag coefficient C_d.
    force : float64 (k,)
        Filled, N.
    """
    canopy_height, attenuation = profile
    for k in range(len(height)):
        u = speed * wind_profile(height[k], canopy_height, attenuation)
        force[k] = 0.5 * AIR_DENSITY * drag * streamlining(u) * crown_area[k] * u * u


@njit
def bending_moments(stem, tip, force, along_x, along_y, moment):  # type: ignore[no-untyped-def]
    """Fill the bending moment at the lower end of each station; one backward scan.

    Weight acts at the centres of mass of internodes and loads; the wind at the height of the
    leaves, straight above the section (it does not twist the stem). What turns about the stem's own
    direction is torsion, not bending, and is left out.

    Parameters
    ----------
    stem : Stem
        k stations.
    tip : float32 (n, 3)
        Upper ends of the tree's metamers relative to its base, m.
    force : float64 (k,)
        Of the wind, N.
    along_x, along_y : float
        Unit vector in which the wind blows.
    moment : float64 (k,)
        Filled, N m.
    """
    mass = 0.0
    mass_x = 0.0
    mass_y = 0.0
    wind = 0.0
    wind_z = 0.0
    x = y = z = 0.0
    for k in range(len(moment) - 1, -1, -1):
        i = stem.metamer[k]
        hx = np.float64(tip[i, 0])
        hy = np.float64(tip[i, 1])
        hz = np.float64(tip[i, 2])
        x = y = z = 0.0
        if k > 0:
            below = stem.metamer[k - 1]
            x = np.float64(tip[below, 0])
            y = np.float64(tip[below, 1])
            z = np.float64(tip[below, 2])
        wood = stem.wood[k]
        mass += wood + stem.load[k]
        mass_x += wood * 0.5 * (hx + x) + stem.load_x[k]
        mass_y += wood * 0.5 * (hy + y) + stem.load_y[k]
        wind += force[k]
        wind_z += force[k] * stem.leaf_height[k]
        tilt = wind_z - wind * z
        tilt_x = GRAVITY * (mass_x - mass * x) + along_x * tilt
        tilt_y = GRAVITY * (mass_y - mass * y) + along_y * tilt
        # The moment is up x tilt; its part along the internode twists.
        span = (hx - x) ** 2 + (hy - y) ** 2 + (hz - z) ** 2
        twist = tilt_x * (hy - y) - tilt_y * (hx - x)
        square = tilt_x**2 + tilt_y**2
        if span > 0.0:
            square -= twist**2 / span
        moment[k] = np.sqrt(max(square, 0.0))


@njit
def largest_stress(stem, moment):  # type: ignore[no-untyped-def]
    """The largest bending stress, sigma = M r / I = 4 M / (pi r^3), Pa, and its station."""
    worst = 0.0
    where = 0
    for k in range(len(moment)):
        stress = 4.0 * moment[k] / (np.pi * stem.radius[k] ** 3)
        if stress > worst:
            worst = stress
            where = k
    return worst, where
