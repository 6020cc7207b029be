"""The stand and its year. `Stand.step` reads like the year; everything else serves it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.planting import headings, seedlings
from forest.dynamics.weather import income_factor
from forest.environment.surroundings import Surroundings
from forest.errors import InputError, nearest
from forest.growth import budget
from forest.growth.allocate import allocate
from forest.growth.dealing import Deal, Workbench, deal
from forest.growth.parameters import Year, species_traits
from forest.growth.pipes import thicken
from forest.growth.shedding import shed
from forest.growth.shoots import extend, shooting_buds, sprout
from forest.measure.rings import remember_breast
from forest.measure.trees import MeasureSpecies, TreeMeasures, measure_trees
from forest.mechanics.year import Mechanics, MechanicsSpec
from forest.record.schema import CAUSES
from forest.stand_state import put_state, take_state
from forest.trees import table
from forest.trees.metamers import Arena
from forest.trees.pruning import cut_branch
from forest.yearbook import Event, YearRecord, record_year

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario
    from forest.trees.skeleton import Skeleton


class Stand:
    """Trees that grow together in one space, driven year by year.

    Parameters
    ----------
    scenario : Scenario
        What to grow, and where.

    Attributes
    ----------
    year : int
        The last calendar year that is complete; `start_year - 1` before the first step.
    rows : Trees
        The tree table, one row per living tree, in order of tree id.
    arena : Arena
        The metamers of all trees.
    steps : int
        Years grown so far.
    pending : list of Event
        Events since the last record.
    next_id : int
        Id of the next tree.
    mechanics : Mechanics or None
        What bends and holds the trees, where the scenario has mechanics.
    surroundings : Surroundings
        Light and space.
    seconds : dict of str to float
        Wall time spent in each phase of the year so far.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._start(scenario)
        x, y, species = scenario.planting_positions()
        self._plant(x, y, species, headings(*scenario.planting_leans()))

    def _start(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self.species = scenario.species_list
        self.species_names = [s.name for s in self.species]
        self._paper = scenario.mode == "paper"
        self._traits = species_traits(
            self.species,
            paper=self._paper,
            bending=scenario.mechanics is not None and scenario.mechanics.bending,
        )
        self._measures_of = MeasureSpecies.of(self.species, self.pipe_exponent)
        self.surroundings = Surroundings(scenario, self.pipe_exponent)
        self.mechanics: Mechanics | None = None
        if scenario.mechanics is not None:
            spec = MechanicsSpec(**scenario.mechanics.model_dump())
            self.mechanics = Mechanics(spec, self.species, self.pipe_exponent)
        self.arena = Arena(companions=self.mechanics.companions if self.mechanics else None)
        self.rows = table.empty()
        self._bench = Workbench()
        self.steps = 0
        self.next_id = 1
        self.pending: list[Event] = []
        self.sample_ids: list[int] = []
        self.seconds: dict[str, float] = {}

    # ------------------------------------------------------------------ the year

    def step(self) -> YearRecord:
        """Grow for one year and give its record."""
        self.steps += 1
        self._clock = time.perf_counter()
        year = self._year()
        accounts = np.zeros((len(self.rows.tree_id), budget.ACCOUNTS))
        shared = deal(self.rows.size)
        before = self._sample_serials()
        self._lap("deal")

        self._expose()
        self._allocate(shared, year, accounts)
        self._shed(shared)
        shared = self._extend(year)
        self._thicken(shared, year, accounts)
        self._bend()
        measures, dead = self._die()
        record = record_year(self, measures, dead, accounts, before)
        self._bury(dead, measures)
        self._lap("record")
        return record

    def _expose(self) -> None:
        self.surroundings.expose(self.arena.metamers, self.rows, self.steps)
        self._lap("expose")

    def _allocate(self, shared: Deal, year: Year, accounts: NDArray[np.float64]) -> None:
        allocate(
            self.arena.metamers,
            self.rows,
            shared,
            self._bench.scratch(shared),
            self._traits,
            year,
            accounts,
            self._paper or None,
            self.scenario.growth.bud_fate == "priority" or None,
            self.scenario.growth.bud_fate == "balance" or None,
        )
        self._lap("allocate")

    def _shed(self, shared: Deal) -> None:
        shed(
            self.arena,
            self.rows,
            shared,
            self._bench.scratch(shared),
            self._traits,
            not self._paper or bool(self.arena.companions),  # it may have bent below the ground
        )
        self._lap("shed")

    def _extend(self, year: Year) -> Deal:
        rows = self.rows
        shared = deal(rows.size)
        shoots = shooting_buds(self.arena.metamers, rows, shared, self._traits)
        self.arena.make_room(rows.start, rows.size, rows.room, rows.size + shoots.new)
        arena = self.arena.metamers
        toward = self.surroundings.directions(arena, rows, shoots)
        extend(
            arena,
            rows,
            shared,
            shoots,
            toward,
            self._traits,
            year,
            self.surroundings.solid,
            self.surroundings.voxel_m,
        )
        self._lap("extend")
        return deal(rows.size)

    def _thicken(self, shared: Deal, year: Year, accounts: NDArray[np.float64]) -> None:
        thicken(
            self.arena.metamers,
            self.rows,
            shared,
            self._bench.scratch(shared),
            self._traits,
            year,
            accounts,
        )
        self._lap("thicken")

    def _bend(self) -> None:
        if self.mechanics is not None:
            self.mechanics.bend(self.arena, self.rows, self.steps)
            self._lap("bend")

    def _die(self) -> tuple[TreeMeasures, list[tuple[int, str]]]:
        """Measure all trees; name the rows of those that die, with the cause."""
        measures = measure_trees(
            self.arena.metamers, self.rows, self._measures_of, self._full_light
        )
        dead: list[tuple[int, str]] = []
        if not self._paper:
            limit = self._traits.of["suppression_years"][self.rows.species]
            suppressed = self.rows.bad_years >= limit
            for row in np.flatnonzero(suppressed | (measures.buds == 0)):
                dead.append((int(row), "suppression" if suppressed[row] else "no_buds"))
        self._lap("measure")
        return measures, dead

    def _bury(self, dead: list[tuple[int, str]], measures: TreeMeasures) -> None:
        remember_breast(self.rows, measures)
        self.pending = []
        if dead:
            alive = np.ones(len(self.rows.tree_id), np.bool_)
            alive[[row for row, _ in dead]] = False
            self.rows = table.keep(self.rows, alive)

    def _year(self) -> Year:
        s = self.scenario
        factor = income_factor(
            self.year,
            s.seed,
            s.weather.noise_sd,
            [(e.year, e.factor) for e in s.weather.extreme_years],
        )
        return Year(
            step=self.steps,
            seed=s.seed,
            income_factor=factor * s.site.productivity,
            full_light=self._full_light,
            paper=self._paper,
            balance=s.growth.bud_fate == "balance",
        )

    def _lap(self, phase: str) -> None:
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._clock
        self._clock = now

    # ------------------------------------------------------------------ acts between years

    def plant(
        self,
        x: Sequence[float],
        y: Sequence[float],
        species: str | Sequence[str],
        *,
        lean_deg: float | Sequence[float] = 0.0,
        lean_azimuth_deg: float | Sequence[float] = 0.0,
    ) -> list[int]:
        """Plant seedlings; they start to grow with the next step.

        Parameters
        ----------
        x, y : sequences of float
            Places, m, inside the plot.
        species : str or sequence of str
            Name or names of species of the scenario.
        lean_deg, lean_azimuth_deg : float or sequence of float
            Angle of the stems to the vertical, 0 to 85, and the direction towards which they lean,
            from x to y.

        Returns
        -------
        list of int
            The new trees' ids.
        """
        names = [species] * len(x) if isinstance(species, str) else list(species)
        if not len(x) == len(y) == len(names):
            raise InputError(
                f"{len(x)} x, {len(y)} y and {len(names)} species",
                where="Stand.plant",
                expected="as many of each",
            )
        known = {name: k for k, name in enumerate(self.species_names)}
        for name in names:
            if name not in known:
                raise InputError(
                    f"species '{name}' is not in this stand",
                    where="Stand.plant",
                    expected="one of " + ", ".join(known),
                )
        at = np.asarray(x, np.float64), np.asarray(y, np.float64)
        width, depth = self.scenario.plot.size_m
        inside = (at[0] >= 0) & (at[0] <= width) & (at[1] >= 0) & (at[1] <= depth)
        if not inside.all():
            k = int(np.flatnonzero(~inside)[0])
            raise InputError(
                f"({at[0][k]}, {at[1][k]}) is outside the plot",
                where="Stand.plant",
                expected=f"0 to {width} and 0 to {depth} m",
            )
        if self.scenario.plot.boundary == "periodic":
            at = at[0] % width, at[1] % depth
        leans = []
        for key, value, low, high in (
            ("lean_deg", lean_deg, 0.0, 85.0),
            ("lean_azimuth_deg", lean_azimuth_deg, -360.0, 360.0),
        ):
            angle = np.asarray(value, np.float64)
            if angle.shape not in ((), (len(x),)) or not ((angle >= low) & (angle <= high)).all():
                raise InputError(
                    f"{key} = {value}",
                    where="Stand.plant",
                    expected=f"{low:g} to {high:g}, one for all trees or one for each",
                )
            leans.append(np.broadcast_to(angle, len(x)))
        first = self.next_id
        self._plant(*at, np.array([known[name] for name in names], np.int16), headings(*leans))
        return list(range(first, self.next_id))

    def _plant(
        self,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        species: NDArray[Any],
        heading: NDArray[np.float64],
    ) -> None:
        more = seedlings(
            x,
            y,
            species,
            first_id=self.next_id,
            step=self.steps,
            seed=self.scenario.seed,
            voxel_m=self.surroundings.voxel_m,
            vigour_sd=np.array([s.carbon.vigour_sd for s in self.species]),
            seed_reserve_kg=np.array([s.carbon.seed_reserve_kg for s in self.species]),
        )
        first_row = len(self.rows.tree_id)
        self.next_id += len(more.tree_id)
        self.rows = table.append(self.rows, more)
        rows = self.rows
        wanted = rows.size.astype(np.int64)
        wanted[first_row:] = 1
        self.arena.make_room(rows.start, rows.size, rows.room, wanted)
        sprout(self.arena.metamers, rows, first_row, heading, self._traits, self._year())
        measures = self.measure()
        for row in range(first_row, len(rows.tree_id)):
            self.pending.append(Event.of(self, row, "planted", "none", measures))

    def fell(self, tree_ids: Sequence[int], cause: str = "harvest") -> None:
        """Fell trees: they are gone at once, with an event in the next year's record.

        Parameters
        ----------
        tree_ids : sequence of int
            Living trees; one named twice is felled once.
        cause : str
            One of `forest.record.schema.CAUSES`.

        Raises
        ------
        InputError
            If there is no such tree or cause; then none is felled.
        """
        if cause not in CAUSES:
            raise InputError(
                f"unknown cause '{cause}', {nearest(cause, CAUSES)}", where="Stand.fell"
            )
        rows = [self.row_of(tree_id) for tree_id in tree_ids]
        measures = self.measure()
        alive = np.ones(len(self.rows.tree_id), np.bool_)
        for row in rows:
            if alive[row]:
                self.pending.append(Event.of(self, row, "felled", cause, measures))
            alive[row] = False
        self.rows = table.keep(self.rows, alive)

    def prune(self, tree_id: int, metamer: int) -> int:
        """Cut a tree above the foot of a metamer, named by its serial number.

        Returns the number of metamers that go. Cutting the first metamer is refused: fell the tree.
        """
        row = self.row_of(tree_id)
        measures = self.measure()
        kind = int(self.rows.species[row])
        branch_pipe = float(self._traits.of["branch_pipe"][kind])
        gone = cut_branch(self.arena, self.rows, row, metamer, branch_pipe)
        self.pending.append(Event.of(self, row, "pruned", "none", measures))
        return gone

    # ------------------------------------------------------------------ what it is now

    @property
    def year(self) -> int:
        """The last complete calendar year."""
        return self.scenario.start_year + self.steps - 1

    @property
    def floor_light(self) -> float:
        """Mean relative irradiance on the ground, 0..1; NaN without a far field."""
        return self.surroundings.floor_light()

    @property
    def pipe_exponent(self) -> NDArray[np.float64]:
        """Pipe exponent n of each species, as used in this run: d = pipe^(1/n)."""
        return np.ascontiguousarray(self._traits.of["pipe_exponent"])

    @property
    def _full_light(self) -> float:
        return self.surroundings.full_light

    @property
    def trees(self) -> pd.DataFrame:
        """The living trees now: a row each, with the columns of `/trees` that need no ring."""
        import pandas as pd

        measures = self.measure()
        columns: dict[str, Any] = {
            "tree_id": self.rows.tree_id,
            "species": [self.species_names[k] for k in self.rows.species],
            "x_m": self.rows.x,
            "y_m": self.rows.y,
            "age": self.steps - self.rows.birth,
        }
        columns.update(measures.columns())
        return pd.DataFrame(columns)

    def measure(self) -> TreeMeasures:
        """Measure all living trees."""
        return measure_trees(self.arena.metamers, self.rows, self._measures_of, self._full_light)

    def skeleton(self, tree_id: int, season: Literal["summer", "winter"] = "summer") -> Skeleton:
        """The shape of a living tree.

        Parameters
        ----------
        tree_id : int
            A living tree.
        season : {"summer", "winter"}
            Where trees bend: under its load of leaves and fruit, or as it springs up without
            (Taylor-Hell 2005, 6.3).
        """
        from forest.trees.skeleton import skeleton_of

        row = self.row_of(tree_id)
        kind = int(self.rows.species[row])
        metamers, rows = self.arena.metamers, self.rows
        if season == "winter" and self.mechanics is not None:
            metamers, rows = self.mechanics.winter(self.arena, self.rows, row)
            row = 0
        return skeleton_of(
            metamers,
            rows,
            row,
            species=self.species_names[kind],
            pipe_exponent=float(self.pipe_exponent[kind]),
            start_year=self.scenario.start_year - 1,
        )

    def row_of(self, tree_id: int) -> int:
        """Find the row of a living tree."""
        row = int(np.searchsorted(self.rows.tree_id, tree_id))
        if row == len(self.rows.tree_id) or self.rows.tree_id[row] != tree_id:
            raise InputError(
                f"no living tree has the id {tree_id}",
                where="Stand",
                expected=f"one of the {len(self.rows.tree_id)} ids in stand.trees.tree_id",
            )
        return row

    def _sample_serials(self) -> dict[int, NDArray[np.int32]]:
        """Serials of the sample trees' metamers before the year, to tell what was shed."""
        serials = {}
        for tree_id in self.sample_ids:
            row = int(np.searchsorted(self.rows.tree_id, tree_id))
            if row < len(self.rows.tree_id) and self.rows.tree_id[row] == tree_id:
                start, size = int(self.rows.start[row]), int(self.rows.size[row])
                serials[tree_id] = self.arena.metamers.serial[start : start + size].copy()
        return serials

    # ------------------------------------------------------------------ checkpoints

    def state(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """Everything that the next year needs: arrays, and a few numbers (JSON)."""
        return take_state(self)

    @classmethod
    def restore(
        cls, scenario: Scenario, arrays: dict[str, NDArray[Any]], meta: dict[str, Any]
    ) -> Stand:
        """Build the stand that `state` was taken of."""
        stand = cls.__new__(cls)
        stand._start(scenario)
        put_state(stand, arrays, meta)
        return stand
