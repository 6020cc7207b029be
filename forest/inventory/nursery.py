"""A nursery: hidden stands of a species, open-grown to dense, in which measured trees find theirs.

The stands grow by the scenario's own rules, with the species' own parameters, on its site and level
ground; all years are alike. Each year every wanted tree looks whether a tree of the nursery is
nearer to its size than the one it has found before. So only trees that are wanted are ever kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.measure.trees import TreeMeasures
from forest.random import STREAM_NURSERY, normals

if TYPE_CHECKING:
    from forest.scenario import Scenario
    from forest.stand import Stand

#: Spacings of the nursery's stands, m, and trees along an edge of each.
LAYOUTS = ((0.7, 7), (1.0, 6), (1.5, 5), (2.5, 4), (4.0, 3), (7.0, 2))
#: A stand is given up after so many years, or when it has not grown a fiftieth in so many.
_MOST_YEARS = 400
_PATIENCE, _LEAST_RISE = 20, 1.02
#: Trees within this difference of ln(height) tell how thick and how thin one of that height can be.
_BAND = 0.2
#: Weights of the squared differences of ln(height), ln(dbh), crown base per height, height per that
#: of the tallest around, and ln(age).
_HEIGHT, _DBH, _CROWN, _RANK, _AGE = 4.0, 1.0, 2.0, 0.1, 0.25
#: Standard deviations of ln(height) and ln(dbh) by which a tree looks beside its own.
_BESIDE = (0.03, 0.05)
#: What a missing dbh counts as, as a difference of ln(dbh).
_NO_DBH = 1.0


class Wanted(NamedTuple):
    """Trees of one species that are looked for; float64 arrays of n entries.

    Attributes
    ----------
    height_m : float64
    dbh_cm : float64
        Over bark; NaN below 1.3 m.
    crown_base_m, age : float64
        NaN where it is not known.
    rank : float64
        Height per that of the tallest tree around, 0 to 1: one that was always overtopped has
        another crown than a young one of its height.
    """

    height_m: NDArray[np.float64]
    dbh_cm: NDArray[np.float64]
    crown_base_m: NDArray[np.float64]
    age: NDArray[np.float64]
    rank: NDArray[np.float64]


class Donor(NamedTuple):
    """A tree of the nursery as it stood at the end of a year.

    Attributes
    ----------
    row : dict of str to array
        Its row of the tree table, each column of one entry.
    metamers : dict of str to array
        Its metamers, by field; `birth` counts back from the year in which it was taken (0).
    companions : tuple of array
        Its part of the arena's companions.
    age : int
        Years.
    height_m, dbh_cm, crown_base_m : float
    """

    row: dict[str, NDArray[Any]]
    metamers: dict[str, NDArray[Any]]
    companions: tuple[NDArray[Any], ...]
    age: int
    height_m: float
    dbh_cm: float
    crown_base_m: float


class Found(NamedTuple):
    """What the nursery has for the wanted trees.

    Attributes
    ----------
    donors : list of Donor
        The donor of each wanted tree; several trees may share one.
    thinnest_cm, thickest_cm : float64 (n,)
        Least dbh, and greatest base diameter, among the nursery's trees of about the tree's
        height; infinite and 0 where there was none.
    tallest_m : float
        Height that the nursery has reached.
    years : int
        Years of its oldest stand.
    """

    donors: list[Donor]
    thinnest_cm: NDArray[np.float64]
    thickest_cm: NDArray[np.float64]
    tallest_m: float
    years: int


def nursery_scenario(scenario: Scenario, name: str, layout: int) -> Scenario:
    """Give the scenario of one stand of the nursery: a species in rows on a small torus."""
    spacing, along = LAYOUTS[layout]
    given = scenario.model_dump()
    environment = given["environment"]
    if environment["markers"] is not None:
        environment["markers"] |= {"envelope": (), "clouds": ()}
    if environment["rendered"] is not None:
        environment["rendered"] |= {"clearing_radius_m": None, "clearing_height_m": None}
    voxel = [environment[part]["voxel_m"] for part in ("canopy", "shadow") if environment[part]]
    edge = math.ceil(spacing * along / voxel[0]) * voxel[0] if voxel else spacing * along
    return type(scenario)(
        years=_MOST_YEARS,
        seed=scenario.seed,
        mode=scenario.mode,
        plot={"size_m": [edge, edge], "boundary": "periodic"},
        site=given["site"],
        growth=given["growth"],
        mechanics=given["mechanics"],
        environment=environment,
        species={name: given["species"][name]},
        planting={"kind": "regular", "spacing_m": [edge / along, edge / along]},
        output={"tables": []},
    )


def search(
    scenario: Scenario,
    name: str,
    wanted: Wanted,
    tree_id: NDArray[np.int32],
    grow: Callable[[Scenario], Stand],
    say: Callable[[str], None],
) -> Found:
    """Grow the nursery of a species and find the tree nearest to each that is wanted.

    Parameters
    ----------
    scenario : Scenario
        Whose rules and species they are.
    name : str
        The species.
    wanted : Wanted
    tree_id : int32 (n,)
        Their ids. Each looks a little beside its size, so that trees of one size are not all alike.
    grow : callable
        Makes a stand of a scenario.
    say : callable
        Told how it goes on.
    """
    draws = [normals(scenario.seed, STREAM_NURSERY, int(i), 1, 0) for i in tree_id]
    finder = _Finder(wanted, np.array(draws).reshape(-1, 2))
    top = float(wanted.height_m.max())
    years = 0
    for layout, (spacing, _) in enumerate(LAYOUTS):
        stand = grow(nursery_scenario(scenario, name, layout))
        heights = [0.0]
        while stand.steps < _MOST_YEARS and heights[-1] < top:
            stand.step()
            measures = stand.measure()
            if not len(measures.height_m):
                break
            finder.look(stand, measures)
            heights.append(max(heights[-1], float(measures.height_m.max())))
            if stand.steps > _PATIENCE and heights[-1] < _LEAST_RISE * heights[-1 - _PATIENCE]:
                break
        years = max(years, stand.steps)
        say(
            f"nursery of {name}, {spacing:g} m apart: {heights[-1]:.1f} m high after "
            f"{stand.steps} years"
        )
    return finder.found(years)


class _Finder:
    """The nearest trees so far."""

    def __init__(self, wanted: Wanted, draws: NDArray[np.float64]) -> None:
        n = len(wanted.height_m)
        self._wanted = wanted
        self._log_height = np.log(wanted.height_m) + _BESIDE[0] * draws[:, 0]
        self._log_dbh = np.log(wanted.dbh_cm) + _BESIDE[1] * draws[:, 1]
        self._distance = np.full(n, np.inf)
        self._donors: list[Donor | None] = [None] * n
        self._thinnest = np.full(n, np.inf)
        self._thickest = np.zeros(n)
        self._tallest = 0.0

    def look(self, stand: Stand, measures: TreeMeasures) -> None:
        """Look over the trees of a stand at the end of a year."""
        self._tallest = max(self._tallest, float(measures.height_m.max()))
        self._note_range(measures)
        distance = self._distances(measures, stand.steps)
        best = np.argmin(distance, axis=1)
        nearest = distance[np.arange(len(best)), best]
        better = np.flatnonzero(nearest < self._distance)
        taken: dict[int, Donor] = {}
        for i in better:
            row = int(best[i])
            if row not in taken:
                taken[row] = _take(stand, measures, row)
            self._donors[i] = taken[row]
        self._distance[better] = nearest[better]

    def found(self, years: int) -> Found:
        """Tell what has been found."""
        donors = [donor for donor in self._donors if donor is not None]
        return Found(donors, self._thinnest, self._thickest, self._tallest, years)

    def _distances(self, measures: TreeMeasures, steps: int) -> NDArray[np.float64]:
        """Give the squared difference in size of each wanted tree to each tree, (wanted, trees)."""
        wanted = self._wanted
        height = self._log_height[:, None] - np.log(measures.height_m)
        dbh = self._log_dbh[:, None] - np.log(measures.dbh_cm)
        dbh = np.where(np.isnan(wanted.dbh_cm)[:, None], 0.0, dbh)
        crown = (wanted.crown_base_m / wanted.height_m)[:, None]
        crown = np.nan_to_num(crown - measures.crown_base_m / measures.height_m)
        rank = wanted.rank[:, None] - measures.height_m / measures.height_m.max()
        older = np.nan_to_num(np.log(wanted.age) - np.log(steps))[:, None]
        squares = _HEIGHT * height**2 + _CROWN * crown**2 + _RANK * rank**2 + _AGE * older**2
        squares += _DBH * np.where(np.isnan(dbh), _NO_DBH, dbh) ** 2
        return np.where(measures.buds > 0, squares, np.inf)

    def _note_range(self, measures: TreeMeasures) -> None:
        """Note how thin and how thick trees of about the wanted heights are."""
        apart = np.log(self._wanted.height_m)[:, None] - np.log(measures.height_m)
        alike = (np.abs(apart) <= _BAND) & ~np.isnan(measures.dbh_cm)
        thin = np.where(alike, measures.dbh_cm, np.inf).min(axis=1)
        thick = np.where(alike, measures.base_diameter_cm, 0.0).max(axis=1)
        self._thinnest = np.minimum(self._thinnest, thin)
        self._thickest = np.maximum(self._thickest, thick)


def _take(stand: Stand, measures: TreeMeasures, row: int) -> Donor:
    """Copy a tree as it stands."""
    start, size = int(stand.rows.start[row]), int(stand.rows.size[row])
    here = slice(start, start + size)
    metamers = {name: field[here].copy() for name, field in stand.arena.metamers._asdict().items()}
    metamers["birth"] -= np.int16(stand.steps)
    return Donor(
        row={name: column[row : row + 1].copy() for name, column in stand.rows._asdict().items()},
        metamers=metamers,
        companions=tuple(field[here].copy() for field in stand.arena.companions),
        age=int(stand.steps - stand.rows.birth[row]),
        height_m=float(measures.height_m[row]),
        dbh_cm=float(measures.dbh_cm[row]),
        crown_base_m=float(measures.crown_base_m[row]),
    )
