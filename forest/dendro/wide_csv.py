"""Ring widths as a comma-separated table: `Year`, then one column per series, in mm."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd

from forest.dendro.writing import check_widths, in_thousandths, read_text, write_text
from forest.errors import InputError


def write_csv(
    widths: pd.DataFrame,
    path: str | Path,
    *,
    overwrite: bool = False,
    present_year: int | None = None,
) -> Path:
    """Write ring widths as a wide table, to 0.001 mm; `NA` outside a series' span.

    Parameters
    ----------
    widths : pandas.DataFrame
        Widths in mm, indexed by calendar year, one column per series, as in `RingSeries.widths`.
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
        If years lie after the present, an id has others than letters and digits, a series is
        empty or has a gap, a width is negative, or the file exists.
    OutputError
        If it cannot be written.
    """
    check_widths(widths, present_year)
    rounded = widths.copy()
    rounded[:] = in_thousandths(widths.to_numpy(dtype=float)) / 1000.0
    text = rounded.to_csv(index_label="Year", na_rep="NA", float_format="%.3f", lineterminator="\n")
    return write_text(Path(path), text, overwrite=overwrite)


def read_csv(path: str | Path) -> pd.DataFrame:
    """Read a wide table of ring widths.

    Parameters
    ----------
    path : path
        The file: `Year`, then one column per series in mm; empty or `NA` outside its span.

    Returns
    -------
    pandas.DataFrame
        Widths in mm, indexed by `Year`, one column per series.

    Raises
    ------
    InputError
        If the file cannot be read, has no column `Year`, its years do not follow each other, or
        a cell is not a number.
    """
    path = Path(path)
    text = read_text(path)
    try:
        cells = pd.read_csv(io.StringIO(text), dtype=str)
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"no table: {reason}", where=str(path), expected="a CSV file") from error
    if "Year" not in cells.columns or len(cells.columns) < 2 or not len(cells):
        raise InputError(
            "no ring widths", where=str(path), expected="a column 'Year', and one per series"
        )
    frame = cells.apply(pd.to_numeric, errors="coerce").astype(float)
    for name in frame.columns:
        bad = np.flatnonzero(frame[name].isna() & cells[name].notna())
        if len(bad):
            raise InputError(
                f"'{cells[name].iloc[bad[0]]}' in column '{name}' is not a number",
                where=f"{path}: line {bad[0] + 2}",
                expected="a width in mm, or NA",
            )
    years = frame.pop("Year").to_numpy()
    if years[0] % 1 != 0 or not np.all(np.diff(years) == 1):
        raise InputError(
            "the years do not follow each other",
            where=f"{path}: Year",
            expected="whole numbers, each year, in order",
        )
    frame.index = pd.RangeIndex(int(years[0]), int(years[-1]) + 1, name="Year")
    return frame
