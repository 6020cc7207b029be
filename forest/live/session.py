"""The live session: acts are queued, a step does them and grows a year, and all can be replayed."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forest.errors import ActError, InputError, OutputError
from forest.live.preview import markers_to_come, preview
from forest.live.records import tables_of, write_run
from forest.management.plan import YearOfActs, plan_year
from forest.record.export import whole_file
from forest.scenario.timing import Timing
from forest.stand import Stand

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from forest.scenario import Scenario
    from forest.scenario.model import Obstacle
    from forest.trees.skeleton import Skeleton
    from forest.yearbook import YearRecord


#: How a session's file begins, so that no other file is taken for one.
HEADING = "# A live session as a scenario: `forest run` grows it again.\n"
#: What follows where no year is grown yet: its `years` are one at least.
NOT_YET = "# No year of it is grown yet.\n"


class LiveSession:
    """A stand that is worked on while it grows.

    Acts are queued and done by the scenario's own machinery at the start of the next step. The
    scenario that the session has come to is therefore a headless run of the same bits.

    Parameters
    ----------
    scenario : Scenario
        Where it starts; its own acts are done in their years.
    save_to : path, optional
        The session's scenario file, written anew, whole or not at all, after each act and step.
    say : callable, optional
        Told how the nursery goes on where the stand starts from an inventory, and of surfaces that
        are written.

    Attributes
    ----------
    stand : Stand
        As it is after the last step.
    kept : bool
        Whether its file holds all that was done: not where a step's could not be written.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        save_to: str | Path | None = None,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._base = scenario
        self._say = say
        self._save_to = None if save_to is None else Path(save_to)
        self.kept = True
        self._acts: list[dict[str, Any]] = []
        self._pending: list[dict[str, Any]] = []
        self._records: list[YearRecord] = []
        self._tables: dict[str, pd.DataFrame] | None = None
        self._plan_now: YearOfActs | None = None
        self._planned = False
        self.stand = Stand(scenario, say)
        self._become(self._with([]))

    @property
    def scenario(self) -> Scenario:
        """The session as a scenario: all acts so far, and as many years as are done, one at least.

        Run headless it gives the same bits. Acts that wait for the next step are in it as well.
        """
        return self.stand.scenario

    @property
    def year(self) -> int:
        """The last complete calendar year; the one before the first before any step."""
        return self.stand.year

    @property
    def next_year(self) -> int:
        """The calendar year that the next step grows."""
        return self.stand.year + 1

    @property
    def pending(self) -> tuple[dict[str, Any], ...]:
        """The acts that wait for the next step, as they were given, in order."""
        return tuple(dict(keys) for keys in self._pending)

    @property
    def records(self) -> tuple[YearRecord, ...]:
        """The record of each year so far."""
        return tuple(self._records)

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of all years so far, by name, as their run file would give them."""
        if self._tables is None:
            self._tables = tables_of(self.scenario, self._records)
        return dict(self._tables)

    # ------------------------------------------------------------------ acts and years

    def act(self, **keys: Any) -> None:
        """Queue an act for the start of the next step.

        Parameters
        ----------
        **keys
            Those of an `[[acts]]` entry but for its time, as ``kind="fell", tree_ids=[3]``.

        Raises
        ------
        InputError
            If it is not right, or cannot be done to the stand as it is; then nothing is queued.
        """
        for key in Timing.model_fields.keys() - {"kind"}:
            if key in keys:
                raise InputError(
                    f"{key} is given", where="act", expected="an act of the next year, without time"
                )
        queued = [*self._pending, keys]
        before = self.stand.scenario
        try:
            self._become(self._with(queued))
            plan_year(self.stand, self.next_year)
        except InputError as error:
            self._become(before)
            raise _of_act(error, self._next_number) from None
        self._wait(queued, before)

    def undo(self, number: int = -1) -> None:
        """Take back an act that waits for the next step.

        Parameters
        ----------
        number : int
            Its place in `pending`; the last one if not given.

        Raises
        ------
        InputError
            If none waits there: what is done is done; or if a later one needs it.
        """
        if not -len(self._pending) <= number < len(self._pending):
            raise InputError(
                "no act is pending", where="undo", expected="an act since the last step"
            )
        left = list(self._pending)
        del left[number]
        before = self.stand.scenario
        try:
            self._become(self._with(left))
            plan_year(self.stand, self.next_year)
        except InputError as error:
            self._become(before)
            raise InputError(f"a later act needs it: {error}", where="undo") from None
        self._wait(left, before)

    def step(self) -> YearRecord:
        """Do the acts that wait, grow a year and give its record.

        Raises
        ------
        InputError
            If an act of the scenario that the session started from cannot be done in its year, or
            the climate ends; then the stand is as it was.
        OutputError
            If the year is grown, but its file cannot be written: `kept` is false until it can.
        """
        done = self._dated(self._pending)
        record = self.stand.step()
        self._acts += done
        self._pending = []
        self._records.append(record)
        self._tables = None
        self._become(self._with([]))
        self.keep()
        return record

    # ------------------------------------------------------------------ what it is now

    def trees(self) -> pd.DataFrame:
        """The living trees now, with what the next step will do to each in a column `pending`.

        It is "" for nothing, or the kinds of the acts, joined by commas.
        """
        trees = self.stand.trees
        waiting: dict[int, list[str]] = {}
        plan = self._plan()
        if plan is not None:
            for kind, tree_ids in plan.touched():
                for tree_id in tree_ids:
                    kinds = waiting.setdefault(tree_id, [])
                    if kind not in kinds:
                        kinds.append(kind)
        trees["pending"] = [",".join(waiting.get(i, ())) for i in trees.tree_id]
        return trees

    def skeleton(self, tree_id: int) -> Skeleton:
        """The shape of a living tree as the acts that wait will leave it.

        Raises
        ------
        InputError
            If no living tree has that id.
        """
        return preview(self.stand, tree_id, self._plan())

    def bent(self, tree_id: int, metamer: int, to_m: Sequence[float]) -> Skeleton:
        """The shape of a living tree as an act `bend` would leave it; nothing is queued.

        Raises
        ------
        InputError
            If it cannot be bent so.
        """
        with self._as_if(kind="bend", tree_id=tree_id, metamer=metamer, to_m=list(to_m)) as plan:
            return preview(self.stand, tree_id, plan)

    def would_fell(self, **keys: Any) -> tuple[int, ...]:
        """Trees that an act would fell beside those that wait to be felled; nothing is queued.

        Parameters
        ----------
        **keys
            As of `act`.

        Raises
        ------
        InputError
            If it cannot be done.
        """
        number = self._next_number
        try:
            with self._as_if(**keys) as plan:
                felling = None if plan is None else plan.fellings.get(number)
                return () if felling is None else tuple(felling.tree_ids)
        except InputError as error:
            raise _of_act(error, number) from None

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles as the acts that wait will leave them."""
        plan = self._plan()
        if plan is None or not plan.changes:
            return self.stand.obstacles.now
        return list(plan.changes.values())[-1].obstacles

    @property
    def markers_to_come(self) -> NDArray[np.float64]:
        """Places (n, 3), m, of the markers that strokes that wait will lay, in all their steps."""
        return markers_to_come(self.stand, self._plan())

    # ------------------------------------------------------------------ files

    def save(self, path: str | Path) -> None:
        """Write the scenario that replays the session, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written; what was there before stays.
        """
        heading = HEADING if self._records else HEADING + NOT_YET
        with (
            whole_file(path, overwrite=True) as draft,
            draft.open("w", encoding="utf-8") as file,
        ):
            file.write(heading + self.scenario.to_toml())
            file.flush()
            os.fsync(file.fileno())

    def keep_in(self, path: str | Path) -> None:
        """Keep the session in a file from now on: written anew after each act and step."""
        self._save_to = Path(path)
        self.keep()

    def keep(self) -> None:
        """Write the file in which the session is kept, if it is.

        Raises
        ------
        OutputError
            If it cannot be written; what was there before stays.
        """
        self.kept = False
        if self._save_to is not None:
            self.save(self._save_to)
        self.kept = True

    def write_run(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write a run file of the years so far, and what goes with it, as the headless run does.

        Raises
        ------
        InputError
            If no year is done, or the file cannot be written.
        """
        if not self._records:
            raise InputError("no year is done", expected="a step before a run file")
        scenario = self._with([])
        write_run(scenario, self._records, Path(path), overwrite=overwrite, say=self._say)

    # ------------------------------------------------------------------ inside

    def _plan(self) -> YearOfActs | None:
        """What the next step will do; None if nothing, or if it cannot be done."""
        if not self._planned:
            try:
                self._plan_now = plan_year(self.stand, self.next_year)
            except ActError:
                self._plan_now = None
            self._planned = True
        return self._plan_now

    @contextmanager
    def _as_if(self, **keys: Any) -> Iterator[YearOfActs | None]:
        """Give the plan of the next step as if one more act waited."""
        before = self.stand.scenario
        try:
            self._become(self._with([*self._pending, keys]))
            yield plan_year(self.stand, self.next_year)
        finally:
            self._become(before)

    @property
    def _next_number(self) -> int:
        """The place among the scenario's acts of one that is queued now."""
        return len(self._base.acts) + len(self._acts) + len(self._pending)

    def _dated(self, acts: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [{**keys, "year": self.next_year} for keys in acts]

    def _with(self, pending: list[dict[str, Any]]) -> Scenario:
        done = self.stand.steps
        return self._base.lived(
            [*self._acts, *self._dated(pending)], years=max(done, 1), planned=done + 1
        )

    def _become(self, scenario: Scenario) -> None:
        """Let the stand have a scenario that differs in acts and years alone."""
        self.stand.scenario = scenario
        self._planned = False

    def _wait(self, pending: list[dict[str, Any]], before: Scenario) -> None:
        """Let these acts wait, if they can be kept; else those that waited before."""
        were, self._pending = self._pending, pending
        try:
            self.keep()
        except OutputError:
            self._pending = were
            self._become(before)
            raise


def _of_act(error: InputError, number: int) -> InputError:
    """Say of an act, not of its place among all acts, what is wrong."""
    return InputError(str(error).replace(f"acts[{number}]", "act", 1))
