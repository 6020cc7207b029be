"""A sweep: many runs over processes, one file each, and what they have in common."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forest.ensemble.bar import Listener, RunsBar, Silent
from forest.ensemble.design import PlannedRun, Scenarios, plan
from forest.ensemble.manifest import (
    DONE,
    FAILED,
    NAME,
    Manifest,
    file_of,
    parameters_of,
    read_manifest,
)
from forest.ensemble.processes import check_dask, processes
from forest.ensemble.worker import grow, verified_seconds
from forest.errors import InputError, OutputError, nearest

if TYPE_CHECKING:
    import pandas as pd

    from forest.ensemble.landscape import Landscape

_LOW, _HIGH = 0.05, 0.95
_YEARS_TO_WARM = 3


@dataclass(frozen=True)
class Sweep:
    """The runs of a folder, read together.

    Attributes
    ----------
    folder : Path
        Where they lie.
    manifest : pandas.DataFrame
        A row per run: run, scenario, its settings, replicate, seed, status, file, elapsed_s, error.
    """

    folder: Path
    manifest: pd.DataFrame

    @property
    def parameters(self) -> tuple[str, ...]:
        """The columns of the settings that the sweep varied."""
        return parameters_of(self.manifest)

    @property
    def failed(self) -> pd.DataFrame:
        """The rows of the manifest of runs that failed."""
        return self.manifest[self.manifest["status"] == FAILED]

    @cached_property
    def stand(self) -> pd.DataFrame:
        """The stand tables of all finished runs: scenario, settings, replicate, seed, and theirs.

        Raises
        ------
        InputError
            If no finished run holds a stand table, or one cannot be read.
        """
        import pandas as pd

        from forest.record.run import open_run

        shown = ["scenario", *self.parameters, "replicate", "seed"]
        frames = []
        for _, row in self.manifest[self.manifest["status"] == DONE].iterrows():
            with open_run(self.folder / row["file"]) as run:
                if "stand" not in run.tables:
                    continue
                table = run.stand
            table["species"] = table["species"].astype(str)  # codes differ between scenarios
            for place, name in enumerate(shown):
                table.insert(place, name, row[name])
            frames.append(table)
        if not frames:
            raise InputError("no finished run holds a stand table", where=str(self.folder))
        return pd.concat(frames, ignore_index=True)

    def means(self, column: str) -> pd.DataFrame:
        """Average a column of the stand table over replicates.

        Parameters
        ----------
        column : str
            A column of the stand table, e.g. ``"basal_area_m2ha"``.

        Returns
        -------
        pandas.DataFrame
            A row per scenario, combination of settings, year and species: mean, sd (NaN of a
            single replicate), n, and low and high, the 5th and 95th percentile. Replicates
            without a value (NaN) do not count.

        Raises
        ------
        InputError
            If there is no such column.
        """
        table = self.stand
        keys = ["scenario", *self.parameters, "year", "species"]
        known = [name for name in table.columns if name not in (*keys, "replicate", "seed")]
        if column not in known:
            raise InputError(f"no column '{column}' in 'stand'; {nearest(column, known)}")
        groups = table.groupby(keys, sort=False, dropna=False)[column]
        means = groups.agg(mean="mean", sd="std", n="count")
        means["low"] = groups.quantile(_LOW)
        means["high"] = groups.quantile(_HIGH)
        return means.reset_index()

    def landscape(self, *, least_basal_area_m2ha: float | None = None) -> Landscape:
        """Read the finished runs as the plots of a landscape; see `forest.ensemble.landscape`.

        Parameters
        ----------
        least_basal_area_m2ha : float, optional
            Basal area below which a plot has no dominant species; default: 1.

        Raises
        ------
        InputError
            If no finished run holds a stand table, or one cannot be read.
        """
        from forest.ensemble.landscape import LEAST_BASAL_AREA_M2HA, landscape_of

        least = LEAST_BASAL_AREA_M2HA if least_basal_area_m2ha is None else least_basal_area_m2ha
        return landscape_of(self, least_basal_area_m2ha=least)


def open_sweep(folder: str | Path) -> Sweep:
    """Open the folder of a sweep, finished or not.

    Raises
    ------
    InputError
        If it holds none.
    """
    folder = Path(folder)
    return Sweep(folder, read_manifest(folder))


def sweep(
    scenarios: Scenarios,
    *,
    settings: Mapping[str, Sequence[Any]] | None = None,
    replicates: int = 1,
    out: str | Path,
    workers: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    progress: bool = False,
) -> Sweep:
    """Grow scenarios under all combinations of settings, several times each, over processes.

    Each run writes one file, which has its final name only when it is done. A run that fails is
    listed and the others go on; one whose process is killed goes on elsewhere from its last
    checkpoint, to the same bits.

    In a script, call it under ``if __name__ == "__main__":``, since the processes import the
    script once more.

    Parameters
    ----------
    scenarios : path, sequence of paths, or mapping of name to Scenario
        What to grow.
    settings : mapping of key to values, optional
        Keys of the scenario, as ``"site.productivity"``, and the values that each takes.
    replicates : int
        Runs of each combination; the k-th has the scenario's seed + k, from k = 0.
    out : path
        The folder; it is made if it is not there.
    workers : int, optional
        Processes on this machine; all cores by default.
    scheduler : str, optional
        Address of a dask scheduler whose cluster to use instead. Its workers must see `out` under
        the same path, and have one thread each.
    resume : bool
        Go on with the sweep in `out`: finished runs are checked and kept, others are grown. There
        may be more scenarios, values and replicates than before.
    progress : bool
        Whether to show on standard error how the runs go on.

    Returns
    -------
    Sweep

    Raises
    ------
    InputError
        If a scenario or setting is refused, before anything is grown; if `out` holds another sweep;
        if dask is not installed or no scheduler answers.
    OutputError
        If the manifest cannot be written.
    """
    if workers is not None and scheduler is not None:
        raise InputError("workers and scheduler exclude each other", expected="one of them")
    if workers is not None and workers < 1:
        raise InputError(f"{workers} workers", where="workers", expected="1 or more")
    runs = plan(scenarios, settings or {}, replicates)
    check_dask()
    folder = Path(out).absolute()
    _check_folder(folder, runs, resume=resume)
    manifest = Manifest(folder, runs)
    listener = RunsBar() if progress else Silent()
    waiting = _sort_out(folder, runs, manifest)
    manifest.write()
    if waiting:
        _warm(waiting, listener)
        listener.begin(len(runs), len(runs) - len(waiting))
        try:
            with processes(workers, scheduler, len(waiting)) as client:
                _deal(client, folder, waiting, manifest, listener)
        finally:
            listener.end()
    return open_sweep(folder)


def _check_folder(folder: Path, runs: Sequence[PlannedRun], *, resume: bool) -> None:
    """Make the folder of a sweep; refuse one that holds another sweep."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError.of(error, folder) from error
    if resume and (folder / NAME).exists():
        planned = {run.name for run in runs}
        for name in read_manifest(folder)["run"]:
            if name not in planned:
                raise InputError(
                    f"lists a run '{name}' that is none of this sweep",
                    where=f"--resume {folder}",
                    expected="the same scenarios and settings, or more of them",
                )
    elif not resume and any(folder.iterdir()):
        raise InputError(
            "is not empty",
            where=str(folder),
            expected="a new folder, or --resume to go on with the sweep in it",
        )


def _sort_out(folder: Path, runs: Sequence[PlannedRun], manifest: Manifest) -> list[PlannedRun]:
    """Enter the runs that are done; give the others."""
    waiting = []
    for run in runs:
        path = folder / file_of(run)
        seconds = verified_seconds(path, run.digest, run.scenario.years)
        if seconds is not None:
            manifest.done(run, seconds)
            continue
        if _digest_of(path) not in (None, run.digest):
            raise InputError(
                "was made by a different scenario",
                where=f"--resume {path}",
                expected="the scenario as it was, or another folder",
            )
        waiting.append(run)
    return waiting


def _digest_of(path: Path) -> str | None:
    from forest.record.run import open_run

    try:
        with open_run(path) as run:
            return run.digest
    except InputError:
        return None


def _warm(runs: Sequence[PlannedRun], listener: Listener) -> None:
    """Compile the kernels that the runs need, for the workers to copy."""
    from forest._jit import announce_compiling
    from forest.stand import Stand

    kinds = {_kind(run): run for run in runs}
    message = "compiling kernels that this machine has not run yet (up to a minute)"
    with announce_compiling(lambda: listener.say(message)):
        for run in kinds.values():
            # What is wrong with a run is told when it is that run's turn.
            with contextlib.suppress(Exception):
                stand = Stand(run.scenario)
                for _ in range(_YEARS_TO_WARM):
                    stand.step()


def _kind(run: PlannedRun) -> str:
    """Name the models that a scenario uses: runs of one kind call the same kernels."""
    scenario = run.scenario
    parts = [scenario.mode, scenario.plot.boundary, bool(scenario.obstacles)]
    models = scenario.model_dump(include={"growth", "environment"})
    return repr([*parts, _without_numbers(models)])


def _without_numbers(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_numbers(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return bool(value)
    return value if isinstance(value, str | bool) or value is None else 0


def _deal(
    client: Any,
    folder: Path,
    runs: Sequence[PlannedRun],
    manifest: Manifest,
    listener: Listener,
) -> None:
    """Have all runs grown, and enter each in the manifest when it ends."""
    from distributed import as_completed

    futures = {
        client.submit(
            grow,
            run.scenario.to_toml(),
            run.digest,
            str(folder / file_of(run)),
            pure=False,
        ): run
        for run in runs
    }
    for future in as_completed(futures):
        run = futures[future]
        if future.status == "finished":
            manifest.done(run, future.result())
        else:
            manifest.failed(run, _line(future))
        manifest.write()
        listener.run_ended(run.name, failed=future.status != "finished")


def _line(future: Any) -> str:
    """Say in one line why a run failed."""
    from distributed import KilledWorker

    if future.cancelled():
        return "the cluster gave it up"
    error = future.exception()
    if isinstance(error, KilledWorker):
        return "its process died again and again (out of memory?)"
    text = " ".join(str(error).split())
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"
