"""The stem as a row of stations: how stiff it is, what it weighs and what hangs on it.

A station is a metamer of the stem: its internode, and the node at its upper end, where branches
hang. The stem is the path that mensuration calls so: along the main continuation while there is
one; where an axis has ended, along the branch at its last node.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.growth.dealing import FLOATS, INTEGERS
from forest.trees.metamers import CONTINUED, LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import Trees

#: Standard gravity, m/s2.
GRAVITY = 9.80665


class StemSpecies(NamedTuple):
    """What statics must know of each species; float64 arrays of one entry per species."""

    pipe_exponent: NDArray[np.float64]  # n of the pipe model
    green_density: NDArray[np.float64]  # fresh mass of wood per fresh volume, kg/m3
    support: NDArray[np.float64]  # k of supports(R, d) = k d R^2 with the green density, m
    leaf_mass: NDArray[np.float64]  # fresh mass of a site's leaves, kg
    leaf_area: NDArray[np.float64]  # of a site, m2
    modulus: NDArray[np.float64]  # of elasticity, green wood, Pa
    rupture: NDArray[np.float64]  # modulus of rupture, green wood, Pa
    drag: NDArray[np.float64]  # drag coefficient of the crown
    compression_wood: NDArray[np.float64]  # 1: reaction wood below (conifers); 0: above


class Stem(NamedTuple):
    """A stem's stations from the ground up; arrays of one entry per station."""

    metamer: NDArray[np.int32]  # index in the tree's extent
    length: NDArray[np.float64]  # of the internode, m
    radius: NDArray[np.float64]  # under bark, m
    rigidity: NDArray[np.float64]  # E I, N m2
    wood: NDArray[np.float64]  # mass of the internode, kg
    load: NDArray[np.float64]  # mass at the node: its leaves, and branches with theirs, kg
    load_x: NDArray[np.float64]  # load times the x of its centre of mass, kg m
    load_y: NDArray[np.float64]
    leaf_area: NDArray[np.float64]  # of the leaves in the load, m2
    leaf_height: NDArray[np.float64]  # their mean height; the node's where there are none, m


@njit
def wood_radius(pipe, exponent):  # type: ignore[no-untyped-def]
    """The radius of a metamer, m, from its pipes d^n."""
    if exponent == 2.0:
        return 0.5 * np.sqrt(np.float64(pipe))
    return 0.5 * np.float64(pipe) ** (1.0 / exponent)


@njit
def hang_loads(arena, trees, row, species, work, on_stem):  # type: ignore[no-untyped-def]
    """Gather what hangs at each metamer of the stem; one forward and one backward scan.

    A metamer's load is that of its leaves and, beside the stem, of its wood, at the places where
    these are. Beside the stem it is handed down to the parent.
    """
    s = trees.start[row]
    n = np.int64(trees.size[row])
    sp = trees.species[row]
    load, load_x, load_y, leaves, leaf_z = work[0], work[1], work[2], work[3], work[4]
    top = -1
    goes_on = False
    for i in range(n):
        state = arena.state[s + i]
        x = np.float64(arena.tip[s + i, 0])
        y = np.float64(arena.tip[s + i, 1])
        sites = (1 if state & TERMINAL else 0) + (1 if state & LATERAL else 0)
        mass = sites * species.leaf_mass[sp]
        load[i] = mass
        load_x[i] = mass * x
        load_y[i] = mass * y
        leaves[i] = sites * species.leaf_area[sp]
        leaf_z[i] = leaves[i] * np.float64(arena.tip[s + i, 2])
        p = arena.parent[s + i]
        on_stem[i] = 0
        if p == top and (not goes_on or (state & MAIN) != 0):
            on_stem[i] = 1
            top = i
            goes_on = (state & CONTINUED) != 0
        else:
            r = wood_radius(arena.pipe[s + i], species.pipe_exponent[sp])
            wood = np.pi * r * r * np.float64(arena.length[s + i]) * species.green_density[sp]
            load[i] += wood
            load_x[i] += wood * 0.5 * (x + np.float64(arena.tip[s + p, 0]))
            load_y[i] += wood * 0.5 * (y + np.float64(arena.tip[s + p, 1]))
    for i in range(n - 1, 0, -1):
        if on_stem[i] == 0:
            p = arena.parent[s + i]
            load[p] += load[i]
            load_x[p] += load_x[i]
            load_y[p] += load_y[i]
            leaves[p] += leaves[i]
            leaf_z[p] += leaf_z[i]


@njit
def stem_stations(arena, trees, row, species, rigidity, work, on_stem):  # type: ignore[no-untyped-def]
    """Read a tree's stem.

    Parameters
    ----------
    rigidity : float32 (metamers, 3)
        G J and E I about the two axes of the section, N m2, as rods keep them: the weaker E I
        counts. With no rows, E I is the species' modulus times pi r^4 / 4.
    work : float64 (9 or more, n)
        Scratch of n = size of the tree; the stations' arrays lie in its first rows.
    on_stem : int32 (n,)
        Scratch; the stations' metamers lie in it.

    Returns
    -------
    Stem
    """
    hang_loads(arena, trees, row, species, work, on_stem)
    s = trees.start[row]
    sp = trees.species[row]
    k = 0
    for i in range(np.int64(trees.size[row])):
        if on_stem[i] == 0:
            continue
        r = wood_radius(arena.pipe[s + i], species.pipe_exponent[sp])
        length = np.float64(arena.length[s + i])
        on_stem[k] = i
        # A station's number never exceeds its metamer's: what is read is still there.
        height = np.float64(arena.tip[s + i, 2])
        if work[3, i] > 0.0:
            height = work[4, i] / work[3, i]
        work[4, k] = height
        for column in range(4):
            work[column, k] = work[column, i]
        work[5, k] = length
        work[6, k] = r
        if len(rigidity) > 0:
            work[7, k] = min(np.float64(rigidity[s + i, 1]), np.float64(rigidity[s + i, 2]))
        else:
            work[7, k] = species.modulus[sp] * 0.25 * np.pi * r**4
        work[8, k] = np.pi * r * r * length * species.green_density[sp]
        k += 1
    return Stem(
        on_stem[:k],
        work[5][:k],
        work[6][:k],
        work[7][:k],
        work[8][:k],
        work[0][:k],
        work[1][:k],
        work[2][:k],
        work[3][:k],
        work[4][:k],
    )


#: Means: take E I from the species' modulus.
NO_RIGIDITY: NDArray[np.float32] = np.empty((0, 3), np.float32)


def read_stem(
    metamers: Metamers,
    trees: Trees,
    row: int,
    species: StemSpecies,
    rigidity: NDArray[np.float32] = NO_RIGIDITY,
) -> Stem:
    """Give the stations of the stem of the tree in a row of the table.

    Parameters
    ----------
    metamers, trees : Metamers, Trees
        Arena and tree table.
    row : int
        Row of the table.
    species : StemSpecies
        One entry per species.
    rigidity : float32 array (metamers, 3)
        Rigidities of the rods (G J, E I, E I), N m2; without them E is constant.

    Returns
    -------
    Stem
        From the ground up; empty for a tree without metamers.
    """
    n = int(trees.size[row])
    work = np.empty((FLOATS, n))
    numbers = np.empty((INTEGERS, n), np.int32)
    stem: Any = stem_stations(metamers, trees, row, species, rigidity, work, numbers[0])
    return Stem(*stem)
