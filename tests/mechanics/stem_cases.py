"""Stems and species for the tests of statics."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from forest.mechanics.stems import StemSpecies
from forest.trees.metamers import CONTINUED, MAIN, Arena, Metamers
from forest.trees.table import Trees, empty
from tests.builders import random_arena
from tests.reference.stems import Wood

SPECIES = StemSpecies(
    pipe_exponent=np.array([2.0, 2.5]),
    green_density=np.array([850.0, 1000.0]),
    support=np.array([95.0, 40.0]),
    leaf_mass=np.array([0.01, 0.02]),
    leaf_area=np.array([0.05, 0.03]),
    modulus=np.array([6.3e9, 9.8e9]),
    rupture=np.array([36e6, 65e6]),
    drag=np.array([0.35, 0.29]),
    compression_wood=np.array([1.0, 0.0]),
)


def wood_of(species: int) -> Wood:
    """A species of `SPECIES` as the twins know it."""
    return Wood(
        exponent=float(SPECIES.pipe_exponent[species]),
        density=float(SPECIES.green_density[species]),
        support=float(SPECIES.support[species]),
        leaf_mass=float(SPECIES.leaf_mass[species]),
        leaf_area=float(SPECIES.leaf_area[species]),
        modulus=float(SPECIES.modulus[species]),
    )


def woody_arena(rng: Generator, n_trees: int, n_per_tree: int) -> tuple[Metamers, Trees]:
    """Random trees of both species, with diameters that taper to 4 mm."""
    metamers, trees = random_arena(rng, n_trees, n_per_tree, n_species=2)
    for row in range(n_trees):
        s, n = int(trees.start[row]), int(trees.size[row])
        exponent = SPECIES.pipe_exponent[trees.species[row]]
        metamers.pipe[s : s + n] = 0.0
        for i in range(n - 1, -1, -1):
            metamers.pipe[s + i] += 0.004**exponent * rng.uniform(1.0, 4.0)
            if i > 0:
                metamers.pipe[s + metamers.parent[s + i]] += metamers.pipe[s + i]
    return metamers, trees


def pole(radius: NDArray[np.float64], length_m: float, lean: float = 0.0) -> tuple[Metamers, Trees]:
    """One bare stem of `SPECIES` 0 whose internodes have the given radii.

    `lean` is its angle from the vertical towards +x, rad.
    """
    n = len(radius)
    metamers = Arena(n).metamers
    for field in metamers:
        field[...] = 0
    metamers.parent[:n] = np.arange(-1, n - 1)
    metamers.serial[:n] = np.arange(n)
    metamers.length[:n] = length_m / n
    metamers.pipe[:n] = (2.0 * radius) ** 2
    metamers.state[:n] = MAIN | CONTINUED
    metamers.state[n - 1] = MAIN
    reach = (np.arange(n) + 1.0) * length_m / n
    metamers.tip[:n, 0] = reach * np.sin(lean)
    metamers.tip[:n, 2] = reach * np.cos(lean)
    trees = empty(1)
    trees.start[:] = 0
    trees.size[:] = trees.room[:] = n
    trees.species[:] = 0
    return metamers, trees


def tapered(n: int, power: float, base_m: float) -> NDArray[np.float64]:
    """Radii at the middles of n internodes of a stem with r ~ x^power, x from the tip."""
    radii: NDArray[np.float64] = base_m * ((n - 0.5 - np.arange(n)) / n) ** power
    return radii
