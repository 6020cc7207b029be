"""The stand and its year. `Stand.step` reads like the year; everything else serves it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from forest import establishment, management
from forest.dynamics import mortality
from forest.dynamics.mortality import Death
from forest.dynamics.snags import DeadWood
from forest.dynamics.storms import Storms
from forest.environment.climate import Climate
from forest.environment.surroundings import Surroundings
from forest.growth import budget
from forest.growth.allocate import allocate
from forest.growth.dealing import Deal, Workbench, deal, leave_out
from forest.growth.parameters import Year, species_traits
from forest.growth.pipes import NO_NEED, thicken
from forest.growth.shedding import shed
from forest.growth.shoots import extend, shooting_buds
from forest.inventory import Built, settle
from forest.measure.rings import RingYear, remember_discs
from forest.measure.trees import MeasureSpecies, TreeMeasures, measure_trees
from forest.mechanics.shelter import Plot
from forest.mechanics.year import Mechanics, MechanicsSpec
from forest.renewal import Regeneration
from forest.residual import ResidualTrees
from forest.scenario.inventory import Inventory
from forest.stand_state import Memory, put_state, take_state
from forest.trees import table
from forest.trees.metamers import Arena
from forest.yearbook import (
    Event,
    Loss,
    YearRecord,
    record_year,
    sample_serials,
    snag_columns,
)

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario
    from forest.trees.skeleton import Skeleton


class Stand(management.Hand):
    """Trees that grow together in one space, driven year by year.

    Parameters
    ----------
    scenario : Scenario
        What to grow, and where.
    say : callable, optional
        Told how the nursery goes on where the stand starts from an inventory.

    Attributes
    ----------
    year : int
        The last calendar year that is complete; `start_year - 1` before the first step.
    rows : Trees
        The tree table, one row per living tree, in order of tree id.
    arena : Arena
        The metamers of all trees.
    measured_species : MeasureSpecies
        What mensuration must know of the species.
    steps : int
        Years grown so far.
    pending : list of Event
        Events since the last record.
    losses : dict of int to Loss
        What acts took from sample trees since the last record, by tree id.
    next_id : int
        Id of the next tree.
    mechanics : Mechanics or None
        What bends and holds the trees, where the scenario has mechanics.
    climate : Climate
        What each year is like, and what the species make of it.
    regeneration : Regeneration or None
        Seeds and seedlings, where the scenario has regeneration.
    surroundings : Surroundings
        Light and space.
    built : Built or None
        How near the first trees are to the inventory that they were built from.
    brush : Brush
        The strokes of the procedural brush.
    treatments : Treatments
        What acts changed since the last record.
    marks : Marks
        The words with which trees are marked.
    obstacles : Obstacles
        The obstacles that stand now.
    dead_wood : DeadWood or None
        Snags and lying dead wood, where the scenario has snags.
    residual : ResidualTrees
        Trees that were not simulated: those that stand now, one by one, or all as its `table`.
    memories : dict of str to Memory
        The parts that remember something between years, for checkpoints.
    seconds : dict of str to float
        Wall time spent in each phase of the year so far.
    """

    built: Built | None = None

    def __init__(self, scenario: Scenario, say: Callable[[str], None] = lambda _: None) -> None:
        self._start(scenario)
        if isinstance(scenario.planting, Inventory):
            self.built = settle(self, scenario.planting, Stand, say)
        else:
            first = establishment.first_trees(self)
            establishment.establish(self, first, "planted", self._traits)
        management.check_due(self)  # what cannot be done in the first year is refused before it
        mortality.check_due(self)

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
        self._ring_heights = np.array(scenario.output.ring_heights_m, np.float64)
        self._pipes_before = np.empty(0, np.float32)
        self.measured_species = MeasureSpecies.of(self.species, self.pipe_exponent)
        self.climate = Climate(scenario)
        self.surroundings = Surroundings(scenario, self.pipe_exponent)
        self.treatments = management.Treatments(self)
        self.marks = management.Marks()
        self.obstacles = management.Obstacles(self)
        self.storms = Storms(scenario, self.pipe_exponent)
        self.brush = management.Brush()
        self.memories: dict[str, Memory] = {
            "obstacles": self.obstacles,
            "surroundings": self.surroundings,
            "marks": self.marks,
            "treatments": self.treatments,
            "storms": self.storms,
            "brush": self.brush,
        }
        self.residual = ResidualTrees(scenario, self.surroundings)
        if self.residual.trees:
            self.memories["residual"] = self.residual
        self.mechanics: Mechanics | None = None
        if scenario.mechanics is not None:
            spec = MechanicsSpec(**scenario.mechanics.model_dump())
            plot = Plot(*scenario.plot.size_m, scenario.plot.boundary == "periodic")
            self.mechanics = Mechanics(spec, self.species, self.pipe_exponent, plot)
        self.dead_wood: DeadWood | None = None
        if scenario.mortality.snags:
            self.dead_wood = DeadWood(self.species, scenario.seed)
            self.memories["deadwood"] = self.dead_wood
        self.regeneration: Regeneration | None = None
        if scenario.regeneration is not None and self.surroundings.canopy is not None:
            self.regeneration = Regeneration(scenario, self.surroundings.canopy)
            self.memories["regeneration"] = self.regeneration
        self.arena = Arena(companions=self.mechanics.companions if self.mechanics else None)
        self.rows = table.empty()
        self._bench = Workbench()
        self.steps = 0
        self.next_id = 1
        self.pending: list[Event] = []
        self.losses: dict[int, Loss] = {}
        self.sample_ids: list[int] = []
        self.seconds: dict[str, float] = {}

    # ------------------------------------------------------------------ the year

    def step(self) -> YearRecord:
        """Do the scenario's acts of the next year, grow for that year and give its record.

        Raises
        ------
        InputError
            If an act cannot be done, or the climate ends before; then the stand is as it was.
        """
        self._clock = time.perf_counter()
        self.climate.check_known(self.year + 1)
        mortality.check_due(self)
        management.act(self, self._traits)
        self._lap("act")
        self.steps += 1
        year = self.growth_year()
        accounts = np.zeros((len(self.rows.tree_id), budget.ACCOUNTS))
        shared = deal(self.rows.size)
        before = sample_serials(self)
        self._lap("deal")

        held = self._expose()
        self._allocate(shared, year, accounts)
        self._shed(leave_out(shared, held) if len(held) else shared)
        shared = self._extend(year)
        rings = self._note_pipes()
        self._thicken(shared, year, accounts)
        self._bend()
        measures, deaths = self._die()
        record = record_year(self, measures, deaths, accounts, before, rings)
        grown = self.rows
        self._bury(deaths, measures)
        self._lap("record")
        if self.regeneration is not None:
            seedlings = self.regeneration.year(self, grown, measures, deaths, self._traits)
            record.tables["regeneration"] = seedlings
            self._lap("regenerate")
        return record

    def _expose(self) -> NDArray[np.int64]:
        """Expose the buds; give the rows of trees of which parts are held dormant."""
        dead = None
        if self.dead_wood is not None:
            dead = self.dead_wood.plant_area(self.steps, self.surroundings.voxel_m)
        holds = self.brush.holds(self)
        self.surroundings.expose(self.arena.metamers, self.rows, self.steps, dead, holds)
        self._lap("expose")
        held = np.array(sorted({hold.tree_id for hold in holds}), np.int64)
        return np.searchsorted(self.rows.tree_id, held).astype(np.int64)

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

    def _note_pipes(self) -> RingYear:
        """Keep how thick everything is before it thickens."""
        if len(self._pipes_before) != self.arena.capacity:
            self._pipes_before = np.empty(self.arena.capacity, np.float32)
        used = self.arena.used
        self._pipes_before[:used] = self.arena.metamers.pipe[:used]
        return RingYear(self.year, self.steps, self._pipes_before, self.pipe_exponent)

    def _thicken(self, shared: Deal, year: Year, accounts: NDArray[np.float64]) -> None:
        wind_need = NO_NEED
        if self.mechanics is not None and self.mechanics.wind_growth:
            wind_need = self.mechanics.feel_wind(self.arena, self.rows, shared)
        thicken(
            self.arena.metamers,
            self.rows,
            shared,
            self._bench.scratch(shared),
            self._traits,
            year,
            accounts,
            wind_need,
        )
        self._lap("thicken")

    def _bend(self) -> None:
        if self.mechanics is not None:
            around = self.surroundings
            self.mechanics.bend(self.arena, self.rows, self.steps, around.solid, around.voxel_m)
            self._lap("bend")

    def _die(self) -> tuple[TreeMeasures, list[Death]]:
        """Measure all trees; tell which die, in order of rows."""
        measures = measure_trees(
            self.arena.metamers,
            self.rows,
            self.measured_species,
            self._full_light,
            self._ring_heights,
        )
        deaths = self.storms.of_year(self, measures, mortality.deaths_of(self, measures))
        if self.dead_wood is not None:
            self.dead_wood.pass_year(self, deaths, measures)
        self._lap("measure")
        return measures, deaths

    def _bury(self, deaths: list[Death], measures: TreeMeasures) -> None:
        remember_discs(self.rows, self.arena.metamers, measures)
        self.pending = []
        self.losses = {}
        self.treatments.clear()
        if deaths:
            alive = np.ones(len(self.rows.tree_id), np.bool_)
            alive[[death.row for death in deaths]] = False
            self.rows = table.keep(self.rows, alive)

    def growth_year(self) -> Year:
        """Tell growth what it must know of the current step."""
        s = self.scenario
        return Year(
            step=self.steps,
            seed=s.seed,
            income_factor=self.climate.factors(self.year) * s.site.productivity,
            full_light=self._full_light,
            paper=self._paper,
            balance=s.growth.bud_fate == "balance",
        )

    def _lap(self, phase: str) -> None:
        now = time.perf_counter()
        self.seconds[phase] = self.seconds.get(phase, 0.0) + now - self._clock
        self._clock = now

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

    @property
    def snags(self) -> pd.DataFrame:
        """The dead trees that stand now, a row each; none where the scenario has no snags."""
        import pandas as pd

        return pd.DataFrame(snag_columns(self))

    @property
    def strokes(self) -> pd.DataFrame:
        """The strokes so far, a row each: markers laid, and how many of them are colonised."""
        import pandas as pd

        return pd.DataFrame(self.brush.columns(self))

    def measure(self) -> TreeMeasures:
        """Measure all living trees."""
        return measure_trees(
            self.arena.metamers, self.rows, self.measured_species, self._full_light
        )

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
        bent = bool(table.have_grown(rows, metamers, self.steps)[row])  # newcomers have no rods yet
        if season == "winter" and self.mechanics is not None and bent:
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
        return table.row_of(self.rows, tree_id, where="Stand")

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
