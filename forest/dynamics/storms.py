"""Storms: when they blow, and which trees they break and uproot.

A storm goes on until no more trees fall: each round finds, for every tree that stands, the wind
that it gets behind those that stand upwind, and what it does not withstand. Those that fall expose
others in the next round.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.mortality import Death
from forest.growth.dealing import Workbench, deal
from forest.mechanics.fetch import Exposure, Ways, expose, heading, lay_ways
from forest.mechanics.momentum import LAYERS, Crowns, canopies, draw_crowns, fill_winds, layer_of
from forest.mechanics.overthrow import Blow, Critical, find_critical
from forest.mechanics.shelter import Plot, silhouettes
from forest.mechanics.stems import NO_RIGIDITY
from forest.mechanics.year import stem_species
from forest.random import STREAM_STORM, uniforms
from forest.scenario.wind import Storm, Wind
from forest.trees.table import have_grown

if TYPE_CHECKING:
    from forest.measure.trees import TreeMeasures
    from forest.scenario import Scenario
    from forest.scenario.wind import YearlyStorms
    from forest.stand import Stand

STOOD, BROKEN, UPROOTED = 0, 1, 2
_ANGLES = 3600  # steps of a turn in which random directions are drawn

Columns = dict[str, NDArray[Any]]


class _Passage(NamedTuple):
    """A storm over a stand, round by round; one entry per row of the table."""

    ways: Ways
    crowns: Crowns
    standing: NDArray[np.bool_]
    exposure: Exposure
    density: NDArray[np.float64]
    critical: Critical
    outcome: NDArray[np.int8]
    round: NDArray[np.int16]


class Storms:
    """What storms do to one stand.

    Parameters
    ----------
    scenario : Scenario
    pipe_exponent : float64 (species,)
        n of the run: diameter = pipe^(1/n).
    """

    def __init__(self, scenario: Scenario, pipe_exponent: NDArray[np.float64]) -> None:
        self._wind = scenario.wind or Wind()
        self._seed = scenario.seed
        self._plot = Plot(*scenario.plot.size_m, scenario.plot.boundary == "periodic")
        self._stems = stem_species(scenario.species_list, pipe_exponent)
        held = [s.anchorage.turning_moment_nm_kg for s in scenario.species_list]
        self._turning = self._wind.anchorage * np.array(held, np.float64)
        self._workbench = Workbench()
        self._rows: list[Columns] = []

    # ------------------------------------------------------------------ in the year

    def of_year(self, stand: Stand, measures: TreeMeasures, deaths: list[Death]) -> list[Death]:
        """Let the scenario's storms of a year blow after its growth.

        Parameters
        ----------
        stand : Stand
        measures : TreeMeasures
            Of all rows.
        deaths : list of Death
            Trees that die of something else: they stand, but are not thrown.

        Returns
        -------
        list of Death
            With the trees thrown, in order of rows.
        """
        standing = np.ones(len(stand.rows.tree_id), np.bool_)
        thrown: list[Death] = []
        for storm in self.due(stand.year):
            spared = np.zeros(len(standing), np.bool_)
            spared[[death.row for death in deaths]] = True
            outcome = self._throw(stand, measures, storm, standing, spared)
            fell = np.flatnonzero(outcome != STOOD)
            standing[fell] = False
            thrown += [
                Death(int(row), "windthrown", "wind", bool(outcome[row] == BROKEN)) for row in fell
            ]
        return sorted([*deaths, *thrown])

    def due(self, year: int) -> list[Storm]:
        """The scenario's storms of a calendar year: those named, then the drawn one."""
        storms = [storm for storm in self._wind.storms if storm.year == year]
        yearly = self._wind.yearly
        if yearly is not None:
            drawn = draw_storm(yearly, self._seed, year)
            storms += [drawn] if drawn.speed_m_s >= yearly.from_m_s else []
        return storms

    # ------------------------------------------------------------------ between years

    def blow(
        self, stand: Stand, speed_m_s: float, direction_deg: float, measures: TreeMeasures
    ) -> NDArray[np.int8]:
        """Let a storm blow between two years; its rows of `/storms` come in the next record.

        Returns
        -------
        int8 (n,)
            What becomes of each row of the table, as `STOOD`; the fallen are still in it.

        Raises
        ------
        InputError
            If there is no such storm.
        """
        storm = Storm.of(
            "Stand.blow", year=stand.year, speed_m_s=speed_m_s, direction_deg=direction_deg
        )
        none = np.zeros(len(stand.rows.tree_id), np.bool_)
        return self._throw(stand, measures, storm, ~none, none)

    def critical(self, stand: Stand, direction_deg: float) -> Columns:
        """Find the storms of a direction that the trees do not withstand; none falls."""
        given = {"year": stand.year, "speed_m_s": 1.0, "direction_deg": direction_deg}
        Storm.of("Stand.critical_wind", **given)
        measures = stand.measure()
        due = self._due_rows(stand, measures)
        n = len(due)
        passed = self._pass(stand, due, np.ones(n, np.bool_), 0.0, direction_deg)
        rows = np.flatnonzero(due)
        names = np.array(stand.species_names, dtype=object)
        return {
            "tree_id": stand.rows.tree_id[rows],
            "species": names[stand.rows.species[rows]],
            "x_m": stand.rows.x[rows],
            "y_m": stand.rows.y[rows],
            "edge": passed.exposure.edge[rows],
            "critical_break_m_s": passed.critical.breaks[rows],
            "critical_uproot_m_s": passed.critical.uproots[rows],
            "dbh_cm": measures.dbh_cm[rows],
            "height_m": measures.height_m[rows],
        }

    # ------------------------------------------------------------------ a storm

    def _throw(
        self,
        stand: Stand,
        measures: TreeMeasures,
        storm: Storm,
        standing: NDArray[np.bool_],
        spared: NDArray[np.bool_],
    ) -> NDArray[np.int8]:
        """Blow once; note the rows of `/storms` and give the outcome of every row."""
        due = self._due_rows(stand, measures) & standing & ~spared
        passed = self._pass(stand, due, standing.copy(), storm.speed_m_s, storm.direction_deg)
        self._note(stand, measures, storm, due, passed)
        return passed.outcome

    def _due_rows(self, stand: Stand, measures: TreeMeasures) -> NDArray[np.bool_]:
        """Rows that a storm may throw: tall enough, and not planted since the last year."""
        grown = have_grown(stand.rows, stand.arena.metamers, stand.steps)  # others have no rods
        tall = measures.height_m >= self._wind.from_height_m
        due: NDArray[np.bool_] = grown & tall & (stand.rows.size > 0)
        return due

    def _pass(
        self,
        stand: Stand,
        due: NDArray[np.bool_],
        standing: NDArray[np.bool_],
        speed: float,
        direction_deg: float,
    ) -> _Passage:
        """Blow round by round, until no tree falls; `standing` changes as they do."""
        arena, trees = stand.arena, stand.rows
        n = len(due)
        seen = silhouettes(arena.metamers, trees, self._stems.leaf_area)
        weight = seen.frontal.sum()
        canopy = float(seen.frontal @ seen.height / weight) if weight > 0.0 else 0.0
        canopy = max(canopy, 0.1)
        ways = lay_ways(trees.x, trees.y, canopy, direction_deg, self._plot)
        to, top = heading(direction_deg), float(seen.height.max(initial=0.0))
        crowns = draw_crowns(arena.metamers, trees, self._stems, to, top)
        rigidity = arena.companions.rigidity if arena.companions else NO_RIGIDITY
        shared = deal(trees.size)
        scratch = self._workbench.scratch(shared)
        critical = Critical(np.full(n, np.nan), np.full(n, np.nan))
        outcome, rounds = np.zeros(n, np.int8), np.zeros(n, np.int16)
        exposure = Exposure(*(np.full(n, np.nan) for _ in Exposure._fields))
        density = np.full((n, LAYERS), np.nan)
        for number in range(1, n + 2):
            felt = expose(seen.height, standing, ways)
            around = canopies(standing, crowns, ways)
            changed = (felt.edge != exposure.edge) | (felt.gusts != exposure.gusts)
            changed |= (around != density).any(axis=1)
            density[standing] = around[standing]
            for now, then in zip(felt, exposure, strict=True):
                then[standing] = now[standing]
            where = (density, exposure.edge, exposure.gusts)
            blow = Blow(*to, canopy, crowns.thick, crowns.share, *where)
            find_critical(
                arena.metamers,
                trees,
                shared,
                scratch,
                self._stems,
                self._turning,
                rigidity,
                blow,
                due & standing & changed,
                critical,
            )
            least = np.fmin(critical.breaks, critical.uproots)
            falls = due & standing & (least <= speed)
            if not falls.any():
                break
            broken = ~(critical.uproots < critical.breaks)
            outcome[falls] = np.where(broken, BROKEN, UPROOTED)[falls]
            rounds[falls] = number
            standing[falls] = False
        return _Passage(ways, crowns, standing, exposure, density, critical, outcome, rounds)

    # ------------------------------------------------------------------ the rows of /storms

    def _note(
        self,
        stand: Stand,
        measures: TreeMeasures,
        storm: Storm,
        due: NDArray[np.bool_],
        passed: _Passage,
    ) -> None:
        rows = np.flatnonzero(due)
        n = len(rows)
        self._rows.append(
            {
                "tree_id": stand.rows.tree_id[rows],
                "species": stand.rows.species[rows],
                "storm": np.full(n, len(self._rows) + 1, np.int16),
                "x_m": stand.rows.x[rows],
                "y_m": stand.rows.y[rows],
                "storm_m_s": np.full(n, storm.speed_m_s),
                "direction_deg": np.full(n, storm.direction_deg),
                "wind_m_s": _at_tops(passed, storm.speed_m_s, measures.height_m, rows),
                "edge": passed.exposure.edge[rows],
                "critical_break_m_s": passed.critical.breaks[rows],
                "critical_uproot_m_s": passed.critical.uproots[rows],
                "outcome": passed.outcome[rows],
                "round": passed.round[rows],
                "dbh_cm": measures.dbh_cm[rows].astype(np.float64),
                "height_m": measures.height_m[rows].astype(np.float64),
            }
        )

    def take(self, year: int) -> Columns:
        """Hand out the rows of `/storms` since the last record, as those of a year."""
        if not self._rows:
            return {}
        columns = _joined(self._rows)
        self._rows = []
        return {"year": np.full(len(columns["tree_id"]), year, np.int32), **columns}

    def state(self) -> dict[str, NDArray[Any]]:
        """What blew since the last record."""
        counts = np.array([len(rows["tree_id"]) for rows in self._rows], np.int64)
        return {"counts": counts, **(_joined(self._rows) if self._rows else {})}

    def restore(self, arrays: dict[str, NDArray[Any]]) -> None:
        """Take back what `state` gave."""
        columns = dict(arrays)
        ends = np.cumsum(columns.pop("counts"))
        starts = np.concatenate(([0], ends[:-1]))
        self._rows = [
            {name: column[a:b] for name, column in columns.items()}
            for a, b in zip(starts, ends, strict=bool(len(ends)))
        ]


def _at_tops(
    passed: _Passage, speed: float, height: NDArray[np.floating[Any]], rows: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Mean wind at the tops of trees, m/s."""
    thick, canopy = passed.crowns.thick, passed.ways.canopy_height
    winds, found = np.zeros((3, LAYERS)), np.empty(len(rows))
    for k, row in enumerate(rows):
        edge = passed.exposure.edge[row]
        fill_winds(speed, canopy, thick, passed.density[row], edge, winds)
        found[k] = winds[0, layer_of(float(height[row]), thick)]
    return found


def _joined(parts: list[Columns]) -> Columns:
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def draw_storm(of: YearlyStorms, seed: int, year: int) -> Storm:
    """Draw the strongest storm of a calendar year.

    Parameters
    ----------
    of : YearlyStorms
    seed : int
        Seed of the scenario; the draw is a pure function of seed and year.
    year : int

    Notes
    -----
    The speed has Gumbel's distribution of yearly largest values, the direction von Mises', drawn
    by inverting its sum over a tenth of a degree.
    """
    by_speed, by_direction, _, _ = uniforms(seed, STREAM_STORM, 0, 0, year)
    speed = of.mode_m_s - of.dispersion_m_s * np.log(-np.log(by_speed))
    turn = (np.arange(_ANGLES) + 0.5) * (360.0 / _ANGLES) - 180.0
    share = np.cumsum(np.exp(of.concentration * (np.cos(np.radians(turn)) - 1.0)))
    aside = float(np.interp(by_direction * share[-1], share, turn))
    direction = (of.direction_deg + aside) % 360.0
    return Storm(year=year, speed_m_s=float(np.clip(speed, 0.01, 100.0)), direction_deg=direction)
