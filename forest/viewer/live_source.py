"""A stand that lives, as the viewer shows it: its years so far, and its trees as they stand."""

from __future__ import annotations

import tempfile
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np

from forest.errors import InputError
from forest.view.stand_years import COLUMNS as BODY_COLUMNS
from forest.view.standing import (
    EVENT_COLUMNS,
    PLACE_COLUMNS,
    in_year,
    residual_rows,
    snags_of,
    together,
)
from forest.viewer.source import COLUMNS, largest_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import pandas as pd
    from numpy.typing import NDArray

    from forest.dendro.disc import Disc
    from forest.live import LiveSession
    from forest.record.run import Run
    from forest.scenario import Scenario
    from forest.scenario.model import Obstacle
    from forest.stand import Stand
    from forest.surface.export import Part
    from forest.trees.skeleton import Skeleton

_SHAPING = ("prune", "bend", "obstacle", "crack")  # acts that change a tree's surface
_MOST_METAMERS = 60_000  # of all trees that are shown with their branches
_MOST_NEAR = 24  # trees that were looked at last, where not all can be shown with branches


class LiveSource:
    """A live session.

    While a year grows, in a thread of its own, all that is asked for comes from before it.

    Parameters
    ----------
    session : LiveSession
    where : str
        Its file.

    Attributes
    ----------
    session : LiveSession
        To be touched only with `lock` held.
    lock : threading.Lock
        Held while a year grows, and while something is read of the session.
    growing : bool
        Whether a year grows.

    Raises
    ------
    InputError
        If its scenario keeps no table of trees.
    """

    def __init__(self, session: LiveSession, where: str) -> None:
        self.session, self.where = session, where
        self.lock, self.growing = Lock(), False
        self.title = session.scenario.title or Path(where).name
        self._near: list[int] = []
        self._first_year = session.scenario.start_year - 1
        self._at_first = self._trees_at_first()
        self._residual_at_first = session.stand.residual.table
        self.refresh()

    def refresh(self) -> None:
        """Take over what the session has come to; not while a year grows."""
        tables = self.session.tables
        for table in ("trees", "stand", "events"):
            if table not in tables:
                raise InputError(f"keeps no table '{table}', which a view needs", where=self.where)
        self.scenario: Scenario = self.session.scenario
        self._trees, self.stand, self.events = tables["trees"], tables["stand"], tables["events"]
        self._snags = snags_of(
            self.scenario, self.events[list(EVENT_COLUMNS)], self._trees[list(PLACE_COLUMNS)]
        )
        self._residual = tables.get(
            "residual", self._residual_at_first.assign(year=self._first_year)
        )
        records = self.session.records
        self.years = (self._first_year, *(record.year for record in records))
        self.now = self._first_year if not records else records[-1].year
        self.largest = largest_of(self._trees if len(records) else self._at_first)
        self.living = self.session.trees()
        self.pending = self.session.pending
        self.obstacles = self.session.obstacles
        self.markers_to_come = self.session.markers_to_come
        self.markers_laid = self._free_markers()
        self.strokes = self.session.stand.strokes
        self._metamers = dict(
            zip(
                self.living["tree_id"].astype(int),
                self.living["metamers"].astype(int),
                strict=True,
            )
        )
        self._skeletons: dict[int, Skeleton] = {}
        self._recorded: tempfile.TemporaryDirectory[str] | None = None

    def _free_markers(self) -> NDArray[np.float64]:
        """Places of the markers of strokes that are there and not taken for good."""
        stand = self.session.stand
        if stand.surroundings.markers is None:
            return np.zeros((0, 3))
        laid = stand.surroundings.markers.laid
        return laid.point[(laid.due <= stand.steps) & ~laid.gone]

    def _trees_at_first(self) -> pd.DataFrame:
        """The stand before its first year, with what is not known then."""
        trees = self.session.stand.trees
        trees["status"] = "living"
        for name in COLUMNS:
            if name not in trees:
                trees[name] = np.nan
        return trees.loc[:, list(COLUMNS)]

    def trees(self, year: int) -> pd.DataFrame:
        """Rows at the end of a year, or of the stand as it began."""
        if year == self._first_year:
            return self._at_first
        rows = self._trees["year"].to_numpy() == year
        return self._trees.loc[rows, list(COLUMNS)].reset_index(drop=True)

    def others(self, year: int) -> pd.DataFrame:
        """Residual trees and snags that stand at the end of a year."""
        residual = self._residual[self._residual["year"] == year]
        if year == self._first_year:
            residual = self._residual_at_first
        parts = residual_rows(residual), in_year(self._snags, year)
        return together(parts, (*BODY_COLUMNS, "fate"))

    def standing_obstacles(self, year: int) -> tuple[Obstacle, ...]:
        """None: the desk draws them as acts will leave them."""
        return ()

    def life(self, tree_id: int) -> pd.DataFrame:
        """Year, dbh and height of a tree over its life."""
        rows = self._trees["tree_id"].to_numpy() == tree_id
        columns = ["year", "dbh_cm", "height_m"]
        found = self._trees.loc[rows, columns].reset_index(drop=True)
        if not len(found) and tree_id in set(self._at_first["tree_id"]):
            here = self._at_first["tree_id"].to_numpy() == tree_id
            found = self._at_first.loc[here].assign(year=self._first_year)[columns]
        return found

    # ------------------------------------------------------------------ branches

    def come_near(self, tree_id: int) -> bool:
        """Show this tree with branches from now on; tell whether that is new."""
        if tree_id not in self._metamers or tree_id in self.with_branches(self.now):
            return False
        self._near = [tree_id, *self._near][:_MOST_NEAR]
        return True

    def with_branches(self, year: int) -> tuple[int, ...]:
        """All living trees where they are few, and else those looked at last; now alone."""
        if year != self.now:
            return ()
        if self.growing:
            return tuple(self._skeletons)
        if sum(self._metamers.values()) <= _MOST_METAMERS:
            return tuple(self._metamers)
        found: list[int] = []
        room = _MOST_METAMERS
        for tree_id in self._near:
            room -= self._metamers.get(tree_id, 0)
            if tree_id in self._metamers and (room >= 0 or not found):
                found.append(tree_id)
        return tuple(found)

    def skeleton(self, tree_id: int, year: int) -> Skeleton:
        """Shape of a living tree as the acts that wait will leave it."""
        if year != self.now:
            raise InputError(f"branches are known of {self.now} alone", where=self.where)
        if tree_id not in self._skeletons:
            with self.at_rest() as session:
                self._skeletons[tree_id] = session.skeleton(tree_id)
        return self._skeletons[tree_id]

    # ------------------------------------------------------------------ what needs the stand

    def close(self) -> None:
        """Remove what was written for the viewer alone."""
        if self._recorded is not None:
            self._recorded.cleanup()

    @contextmanager
    def at_rest(self) -> Iterator[LiveSession]:
        """Give the session if no year grows.

        Raises
        ------
        InputError
            If one does.
        """
        if self.growing:
            raise InputError("a year is growing", expected="its end before this")
        with self.lock:
            yield self.session

    def disc(self, tree_id: int, height_m: float, year: int) -> Disc:
        """A disc, cut as out of the session's run file."""
        with self._run() as run:
            return run.disc(tree_id, height_m, year=year)

    @contextmanager
    def _run(self) -> Iterator[Run]:
        """Give the session as a run file, written anew after each year.

        A year may grow as it is read.
        """
        from forest.record.run import open_run

        with self.at_rest() as session:
            folder = self._recorded
            if folder is None:
                folder = tempfile.TemporaryDirectory(prefix="forest-view-")
                session.write_run(Path(folder.name) / "run.h5")
                self._recorded = folder
        with open_run(Path(folder.name) / "run.h5") as run:
            yield run

    def surface(
        self, tree_id: int, year: int, shape: str, say: Callable[[str], None] = lambda line: None
    ) -> list[Part]:
        """Surface of a living tree; only a sample tree has the rings along which bark is torn.

        Bark is that of the last year, with the cracks that wait.
        """
        from forest.surface.bark.cracks import Crack
        from forest.viewer.surfaces import surface_parts, wood_parts

        if shape == "bark":
            waiting = [
                Crack(year + 1, act["height_m"], act["azimuth_deg"])
                for act in self.pending
                if act["kind"] == "crack" and act["tree_id"] == tree_id
            ]
            with self._run() as run:
                if tree_id not in run.samples:
                    raise InputError(
                        f"tree {tree_id} is no sample tree: no rings to tear its bark along",
                        expected="one of output.sample_trees",
                    )
                return surface_parts(run, tree_id, year, shape, waiting, say)
        species = {kind.name: kind for kind in self.scenario.species_list}
        skeleton = self.skeleton(tree_id, year)
        return wood_parts(skeleton, species[skeleton.species], shape)

    def waiting_for(self, tree_id: int) -> str:
        """What waits to be done to its shape or bark."""
        acts = [
            act
            for act in self.pending
            if act["kind"] in _SHAPING and act.get("tree_id") in (None, tree_id)
        ]
        return repr(acts) if acts else ""

    def stand_near(self, year: int) -> Stand:
        """A copy of the stand as it is now."""
        from forest.stand import Stand

        with self.at_rest() as session:
            arrays, meta = session.stand.state()
            arrays = {name: array.copy() for name, array in arrays.items()}
            return Stand.restore(session.scenario, arrays, meta)

    def stand_year(self, year: int) -> int:
        """The last complete year."""
        return self.now
