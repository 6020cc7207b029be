"""How safely the trees of a year stand, by species and size class."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from forest.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    from rich.table import Table

    from forest.record.run import Run

_CLASS_CM = 10
_SMALL = "< 1.3 m"

# Column of the report: heading, digits
_COLUMNS = {
    "trees": ("trees\n", 0),
    "safety_min": ("safety\nmin", 1),
    "safety_p10": ("factor\n10 %", 1),
    "safety_median": ("\nmedian", 1),
    "share_below_1": ("share\n< 1", 2),
    "frequency_hz": ("sway\nHz", 2),
    "wind_stress_share": ("wind\nstress", 2),
    "wind_stress_max": ("\nmax", 2),
}


def stability_of_year(run: Run, year: int | None = None) -> pd.DataFrame:
    """Read the stability of a year's trees, with their size.

    Parameters
    ----------
    run : Run
        With the tables stability and trees.
    year : int, optional
        Calendar year; the run's last if not given.

    Returns
    -------
    DataFrame
        A row per tree that has a stem: the columns of `/stability`, dbh_cm and height_m.

    Raises
    ------
    InputError
        If the run has no such table or year.
    """
    where = str(run.path)
    if run.scenario.mechanics is None:
        raise InputError(
            "holds no stability", where=where, expected="a run whose scenario has [mechanics]"
        )
    for table in ("stability", "trees"):
        if table not in run.tables:
            raise InputError(
                f"holds no table {table}", where=where, expected="it among output.tables"
            )
    if not len(run.years):
        raise InputError("holds no years yet", where=where)
    at = int(run.years[-1]) if year is None else year
    if at not in run.years:
        expected = f"{run.years[0]} to {run.years[-1]}"
        raise InputError(f"holds no year {at}", where=where, expected=expected)
    trees = run.read("trees", ["tree_id", "dbh_cm", "height_m"], years=(at, at))
    found = run.read("stability", years=(at, at)).merge(trees, on="tree_id")
    return found[found["safety_factor"].notna()].reset_index(drop=True)


def classes(trees: pd.DataFrame) -> pd.DataFrame:
    """Summarise trees by species and class of dbh.

    Parameters
    ----------
    trees : DataFrame
        See `stability_of_year`.

    Returns
    -------
    DataFrame
        A row per species and class that has trees: their number; least, 10th percentile and median
        of the safety factor, and the share of trees that would buckle (below 1); medians of
        the frequency and of the largest stress per modulus of rupture, by weight alone and with
        the wind, and the greatest of these.
    """
    lower = np.floor(trees["dbh_cm"] / _CLASS_CM) * _CLASS_CM
    groups = trees.assign(lower=lower.fillna(-1.0), species=trees["species"].astype(str)).groupby(
        ["species", "lower"]
    )
    factor = groups["safety_factor"]
    report = factor.agg(trees="size", safety_min="min").assign(
        safety_p10=factor.quantile(0.1),
        safety_median=factor.median(),
        share_below_1=factor.agg(lambda values: (values < 1.0).mean()),
        frequency_hz=groups["frequency_hz"].median(),
        stress_share=groups["stress_share"].median(),
        wind_stress_share=groups["wind_stress_share"].median(),
        wind_stress_max=groups["wind_stress_share"].max(),
    )
    report = report.reset_index()
    names = [_SMALL if k < 0 else f"{k:.0f}-{k + _CLASS_CM:.0f} cm" for k in report.pop("lower")]
    report.insert(1, "size_class", names)
    return report


def stability_table(trees: pd.DataFrame) -> Table:
    """Give the classes of `classes` as a table for the terminal, without the stress of weight."""
    from rich.table import Table

    table = Table(box=None, header_style="bold", padding=(0, 1, 0, 0))
    table.add_column("species", vertical="bottom", no_wrap=True)
    table.add_column("dbh", vertical="bottom", no_wrap=True)
    for heading, _ in _COLUMNS.values():
        table.add_column(heading, justify="right")
    for _, row in classes(trees).iterrows():
        cells = (f"{row[name]:.{digits}f}" for name, (_, digits) in _COLUMNS.items())
        table.add_row(row["species"], row["size_class"], *cells)
    return table
