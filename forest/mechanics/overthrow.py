"""The winds that break a stem or turn its root plate over.

A storm's gusts load the crown with the mean wind's drag times `GUST`. The stem breaks where the
bending stress in its lower third reaches the modulus of rupture; the tree is uprooted when the
moment at the ground reaches what tree pulling found, a multiple of the fresh mass of the stem
(Gardiner et al. 2000).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.dealing import BINS, FLOATS, INTEGERS, Deal, Scratch
from forest.mechanics.momentum import LAYERS, layer_of, press
from forest.mechanics.stems import GRAVITY, StemSpecies, stem_stations
from forest.mechanics.stress import AIR_DENSITY, bending_moments
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: Moment in the strongest gust of a storm per that of its mean wind on a lone tree. Calibrated to
#: critical speeds of spruce stands (Gardiner et al. 2000); it stands for gusts and for sway.
GUST = 6.8
#: Winds beyond this one are not looked for, m/s.
STRONGEST = 100.0
#: Height at which a stem is judged, m, and the share of its height in a tree too low for it.
BREAST_HEIGHT, LOW = 1.3, 1.0 / 3.0
#: The least critical speed, m/s: of a tree that its own weight breaks or uproots where it stands,
#: which falls in the first storm of any strength.
CALM = 0.1
_HALVINGS = 24


class Blow(NamedTuple):
    """A wind that blows over a stand.

    Attributes
    ----------
    along_x, along_y : float
        Unit vector towards which it blows.
    canopy_height : float
        m.
    thick : float
        Height of a layer of the canopy, m.
    share : float64 (trees, LAYERS)
        Of leaves shown to it, as in `forest.mechanics.momentum.Crowns`.
    density : float64 (trees, LAYERS)
        Of the canopy around each tree, see `forest.mechanics.momentum.canopies`.
    edge, gusts : float64 (trees,)
        As in `forest.mechanics.fetch.Exposure`.
    """

    along_x: float
    along_y: float
    canopy_height: float
    thick: float
    share: NDArray[np.float64]
    density: NDArray[np.float64]
    edge: NDArray[np.float64]
    gusts: NDArray[np.float64]


class Critical(NamedTuple):
    """Speeds of a storm that a tree does not stand: float64 arrays of one entry per row, m/s.

    At the canopy's top; NaN where no wind up to `STRONGEST` does it, `CALM` where weight alone
    does.
    """

    breaks: NDArray[np.float64]
    uproots: NDArray[np.float64]


@njit
def add_sway(stem, rest, moment, aside):  # type: ignore[no-untyped-def]
    """Add the moment of the weight that the wind bends aside (as Peltola et al. 1999).

    The shape in which a stem stands is that in which it carries its weight; what the wind adds
    to its moments bends it further, theta' = (M - M_rest) / (E I), and its weight moves aside.
    Once: a stem as thin as to buckle under the weight that it carries would go on. No part leans
    beyond the horizontal.

    Parameters
    ----------
    stem : Stem
        k stations.
    rest : float64 (k,)
        Moment at the lower end of each station without wind, N m.
    moment : float64 (k,)
        That in the wind as long as the stem does not bend; added to.
    aside : float64 (k + 1,)
        Scratch.
    """
    n = len(rest)
    lean = 0.0
    aside[0] = 0.0
    for k in range(n):
        above = moment[k + 1] - rest[k + 1] if k + 1 < n else 0.0
        turn = 0.5 * (moment[k] - rest[k] + above) * stem.length[k] / stem.rigidity[k]
        middle = min(max(lean + 0.5 * turn, -0.5 * np.pi), 0.5 * np.pi)
        aside[k + 1] = aside[k] + np.sin(middle) * stem.length[k]
        lean += turn
    mass = 0.0
    reach = 0.0
    for k in range(n - 1, -1, -1):
        mass += stem.wood[k] + stem.load[k]
        reach += stem.wood[k] * 0.5 * (aside[k] + aside[k + 1]) + stem.load[k] * aside[k + 1]
        moment[k] += GRAVITY * (reach - mass * aside[k])


@njit
def breast_height(stem, tip):  # type: ignore[no-untyped-def]
    """The station that stands at breast height."""
    at = min(BREAST_HEIGHT, LOW * np.float64(tip[stem.metamer[len(stem.length) - 1], 2]))
    k = 0
    while k + 1 < len(stem.length) and np.float64(tip[stem.metamer[k], 2]) <= at:
        k += 1
    return k


@njit
def _strain(speed, stem, tip, loads, wind, rupture, anchor):  # type: ignore[no-untyped-def]
    """Stress at breast height and moment at the ground, as shares of what the tree resists."""
    area, force, moment, rest, aside, winds, drag = loads
    along_x, along_y, canopy_height, thick, density, exposure = wind
    press(speed, canopy_height, thick, density, exposure, winds)
    for k in range(len(force)):
        pressure = winds[1, layer_of(stem.leaf_height[k], thick)]
        force[k] = GUST * 0.5 * AIR_DENSITY * drag * area[k] * pressure
    bending_moments(stem, tip, force, along_x, along_y, moment)
    add_sway(stem, rest, moment, aside)
    at = breast_height(stem, tip)
    stress = 4.0 * moment[at] / (np.pi * stem.radius[at] ** 3)
    return stress / rupture, moment[0] / anchor


@njit
def critical_speeds(stem, tip, scratch, winds, wind, drag, rupture, turning):  # type: ignore[no-untyped-def]
    """The storms' speeds that break and uproot a tree, m/s; NaN where none does.

    Parameters
    ----------
    stem : Stem
        k stations.
    tip : float32 (n, 3)
        Upper ends of the tree's metamers relative to its base, m.
    scratch : float64 (5, k + 1)
        The first row holds the area of crown shown to the wind at each station, m2.
    winds : float64 (3, LAYERS)
        Scratch.
    wind : (along_x, along_y, canopy_height, thick, density, (edge, gusts))
        Of the tree, as in `Blow`.
    drag : float
        Drag coefficient of the crown.
    rupture : float
        Modulus of rupture, Pa.
    turning : float
        Moment that uproots, per fresh mass of the stem, N m/kg.

    Notes
    -----
    The least speed is found by halving; that a moment grows with the wind is taken for granted.
    """
    n = len(stem.length)
    area, force, moment, rest = scratch[0, :n], scratch[1, :n], scratch[2, :n], scratch[3, :n]
    loads = (area, force, moment, rest, scratch[4], winds, drag)
    anchor = turning * np.sum(stem.wood)
    force[:] = 0.0
    bending_moments(stem, tip, force, wind[0], wind[1], rest)
    stress, turn = _strain(STRONGEST, stem, tip, loads, wind, rupture, anchor)
    found = (np.nan, np.nan)
    for way in range(2):
        if (stress if way == 0 else turn) < 1.0:
            continue
        low = 0.0
        high = STRONGEST
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            shares = _strain(middle, stem, tip, loads, wind, rupture, anchor)
            if (shares[0] if way == 0 else shares[1]) < 1.0:
                low = middle
            else:
                high = middle
        high = max(high, CALM)
        found = (high, found[1]) if way == 0 else (found[0], high)
    return found


@driver
def _test(first, step, arena, trees, shared, spaces, species, turning, rigidity, blow, due, out):  # type: ignore[no-untyped-def]
    scratch, bench, winds = spaces
    for b in range(first, len(shared.place) - 1, step):
        for at in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[at]
            n = np.int64(trees.size[row])
            if n == 0 or not due[row]:
                continue
            sp = trees.species[row]
            f = shared.place[b] * FLOATS
            i = shared.place[b] * INTEGERS
            work = scratch.floats[f : f + FLOATS * n].reshape((FLOATS, n))
            stem = stem_stations(
                arena, trees, row, species, rigidity, work, scratch.integers[i : i + n]
            )
            for k in range(len(stem.metamer)):
                shown = blow.share[row, layer_of(stem.leaf_height[k], blow.thick)]
                bench[b, 0, k] = shown * stem.leaf_area[k]
            s = trees.start[row]
            wind = (
                blow.along_x,
                blow.along_y,
                blow.canopy_height,
                blow.thick,
                blow.density[row],
                (blow.edge[row], blow.gusts[row]),
            )
            out.breaks[row], out.uproots[row] = critical_speeds(
                stem,
                arena.tip[s : s + n],
                bench[b],
                winds[b],
                wind,
                species.drag[sp],
                species.rupture[sp],
                turning[sp],
            )


def find_critical(
    metamers: Metamers,
    trees: Trees,
    shared: Deal,
    scratch: Scratch,
    species: StemSpecies,
    turning: NDArray[np.float64],
    rigidity: NDArray[np.float32],
    blow: Blow,
    due: NDArray[np.bool_],
    out: Critical,
) -> None:
    """Find the storms that trees do not stand.

    Parameters
    ----------
    metamers, trees : Metamers, Trees
        Arena and tree table.
    shared, scratch : Deal, Scratch
        How trees are dealt to threads, and their scratch memory.
    species : StemSpecies
        One entry per species.
    turning : float64 (species,)
        Moment that uproots, per fresh mass of the stem, N m/kg; of species and soil.
    rigidity : float32 (metamers, 3)
        Of rods, where trees bend; else `forest.mechanics.stems.NO_RIGIDITY`.
    blow : Blow
    due : bool (trees,)
        Rows to fill; the others are left.
    out : Critical
        Filled.
    """
    bench = np.empty((BINS, 5, int(trees.size.max(initial=0)) + 1))
    winds = np.zeros((BINS, 3, LAYERS))
    in_threads(
        _test,
        metamers,
        trees,
        shared,
        (scratch, bench, winds),
        species,
        turning,
        rigidity,
        blow,
        due,
        out,
    )
