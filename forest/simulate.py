"""Run a scenario from planting to its last year and write the run file."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from forest.errors import InputError
from forest.record.checkpoint import latest_checkpoint, remove_checkpoints, write_checkpoint
from forest.record.run import Run, open_run
from forest.record.writer import RunWriter, check_run_file

if TYPE_CHECKING:
    from forest.scenario import Scenario
    from forest.stand import Stand


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
    Interrupted
        After SIGINT or SIGTERM; the year was finished and a checkpoint written.
    """
    out = Path(out)
    observer = _observer(progress)
    count = _thread_count(threads)
    started = _resumed(scenario, out, count, command) if resume and out.exists() else None
    if started is None and resume and out.exists():
        check_run_file(out)
        overwrite = True
        observer.say(f"{out} has no checkpoint yet; starting over")
    if started is not None and started[1] is None:
        observer.say(f"{out} is complete; nothing to do")
        return open_run(out)

    import numba

    from forest._jit import is_cold

    numba.set_num_threads(count)
    if started is None:
        writer = _create(scenario, out, count, command, overwrite)
        stand = None
    else:
        stand, writer = started[0], started[1]
    if is_cold():
        observer.say("compiling the kernels for the first run on this machine (under a minute)")
    try:
        if stand is None:
            from forest.stand import Stand

            stand = Stand(scenario)
        assert writer is not None
        _grow(stand, writer, out, observer)
    finally:
        observer.end()
        if writer is not None:
            writer.close()
    return open_run(out)


def _grow(stand: Stand, writer: RunWriter, out: Path, observer: Observer) -> None:
    scenario = stand.scenario
    every = scenario.output.checkpoint_every_years
    observer.begin(scenario.years, stand.steps)
    with _stop_requests() as stop:
        while stand.steps < scenario.years:
            record = stand.step()
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


def _create(
    scenario: Scenario, out: Path, threads: int, command: Sequence[str], overwrite: bool
) -> RunWriter:
    n = len(scenario.planting_positions()[0])
    writer = RunWriter.create(
        out,
        scenario_toml=scenario.to_toml(),
        digest=scenario.digest(),
        seed=scenario.seed,
        species_names=[s.name for s in scenario.species_list],
        threads=threads,
        tables=scenario.output.tables,
        trees_per_year=max(n, 1),
        command=command,
        overwrite=overwrite,
    )
    remove_checkpoints(out)
    return writer


def _resumed(
    scenario: Scenario, out: Path, threads: int, command: Sequence[str]
) -> tuple[Stand | None, RunWriter | None] | None:
    """Open a run to go on with: (stand, writer), (None, None) if complete, None to start over."""
    with open_run(out) as run:
        done = run.scenario
        if done.with_overrides([f"years={scenario.years}"]) != scenario:
            raise InputError(
                "was made by a different scenario",
                where=f"--resume {out}",
                expected="the same scenario, seed and settings; only `years` may grow",
            )
        years_done = len(run.years)
        if years_done > scenario.years:
            raise InputError(
                f"holds {years_done} years already",
                where=f"--resume {out}",
                expected=f"years = {years_done} or more",
            )
        if run.complete and years_done == scenario.years:
            return None, None
    found = latest_checkpoint(out)
    if found is None:
        return None
    from forest.stand import Stand

    arrays, meta = found
    writer = RunWriter.reopen(
        out,
        rows=meta["rows"],
        years_done=int(meta["step"]),
        threads=threads,
        command=command,
    )
    try:
        return Stand.restore(scenario, arrays, meta), writer
    except BaseException:
        writer.close()
        raise


def _thread_count(threads: int | None) -> int:
    available = int(os.environ.get("NUMBA_NUM_THREADS", 0)) or len(os.sched_getaffinity(0))
    if threads is None:
        return available
    if not 1 <= threads <= available:
        raise InputError(
            f"{threads} threads", where="--threads", expected=f"1 to {available} on this machine"
        )
    return threads


@contextmanager
def _stop_requests() -> Iterator[threading.Event]:
    """Turn SIGINT and SIGTERM into a request to stop after the year."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: stop.set())
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
