"""Girths measured over the years, as on a plot's tape or its dendrometer bands."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.scenario.files import as_number, as_whole_number, read_rows
from forest.species.schema import Refusal

_COLUMNS = ("year", "girth_cm")
_LIMITS = {"year": (-10_000.0, 10_000.0), "girth_cm": (0.1, 5_000.0)}


def read_girths(path: str | Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read a CSV file of a stem's girth at breast height.

    Parameters
    ----------
    path : path
        Columns ``year`` (whole, rising) and ``girth_cm`` (never falling); others are left out.

    Returns
    -------
    years, girth_m : float64 (rows,)

    Raises
    ------
    InputError
        If it cannot be read, a column is missing, a value is no such number, or there are fewer
        than two rows.
    """
    try:
        rows = read_rows(str(path), None, _COLUMNS)
    except Refusal as refusal:
        raise InputError(refusal.what, expected=refusal.expected) from None
    found: list[tuple[float, float]] = []
    for line, row in rows:
        where = f"{path} line {line}"
        year, girth = (_value(row[column], column, where) for column in _COLUMNS)
        if found and year <= found[-1][0]:
            raise InputError(
                f"year {year:g} after {found[-1][0]:g}", where=where, expected="years that rise"
            )
        if found and girth < found[-1][1]:
            raise InputError(
                f"girth_cm {girth:g} after {found[-1][1]:g}",
                where=where,
                expected="girths that do not fall",
            )
        found.append((year, girth))
    if len(found) < 2:
        raise InputError("holds one year", where=str(path), expected="two or more")
    years, girths = np.array(found).T
    return years, 0.01 * girths


def _value(cell: str, column: str, where: str) -> float:
    low, high = _LIMITS[column]
    try:
        value = float(as_whole_number(cell)) if column == "year" else as_number(cell)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        kind = "a whole number" if column == "year" else "a number"
        raise InputError(
            f"{column} is '{cell[:40]}'", where=where, expected=f"{kind}, {low:g} to {high:g}"
        )
    return value
