"""The trees of a run through the years: who stands, how large, and who has just gone."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from forest.errors import InputError, span_of
from forest.record.run import Run
from forest.scenario.model import Obstacle
from forest.view.standing import (
    EVENT_COLUMNS,
    PLACE_COLUMNS,
    SNAG,
    in_year,
    obstacles_at,
    residual_rows,
    snags_of,
    together,
)

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario

#: Columns of `/trees` that bodies and their colours need.
COLUMNS = (
    "tree_id",
    "species",
    "x_m",
    "y_m",
    "age",
    "status",
    "dbh_cm",
    "base_diameter_cm",
    "height_m",
    "crown_base_m",
    "crown_radius_m",
    "lean_deg",
    "light",
)
_SIZES = (
    "dbh_cm",
    "base_diameter_cm",
    "height_m",
    "crown_base_m",
    "crown_radius_m",
    "lean_deg",
    "light",
)
_CACHED_YEARS = 64
_RESIDUAL_CONIFERS = ("balsam_fir",)
#: How a tree goes, as the events' kinds name it.
FATES = ("died", "felled", "windthrown")
_FALLING = ("felled", "windthrown")
_FALLEN_DEG = 78.0
_BARE = 0.25  # reach of a crown when its tree has died, of that before


def conifers_of(scenario: Scenario) -> frozenset[str]:
    """Name the conifers among a scenario's species, and among those of residual trees."""
    grown = (s.name for s in scenario.species_list if s.group == "conifer")
    return frozenset((*grown, *_RESIDUAL_CONIFERS))


class StandYears:
    """A run's trees, read year by year.

    Parameters
    ----------
    run : Run
        An open run.
    columns : tuple of str
        Columns of `/trees` that are read, `COLUMNS` among them.

    Raises
    ------
    InputError
        If it has no table of trees, or no year.
    """

    def __init__(self, run: Run, columns: tuple[str, ...] = COLUMNS) -> None:
        if "trees" not in run.tables:
            raise InputError(
                "holds no table of trees",
                where=str(run.path),
                expected="a run with 'trees' among output.tables",
            )
        if not len(run.years):
            raise InputError("holds no years yet", where=str(run.path))
        self.run, self.columns = run, columns
        self.first, self.last = int(run.years[0]), int(run.years[-1])
        self.rows = lru_cache(maxsize=_CACHED_YEARS)(self._rows)
        self.living = lru_cache(maxsize=3)(self._living)
        self.gone = lru_cache(maxsize=2)(self._gone)
        self.residual = lru_cache(maxsize=2)(self._residual)
        self._obstacles = lru_cache(maxsize=8)(self._obstacles_at)

    def check_year(self, year: int | None, name: str, usual: int) -> int:
        """Give the year, the usual one if none is given; refuse one that is not on file."""
        if year is None:
            return usual
        if not self.first <= year <= self.last:
            raise InputError(
                f"{name} is {year}",
                where=str(self.run.path),
                expected=span_of(self.first, self.last),
            )
        return year

    def _rows(self, year: int) -> pd.DataFrame:
        """Rows of `/trees` at the end of a year, those that died in it among them."""
        return self.run.read("trees", self.columns, years=(year, year))

    def _living(self, year: int) -> pd.DataFrame:
        """Rows of the trees that live at the end of a year."""
        trees = self.rows(year)
        return trees[(trees["status"] == "living") & (trees["height_m"] > 0.0)].reset_index(
            drop=True
        )

    def _gone(self, year: int) -> pd.DataFrame:
        """Rows, of the year before, of the trees that went in a year, with their `fate`."""
        if year <= self.first:
            return self.living(self.first).iloc[:0].assign(fate="")
        before, now = self.living(year - 1), self.living(year)
        gone = before[~before["tree_id"].isin(now["tree_id"])]
        fate: dict[int, str] = {}
        if "events" in self.run.tables:
            events = self.run.read("events", ["tree_id", "kind"], years=(year, year))
            events = events[events["kind"].isin(FATES)]
            fate = dict(zip(events["tree_id"], events["kind"].astype(str), strict=True))
        return gone.assign(fate=[fate.get(int(tree_id), "died") for tree_id in gone["tree_id"]])

    def _residual(self, year: int) -> pd.DataFrame:
        """Rows of the residual trees that stand, in the columns of the others."""
        if "residual" not in self.run.tables:
            return self.living(year).iloc[:0].assign(fate="")
        return residual_rows(self.run.read("residual", years=(year, year)))

    @cached_property
    def _snags(self) -> pd.DataFrame:
        run = self.run
        if run.scenario.mortality.snags and "events" in run.tables:
            places = run.read("trees", PLACE_COLUMNS)
            return snags_of(run.scenario, run.read("events", EVENT_COLUMNS), places)
        return self.living(self.first).iloc[:0].assign(fate=SNAG, first=0, last=0)

    def others(self, year: int) -> pd.DataFrame:
        """Rows of the residual trees and the snags that stand at the end of a year.

        `COLUMNS` and `fate`; residual trees have numbers below 0.
        """
        return together((self.residual(year), in_year(self._snags, year)), (*COLUMNS, "fate"))

    def obstacles(self, year: int) -> tuple[Obstacle, ...]:
        """The obstacles that stand at the end of a year."""
        return self._obstacles(min(max(year, self.first), self.last))

    def _obstacles_at(self, year: int) -> tuple[Obstacle, ...]:
        scenario = self.run.scenario
        if not any(act.kind == "obstacle" for act in scenario.acts):
            return scenario.obstacles
        done = None
        if "treatments" in self.run.tables:
            done = self.run.read("treatments", ["year", "number", "act"])
        return obstacles_at(scenario, year, done)

    def at(self, moment: float, since: float) -> pd.DataFrame:
        """Give the trees at a moment between the ends of two years.

        Parameters
        ----------
        moment : float
            Calendar years; 2001.0 is the end of 2001. Sizes between two ends lie on a line.
        since : float
            The moment of the picture before: trees that went after it are still there.

        Returns
        -------
        DataFrame
            `COLUMNS` and `fate`: empty for the living, else one of `FATES`, or `SNAG`. Trees that
            are felled or thrown come down through the year, those that die lose their crowns.
            Residual trees, with numbers below 0, and snags that stand at the end of the year come
            last.
        """
        year = int(np.ceil(moment))
        share = moment - (year - 1)
        trees = self.living(year).assign(fate="")
        if share < 1.0 and year > self.first:
            trees = _between(self.living(year - 1), trees, share)
        before = range(max(int(np.floor(since)), self.first) + 1, year + 1)
        gone = [_going(self.gone(y), share if y == year else 1.0) for y in before]
        others = self.others(year)
        for rows in gone:  # who dies standing is a snag from the next frames on
            others = others[(others["fate"] != SNAG) | ~others["tree_id"].isin(rows["tree_id"])]
        return together((trees, *gone, others), (*COLUMNS, "fate"))


def _going(gone: pd.DataFrame, share: float) -> pd.DataFrame:
    """Let trees that go in a year fall or lose their crowns by a share of the year."""
    falls = gone["fate"].isin(_FALLING).to_numpy()
    lean = np.nan_to_num(gone["lean_deg"].to_numpy(np.float64))
    lean = np.where(falls, lean + (_FALLEN_DEG - lean) * share**2, lean)
    low = np.where(falls, np.cos(np.radians(lean)), 1.0)
    reach = np.where(gone["fate"] == "died", 1.0 - (1.0 - _BARE) * share, 1.0)
    return gone.assign(
        lean_deg=lean,
        height_m=gone["height_m"].to_numpy(np.float64) * low,
        crown_base_m=gone["crown_base_m"].to_numpy(np.float64) * low,
        crown_radius_m=gone["crown_radius_m"].to_numpy(np.float64) * reach,
    )


def _between(before: pd.DataFrame, now: pd.DataFrame, share: float) -> pd.DataFrame:
    """Put sizes on the line from one year to the next; who is new grows out of the ground."""
    old = before.set_index("tree_id").reindex(now["tree_id"])
    known = old["height_m"].notna().to_numpy()
    mixed = {}
    for column in _SIZES:
        to = now[column].to_numpy(np.float64)
        start = old[column].to_numpy(np.float64)
        start = np.where(known, np.where(np.isnan(start), to, start), 0.0)
        mixed[column] = start + share * (to - start)
    return now.assign(**mixed)
