"""The trees of a run through the years: who stands, how large, and who has just gone."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from forest.errors import InputError, span_of
from forest.record.run import Run

if TYPE_CHECKING:
    import pandas as pd

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
_RESIDUAL_CONIFERS = ("balsam_fir",)
#: How a tree goes, as the events' kinds name it.
FATES = ("died", "felled", "windthrown")


def conifers_of(run: Run) -> frozenset[str]:
    """Name the conifers among a run's species, and among those of residual trees."""
    grown = (s.name for s in run.scenario.species_list if s.group == "conifer")
    return frozenset((*grown, *_RESIDUAL_CONIFERS))


class StandYears:
    """A run's trees, read year by year.

    Parameters
    ----------
    run : Run
        An open run.

    Raises
    ------
    InputError
        If it has no table of trees, or no year.
    """

    def __init__(self, run: Run) -> None:
        if "trees" not in run.tables:
            raise InputError(
                "holds no table of trees",
                where=str(run.path),
                expected="a run with 'trees' among output.tables",
            )
        if not len(run.years):
            raise InputError("holds no years yet", where=str(run.path))
        self.run = run
        self.first, self.last = int(run.years[0]), int(run.years[-1])
        self.living = lru_cache(maxsize=3)(self._living)
        self.gone = lru_cache(maxsize=2)(self._gone)
        self.residual = lru_cache(maxsize=2)(self._residual)

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

    def _living(self, year: int) -> pd.DataFrame:
        """Rows of the trees that live at the end of a year."""
        trees = self.run.read("trees", COLUMNS, years=(year, year))
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
        rows = self.run.read("residual", years=(year, year))
        rows = rows[rows["status"] == "standing"].reset_index(drop=True)
        rows = rows.assign(tree_id=-rows["residual_id"], status="living", age=0, fate="")
        return rows.reindex(columns=[*COLUMNS, "fate"])

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
            `COLUMNS` and `fate`: empty for the living, else one of `FATES`. Residual trees that
            stand at the end of the year come last, with numbers below 0.
        """
        import pandas as pd

        year = int(np.ceil(moment))
        share = moment - (year - 1)
        trees = self.living(year).assign(fate="")
        if share < 1.0 and year > self.first:
            trees = _between(self.living(year - 1), trees, share)
        gone = [self.gone(y) for y in range(max(int(np.floor(since)), self.first) + 1, year + 1)]
        more = [rows for rows in (*gone, self.residual(year)) if len(rows)]
        if not more:
            return trees
        parts = [rows.astype({"species": object}) for rows in (trees, *more)]
        return pd.concat(parts, ignore_index=True)


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
