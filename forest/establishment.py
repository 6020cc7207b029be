"""How trees come into a stand: planted, or recruited with the size and age they have reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.planting import check_leans, check_planting, headings, seedlings
from forest.errors import InputError
from forest.growth.shoots import first_internode, sprout
from forest.measure.trees import measure_trees
from forest.scenario.model import Explicit
from forest.trees import table
from forest.yearbook import Event

if TYPE_CHECKING:
    from forest.environment.obstacles import Solid
    from forest.environment.surroundings import Surroundings
    from forest.growth.parameters import SpeciesTraits
    from forest.stand import Stand


class Newcomers(NamedTuple):
    """Trees that come into a stand; arrays of n entries.

    Attributes
    ----------
    x, y : float64
        Places, m, inside the plot.
    species : int
        Indices into the scenario's species.
    heading : float64 (n, 3)
        Unit vectors along which their stems stand.
    height_m : float64
        Their height: as many internodes as fit best, one at least.
    age : int
        Years since they germinated.
    mother_id : int
        Trees that seeded them; 0 if planted or not known.
    reserve_kg : float64
        What they have stored; NaN for the species' seed reserve.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    species: NDArray[Any]
    heading: NDArray[np.float64]
    height_m: NDArray[np.float64]
    age: NDArray[Any]
    mother_id: NDArray[Any]
    reserve_kg: NDArray[np.float64]

    @classmethod
    def planted(
        cls,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        species: NDArray[Any],
        heading: NDArray[np.float64],
    ) -> Newcomers:
        """Seedlings of one internode."""
        n = len(x)
        none = np.zeros(n, np.int64)
        return cls(x, y, species, heading, np.zeros(n), none, none, np.full(n, np.nan))


def first_trees(stand: Stand) -> Newcomers:
    """Give the trees of the first year; a pattern leaves out where obstacles are.

    Raises
    ------
    InputError
        If a tree that the scenario names stands in an obstacle.
    """
    scenario = stand.scenario
    x, y, species = scenario.planting_positions()
    heading = headings(*scenario.planting_leans())
    if isinstance(scenario.planting, Explicit):
        check_free(stand.surroundings, x, y, where="planting.trees[{}]")
        return Newcomers.planted(x, y, species, heading)
    free = ~stand.surroundings.blocked(x, y)
    return Newcomers.planted(x[free], y[free], species[free], heading[free])


def check_free(
    around: Surroundings,
    x: Sequence[float] | NDArray[Any],
    y: Sequence[float] | NDArray[Any],
    *,
    where: str,
    solid: Solid | None = None,
) -> None:
    """Refuse trees whose foot would lie in an obstacle.

    Parameters
    ----------
    around : Surroundings
    x, y : sequence of n floats
        Places, m.
    where : str
        Names the trees in messages; {} stands for the number of one.
    solid : Solid, optional
        What obstacles that are to come fill; default: those that stand.
    """
    blocked = around.blocked(np.asarray(x), np.asarray(y), solid)
    if blocked.any():
        k = int(np.flatnonzero(blocked)[0])
        raise InputError(
            f"({x[k]:g}, {y[k]:g}) lies in an obstacle",
            where=where.format(k),
            expected="a place outside all obstacles",
        )


def plant(
    stand: Stand,
    x: Sequence[float],
    y: Sequence[float],
    species: str | Sequence[str],
    lean_deg: float | Sequence[float],
    lean_azimuth_deg: float | Sequence[float],
    traits: SpeciesTraits,
) -> list[int]:
    """Plant seedlings; see `forest.Stand.plant`."""
    names = [species] * len(x) if isinstance(species, str) else list(species)
    at = np.asarray(x, np.float64), np.asarray(y, np.float64)
    width, depth = stand.scenario.plot.size_m
    check_planting(*at, names, (width, depth), stand.species_names)
    leans = check_leans(len(x), lean_deg, lean_azimuth_deg)
    check_free(stand.surroundings, *at, where="Stand.plant")
    if stand.scenario.plot.boundary == "periodic":
        at = at[0] % width, at[1] % depth
    codes = np.array([stand.species_names.index(name) for name in names], np.int16)
    return establish(stand, Newcomers.planted(*at, codes, headings(*leans)), "planted", traits)


def establish(stand: Stand, new: Newcomers, kind: str, traits: SpeciesTraits) -> list[int]:
    """Give trees their rows and first metamers, and note the event; they grow from the next step.

    Parameters
    ----------
    stand : Stand
    new : Newcomers
    kind : {"planted", "recruited"}
        The event.
    traits : SpeciesTraits

    Returns
    -------
    list of int
        Their ids.
    """
    first_id, first_row = stand.next_id, len(stand.rows.tree_id)
    more = seedlings(
        new.x,
        new.y,
        new.species,
        first_id=first_id,
        step=stand.steps,
        seed=stand.scenario.seed,
        voxel_m=stand.surroundings.voxel_m,
        vigour_sd=np.array([s.carbon.vigour_sd for s in stand.species]),
        seed_reserve_kg=np.array([s.carbon.seed_reserve_kg for s in stand.species]),
    )
    more.birth[:] -= np.asarray(new.age, np.int32)
    more.mother_id[:] = new.mother_id
    given = ~np.isnan(new.reserve_kg)
    more.reserve[given] = new.reserve_kg[given]
    stand.next_id += len(more.tree_id)
    stand.rows = table.append(stand.rows, more)
    rows = stand.rows
    internode = np.array([first_internode(traits, k) for k in range(len(stand.species))])
    metamers = np.maximum(np.rint(new.height_m / internode[more.species]), 1.0).astype(np.int64)
    wanted = rows.size.astype(np.int64)
    wanted[first_row:] = metamers
    stand.arena.make_room(rows.start, rows.size, rows.room, wanted)
    sprout(
        stand.arena.metamers, rows, first_row, new.heading, metamers, traits, stand.growth_year()
    )
    for start, size in zip(rows.start[first_row:], rows.size[first_row:], strict=True):
        for field in stand.arena.companions:
            field[start : start + size] = 0  # they get their rods with their first year
    come = table.keep(rows, np.arange(len(rows.tree_id)) >= first_row)
    full_light = stand.surroundings.full_light
    measures = measure_trees(stand.arena.metamers, come, stand.measured_species, full_light)
    for k in range(len(come.tree_id)):
        stand.pending.append(Event.of(stand, first_row + k, kind, "none", measures, k))
    return list(range(first_id, stand.next_id))
