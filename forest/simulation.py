"""Run a scenario from planting to its last year and write the run file."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from forest._jit import announce_compiling
from forest._threads import most_threads, using_threads
from forest.errors import ActError, InputError
from forest.record.checkpoint import latest_checkpoint, write_checkpoint
from forest.record.run import Run, open_run
from forest.record.writer import RunWriter, check_target
from forest.scenario.timing import acts_so_far
from forest.stand import Stand

if TYPE_CHECKING:
    from forest.scenario import Scenario


class Observer(Protocol):
    """Who is told how a run goes on."""

    def say(self, message: str) -> None:
        """Take a line about what is going on."""

    def begin(self, years: int, done: int) -> None:
        """Take the number of years to grow, and of those that are done."""

    def year_done(self, stand: Stand) -> None:
        """Take the stand at the end of a year."""

    def end(self) -> None:
        """Take the end of the run."""


class Interrupted(KeyboardInterrupt):
    """A run that was asked to stop: its years so far are on file and it can be resumed."""


def simulate(
    scenario: Scenario,
    out: str | Path,
    *,
    threads: int | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool | Observer = False,
    command: Sequence[str] = (),
) -> Run:
    """Grow a scenario and write its run file.

    Parameters
    ----------
    scenario : Scenario
        What to grow.
    out : path
        The run file; checkpoints are written beside it.
    threads : int, optional
        Threads to use; all cores by default. Results do not depend on it.
    resume : bool
        Go on with an unfinished run of the same scenario, from its last checkpoint; a run without
        one starts over. A finished run is given back, and goes on if `scenario.years` has grown.
        Acts, deaths, storms and climate of years that are not on file may differ.
    overwrite : bool
        Replace an existing file.
    progress : bool or Observer
        Whether, or to whom, to show how the run goes on.
    command : sequence of str
        The command line, for the record.

    Returns
    -------
    Run
        The finished run, open for reading.

    Raises
    ------
    InputError
        If the file cannot be written, or cannot be resumed with this scenario.
    ActError
        If an act of the scenario cannot be done in its year. The years before are on file, and
        the run can be resumed with other acts from that year on.
    Interrupted
        After SIGINT or SIGTERM; the year was finished and a checkpoint written.
    """
    out = Path(out)
    observer = _observer(progress)
    if resume and out.exists():
        if _is_complete(scenario, out):
            observer.say(f"{out} is complete; nothing to do")
            return open_run(out)
        checkpoint = latest_checkpoint(out)
        if checkpoint is None:
            _check_nothing_is_lost(out)
            observer.say(f"{out} has no checkpoint yet; starting over")
            overwrite = True
    else:
        checkpoint = None
        check_target(out, overwrite=overwrite)

    def compiling() -> None:
        observer.say("compiling kernels that this machine has not run yet (up to a minute)")

    with _threads(threads) as count, announce_compiling(compiling):
        # The stand comes before the file: if it cannot be built, the file is left as it was.
        if checkpoint is None:
            stand = Stand(scenario, observer.say)
            writer = writer_of(scenario, out, threads=count, command=command, overwrite=overwrite)
        else:
            arrays, meta = checkpoint
            stand = Stand.restore(scenario, arrays, meta)
            writer = RunWriter.reopen(
                out,
                rows=meta["rows"],
                years_done=stand.steps,
                scenario_toml=scenario.to_toml(),
                digest=scenario.digest(),
                threads=count,
                command=command,
            )
        with writer:
            try:
                _grow(stand, writer, out, observer)
            finally:
                observer.end()
    return with_meshes(open_run(out), observer.say)


def with_meshes(run: Run, say: Callable[[str], None]) -> Run:
    """Write the surfaces of a finished run's sample trees, if the scenario asks for them."""
    wanted = run.scenario.output.sample_trees
    form = wanted.meshes
    if form is not None and run.samples:
        from forest.view.tree_mesh import write_samples

        say(f"writing the surfaces of {len(run.samples)} sample trees")
        written = write_samples(run, f".{form}", bark=wanted.bark, surface=wanted.surface, say=say)
        say(f"{written[0].parent} holds them")
    return run


def _grow(stand: Stand, writer: RunWriter, out: Path, observer: Observer) -> None:
    scenario = stand.scenario
    every = scenario.output.checkpoint_every_years
    observer.begin(scenario.years, stand.steps)
    with _stop_requests(observer) as stop:
        while stand.steps < scenario.years:
            try:
                record = stand.step()
            except ActError:  # nothing of the year is done yet: all years so far are kept
                _checkpoint(stand, writer, out)
                writer.interrupt()
                raise
            writer.append_year(record.year, record.tables, record.samples)
            observer.year_done(stand)
            last = stand.steps == scenario.years
            if stop.is_set() or last or stand.steps % every == 0:
                _checkpoint(stand, writer, out)
            if stop.is_set() and not last:
                writer.interrupt()
                raise Interrupted(
                    f"stopped after {record.year}; go on with the same command and --resume"
                )
    writer.finish()


def _checkpoint(stand: Stand, writer: RunWriter, out: Path) -> None:
    writer.sync()
    arrays, meta = stand.state()
    meta["rows"] = writer.row_counts()
    write_checkpoint(out, arrays, meta, step=stand.steps)


def writer_of(
    scenario: Scenario,
    out: Path,
    *,
    threads: int,
    command: Sequence[str] = (),
    overwrite: bool = False,
) -> RunWriter:
    """Make the run file of a scenario, without a year; see `RunWriter.create`."""
    n = len(scenario.planting_positions()[0])
    return RunWriter.create(
        out,
        scenario_toml=scenario.to_toml(),
        digest=scenario.digest(),
        seed=scenario.seed,
        species_names=[s.name for s in scenario.species_list],
        threads=threads,
        residual=[(tree.name, tree.species) for tree in scenario.residual_trees],
        tables=stored_tables(scenario),
        trees_per_year=max(n, 1),
        command=command,
        overwrite=overwrite,
    )


def stored_tables(scenario: Scenario) -> list[str]:
    """Name the tables that a run of a scenario stores, beside the ledger of the living."""
    return [
        name for name in scenario.output.tables if name != "residual" or scenario.residual_trees
    ]


def _is_complete(scenario: Scenario, out: Path) -> bool:
    """Tell whether a run file holds all years of its scenario; refuse that of another one."""
    with open_run(out) as run:
        years_done = len(run.years)
        if not _same_so_far(run.scenario, scenario, years_done):
            raise InputError(
                "was made by a different scenario",
                where=f"--resume {out}",
                expected="the same scenario, seed and settings; only `years` may grow, and acts, "
                "deaths, storms and climate of years that are not on file may differ",
            )
        if years_done > scenario.years:
            raise InputError(
                f"holds {years_done} years already",
                where=f"--resume {out}",
                expected=f"years = {years_done} or more",
            )
        return run.complete and years_done == scenario.years


def _same_so_far(one: Scenario, other: Scenario, years_done: int) -> bool:
    """Compare two scenarios but for their years, and for acts, deaths, storms and climate to come.

    Each may choose its sample trees in its own last year, or in one to come.
    """
    return _so_far(one, years_done) == _so_far(other, years_done)


def _so_far(scenario: Scenario, years_done: int) -> dict[str, Any]:
    """Tell what of a scenario the years that are done hang on."""
    content = scenario.model_dump()
    done = range(scenario.start_year, scenario.start_year + years_done)
    content["acts"] = acts_so_far(scenario.acts, done)
    deaths = content["mortality"]
    deaths["events"] = _in_years(deaths["events"], done)
    for event in deaths["events"]:
        del event["source"]  # another file, or another line of it, kills the same trees
    wind = content["wind"]
    if wind is not None:
        wind["storms"] = _in_years(wind["storms"], done)
        if not wind["storms"] and wind["yearly"] is None:
            content["wind"] = None  # nothing has blown yet
    climate = content["climate"]
    climate["extreme_years"] = _in_years(climate["extreme_years"], done)
    if not climate["repeat"]:  # a series may go on
        climate["series"] = [y for y in climate["series"] if y["year"] < done.stop]
    del content["years"], content["planned_years"]
    samples = content["output"]["sample_trees"]
    del samples["meshes"], samples["surface"], samples["bark"]
    if samples["at_year"] == scenario.calendar[-1] or samples["at_year"] not in done:
        samples["at_year"] = None
    return content


def _in_years(entries: Iterable[dict[str, Any]], years: range) -> list[dict[str, Any]]:
    """Keep the entries of some years, by year; within one their order counts."""
    kept = (entry for entry in entries if entry["year"] in years)
    return sorted(kept, key=lambda entry: entry["year"])


def _check_nothing_is_lost(out: Path) -> None:
    """Refuse to start a run over whose checkpoints must have been removed."""
    with open_run(out) as run:
        if run.complete or len(run.years) >= run.scenario.output.checkpoint_every_years:
            raise InputError(
                f"holds {len(run.years)} years, but its checkpoints are gone",
                where=f"--resume {out}",
                expected=f"{out.name}.checkpoint-*.npz beside it; to start over, overwrite it",
            )


@contextmanager
def _threads(wanted: int | None) -> Iterator[int]:
    """Compute with so many threads, all by default; give their number."""
    available = most_threads()
    count = available if wanted is None else wanted
    if not 1 <= count <= available:
        raise InputError(
            f"{count} threads", where="threads", expected=f"1 to {available} on this machine"
        )
    with using_threads(count):
        yield count


@contextmanager
def _stop_requests(observer: Observer) -> Iterator[threading.Event]:
    """Turn the first SIGINT or SIGTERM into a request to stop after the year."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def ask(number: int, _frame: object) -> None:
        if stop.is_set():
            raise KeyboardInterrupt("stopped at once; --resume goes on from the last checkpoint")
        stop.set()
        observer.say("finishing the year; again to stop at once")

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _observer(progress: bool | Observer) -> Observer:
    from forest.progress import Bar, Silent

    if isinstance(progress, bool):
        return Bar() if progress else Silent()
    return progress
