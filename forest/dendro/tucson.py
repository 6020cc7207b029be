"""The Tucson decade format (.rwl), which every program of dendrochronology reads.

Columns 1-8 hold the id of the series, 9-12 the first year of the line, then follow up to ten
integers of width 6; a line ends with its decade. A stop marker ends each series and sets its unit:
-9999 for 0.001 mm, 999 for 0.01 mm. A series whose last ring is of a year that ends in 9 has its
marker alone on the next decade's line.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from forest.dendro.names import MAX_LENGTH
from forest.dendro.writing import check_widths, in_thousandths, read_text, write_text
from forest.errors import InputError

_STOP = -9999  # of series in 0.001 mm, which we write
_MM_OF_MARKER = {"-9999": 1000, "999": 100}  # what its unit is a part of

#: Written in 0.001 mm, 999 is a width; to readers that do not look for the true marker it ends the
#: series. It becomes 998.
_LOOKS_LIKE_STOP = 999

_WIDEST = 99_999  # six digits would touch the number before
_EARLIEST, _LATEST = -999, 9999  # four columns
_MAX_HEADER = 3  # lines


def write_rwl(
    widths: pd.DataFrame,
    path: str | Path,
    *,
    overwrite: bool = False,
    present_year: int | None = None,
) -> Path:
    """Write ring widths as a Tucson file, in 0.001 mm.

    Parameters
    ----------
    widths : pandas.DataFrame
        Widths in mm, indexed by calendar year, one column per series with its id as name, as in
        `RingSeries.widths`. A missing ring is 0; NaN only outside a series' span. A width of
        0.999 mm is written as 0.998 mm, since it would read as a stop marker.
    path : path
        The file.
    overwrite : bool
        Whether to replace a file.
    present_year : int, optional
        The last year that readers accept; this year if not given.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If years lie after the present or before -999, an id has more than six characters or
        others than letters and digits, a series is empty or has a gap, a width is negative or
        above 99.999 mm, or the file exists.
    OutputError
        If it cannot be written.
    """
    check_widths(widths, present_year)
    if not _EARLIEST <= widths.index[0] <= _LATEST:
        raise InputError(
            f"the first year is {widths.index[0]}",
            where="widths",
            expected=f"a start_year from {_EARLIEST}, which the four columns of a year hold",
        )
    lines: list[str] = []
    years = np.asarray(widths.index)
    for name, column in zip(widths.columns, widths.to_numpy(dtype=float).T, strict=True):
        there = np.flatnonzero(~np.isnan(column))
        span = slice(there[0], there[-1] + 1)
        lines += _series_lines(str(name), int(years[there[0]]), column[span])
    return write_text(Path(path), "\n".join(lines) + "\n", overwrite=overwrite)


def _series_lines(name: str, first_year: int, widths_mm: np.ndarray) -> list[str]:
    """Lay out one series, its stop marker included."""
    if len(name) > MAX_LENGTH:
        raise InputError(
            f"the id '{name}' is too long",
            where="widths",
            expected=f"at most {MAX_LENGTH} letters and digits (see short_ids)",
        )
    numbers = in_thousandths(widths_mm).astype(np.int64)
    if numbers.max() > _WIDEST:
        year = first_year + int(numbers.argmax())
        raise InputError(
            f"series '{name}' has a width of {widths_mm.max():g} mm in {year}",
            where="widths",
            expected=f"at most {_WIDEST / 1000:g} mm",
        )
    numbers[numbers == _LOOKS_LIKE_STOP] -= 1
    values = [*numbers.tolist(), _STOP]
    lines = []
    year = first_year
    while values:
        n = 10 - year % 10
        lines.append(f"{name:<8}{year:4d}" + "".join(f"{value:6d}" for value in values[:n]))
        values = values[n:]
        year += n
    return lines


def read_rwl(path: str | Path) -> pd.DataFrame:
    """Read a Tucson file.

    Parameters
    ----------
    path : path
        The file. Up to three lines of header are passed over. Each series is in the unit that its
        own stop marker tells; 999 is a marker only where a series ends with it.

    Returns
    -------
    pandas.DataFrame
        Widths in mm, indexed by `Year`, one column per series in the order of the file; NaN
        outside a series' span.

    Raises
    ------
    InputError
        If the file cannot be read, or one of its lines is not what the format asks for: the
        message names the line.
    """
    path = Path(path)
    blocks: dict[str, tuple[int, list[str], int]] = {}
    current = ""
    for number, name, year, cells in _data_lines(path):
        where = f"{path}: line {number}"
        if name != current:
            if name in blocks:
                raise InputError(f"series '{name}' begins again", where=where, expected="a new id")
            current, blocks[name] = name, (year, [], number)
        first_year, values, _ = blocks[name]
        if year != first_year + len(values):
            raise InputError(
                f"series '{name}' goes on in {year}",
                where=where,
                expected=f"{first_year + len(values)}, the year after its last ring",
            )
        values += cells
        blocks[name] = first_year, values, number
    series = {
        name: _in_mm(name, first_year, values, f"{path}: line {number}")
        for name, (first_year, values, number) in blocks.items()
    }
    first = min(int(s.index[0]) for s in series.values())
    last = max(int(s.index[-1]) for s in series.values())
    years = pd.RangeIndex(first, last + 1, name="Year")
    return pd.DataFrame({name: s.reindex(years) for name, s in series.items()}, index=years)


def _data_lines(path: Path) -> list[tuple[int, str, int, list[str]]]:
    """Split the lines with data: number of the line, id, first year, the ten cells or fewer."""
    found: list[tuple[int, str, int, list[str]]] = []
    for number, line in enumerate(read_text(path).splitlines(), start=1):
        if not line.strip():
            continue
        name, year = line[:8].strip(), line[8:12].strip()
        text = line[12:72].rstrip()
        cells = [text[i : i + 6].strip() for i in range(0, len(text), 6)]
        try:
            first_year = int(year)
            for cell in cells:
                int(cell)
        except ValueError:
            if not found and number <= _MAX_HEADER:
                continue
            raise InputError(
                "no line of ring widths",
                where=f"{path}: line {number}",
                expected="id (8 columns), year (4) and whole numbers (6 each)",
            ) from None
        if not cells or len(cells) > 10 - first_year % 10:
            raise InputError(
                f"{len(cells)} numbers from {first_year} on",
                where=f"{path}: line {number}",
                expected=f"1 to {10 - first_year % 10}, for a line ends with its decade",
            )
        found.append((number, name, first_year, cells))
    if not found:
        raise InputError("no ring widths", where=str(path), expected="a Tucson file (.rwl)")
    return found


def _in_mm(name: str, first_year: int, cells: list[str], where: str) -> pd.Series:
    """Take the stop marker off a series and give its widths in mm."""
    *values, marker = cells
    if marker not in _MM_OF_MARKER or not values:
        raise InputError(
            f"series '{name}' ends with {marker}",
            where=where,
            expected="rings, then a stop marker: -9999 (0.001 mm) or 999 (0.01 mm)",
        )
    numbers = np.array([int(value) for value in values])
    if numbers.min() < 0:
        year = first_year + int(np.argmax(numbers < 0))
        raise InputError(
            f"series '{name}' has a width of {numbers.min()} in {year}",
            where=where,
            expected="0 for a missing ring, and a stop marker at the end alone",
        )
    years = pd.RangeIndex(first_year, first_year + len(numbers))
    return pd.Series(numbers / _MM_OF_MARKER[marker], index=years)
