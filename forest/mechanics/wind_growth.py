"""Wind in growth: what a stem needs so as not to be stressed beyond its limit.

Under the moment M a section of diameter d is stressed by 32 M / (pi d^3). Stems grow towards
uniform stress in the usual wind (Metzger 1893; Telewski 1995): the needed d^3 = 32 M / (pi sigma).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.dealing import FLOATS, INTEGERS, Deal, Scratch
from forest.mechanics.stems import NO_RIGIDITY, StemSpecies, stem_stations
from forest.mechanics.stress import PROJECTION, Wind, bending_moments, wind_forces
from forest.trees.metamers import Metamers
from forest.trees.table import Trees


@njit
def _heavy_side(stem):  # type: ignore[no-untyped-def]
    """Unit vector to the side on which the crown hangs; +x where it is in balance."""
    x = 0.0
    y = 0.0
    for k in range(len(stem.load)):
        x += stem.load_x[k]
        y += stem.load_y[k]
    reach = np.sqrt(x * x + y * y)
    return (x / reach, y / reach) if reach > 0.0 else (1.0, 0.0)


@njit
def _need_of_stem(stem, tip, pipe, speed, profile, drag, limit, force, moment, need):  # type: ignore[no-untyped-def]
    """Fill the d^2 that each station needs; give the stress at the foot per limit."""
    for k in range(len(force)):
        moment[k] = PROJECTION * stem.leaf_area[k]
    wind_forces(stem.leaf_height, moment, speed, profile, drag, force)
    along_x, along_y = _heavy_side(stem)
    bending_moments(stem, tip, force, along_x, along_y, moment)
    for k in range(len(force)):
        need[stem.metamer[k]] = (32.0 * moment[k] / (np.pi * limit)) ** (2.0 / 3.0)
    wood = np.float64(pipe[0])  # none before the first year
    return (np.float64(need[0]) / wood) ** 1.5 if wood > 0.0 else 0.0


@driver
def _feel(first, step, arena, trees, shared, scratch, species, limit, wind, rigidity, need):  # type: ignore[no-untyped-def]
    for b in range(first, len(shared.place) - 1, step):
        for at in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[at]
            n = np.int64(trees.size[row])
            if n == 0:
                continue
            f = shared.place[b] * FLOATS
            i = shared.place[b] * INTEGERS
            work = scratch.floats[f : f + FLOATS * n].reshape((FLOATS, n))
            stem = stem_stations(
                arena, trees, row, species, rigidity, work, scratch.integers[i : i + n]
            )
            s = trees.start[row]
            sp = trees.species[row]
            k = len(stem.metamer)
            need[s : s + n] = 0.0
            trees.wind_stress[row] = _need_of_stem(
                stem,
                arena.tip[s : s + n],
                arena.pipe[s : s + n],
                wind.speed[row],
                (wind.canopy_height, wind.attenuation[row]),
                species.drag[sp],
                limit[sp],
                work[9][:k],
                work[10][:k],
                need[s : s + n],
            )


def feel_wind(
    metamers: Metamers,
    trees: Trees,
    shared: Deal,
    scratch: Scratch,
    species: StemSpecies,
    limit: NDArray[np.float64],
    wind: Wind,
    need: NDArray[np.float32],
) -> None:
    """Find what the stems need in the usual wind, before they thicken.

    The wind blows to the side on which the crown hangs, where it and the weight add up.

    Parameters
    ----------
    metamers, trees : Metamers, Trees
        Arena and table, with this year's shoots; pipes are d^2. `trees.wind_stress` becomes the
        stress at the stems' feet per limit, in last year's wood.
    shared, scratch : Deal, Scratch
        How trees are dealt to threads, and their scratch memory.
    species : StemSpecies
        One entry per species.
    limit : float64 (species,)
        Stress beyond which stems thicken, Pa.
    wind : Wind
        At the top of the canopy around each tree.
    need : float32 (capacity of the arena,)
        Filled for every metamer of a tree: needed d^2, m2; 0 beside the stem.
    """
    in_threads(_feel, metamers, trees, shared, scratch, species, limit, wind, NO_RIGIDITY, need)
