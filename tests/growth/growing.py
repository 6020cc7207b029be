"""A year of growth without an environment: the kernels in their order, light and space made up."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.environment.obstacles import Solid, no_solid
from forest.growth.allocate import allocate
from forest.growth.budget import ACCOUNTS
from forest.growth.dealing import Workbench, deal
from forest.growth.parameters import SpeciesTraits, Year, species_traits
from forest.growth.pipes import thicken
from forest.growth.shedding import shed
from forest.growth.shoots import extend, shooting_buds
from forest.species import Species, shipped_table
from forest.trees.buds import Shoots
from forest.trees.metamers import LATERAL, TERMINAL, Arena, Metamers
from forest.trees.table import Trees

VOXEL_M = 0.25


def make_species(**changes: dict[str, Any]) -> Species:
    """The paper's tree with some keys changed, section by section."""
    table = shipped_table("generic_deciduous")
    for section, values in changes.items():
        table[section].update(values)
    return Species(**table)


def make_traits(*species: Species, paper: bool = False) -> SpeciesTraits:
    """Pack species for the kernels; the paper's tree if none is given."""
    return species_traits(species or [make_species()], paper=paper)


def make_year(step: int = 5, income_factor: float = 1.0, **changes: Any) -> Year:
    """A year of mass balance with the extended Borchert-Honda model, alike for all species."""
    year = Year(
        step=step,
        seed=3,
        income_factor=np.full(8, income_factor),
        full_light=1.0,
        paper=False,
    )
    return year._replace(**changes)


def arena_of(metamers: Metamers, trees: Trees) -> Arena:
    """Make an arena object of arrays that are filled already."""
    arena = Arena(16)
    arena.metamers = metamers
    ends = trees.start + trees.room
    arena.used = int(ends.max()) if len(ends) else 0
    return arena


def copied(state: Any) -> Any:
    """A deep copy of a tuple of arrays, or of an arena."""
    return copy.deepcopy(state)


def light_everything(metamers: Metamers, trees: Trees, step: int) -> None:
    """Give each node a light that hangs on its tree, serial and year alone."""
    for row in range(len(trees.tree_id)):
        here = extent(trees, row)
        number = metamers.serial[here].astype(np.int64) * 37 + trees.tree_id[row] * 11 + step * 5
        sites = (metamers.state[here] & (TERMINAL | LATERAL)) != 0
        metamers.light[here] = np.where(sites, number % 17 / 16, 0.0)


def extent(trees: Trees, row: int) -> slice:
    """The part of the arena that a tree uses."""
    return slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))


def _pull(metamers: Metamers, trees: Trees, shoots: Shoots) -> NDArray[np.float32]:
    """Directions that hang on tree, serial and bud alone."""
    toward = np.zeros((len(shoots.metamer), 3), np.float32)
    for row in range(len(trees.tree_id)):
        for j in range(shoots.first[row], shoots.first[row + 1]):
            serial = metamers.serial[trees.start[row] + shoots.metamer[j]]
            angle = float(serial * 2.4 + trees.tree_id[row] + shoots.bud[j])
            toward[j] = (0.8 * np.cos(angle), 0.8 * np.sin(angle), 0.6)
    return toward


def grow_shoots(
    arena: Arena, trees: Trees, traits: SpeciesTraits, year: Year, solid: Solid, *, pull: bool
) -> Shoots:
    """Make room and let the buds shoot; without `pull` the environment has no direction."""
    shared = deal(trees.size)
    shoots = shooting_buds(arena.metamers, trees, shared, traits)
    arena.make_room(trees.start, trees.size, trees.room, trees.size + shoots.new)
    toward = _pull(arena.metamers, trees, shoots)
    if not pull:
        toward[:] = 0.0
    extend(arena.metamers, trees, shared, shoots, toward, traits, year, solid, VOXEL_M)
    return shoots


def grow_year(
    arena: Arena,
    trees: Trees,
    traits: SpeciesTraits,
    year: Year,
    *,
    priority: bool = False,
    balance: bool = False,
) -> NDArray[np.float64]:
    """Grow all trees for a year under made-up light; give their accounts."""
    bench = Workbench()
    accounts = np.zeros((len(trees.tree_id), ACCOUNTS))
    light_everything(arena.metamers, trees, year.step)
    shared = deal(trees.size)
    scratch = bench.scratch(shared)
    year = year._replace(balance=balance)
    models = (year.paper or None, priority or None, balance or None)
    allocate(arena.metamers, trees, shared, scratch, traits, year, accounts, *models)
    shed(arena, trees, shared, scratch, traits, not year.paper)
    grow_shoots(arena, trees, traits, year, no_solid(), pull=True)
    shared = deal(trees.size)
    thicken(arena.metamers, trees, shared, bench.scratch(shared), traits, year, accounts)
    return accounts
