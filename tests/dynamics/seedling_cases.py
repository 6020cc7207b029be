"""Small grounds, cohorts and species for tests of regeneration."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from forest.dynamics.regeneration.cohorts import Cohorts, Ground, join
from forest.dynamics.regeneration.traits import SeedlingTraits, Traits
from forest.species import load_species, species_names

NAMES = tuple(species_names())
SHIPPED = Traits.of([load_species(name) for name in NAMES])


def code(name: str) -> int:
    """Give a shipped species' index."""
    return NAMES.index(name)


def random_cohorts(rng: Generator, cells: int, most: int, species: int = len(NAMES)) -> Cohorts:
    """Make some cohorts in some cells."""
    k = int(rng.integers(0, most + 1))
    return join(
        Cohorts(
            cell=rng.integers(0, cells, k),
            species=rng.integers(0, species, k),
            n=rng.integers(1, 60, k),
            height=rng.uniform(0.03, 1.3, k),
            age=rng.integers(0, 9, k).astype(np.float64),
            mother=rng.integers(0, 50, k),
            reserve=rng.uniform(0.0, 0.01, k),
            sprout=rng.random(k) < 0.2,
        )
    )


def one_per_cell(kind: int, n: int, cells: int, height: float = 0.1) -> Cohorts:
    """Put a cohort of one species into each cell."""
    full = np.full
    return Cohorts(
        cell=np.arange(cells),
        species=full(cells, kind),
        n=full(cells, n),
        height=full(cells, height),
        age=np.zeros(cells),
        mother=np.zeros(cells, np.int64),
        reserve=full(cells, 0.001),
        sprout=np.zeros(cells, np.bool_),
    )


def ground(light: Any, taken: Any = 0.0, area: float = 1.0) -> Ground:
    """Give a ground of some light, where leaves take light by Beer and Lambert with k = 0.5."""
    light = np.atleast_1d(np.asarray(light, np.float64))
    transmission = np.exp(-0.5 * np.arange(1025) / 64)
    return Ground(light, np.broadcast_to(taken, light.shape).copy(), transmission, area)


def slow_traits(traits: SeedlingTraits) -> list[dict[str, float]]:
    """Give the traits as a dictionary per species."""
    columns = traits._asdict()
    return [
        {name: float(column[k]) for name, column in columns.items()}
        for k in range(len(traits.survival_max))
    ]
