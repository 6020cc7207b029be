"""Stability of stems: self-buckling, the first bending frequency and stresses of every tree.

A stem is a column clamped at the ground, cut into pieces of constant rigidity: its internodes, or
parts of them. The slope of a buckled column obeys (E I theta')' + lambda g m theta = 0 with m the
mass above (Greenhill 1881); a sway, (E I w'')'' = omega^2 (rho A + loads) w. Both are solved by
inverse iteration: the inverse of the stiffness is a sum from the tip and a sum from the ground.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.dealing import FLOATS, INTEGERS, Workbench, deal
from forest.mechanics.stems import GRAVITY, NO_RIGIDITY, StemSpecies, stem_stations
from forest.mechanics.stress import (
    PROJECTION,
    Wind,
    bending_moments,
    largest_stress,
    wind_forces,
)
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: A column has at least so many pieces; long internodes are cut.
_PIECES = 64
#: Iteration ends when the eigenvalue changes by less than this share, or after so many rounds.
_TOLERANCE = 1e-10
_ROUNDS = 300


class Column(NamedTuple):
    """A column's pieces from the ground up; float64 arrays."""

    length: NDArray[np.float64]  # m
    compliance: NDArray[np.float64]  # 1 / (E I), 1/(N m2)
    wood: NDArray[np.float64]  # mass of the piece, kg
    load: NDArray[np.float64]  # mass at its upper end, kg


class Stability(NamedTuple):
    """Stability of trees: float64 arrays of one entry per row of the table; NaN without a stem."""

    safety_factor: NDArray[np.float64]  # buckling weight / weight
    critical_height_m: NDArray[np.float64]  # at which a stem of this shape would buckle
    frequency_hz: NDArray[np.float64]  # of the first bending mode
    stress_share: NDArray[np.float64]  # largest stress by own weight / modulus of rupture
    stress_height_m: NDArray[np.float64]  # where that is
    wind_stress_share: NDArray[np.float64]  # the same by own weight and wind
    wind_stress_height_m: NDArray[np.float64]
    base_moment_nm: NDArray[np.float64]  # bending moment at the ground by own weight and wind


@njit
def cut_column(stem):  # type: ignore[no-untyped-def]
    """Cut a stem into pieces: all internodes into equally many."""
    k = len(stem.length)
    cuts = max((_PIECES + k - 1) // k, 1)
    n = k * cuts
    column = Column(np.empty(n), np.empty(n), np.empty(n), np.zeros(n))
    j = 0
    for station in range(k):
        for _ in range(cuts):
            column.length[j] = stem.length[station] / cuts
            column.compliance[j] = 1.0 / stem.rigidity[station]
            column.wood[j] = stem.wood[station] / cuts
            j += 1
        column.load[j - 1] = stem.load[station]
    return column


@njit
def buckling_factor(column):  # type: ignore[no-untyped-def]
    """The factor on all weight at which a column buckles (Greenhill 1881).

    Minimizes the Rayleigh quotient of 1/2 E I theta'^2 to 1/2 g m theta^2 with slopes theta linear
    in each piece and m theta^2 by the trapezoidal rule: the error falls with the square of
    the pieces' length. Loads act at their node.
    """
    n = len(column.length)
    weight = np.empty(n)  # g m ds at the upper end of each piece
    above = 0.0
    half = 0.0
    for j in range(n - 1, -1, -1):
        above += column.load[j] + 0.5 * column.wood[j]
        here = 0.5 * GRAVITY * above * column.length[j]
        weight[j] = here + half
        half = here
        above += 0.5 * column.wood[j]
    slope = np.ones(n)
    push = np.empty(n)
    factor = 0.0
    for _ in range(_ROUNDS):
        moment = 0.0
        for j in range(n - 1, -1, -1):
            moment += weight[j] * slope[j]
            push[j] = moment
        turn = 0.0
        stiff = 0.0
        soft = 0.0
        for j in range(n):
            turn += push[j] * column.length[j] * column.compliance[j]
            stiff += weight[j] * slope[j] * turn
            soft += weight[j] * turn * turn
            slope[j] = turn
        before = factor
        factor = stiff / soft
        if abs(factor - before) <= _TOLERANCE * factor:
            break
        for j in range(n):
            slope[j] /= turn
    return factor


@njit
def bending_frequency(column):  # type: ignore[no-untyped-def]
    """The first bending frequency of a column, Hz (Stodola's iteration).

    A piece's mass acts by halves at its ends. Gravity's share in the stiffness is left out: it
    lowers the frequency by about sqrt(1 - 1 / safety factor).
    """
    n = len(column.length)
    mass = np.empty(n)
    half = 0.0
    for j in range(n - 1, -1, -1):
        mass[j] = column.load[j] + 0.5 * column.wood[j] + half
        half = 0.5 * column.wood[j]
    sway = np.ones(n)
    shear = np.empty(n)
    moment = np.empty(n)  # at the lower end of each piece
    square = 0.0
    for _ in range(_ROUNDS):
        force = 0.0
        bend = 0.0
        for j in range(n - 1, -1, -1):
            force += mass[j] * sway[j]
            bend += force * column.length[j]
            shear[j] = force
            moment[j] = bend
        slope = 0.0
        place = 0.0
        stiff = 0.0
        soft = 0.0
        for j in range(n):
            length = column.length[j]
            upper = moment[j] - shear[j] * length
            soften = column.compliance[j] * length
            place += slope * length + soften * length * (2.0 * moment[j] + upper) / 6.0
            slope += soften * 0.5 * (moment[j] + upper)
            stiff += mass[j] * sway[j] * place
            soft += mass[j] * place * place
            sway[j] = place
        before = square
        square = stiff / soft
        if abs(square - before) <= _TOLERANCE * square:
            break
        for j in range(n):
            sway[j] /= place
    return np.sqrt(square) / (2.0 * np.pi)


@njit
def _measure_stem(stem, tip, row, species, sp, wind, force, moment, out):  # type: ignore[no-untyped-def]
    """Fill a tree's row of `out`; `force` and `moment` are scratch of one entry per station."""
    column = cut_column(stem)
    factor = buckling_factor(column)
    out.safety_factor[row] = factor
    top = stem.metamer[len(stem.metamer) - 1]
    out.critical_height_m[row] = np.float64(tip[top, 2]) * factor ** (1.0 / 3.0)
    out.frequency_hz[row] = bending_frequency(column)
    along_x = np.cos(wind.azimuth)
    along_y = np.sin(wind.azimuth)
    force[:] = 0.0
    bending_moments(stem, tip, force, along_x, along_y, moment)
    stress, where = largest_stress(stem, moment)
    out.stress_share[row] = stress / species.rupture[sp]
    out.stress_height_m[row] = _foot(stem, tip, where)
    if wind.speed[row] > 0.0:
        area = moment  # needed no longer
        for k in range(len(area)):
            area[k] = PROJECTION * stem.leaf_area[k]
        profile = (wind.canopy_height, wind.attenuation[row])
        wind_forces(stem.leaf_height, area, wind.speed[row], profile, species.drag[sp], force)
        bending_moments(stem, tip, force, along_x, along_y, moment)
        stress, where = largest_stress(stem, moment)
    out.wind_stress_share[row] = stress / species.rupture[sp]
    out.wind_stress_height_m[row] = _foot(stem, tip, where)
    out.base_moment_nm[row] = moment[0]


@njit
def _foot(stem, tip, station):  # type: ignore[no-untyped-def]
    """Height of the lower end of a station, m."""
    return np.float64(tip[stem.metamer[station - 1], 2]) if station > 0 else 0.0


@driver
def measure_stability(first, step, arena, trees, shared, scratch, species, rigidity, wind, out):  # type: ignore[no-untyped-def]
    """Fill `out` for every tree that has a metamer (see `stability`)."""
    for b in range(first, len(shared.place) - 1, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            n = np.int64(trees.size[row])
            if n == 0:
                continue
            f = shared.place[b] * FLOATS
            i = shared.place[b] * INTEGERS
            work = scratch.floats[f : f + FLOATS * n].reshape((FLOATS, n))
            on_stem = scratch.integers[i : i + n]
            stem = stem_stations(arena, trees, row, species, rigidity, work, on_stem)
            s = trees.start[row]
            _measure_stem(
                stem,
                arena.tip[s : s + n],
                row,
                species,
                trees.species[row],
                wind,
                work[9][: len(stem.metamer)],
                work[10][: len(stem.metamer)],
                out,
            )


def calm(n: int) -> Wind:
    """No wind over `n` trees."""
    return Wind(np.zeros(n), 1.0, 0.0, np.zeros(n))


def stability(
    metamers: Metamers,
    trees: Trees,
    species: StemSpecies,
    wind: Wind | None = None,
    rigidity: NDArray[np.float32] = NO_RIGIDITY,
) -> Stability:
    """Measure how safely every tree of the table stands.

    Parameters
    ----------
    metamers, trees : Metamers, Trees
        Arena and tree table of n rows.
    species : StemSpecies
        One entry per species.
    wind : Wind, optional
        Calm without it.
    rigidity : float32 array (metamers, 3)
        Rigidities of the rods (G J, E I, E I), N m2; without them E is constant.

    Returns
    -------
    Stability
        n entries each.

    Notes
    -----
    The *safety factor* multiplies all weight, of wood and of crown; the *critical height* is the
    stem's height times its cube root, since at equal diameters, and a crown that grows with the
    stem, the load that a column bears falls with the square of its length while its weight
    grows with it (Greenhill 1881). The wind's sway adds no overhang here.
    """
    n = len(trees.tree_id)
    out = Stability(*(np.full(n, np.nan) for _ in Stability._fields))
    shared = deal(trees.size)
    scratch = Workbench().scratch(shared)
    blowing = wind if wind is not None else calm(n)
    in_threads(measure_stability, metamers, trees, shared, scratch, species, rigidity, blowing, out)
    return out
