"""What a frame of widths must be before it goes to a file, and the writing of the file."""

from __future__ import annotations

import datetime
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from forest.errors import InputError, OutputError


def check_widths(widths: pd.DataFrame, present_year: int | None) -> None:
    """Refuse a wide frame that readers of ring files would refuse or misread.

    Parameters
    ----------
    widths : pandas.DataFrame
        As `RingSeries.widths`.
    present_year : int or None
        The last year that readers accept; this year if None.

    Raises
    ------
    InputError
        If there is no series; the years are not whole numbers that follow each other, or lie
        after the present; ids are repeated or not of letters and digits; or a series is empty, has
        a gap, or a width that is negative or not finite.
    """
    if not widths.shape[0] or not widths.shape[1]:
        raise InputError("no ring series", where="widths", expected="at least one")
    years = np.asarray(widths.index)
    if years.dtype.kind not in "iu" or not np.all(np.diff(years) == 1):
        raise InputError(
            "the index is not of years that follow each other",
            where="widths",
            expected="calendar years, each of them, in order",
        )
    present = datetime.date.today().year if present_year is None else present_year
    if years[-1] > present:
        too_late = int(years[-1]) - present
        raise InputError(
            f"the last ring is of {years[-1]}, after the present",
            where="widths",
            expected=f"years to {present}, which readers of ring files accept: a start_year "
            f"{too_late} years earlier, or series moved by {-too_late} years",
        )
    ids = [str(name) for name in widths.columns]
    for name in ids:
        if not (name.isascii() and name.isalnum()):
            raise InputError(
                f"'{name}' is no id for a series", where="widths", expected="letters and digits"
            )
    if len({name.upper() for name in ids}) < len(ids):
        raise InputError("two series have the same id", where="widths", expected="one id each")
    for name, column in zip(ids, widths.to_numpy(dtype=float).T, strict=True):
        _check_column(name, years, column)


def _check_column(name: str, years: np.ndarray, column: np.ndarray) -> None:
    there = np.flatnonzero(~np.isnan(column))
    if not len(there):
        raise InputError(f"series '{name}' has no ring", where="widths", expected="at least one")
    span = slice(there[0], there[-1] + 1)
    good = np.isfinite(column[span]) & (column[span] >= 0.0)
    if not good.all():
        bad = there[0] + int(np.argmin(good))
        raise InputError(
            f"series '{name}' has a width of {column[bad]:g} mm in {years[bad]}",
            where="widths",
            expected="a width; 0 for a missing ring",
        )


def in_thousandths(widths_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round widths in mm to whole thousandths, in the same way for every file; NaN stays."""
    return np.asarray(np.rint(1000.0 * widths_mm), np.float64)


def write_text(path: Path, text: str, *, overwrite: bool) -> Path:
    """Write a text file, whole or not at all.

    Raises
    ------
    InputError
        If it exists and may not be replaced, or is a folder.
    OutputError
        If it cannot be written.
    """
    if path.is_dir():
        raise InputError("is a folder", where=str(path), expected="the path of a file")
    if path.exists() and not overwrite:
        raise InputError("exists already", where=str(path), expected="a new path")
    try:
        # A folder of its own: the draft then has the usual rights.
        with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
            draft = Path(folder) / path.name
            draft.write_text(text, encoding="ascii", newline="\n")
            draft.replace(path)
    except OSError as error:
        raise OutputError.of(error, path) from error
    return path


def read_text(path: Path) -> str:
    """Read a text file of other programs.

    Raises
    ------
    InputError
        If it is missing or cannot be read.
    """
    try:
        # latin-1 reads every byte: old headers hold names in many encodings.
        return path.read_text(encoding="latin-1")
    except OSError as error:
        reason = (error.strerror or "unreadable").lower()
        raise InputError(
            f"cannot be read: {reason}", where=str(path), expected="a file of ring widths"
        ) from error
