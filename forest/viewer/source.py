"""What the viewer shows: the tables and shapes of a run, whoever holds them."""

from __future__ import annotations

from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np

from forest.errors import InputError
from forest.view.stand_years import COLUMNS as BODY_COLUMNS
from forest.view.stand_years import StandYears

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas as pd

    from forest.dendro.disc import Disc
    from forest.record.run import Run
    from forest.scenario import Scenario
    from forest.scenario.model import Obstacle
    from forest.stand import Stand
    from forest.surface.export import Part
    from forest.trees.skeleton import Skeleton

#: Columns of a year's trees that are read for pictures and cards.
COLUMNS = (
    *BODY_COLUMNS,
    "basal_area_m2",
    "stem_volume_m3",
    "biomass_kg",
    "leaf_area_m2",
    "ring_width_mm",
    "metamers",
    "buds",
)
_SCALED = ("dbh_cm", "height_m", "age", "ring_width_mm", "leaf_area_m2")


def largest_of(trees: pd.DataFrame) -> dict[str, float]:
    """Give the largest dbh, height, age and (all but a few) vigour of rows of `/trees`."""
    from forest.viewer.colours import vigour

    found = {
        name: float(np.nanmax(trees[name].to_numpy(np.float64), initial=0.0))
        for name in _SCALED[:3]
    }
    known = vigour(trees)
    known = known[np.isfinite(known)]
    # A few seedlings with a leaf or two would stretch the scale.
    found["vigour"] = float(np.quantile(known, 0.98)) if len(known) else 0.0
    return found


class Source(Protocol):
    """What is shown: a run file, or a stand that lives.

    Attributes
    ----------
    title : str
        Name of the stand.
    where : str
        Where it comes from, for messages.
    scenario : Scenario
        Its scenario.
    """

    title: str
    where: str

    @property
    def scenario(self) -> Scenario:
        """The scenario."""

    @property
    def years(self) -> tuple[int, ...]:
        """Calendar years on record, in order."""

    @property
    def stand(self) -> pd.DataFrame:
        """The columns of `/stand`."""

    @property
    def events(self) -> pd.DataFrame:
        """The columns of `/events`."""

    @property
    def largest(self) -> dict[str, float]:
        """Largest value of each number in `COLUMNS`, over all years: the ends of colour scales."""

    def trees(self, year: int) -> pd.DataFrame:
        """Rows of `/trees` at the end of a year, `COLUMNS`, those that died in it among them."""

    def others(self, year: int) -> pd.DataFrame:
        """Residual trees and snags at the end of a year: columns for bodies, and `fate`."""

    def standing_obstacles(self, year: int) -> tuple[Obstacle, ...]:
        """Obstacles at the end of a year; none where a tool draws them."""

    def life(self, tree_id: int) -> pd.DataFrame:
        """Rows of `/trees` of one tree: `year`, `dbh_cm`, `height_m`."""

    def with_branches(self, year: int) -> tuple[int, ...]:
        """Trees whose branches are known at the end of a year."""

    def skeleton(self, tree_id: int, year: int) -> Skeleton:
        """Shape of a tree; InputError if it is not known."""

    def disc(self, tree_id: int, height_m: float, year: int) -> Disc:
        """A disc out of a stem; InputError if there is none."""

    def surface(
        self, tree_id: int, year: int, shape: str, say: Callable[[str], None] = lambda line: None
    ) -> list[Part]:
        """Surface of a tree, "tubes", "blended" or with its "bark"; InputError if it has none.

        Called in a thread of its own. `say` is told in a line of what is not to be seen.
        """

    def waiting_for(self, tree_id: int) -> str:
        """What waits to be done to a tree's shape or bark, as a text; "" for nothing."""

    def stand_near(self, year: int) -> Stand:
        """The stand with all its buds, as near to a year as it is known; InputError if it is not.

        Its own `year` says which year it is.
        """

    def stand_year(self, year: int) -> int:
        """The year of `stand_near`, without making the stand; InputError if there is none."""


class RunSource:
    """A run file, read as it is asked for.

    Parameters
    ----------
    run : Run
        An open run that holds at least a year.

    Raises
    ------
    InputError
        If it holds no years, or no table of trees.
    """

    def __init__(self, run: Run) -> None:
        self.where = str(run.path)
        for table in ("trees", "stand", "events"):
            if table not in run.tables:
                raise InputError(f"holds no table '{table}', which a view needs", where=self.where)
        self._run = run
        self.title = run.scenario.title or Path(run.path).name
        self.years = tuple(int(year) for year in run.years)
        self._years = StandYears(run, COLUMNS)
        self._restored = lru_cache(1)(self._restore)

    @property
    def scenario(self) -> Scenario:
        """The scenario of the run."""
        return self._run.scenario

    @property
    def stand(self) -> pd.DataFrame:
        """The whole table `/stand`."""
        return self._run.stand

    @property
    def events(self) -> pd.DataFrame:
        """The whole table `/events`."""
        return self._run.events

    @cached_property
    def largest(self) -> dict[str, float]:
        """Largest dbh, height, age and (all but a few) vigour of the run."""
        return largest_of(self._run.read("trees", list(_SCALED)))

    def trees(self, year: int) -> pd.DataFrame:
        """Rows at the end of a year."""
        return self._years.rows(year)

    def others(self, year: int) -> pd.DataFrame:
        """Residual trees and snags that stand at the end of a year."""
        return self._years.others(year)

    def standing_obstacles(self, year: int) -> tuple[Obstacle, ...]:
        """Obstacles that stand at the end of a year."""
        return self._years.obstacles(year)

    @cached_property
    def _lives(self) -> pd.DataFrame:
        return self._run.read("trees", ["tree_id", "year", "dbh_cm", "height_m"])

    def life(self, tree_id: int) -> pd.DataFrame:
        """Year, dbh and height of a tree over its life."""
        lives = self._lives
        return lives[lives["tree_id"].to_numpy() == tree_id].reset_index(drop=True)

    def with_branches(self, year: int) -> tuple[int, ...]:
        """The sample trees that lived then."""
        run = self._run
        return tuple(tree for tree in run.samples if year in run.sample_years(tree))

    def skeleton(self, tree_id: int, year: int) -> Skeleton:
        """Shape of a sample tree."""
        return self._run.skeleton(tree_id, year)

    def disc(self, tree_id: int, height_m: float, year: int) -> Disc:
        """A disc, of a sample tree at any height, of others where `/rings` has one."""
        return self._run.disc(tree_id, height_m, year=year)

    def surface(
        self, tree_id: int, year: int, shape: str, say: Callable[[str], None] = lambda line: None
    ) -> list[Part]:
        """Surface of a sample tree."""
        from forest.viewer.surfaces import surface_parts

        return surface_parts(self._run, tree_id, year, shape, say=say)

    def waiting_for(self, tree_id: int) -> str:
        """Nothing waits in a run."""
        return ""

    def stand_near(self, year: int) -> Stand:
        """The stand of the checkpoint that is nearest to a year."""
        return self._restored(self._checkpoint(year)[1])

    def stand_year(self, year: int) -> int:
        """Year of that checkpoint."""
        return self._checkpoint(year)[0]

    def _checkpoint(self, year: int) -> tuple[int, Path]:
        from forest.record.checkpoint import checkpoint_paths, step_of

        first = self.scenario.start_year - 1
        found = [(first + step_of(path), path) for path in checkpoint_paths(self._run.path)]
        if not found:
            raise InputError(
                "no checkpoint lies beside the run file, and only checkpoints hold all buds",
                where=self.where,
            )
        return min(found, key=lambda each: abs(each[0] - year))

    def _restore(self, path: Path) -> Stand:
        from forest.record.checkpoint import read_checkpoint
        from forest.stand import Stand

        return Stand.restore(self.scenario, *read_checkpoint(path))
