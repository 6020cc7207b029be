"""Seedlings as cohorts: those of one species and size in a cell of the ground, and their year.

In a cell the tallest come first. They take the light, each cohort standing in what the taller ones
let through, and they take the room: a square metre holds no more than a density that falls with
height, and what the taller ones leave of it is for the others.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.dynamics.regeneration.traits import SeedlingTraits
from forest.environment.canopy import through
from forest.random import STREAM_GERMINATION, STREAM_ROOM, STREAM_SEEDLING, normals, uniforms

_CHUNKS = 64
#: Height at which a seedling grows half as much as a tall one, m; assumed alike for all species.
HALF_HEIGHT_M = 0.15
#: Expected numbers from which seedlings are drawn from a normal instead of a Poisson distribution.
_MANY = 30.0


class Cohorts(NamedTuple):
    """Cohorts of seedlings: arrays of one entry per cohort, by cell and then from the tallest on.

    Attributes
    ----------
    cell : int64
        Cell of the ground.
    species : int64
        Index into the scenario's species.
    n : int64
        Seedlings.
    height : float64
        Their height, m.
    age : float64
        Years since they germinated; a mean where cohorts have merged.
    mother : int64
        Id of the tree that seeded them; 0 for seed from outside.
    reserve : float64
        What each has stored, kg.
    sprout : bool
        Whether they are sprouts of a stump.
    """

    cell: NDArray[np.int64]
    species: NDArray[np.int64]
    n: NDArray[np.int64]
    height: NDArray[np.float64]
    age: NDArray[np.float64]
    mother: NDArray[np.int64]
    reserve: NDArray[np.float64]
    sprout: NDArray[np.bool_]


_DTYPES = (np.int64, np.int64, np.int64, np.float64, np.float64, np.int64, np.float64, np.bool_)


def no_cohorts() -> Cohorts:
    """Give none."""
    columns: list[Any] = [np.empty(0, dtype) for dtype in _DTYPES]
    return Cohorts(*columns)


def keep(cohorts: Cohorts, which: NDArray[Any]) -> Cohorts:
    """Give the cohorts that a mask, or an order, chooses."""
    columns: list[Any] = [column[which] for column in cohorts]
    return Cohorts(*columns)


def join(*parts: Cohorts) -> Cohorts:
    """Put cohorts together, in order of cell and from the tallest on."""
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    joined = Cohorts(*columns)
    return keep(joined, np.lexsort((joined.species, -joined.height, joined.cell)))


class Ground(NamedTuple):
    """What seedlings find in their cells; float64 (cells,) and numbers.

    Attributes
    ----------
    light : float64 (cells,)
        Light above them, 0 to 1.
    taken : float64 (cells,)
        Share of the room that trees take.
    transmission : float64 (n,)
        What a layer of leaves lets through; see `forest.environment.canopy.Canopy`.
    area : float
        Area of a cell, m2.
    """

    light: NDArray[np.float64]
    taken: NDArray[np.float64]
    transmission: NDArray[np.float64]
    area: float


@njit
def survival(light: Any, half: Any, most: Any) -> Any:
    """Give the share of seedlings that survives a year: half of the most at the light `half`.

    most / (1 + (half / L)^4): a tolerant species' half is low, and little below it all die. Of
    germinants the most is 1: what else kills them is in the share that germinates.
    """
    ratio = half / np.maximum(light, 1e-9)
    square = ratio * ratio
    return most / (1.0 + square * square)


@njit
def growth_response(light: Any, least: Any, slope: Any) -> Any:
    """Give the factor of light on growth in height, 0 at the least light and 1 in full light.

    (1 - exp(-c (L - L0))) / (1 - exp(-c (1 - L0))), the form of Botkin et al. 1972.
    """
    if light <= least:
        return 0.0
    return (1.0 - np.exp(-slope * (light - least))) / (1.0 - np.exp(-slope * (1.0 - least)))


@njit
def room(height: Any, kind: Any, traits: Any) -> Any:
    """Give the most plants of a height that stand on a square metre."""
    return traits.density_1m_m2[kind] * height ** (-traits.density_exponent[kind])


@njit
def leaf_area(height: Any, kind: Any, traits: Any) -> Any:
    """Give the leaf area of a seedling, m2."""
    return traits.leaf_area_1m_m2[kind] * height * height


@njit
def survivors(n: Any, share: Any, seed: Any, cell: Any, place: Any, year: Any) -> Any:
    """Draw how many of n survive: one trial each, named by the cohort's place in its cell."""
    alive = np.int64(0)
    for k in range(0, n, 4):
        draws = uniforms(seed, np.int64(STREAM_SEEDLING), cell, (place << 20) + k // 4, year)
        for j in range(min(n - k, 4)):
            if draws[j] < share:
                alive += 1
    return alive


@njit
def _year_of_cell(
    cell: Any,
    first: Any,
    last: Any,
    cohorts: Any,
    ground: Any,
    traits: Any,
    factor: Any,
    key: Any,
    died: Any,
    crowded: Any,
) -> None:
    """Let the cohorts of a cell live a year, from the tallest on; see `live_a_year`."""
    lai = 0.0
    taken = ground.taken[cell]
    for k in range(first, last):
        kind = cohorts.species[k]
        n = cohorts.n[k]
        height = cohorts.height[k]
        light = ground.light[cell] * through(ground.transmission, lai)
        leaves = leaf_area(height, kind, traits)
        lai += n * leaves / ground.area
        share = survival(light, traits.survival_light_half[kind], traits.survival_max[kind])
        alive = survivors(n, share, key[0], cell, k - first, key[1])
        died[k] = n - alive
        if cohorts.sprout[k]:
            most = traits.sprout_height_m[kind]
        else:
            most = traits.max_height_growth_m[kind] * height / (height + HALF_HEIGHT_M)
        response = growth_response(
            light, traits.growth_light_least[kind], traits.growth_light_slope[kind]
        )
        height += most * response * min(factor[kind], 1.0)
        income = traits.light_use_kg_m2[kind] * light * factor[kind]
        gain = leaves * (income - traits.leaf_cost_kg_m2[kind])
        has = max(cohorts.reserve[k] + gain, 0.0)
        cohorts.reserve[k] = traits.reserve_fraction[kind] * has
        cohorts.height[k] = height
        cohorts.age[k] += 1.0
        full = room(height, kind, traits) * ground.area
        draw, _, _, _ = uniforms(key[0], np.int64(STREAM_ROOM), cell, k - first, key[1])
        free = np.int64(max(1.0 - taken, 0.0) * full + draw)
        stay = min(alive, free)
        crowded[k] = alive - stay
        cohorts.n[k] = stay
        taken += stay / full


@driver
def _live(
    first: Any,
    step: Any,
    starts: Any,
    cohorts: Any,
    ground: Any,
    traits: Any,
    factor: Any,
    key: Any,
    died: Any,
    crowded: Any,
) -> None:
    cells = len(starts) - 1
    for chunk in range(first, _CHUNKS, step):
        for c in range(cells * chunk // _CHUNKS, cells * (chunk + 1) // _CHUNKS):
            a = starts[c]
            _year_of_cell(
                cohorts.cell[a],
                a,
                starts[c + 1],
                cohorts,
                ground,
                traits,
                factor,
                key,
                died,
                crowded,
            )


def live_a_year(
    cohorts: Cohorts,
    ground: Ground,
    traits: SeedlingTraits,
    income_factor: NDArray[np.float64],
    *,
    seed: int,
    year: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Let cohorts survive, grow and thin themselves for a year, in place.

    Each seedling lives or dies by the light above it, on its own draw. Those that live grow by that
    light; they put aside the share of what they have that trees do. Then the cohort keeps as many
    as find room beside the trees and the taller cohorts of the cell; a part of a plant is drawn.

    Parameters
    ----------
    cohorts : Cohorts
        In order of cell, from the tallest on.
    ground : Ground
    traits : SeedlingTraits
    income_factor : float64 (species,)
        The year's factor on income. A good year or site adds nothing to the height growth of full
        light, which is the most that a species has in it; a poor one takes from it.
    seed, year : int
        Seed of the scenario and calendar year, of which the draws are a function.

    Returns
    -------
    died, crowded : int64 (n,)
        Seedlings of each cohort that the year's light killed, and that found no room.
    """
    n = len(cohorts.cell)
    died, crowded = np.zeros(n, np.int64), np.zeros(n, np.int64)
    starts = np.flatnonzero(np.diff(cohorts.cell, prepend=-1, append=-1))
    key = np.array([seed, year], np.int64)
    in_threads(_live, starts, cohorts, ground, traits, income_factor, key, died, crowded)
    return died, crowded


@njit
def poisson(mean: Any, seed: Any, cell: Any, kind: Any, year: Any) -> Any:
    """Draw from a Poisson distribution; from a normal one with its moments where it is large."""
    if mean >= _MANY:
        z, _ = normals(seed, np.int64(STREAM_GERMINATION), cell, kind, year)
        return np.int64(max(mean + np.sqrt(mean) * z + 0.5, 0.0))
    draw, _, _, _ = uniforms(seed, np.int64(STREAM_GERMINATION), cell, kind, year)
    n = np.int64(0)
    chance = np.exp(-mean)
    below = chance
    while draw > below and n < 1000:
        n += 1
        chance *= mean / n
        below += chance
    return n


@driver
def _germinate(first: Any, step: Any, expected: Any, key: Any, n: Any) -> None:
    cells = len(expected)
    for chunk in range(first, _CHUNKS, step):
        for cell in range(cells * chunk // _CHUNKS, cells * (chunk + 1) // _CHUNKS):
            n[cell] = poisson(expected[cell], key[0], cell, key[1], key[2])


def germinate(
    expected: NDArray[np.float64], *, seed: int, kind: int, year: int
) -> NDArray[np.int64]:
    """Draw the seedlings of a species that stand in each cell at the end of their first summer."""
    n = np.zeros(len(expected), np.int64)
    in_threads(_germinate, expected, np.array([seed, kind, year], np.int64), n)
    return n


def leaf_index(cohorts: Cohorts, traits: SeedlingTraits, cells: int, area: float) -> Any:
    """Give the leaf area index of the cohorts in each cell, float64 (cells,)."""
    leaves = cohorts.n * traits.leaf_area_1m_m2[cohorts.species] * cohorts.height**2
    return np.bincount(cohorts.cell, weights=leaves, minlength=cells) / area


def merge(cohorts: Cohorts, most: int) -> Cohorts:
    """Bound the number of cohorts: in each cell and species the lowest become one.

    The tallest `most` - 1 stay as they are. The others become one with their mean height, age and
    reserve; its mother, and whether it is of sprouts, are those of its most numerous part.

    Parameters
    ----------
    cohorts : Cohorts
        In order of cell, from the tallest on; none empty.
    most : int
        Cohorts of a species in a cell.
    """
    order: NDArray[np.int64] = np.lexsort((-cohorts.height, cohorts.species, cohorts.cell))
    sorted_ = keep(cohorts, order)
    n = len(order)
    if n == 0:
        return cohorts
    new = np.ones(n, np.bool_)
    new[1:] = (np.diff(sorted_.cell) != 0) | (np.diff(sorted_.species) != 0)
    group = np.flatnonzero(new)
    rank = np.arange(n) - np.repeat(group, np.diff(np.append(group, n)))
    first = np.flatnonzero(rank < most)
    if len(first) == n:
        return cohorts
    count = np.add.reduceat(sorted_.n, first)

    def mean(column: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.add.reduceat(column * sorted_.n, first) / count)

    part = np.repeat(np.arange(len(first)), np.diff(np.append(first, n)))
    largest = np.lexsort((rank, -sorted_.n, part))[first]
    merged = keep(sorted_, first)._replace(
        n=count,
        height=mean(sorted_.height),
        age=mean(sorted_.age),
        reserve=mean(sorted_.reserve),
        mother=sorted_.mother[largest],
        sprout=sorted_.sprout[largest],
    )
    return join(merged)
