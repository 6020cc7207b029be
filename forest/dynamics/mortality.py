"""Which trees die in a year, and of what.

Each cause gives its own list of deaths. A tree dies once, of the first cause in this order: what
the user gave, suppression, buckling, age, the background. Draws are named by tree and year, so
that one cause never shifts the numbers of another.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.draws import uniforms_of
from forest.errors import ActError, InputError
from forest.random import STREAM_DEATH, STREAM_DISTURBANCE
from forest.trees.table import Trees, distances, row_of

if TYPE_CHECKING:
    from forest.measure.trees import TreeMeasures
    from forest.scenario.mortality import Disturbance
    from forest.species import Species
    from forest.stand import Stand


class Death(NamedTuple):
    """A tree that dies this year.

    Attributes
    ----------
    row : int
        Its row of the tree table.
    kind, cause : str
        As in `/events`: one of `forest.record.schema.EVENT_KINDS` and of `CAUSES`.
    broken : bool
        Whether a storm broke its stem, and left the roots of its stump in the ground.
    """

    row: int
    kind: str
    cause: str
    broken: bool = False


class Hazards(NamedTuple):
    """Chances of death by age and at random; float64 arrays of one entry per species."""

    longevity_years: NDArray[np.float64]  # L
    longevity_share: NDArray[np.float64]  # s
    ageing_exponent: NDArray[np.float64]  # k
    background_per_year: NDArray[np.float64]

    @classmethod
    def of(cls, species: Sequence[Species]) -> Self:
        """Read the species."""
        return cls(*(np.array([getattr(s.mortality, key) for s in species]) for key in cls._fields))


class Ground(NamedTuple):
    """The plot's edges along x and y, m, and whether it wraps."""

    size_m: tuple[float, float]
    periodic: bool


def deaths_of(stand: Stand, measures: TreeMeasures) -> list[Death]:
    """Find the trees that die at the end of a year, in order of rows.

    Parameters
    ----------
    stand : Stand
        After growth.
    measures : TreeMeasures
        Of all its trees.
    """
    scenario, rows = stand.scenario, stand.rows
    rules = scenario.mortality
    due = [event for event in rules.events if event.year == stand.year]
    ground = Ground(scenario.plot.size_m, scenario.plot.boundary == "periodic")
    found = [
        disturbed(
            rows, measures.dbh_cm, due, stand.species_names, ground, scenario.seed, stand.steps
        )
    ]
    if scenario.mode != "paper":
        limit = np.array([s.carbon.suppression_years for s in stand.species], np.float64)
        found.append(starved(rows, measures.buds, limit))
    if rules.buckling and stand.mechanics is not None:
        found.append(buckled(stand.mechanics.stability(stand.arena, rows).safety_factor))
    if rules.age or rules.background:
        hazards = Hazards.of(stand.species)
        draws = uniforms_of(scenario.seed, STREAM_DEATH, rows.tree_id, 0, stand.steps)
        if rules.age:
            found.append(aged(rows, stand.steps, hazards, draws[:, 0]))
        if rules.background:
            found.append(unlucky(rows, hazards, draws[:, 1]))
    return first_of(found)


def first_of(causes: Iterable[Sequence[Death]]) -> list[Death]:
    """Let each tree die once, of the first cause that names it; in order of rows."""
    of_row: dict[int, Death] = {}
    for deaths in causes:
        for death in deaths:
            of_row.setdefault(death.row, death)
    return [of_row[row] for row in sorted(of_row)]


def starved(
    trees: Trees, buds: NDArray[np.int32], suppression_years: NDArray[np.float64]
) -> list[Death]:
    """Find the trees whose mass balance ends: suppressed for too long, or without a living site.

    Parameters
    ----------
    trees : Trees
    buds : int32 (n,)
        Living sites of each tree.
    suppression_years : float64 (species,)
        Bad years in a row after which a tree dies.
    """
    suppressed = trees.bad_years >= suppression_years[trees.species]
    return [
        Death(int(row), "died", "suppression" if suppressed[row] else "no_buds")
        for row in np.flatnonzero(suppressed | (buds == 0))
    ]


def buckled(safety_factor: NDArray[np.float64]) -> list[Death]:
    """Find the trees whose weight is more than their stem bears (Greenhill 1881).

    Parameters
    ----------
    safety_factor : float64 (n,)
        Weight at which a stem buckles per weight; NaN for a tree without a stem.
    """
    return [Death(int(row), "died", "buckling") for row in np.flatnonzero(safety_factor < 1.0)]


def ageing_hazard(
    age: NDArray[np.float64],
    longevity_years: NDArray[np.float64],
    longevity_share: NDArray[np.float64],
    ageing_exponent: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Give the chance to die of age in the year that ends at an age.

    Of age alone, the share s^((a/L)^k) of the trees reaches age a (Weibull 1951); the chance is
    what brings it there from a - 1, so that after L years exactly s is left, on average.

    Parameters
    ----------
    age : float64 (n,)
        Years at the end of the year, 1 or more.
    longevity_years, longevity_share, ageing_exponent : float64 (n,)
        L, s and k of each tree.
    """
    before, now = (age - 1.0) / longevity_years, age / longevity_years
    gone = now**ageing_exponent - before**ageing_exponent
    return -np.expm1(np.log(longevity_share) * gone)


def aged(trees: Trees, step: int, hazards: Hazards, draws: NDArray[np.float64]) -> list[Death]:
    """Find the trees that die of age in a year.

    Parameters
    ----------
    trees : Trees
    step : int
        The year's step; a tree that was planted before it is one year old at its end.
    hazards : Hazards
    draws : float64 (n,)
        A uniform number for each tree.
    """
    age = np.maximum(step - trees.birth, 1).astype(np.float64)
    of_age = (column[trees.species] for column in hazards[:3])
    dies = draws < ageing_hazard(age, *of_age)
    return [Death(int(row), "died", "age") for row in np.flatnonzero(dies)]


def unlucky(trees: Trees, hazards: Hazards, draws: NDArray[np.float64]) -> list[Death]:
    """Find the trees that die of what the model does not know; see `aged`."""
    dies = draws < hazards.background_per_year[trees.species]
    return [Death(int(row), "died", "background") for row in np.flatnonzero(dies)]


def disturbed(
    trees: Trees,
    dbh_cm: NDArray[np.float64],
    events: Sequence[Disturbance],
    species_names: Sequence[str],
    ground: Ground,
    seed: int,
    step: int,
) -> list[Death]:
    """Find the trees that the user's disturbances of a year kill; the first one counts.

    Parameters
    ----------
    trees : Trees
    dbh_cm : float64 (n,)
        NaN for a tree below 1.3 m, which counts as 0.
    events : sequence of Disturbance
        Those of the year, in the order of the file. A tree that one names and that acts of the
        same year have felled is left out.
    species_names : sequence of str
        The scenario's species.
    ground : Ground
    seed, step : int
        Of the draws of shares: each tree has one per disturbance and year.
    """
    found = []
    for k, event in enumerate(events):
        if event.tree_id is not None:
            struck = trees.tree_id == event.tree_id
        else:
            struck = _within(trees, event, ground) & _meant(trees, dbh_cm, event, species_names)
            if event.share is not None:
                draws = uniforms_of(seed, STREAM_DISTURBANCE, trees.tree_id, k, step)[:, 0]
                struck &= draws < event.share
        kind = "windthrown" if event.cause == "wind" else "died"
        found.append([Death(int(row), kind, event.cause) for row in np.flatnonzero(struck)])
    return first_of(found)


def _within(trees: Trees, event: Disturbance, ground: Ground) -> NDArray[np.bool_]:
    """Tell which trees stand in a disturbance's patch, or all if it has none."""
    if event.x_m is None or event.y_m is None or event.radius_m is None:
        return np.ones(len(trees.tree_id), np.bool_)
    away = distances(trees.x, trees.y, event.x_m, event.y_m, *ground)
    near: NDArray[np.bool_] = away <= event.radius_m
    return near


def _meant(
    trees: Trees, dbh_cm: NDArray[np.float64], event: Disturbance, species_names: Sequence[str]
) -> NDArray[np.bool_]:
    """Tell which trees are of the species and size that a disturbance kills."""
    dbh = np.nan_to_num(dbh_cm, nan=0.0)
    meant = np.ones(len(dbh), np.bool_)
    if event.species is not None:
        meant &= trees.species == list(species_names).index(event.species)
    if event.min_dbh_cm is not None:
        meant &= dbh >= event.min_dbh_cm
    if event.max_dbh_cm is not None:
        meant &= dbh <= event.max_dbh_cm
    return meant


def check_due(stand: Stand) -> None:
    """Refuse disturbances of the next year that name a tree which does not live.

    Raises
    ------
    ActError
        Then nothing of that year was done.
    """
    year = stand.year + 1
    for i, event in enumerate(stand.scenario.mortality.events):
        if event.year == year and event.tree_id is not None:
            name = event.source or f"mortality.events[{i}].tree_id"
            try:
                row_of(stand.rows, event.tree_id, where=f"{name} in {year}")
            except InputError as refusal:
                raise ActError(str(refusal)) from None
