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
from forest.mechanics.stems import GRAVITY, StemSpecies, stem_stations
from forest.mechanics.stress import PROJECTION, bending_moments, wind_forces
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees

#: Moment in the strongest gust of a storm per that of its mean wind on a lone tree. Calibrated to
#: critical speeds of spruce stands (Gardiner et al. 2000); it stands for gusts and for sway.
GUST = 15.5
#: Winds beyond this one are not looked for, m/s.
STRONGEST = 100.0
#: A stem breaks below this share of its height; above, a top is lost, which is no windthrow.
BROKEN_BELOW = 1.0 / 3.0
#: Rounds in which a bent stem's weight adds to its bending.
PASSES = 6
#: Layers into which a crown is cut, from the ground to the tree's top.
LAYERS = 16
_HALVINGS = 24


class Blow(NamedTuple):
    """A wind that blows over a stand.

    Attributes
    ----------
    along_x, along_y : float
        Unit vector towards which it blows.
    canopy_height : float
        m.
    share, attenuation : float64 (trees,)
        As in `forest.mechanics.fetch.Exposure`.
    """

    along_x: float
    along_y: float
    canopy_height: float
    share: NDArray[np.float64]
    attenuation: NDArray[np.float64]


class Critical(NamedTuple):
    """Speeds of a storm that a tree does not stand: float64 arrays of one entry per row, m/s.

    At the canopy's top over open land; NaN where no wind up to `STRONGEST` does it.
    """

    breaks: NDArray[np.float64]
    uproots: NDArray[np.float64]


@njit
def draw_crown(arena, trees, row, leaf_area, along_x, along_y, layers):  # type: ignore[no-untyped-def]
    """Find how much of its leaves' area a crown shows to the wind, layer by layer.

    A layer of the area A of leaves, dz high and w wide across the wind, shows
    w dz (1 - exp(-A / (2 w dz))): leaves behind leaves are not seen. Its width is four standard
    deviations of the leaves' places, as of a disc that is filled evenly, and a leaf's own.

    Parameters
    ----------
    leaf_area : float
        Of a site, m2.
    along_x, along_y : float
        Unit vector towards which the wind blows.
    layers : float64 (3, LAYERS)
        Scratch; the first row becomes the area shown per area of the leaves.

    Returns
    -------
    float
        Height of a layer, m.
    """
    s = trees.start[row]
    n = np.int64(trees.size[row])
    top = 0.0
    for i in range(s, s + n):
        top = max(top, np.float64(arena.tip[i, 2]))
    thick = max(top, 1e-3) / LAYERS
    layers[:] = 0.0
    for i in range(s, s + n):
        state = arena.state[i]
        sites = (1 if state & TERMINAL else 0) + (1 if state & LATERAL else 0)
        aside = np.float64(arena.tip[i, 1]) * along_x - np.float64(arena.tip[i, 0]) * along_y
        k = layer_of(np.float64(arena.tip[i, 2]), thick)
        layers[0, k] += sites
        layers[1, k] += sites * aside
        layers[2, k] += sites * aside * aside
    for k in range(LAYERS):
        sites = layers[0, k]
        if sites > 0.0:
            mean = layers[1, k] / sites
            spread = np.sqrt(max(layers[2, k] / sites - mean * mean, 0.0))
            section = (4.0 * spread + np.sqrt(leaf_area)) * thick
            shown = section * (1.0 - np.exp(-PROJECTION * sites * leaf_area / section))
            layers[0, k] = shown / (sites * leaf_area)
    return thick


@njit
def layer_of(height, thick):  # type: ignore[no-untyped-def]
    """The layer of a crown at a height, m."""
    return min(max(int(height / thick), 0), LAYERS - 1)


@njit
def add_sway(stem, still, moment, aside):  # type: ignore[no-untyped-def]
    """Add the moment of the weight that a bent stem carries beside its foot.

    The moments bend the stem, theta' = M / (E I), its weight moves aside and adds to them; so
    `PASSES` times. No part leans beyond the horizontal.

    Parameters
    ----------
    stem : Stem
        k stations.
    still : float64 (k,)
        Moment at the lower end of each station as long as the stem does not bend, N m.
    moment : float64 (k,)
        Filled, N m.
    aside : float64 (k + 1,)
        Scratch.
    """
    n = len(still)
    moment[:] = still
    for _ in range(PASSES):
        lean = 0.0
        aside[0] = 0.0
        for k in range(n):
            above = moment[k + 1] if k + 1 < n else 0.0
            turn = 0.5 * (moment[k] + above) * stem.length[k] / stem.rigidity[k]
            middle = min(lean + 0.5 * turn, 0.5 * np.pi)
            aside[k + 1] = aside[k] + np.sin(middle) * stem.length[k]
            lean += turn
        mass = 0.0
        reach = 0.0
        for k in range(n - 1, -1, -1):
            mass += stem.wood[k] + stem.load[k]
            reach += stem.wood[k] * 0.5 * (aside[k] + aside[k + 1]) + stem.load[k] * aside[k + 1]
            moment[k] = still[k] + GRAVITY * (reach - mass * aside[k])


@njit
def _strain(speed, stem, tip, loads, along, rupture, anchor):  # type: ignore[no-untyped-def]
    """Stress and moment at the ground in a wind, as shares of what the tree resists."""
    area, force, moment, still, aside, profile, drag = loads
    wind_forces(stem.leaf_height, area, speed, profile, drag, force)
    for k in range(len(force)):
        force[k] *= GUST
    bending_moments(stem, tip, force, along[0], along[1], still)
    add_sway(stem, still, moment, aside)
    top = np.float64(tip[stem.metamer[len(moment) - 1], 2])
    worst = 0.0
    for k in range(len(moment)):
        if k > 0 and np.float64(tip[stem.metamer[k - 1], 2]) > BROKEN_BELOW * top:
            break
        worst = max(worst, 4.0 * moment[k] / (np.pi * stem.radius[k] ** 3))
    return worst / rupture, moment[0] / anchor


@njit
def critical_speeds(stem, tip, scratch, wind, drag, rupture, turning):  # type: ignore[no-untyped-def]
    """The storms' speeds that break and uproot a tree, m/s; NaN where none does.

    Parameters
    ----------
    stem : Stem
        k stations.
    tip : float32 (n, 3)
        Upper ends of the tree's metamers relative to its base, m.
    scratch : float64 (5, k + 1)
        The first row holds the area of crown shown to the wind at each station, m2.
    wind : (along_x, along_y, canopy_height, share, attenuation)
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
    area, force, moment, still = scratch[0, :n], scratch[1, :n], scratch[2, :n], scratch[3, :n]
    loads = (area, force, moment, still, scratch[4], (wind[2], wind[4]), drag)
    along = (wind[0], wind[1])
    anchor = turning * np.sum(stem.wood)
    most = STRONGEST * wind[3]
    stress, turn = _strain(most, stem, tip, loads, along, rupture, anchor)
    found = (np.nan, np.nan)
    for way in range(2):
        if (stress if way == 0 else turn) < 1.0:
            continue
        low = 0.0
        high = most
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            shares = _strain(middle, stem, tip, loads, along, rupture, anchor)
            if (shares[0] if way == 0 else shares[1]) < 1.0:
                low = middle
            else:
                high = middle
        found = (high / wind[3], found[1]) if way == 0 else (found[0], high / wind[3])
    return found


@driver
def _test(first, step, arena, trees, shared, spaces, species, turning, rigidity, blow, due, out):  # type: ignore[no-untyped-def]
    scratch, bench, layers = spaces
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
            thick = draw_crown(
                arena, trees, row, species.leaf_area[sp], blow.along_x, blow.along_y, layers[b]
            )
            for k in range(len(stem.metamer)):
                shown = layers[b, 0, layer_of(stem.leaf_height[k], thick)]
                bench[b, 0, k] = shown * stem.leaf_area[k]
            s = trees.start[row]
            wind = (
                blow.along_x,
                blow.along_y,
                blow.canopy_height,
                blow.share[row],
                blow.attenuation[row],
            )
            out.breaks[row], out.uproots[row] = critical_speeds(
                stem,
                arena.tip[s : s + n],
                bench[b],
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
    layers = np.zeros((BINS, 3, LAYERS))
    in_threads(
        _test,
        metamers,
        trees,
        shared,
        (scratch, bench, layers),
        species,
        turning,
        rigidity,
        blow,
        due,
        out,
    )
