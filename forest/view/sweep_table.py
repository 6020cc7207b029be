"""What the runs of a sweep came to, for the terminal: means over replicates, with bands."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import pandas as pd
    from rich.table import Table

# Column of the stand table: heading, digits
_COLUMNS = {
    "n_ha": ("N\n/ha", 0),
    "basal_area_m2ha": ("G\nm²/ha", 1),
    "qmd_cm": ("Dq\ncm", 1),
    "volume_m3ha": ("V\nm³/ha", 0),
}


class HasMeans(Protocol):
    """What these views read: a sweep, or anything that answers like one."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """The settings that were varied."""

    def means(self, column: str) -> pd.DataFrame:
        """Average a column of the stand table over replicates."""


def varied(sweep: HasMeans) -> list[str]:
    """Name what tells the sets apart: the scenario, and settings of more than one value."""
    table = sweep.means("n_ha")
    return ["scenario", *(name for name in sweep.parameters if table[name].nunique() > 1)]


def means_of_sets(sweep: HasMeans, column: str) -> dict[tuple[str, ...], pd.DataFrame]:
    """Give the means of the whole stand over the years, by the values of `varied`, as text."""
    table = sweep.means(column)
    groups = table[table["species"] == "all"].groupby(varied(sweep), sort=False)
    return {tuple(_text(value) for value in key): rows for key, rows in groups}


def sweep_table(sweep: HasMeans) -> Table:
    """Give a table of each scenario and combination of settings in its last year.

    Parameters
    ----------
    sweep : Sweep
        The sweep; the stand tables of its finished runs are read.

    Returns
    -------
    rich.table.Table
        Scenario, settings, year, replicates, and per ha: stems, basal area, quadratic mean
        diameter and stem volume, each as its mean and, of several replicates, below it the band
        from the 5th to the 95th percentile.
    """
    from rich.table import Table

    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    for name in varied(sweep):
        table.add_column(f"\n{name}", overflow="fold")
    for name in ("year", "runs"):
        table.add_column(f"\n{name}", justify="right")
    for heading, _ in _COLUMNS.values():
        table.add_column(heading, justify="right", no_wrap=True)
    columns = {name: means_of_sets(sweep, name) for name in _COLUMNS}
    for key, stems in columns["n_ha"].items():
        last = stems.iloc[-1]
        cells = [
            _cell(columns[name][key].iloc[-1], digits) for name, (_, digits) in _COLUMNS.items()
        ]
        table.add_row(*key, str(int(last["year"])), str(int(last["n"])), *cells)
    return table


def _cell(row: Any, digits: int) -> str:
    if math.isnan(row["mean"]):
        return "–"
    mean, low, high = (f"{row[name]:.{digits}f}" for name in ("mean", "low", "high"))
    return f"{mean}\n{low}–{high}" if row["n"] > 1 else mean


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
