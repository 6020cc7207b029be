"""What hangs on a tree: its own fresh wood, leaves and fruit, by season (Taylor-Hell 2005, 6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver
from forest._threads import in_threads
from forest.environment.obstacles import Solid, inside
from forest.growth.dealing import BINS, Deal
from forest.mechanics.rods import Loads
from forest.mechanics.stems import GRAVITY, wood_radius
from forest.species import Species
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees


class LoadSpecies(NamedTuple):
    """What weighs in each species; float64 arrays of one entry per species."""

    pipe_exponent: NDArray[np.float64]  # n of the pipe model
    green_density: NDArray[np.float64]  # fresh mass of wood per fresh volume, kg/m3
    leaf_mass: NDArray[np.float64]  # fresh mass of a site's leaves, kg
    winter_leaf_mass: NDArray[np.float64]  # of those that stay in winter, kg
    fruit_mass: NDArray[np.float64]  # fresh mass of a site's fruit in summer, kg

    @classmethod
    def of(cls, species: Sequence[Species], pipe_exponent: NDArray[np.float64]) -> Self:
        """Read the species; leaves that live for more than a year stay in winter."""
        leaf = np.array(
            [s.leaves.area_m2 / s.leaves.sla_m2_kg * s.mechanics.leaf_water_factor for s in species]
        )
        evergreen = np.array([s.leaves.lifespan_years > 1.0 for s in species])
        return cls(
            pipe_exponent,
            np.array([s.mechanics.green_density_kg_m3 for s in species]),
            leaf,
            np.where(evergreen, leaf, 0.0),
            np.array([s.mechanics.fruit_mass_kg for s in species]),
        )

    def in_winter(self) -> Self:
        """Give what weighs in winter: no fruit, and only the leaves that stay."""
        nothing = np.zeros_like(self.fruit_mass)
        return self._replace(leaf_mass=self.winter_leaf_mass, fruit_mass=nothing)


def make_loads(capacity: int) -> Loads:
    """Make loads for `capacity` metamers, all still air."""
    return Loads(np.zeros((capacity, 2), np.float32), np.zeros((capacity, 2), np.float32))


@driver
def _hang_chunks(first, step, arena, trees, shared, species, weight):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            sp = trees.species[row]
            exponent = species.pipe_exponent[sp]
            wood = np.pi * GRAVITY * species.green_density[sp]
            site = GRAVITY * (species.leaf_mass[sp] + species.fruit_mass[sp])
            for i in range(trees.start[row], trees.start[row] + trees.size[row]):
                state = arena.state[i]
                sites = (1 if state & TERMINAL else 0) + (1 if state & LATERAL else 0)
                radius = wood_radius(arena.pipe[i], exponent)
                weight[i, 0] = wood * radius * radius * np.float64(arena.length[i])
                weight[i, 1] = site * sites


@driver
def _bury_chunks(first, step, arena, trees, shared, solid, voxel_m):  # type: ignore[no-untyped-def]
    bare = np.uint8(255 - TERMINAL - LATERAL)
    obstructed = solid.mask.size > 1  # asked once: the slice of a tip costs more than the question
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            for i in range(trees.start[row], trees.start[row] + trees.size[row]):
                below = arena.tip[i, 2] < 0.0
                if below or (obstructed and inside(solid, trees, row, arena.tip[i], voxel_m)):
                    arena.state[i] &= bare


def bury_sites(arena: Metamers, trees: Trees, shared: Deal, solid: Solid, voxel_m: float) -> None:
    """Let the sites die that hang in the ground or an obstacle; what bears none is shed next year.

    Parameters
    ----------
    arena, trees, shared : Metamers, Trees, Deal
        All trees, and how they are dealt to threads.
    solid : Solid
        Voxels that obstacles fill.
    voxel_m : float
        Edge of those voxels, m.
    """
    in_threads(_bury_chunks, arena, trees, shared, solid, voxel_m)


def hang(arena: Metamers, trees: Trees, shared: Deal, species: LoadSpecies, loads: Loads) -> None:
    """Set the weights of all metamers: wood at their middle, leaves and fruit at their tip, N."""
    in_threads(_hang_chunks, arena, trees, shared, species, loads.weight)
