"""One run of a sweep in a process of its own: what a worker is asked to do.

This module imports nothing that imports numba: the first task of a process chooses where numba
keeps its kernels and how many threads it has before numba is loaded.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from forest.errors import InputError, OutputError, libraries_silenced

if TYPE_CHECKING:
    from forest.scenario import Scenario


def grow(scenario_toml: str, digest: str, path: str) -> float:
    """Grow a scenario, or go on with it, and give its file the name that says it is done.

    Parameters
    ----------
    scenario_toml : str
        The complete scenario.
    digest : str
        Its hash.
    path : str
        The run file. Until it is done it is called ``path + ".part"``, and if that is there
        already, the run goes on from its last checkpoint.

    Returns
    -------
    float
        Seconds that it took, over all sessions that ended.

    Raises
    ------
    InputError
        If the scenario cannot be grown or the file cannot be written.
    """
    _settle_process()
    from forest.record.checkpoint import remove_checkpoints
    from forest.scenario import Scenario

    out = Path(path)
    part = part_of(out)
    scenario = Scenario.from_toml(scenario_toml, where=out.stem)
    seconds = verified_seconds(out, digest, scenario.years)
    if seconds is None:
        with libraries_silenced():
            _simulate(scenario, part)
        seconds = verified_seconds(part, digest, scenario.years)
        if seconds is None:
            raise InputError(
                "does not hold what was asked for",
                where=str(part),
                expected="the same version of forest on all machines",
            )
        part.replace(out)
    remove_checkpoints(part)
    return seconds


def part_of(path: Path) -> Path:
    """Name the file of a run that is not done."""
    return path.with_name(path.name + ".part")


def verified_seconds(path: Path, digest: str, years: int) -> float | None:
    """Open a run file and see whether it is the finished run of a scenario.

    Returns
    -------
    float or None
        Seconds that the run took; None if it is missing, damaged, unfinished or another one.
    """
    from forest.record.run import open_run

    try:
        with open_run(path) as run:
            if not (run.complete and run.digest == digest and len(run.years) == years):
                return None
            sessions = run.provenance["sessions"]
            return float(sum(session["elapsed_s"] or 0.0 for session in sessions))
    except InputError:
        return None


def _simulate(scenario: Scenario, part: Path) -> None:
    """Go on with an unfinished file if that is possible, else start over."""
    from forest.simulation import simulate

    command = ["forest", "sweep"]
    if part.exists():
        try:
            simulate(scenario, part, threads=1, resume=True, command=command).close()
        except OutputError:
            raise
        except InputError:
            pass  # damaged, without its checkpoints, or of a scenario that was changed since
        else:
            return
    simulate(scenario, part, threads=1, overwrite=True, command=command).close()


def _settle_process() -> None:
    """Give this process one thread and its own copy of the compiled kernels.

    Two processes that add different signatures to one cache can leave an index that names the
    other's code, so none may write to what another one reads.
    """
    if "forest._threads" in sys.modules:
        return
    os.environ["FOREST_THREADS"] = "1"
    from distributed import get_worker

    base = os.environ.get("FOREST_CACHE") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    shared = Path(base).expanduser() / "forest-kernels"
    # A folder that goes with the worker.
    os.environ["FOREST_CACHE"] = str(Path(get_worker().local_directory) / "kernels")
    from forest._jit import CACHE

    with contextlib.suppress(OSError):
        shutil.copytree(shared / CACHE.name, CACHE, dirs_exist_ok=True)
