"""The manifest of a sweep: a row per run, kept on file while the runs go on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forest.ensemble.design import PlannedRun, text_of
from forest.errors import InputError, OutputError

if TYPE_CHECKING:
    import pandas as pd

NAME = "manifest.parquet"
DONE, FAILED, PENDING = "done", "failed", "pending"

#: Keys of a scenario that are columns of other meaning in the tables of a sweep.
_TAKEN = ("species",)


class Manifest:
    """What became of each run of a sweep, on file as Parquet and as CSV.

    Its columns: ``run`` (name), ``scenario``, one per setting, ``replicate``, ``seed``, ``status``
    (done, failed, pending), ``file`` (relative to the folder), ``elapsed_s`` (NaN unless done) and
    ``error`` (one line if failed, else empty).

    Parameters
    ----------
    folder : Path
        Where it lies.
    runs : sequence of PlannedRun
        The runs, in the order of its rows; all are pending.
    """

    def __init__(self, folder: Path, runs: Sequence[PlannedRun]) -> None:
        self._folder = folder
        self._runs = runs
        self._status = {run.name: PENDING for run in runs}
        self._elapsed: dict[str, float] = {}
        self._errors: dict[str, str] = {}

    def done(self, run: PlannedRun, elapsed_s: float) -> None:
        """Take the end of a run."""
        self._status[run.name] = DONE
        self._elapsed[run.name] = elapsed_s

    def failed(self, run: PlannedRun, error: str) -> None:
        """Take the failure of a run."""
        self._status[run.name] = FAILED
        self._errors[run.name] = error

    def table(self) -> pd.DataFrame:
        """Give the manifest as it stands."""
        import pandas as pd

        runs = self._runs
        columns: dict[str, Any] = {
            "run": [run.name for run in runs],
            "scenario": [run.origin for run in runs],
        }
        for key in runs[0].settings:
            columns[_column_of(key)] = _column([run.settings[key] for run in runs])
        columns |= {
            "replicate": [run.replicate for run in runs],
            "seed": [run.scenario.seed for run in runs],
            "status": [self._status[run.name] for run in runs],
            "file": [file_of(run) for run in runs],
            "elapsed_s": [self._elapsed.get(run.name, math.nan) for run in runs],
            "error": [self._errors.get(run.name, "") for run in runs],
        }
        return pd.DataFrame(columns)

    def write(self) -> None:
        """Replace the manifest's files, each whole or not at all.

        Raises
        ------
        OutputError
            If they cannot be written.
        """
        table = self.table()
        path = self._folder / NAME
        readable = path.with_suffix(".csv")
        try:
            for to, write in ((readable, table.to_csv), (path, table.to_parquet)):
                draft = to.with_name(to.name + ".part")
                write(draft, index=False)
                draft.replace(to)
        except OSError as error:
            raise OutputError.of(error, path) from error


def read_manifest(folder: Path) -> pd.DataFrame:
    """Read the manifest of a sweep.

    Raises
    ------
    InputError
        If the folder holds none, or it is damaged.
    """
    import pandas as pd

    path = folder / NAME
    try:
        return pd.read_parquet(path)
    except FileNotFoundError:
        raise InputError(
            "holds no sweep", where=str(folder), expected=f"a folder with {NAME}"
        ) from None
    except (OSError, ValueError) as error:
        raise InputError("is damaged", where=str(path)) from error


def parameters_of(manifest: pd.DataFrame) -> tuple[str, ...]:
    """Name the columns of settings."""
    names = list(manifest.columns)
    return tuple(names[names.index("scenario") + 1 : names.index("replicate")])


def file_of(run: PlannedRun) -> str:
    """Name the file of a run."""
    return f"{run.name}.h5"


def _column_of(key: str) -> str:
    return f"set.{key}" if key in _TAKEN else key


def _column(values: list[Any]) -> list[Any]:
    """Give values of one kind: numbers, truth values, or else text."""
    if all(isinstance(value, bool) for value in values):
        return values
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return values
    return [text_of(value) for value in values]
