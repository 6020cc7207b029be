"""Measured trees come into the stand: each as the nursery's nearest tree, fitted to its size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.planting import seedlings
from forest.errors import InputError
from forest.establishment import check_free
from forest.inventory.fitting import aged, stretched, thickened
from forest.inventory.nursery import Donor, Found, Wanted, search
from forest.measure.trees import BREAST_HEIGHT_M
from forest.mechanics.transplant import transplanted
from forest.random import STREAM_NURSERY, uniforms
from forest.scenario.inventory import Inventory, InventoryTree
from forest.trees import table
from forest.yearbook import Event

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario
    from forest.stand import Stand

#: How far beyond the tallest tree of the nursery a tree may be stretched.
_MOST_STRETCH = 1.05
#: How far a dbh may lie beyond those of the nursery's trees of about its height.
_THINNER, _THICKER = 0.5, 1.5
#: Recent years in which the ages of metamers are kept, beyond those in which they keep leaves.
_RECENT_YEARS = 10
#: How far around a tree those stand whose height it is compared with, m.
_AROUND_M = 10.0
#: Above 1.3 m by so little that float32 cannot lose it.
_JUST_ABOVE = 1.0 + 1e-6


class Built(NamedTuple):
    """The trees that were built, beside what was measured; arrays of n entries.

    Attributes
    ----------
    tree_id : int32
    dbh_cm, height_m, crown_base_m : float64
        As measured (a height perhaps by the height curve); NaN where nothing was.
    built_dbh_cm, built_height_m, built_crown_base_m, built_crown_radius_m : float64
        As built.
    donor_dbh_cm, donor_height_m : float64
        Of the nursery's tree before it was fitted.
    donor_age : int64
        Its years.
    """

    tree_id: NDArray[np.int32]
    dbh_cm: NDArray[np.float64]
    height_m: NDArray[np.float64]
    crown_base_m: NDArray[np.float64]
    built_dbh_cm: NDArray[np.float64]
    built_height_m: NDArray[np.float64]
    built_crown_base_m: NDArray[np.float64]
    built_crown_radius_m: NDArray[np.float64]
    donor_dbh_cm: NDArray[np.float64]
    donor_height_m: NDArray[np.float64]
    donor_age: NDArray[np.int64]

    def frame(self) -> pd.DataFrame:
        """Give a table with a row per tree."""
        import pandas as pd

        return pd.DataFrame(self._asdict())

    def report(self) -> str:
        """Say in a line how near the built trees are to what was measured."""
        stretch = self.built_height_m / self.donor_height_m
        thick = self.built_dbh_cm / self.donor_dbh_cm
        text = (
            f"{len(self.tree_id)} trees built from {_distinct(self)} of the nursery; dbh and "
            f"height as measured, lengths x {_middle(stretch)}"
        )
        if not np.isnan(thick).all():
            text += f", diameters x {_middle(thick)}"
        apart = np.abs(self.built_crown_base_m - self.crown_base_m)
        if not np.isnan(apart).all():
            text += f"; crown base {np.nanmedian(apart):.2g} m off (median)"
        ratio = 1.0 - self.built_crown_base_m / self.built_height_m
        return (
            f"{text}; made up: crown radius {np.mean(self.built_crown_radius_m):.2g} m, crown "
            f"ratio {np.mean(ratio):.2g} (means)"
        )


def settle(
    stand: Stand,
    planting: Inventory,
    grow: Callable[[Scenario], Stand],
    say: Callable[[str], None],
) -> Built:
    """Build the trees of an inventory in a stand that has none, and note the events.

    Parameters
    ----------
    stand : Stand
    planting : Inventory
        Complete: every tree with its height.
    grow : callable
        Makes the stands of the nursery.
    say : callable
        Told how the nursery goes on.

    Raises
    ------
    InputError
        If a tree is taller than any of the nursery, or too thin or too thick for its height.
    """
    scenario = stand.scenario
    x, y, species = scenario.planting_positions()
    check_free(stand.surroundings, x, y, where="planting.trees[{}]")
    rows = seedlings(
        x,
        y,
        species,
        first_id=stand.next_id,
        step=stand.steps,
        seed=scenario.seed,
        voxel_m=stand.surroundings.voxel_m,
        vigour_sd=np.zeros(len(stand.species)),
        seed_reserve_kg=np.zeros(len(stand.species)),
    )
    wanted = _wanted(scenario, planting.trees, x, y)
    donors: list[Donor | None] = [None] * len(x)
    for kind, name in enumerate(stand.species_names):
        mine = np.flatnonzero(species == kind)
        if not len(mine):
            continue
        own = Wanted(*(column[mine] for column in wanted))
        found = search(scenario, name, own, rows.tree_id[mine], grow, say)
        _check(stand, planting, kind, mine, own, found)
        for i, donor in zip(mine, found.donors, strict=True):
            donors[i] = donor
    fitting = _Fitting(stand, rows, [donor for donor in donors if donor is not None])
    fitting.stretch(wanted)
    fitting.thicken(wanted)
    fitting.age([tree.age for tree in planting.trees])
    fitting.put()
    measures = stand.measure()
    stand.rows.breast_serial[:] = measures.breast_serial
    for row in range(len(stand.rows.tree_id)):
        stand.pending.append(Event.of(stand, row, "planted", "none", measures))
    built = Built(
        tree_id=stand.rows.tree_id.copy(),
        dbh_cm=wanted.dbh_cm,
        height_m=wanted.height_m,
        crown_base_m=wanted.crown_base_m,
        built_dbh_cm=measures.dbh_cm,
        built_height_m=measures.height_m,
        built_crown_base_m=measures.crown_base_m,
        built_crown_radius_m=measures.crown_radius_m,
        donor_dbh_cm=np.array([donor.dbh_cm for donor in fitting.donors]),
        donor_height_m=np.array([donor.height_m for donor in fitting.donors]),
        donor_age=np.array([donor.age for donor in fitting.donors]),
    )
    say(built.report())
    return built


def _wanted(
    scenario: Scenario,
    trees: Sequence[InventoryTree],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> Wanted:
    """Gather what is known of the measured trees, and how tall each is among those around it."""
    from scipy.spatial import cKDTree

    height, dbh, crown_base, age = (
        np.array([np.nan if v is None else v for v in (getattr(t, key) for t in trees)], np.float64)
        for key in ("height_m", "dbh_cm", "crown_base_m", "age")
    )
    size = scenario.plot.size_m
    torus = scenario.plot.boundary == "periodic"
    places = np.stack((x, y), axis=1)
    reach = min(_AROUND_M, 0.49 * min(size)) if torus else _AROUND_M
    around = cKDTree(places, boxsize=size if torus else None).query_ball_point(places, reach)
    tallest = np.array([height[near].max() for near in around])
    return Wanted(height, dbh, crown_base, age, height / tallest)


class _Fitting:
    """Nursery trees on their way into the stand: one donor for each row of the table."""

    def __init__(self, stand: Stand, rows: table.Trees, donors: list[Donor]) -> None:
        self._stand = stand
        self._rows = rows
        self.donors = donors
        seed, ids = stand.scenario.seed, rows.tree_id
        self._azimuth = [2.0 * np.pi * uniforms(seed, STREAM_NURSERY, int(i), 0, 0)[0] for i in ids]
        self._ratio = np.ones(len(donors))
        self._metamers: list[dict[str, NDArray[Any]]] = []

    def stretch(self, wanted: Wanted) -> None:
        """Turn the donors and stretch them to the wanted heights."""
        self._ratio = wanted.height_m / [donor.height_m for donor in self.donors]
        self._ratio[~np.isnan(wanted.dbh_cm)] *= _JUST_ABOVE  # one of 1.3 m has a dbh
        self._ratio[np.isnan(wanted.dbh_cm)] /= _JUST_ABOVE
        fitted = zip(self.donors, self._ratio, self._azimuth, strict=True)
        self._metamers = [stretched(donor, ratio, azimuth) for donor, ratio, azimuth in fitted]

    def thicken(self, wanted: Wanted) -> None:
        """Give the trees that have a dbh the wanted one, over bark."""
        stand, rows = self._stand, self._rows
        self.put()
        breast = stand.measure().breast_metamer
        wood = 1.0 - stand.measured_species.bark_factor[rows.species]
        exponent = stand.pipe_exponent[rows.species]
        pipes = (0.01 * wanted.dbh_cm * wood) ** exponent
        paper = stand.scenario.mode == "paper"
        for i in np.flatnonzero(~np.isnan(pipes)):
            metamers = self._metamers[i]
            shoot = stand.species[rows.species[i]].wood.twig_diameter_m
            metamers["pipe"] = thickened(
                metamers["pipe"],
                metamers["parent"],
                int(breast[i]),
                float(pipes[i]),
                0.0 if paper else min(shoot**2, float(pipes[i])),
            )
            # what serves the leaves stays, since the leaves do
            metamers["sapwood"] = np.minimum(metamers["sapwood"], metamers["pipe"])

    def age(self, ages: list[int | None]) -> None:
        """Give the trees their ages, and their metamers births that go with them."""
        for i, (donor, age) in enumerate(zip(self.donors, ages, strict=True)):
            leaves = self._stand.species[self._rows.species[i]].leaves
            years = donor.age if age is None else age
            kept = max(_RECENT_YEARS, int(np.ceil(leaves.retention_years)))
            births = aged(donor.metamers["birth"], donor.age, years, kept)
            self._metamers[i]["birth"] = births + np.int16(self._stand.steps)
            self._rows.birth[i] = self._stand.steps - years

    def put(self) -> None:
        """Write the trees into the stand's table and arena, over what was there of them."""
        stand, arena = self._stand, self._stand.arena
        rows = table.append(table.empty(), self._rows)  # a copy
        for name in ("vigour", "reserve", "wind_stress", "bad_years", "next_serial"):
            getattr(rows, name)[:] = [donor.row[name][0] for donor in self.donors]
        size = np.array([len(metamers["parent"]) for metamers in self._metamers], np.int64)
        arena.used = 0
        arena.make_room(rows.start, rows.size, rows.room, size)
        rows.size[:] = size
        stand.rows = rows
        stand.next_id = int(rows.tree_id[-1]) + 1
        for i, metamers in enumerate(self._metamers):
            here = slice(int(rows.start[i]), int(rows.start[i] + rows.size[i]))
            for name, values in metamers.items():
                getattr(arena.metamers, name)[here] = values
            if arena.companions:
                for field, values in zip(arena.companions, self._rods(i), strict=True):
                    field[here] = values

    def _rods(self, i: int) -> tuple[NDArray[Any], ...]:
        donor, exponent = self.donors[i], self._stand.pipe_exponent[self._rows.species[i]]
        thicker = self._metamers[i]["pipe"].astype(np.float64) / donor.metamers["pipe"]
        return transplanted(
            donor.companions,
            donor.metamers["parent"],
            self._azimuth[i],
            float(self._ratio[i]),
            thicker ** (1.0 / exponent),
        )


def _check(
    stand: Stand,
    planting: Inventory,
    kind: int,
    mine: NDArray[np.intp],
    wanted: Wanted,
    found: Found,
) -> None:
    """Refuse a tree that the species cannot be."""
    name = stand.species_names[kind]
    shoot_cm = 100.0 * stand.species[kind].wood.twig_diameter_m
    least = shoot_cm / (1.0 - float(stand.measured_species.bark_factor[kind]))
    for k, i in enumerate(mine):
        tree = planting.trees[i]
        where = f"planting.trees[{i}]"
        if tree.line:
            where = f"planting.file {planting.file!r} line {tree.line}"
        height, dbh = wanted.height_m[k], wanted.dbh_cm[k]
        if height > _MOST_STRETCH * found.tallest_m:
            raise InputError(
                f"{name} of {height:g} m: the nursery's tallest has {found.tallest_m:.1f} m after "
                f"{found.years} years",
                where=where,
                expected=f"at most {_MOST_STRETCH * found.tallest_m:.1f} m on this site",
            )
        low = max(_THINNER * found.thinnest_cm[k], least)
        high = _THICKER * found.thickest_cm[k]
        if height > BREAST_HEIGHT_M and np.isfinite(low) and not low <= dbh <= high:
            raise InputError(
                f"dbh of {dbh:g} cm at a height of {height:.3g} m (h/d {100 * height / dbh:.0f})",
                where=where,
                expected=f"{low:.2g} to {high:.2g} cm for {name} of that height",
            )


def _distinct(built: Built) -> int:
    sizes = zip(built.donor_age, built.donor_height_m, built.donor_dbh_cm, strict=True)
    return len({(int(age), float(height), repr(dbh)) for age, height, dbh in sizes})


def _middle(ratio: NDArray[np.float64]) -> str:
    """Give the middle nine tenths of some ratios."""
    low, high = np.nanquantile(ratio, (0.05, 0.95))
    return f"{low:.2f} to {high:.2f}"
