"""A year of a landscape for the terminal: its area by dominant species and by stage."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

import numpy as np

from forest.errors import InputError, span_of

if TYPE_CHECKING:
    import pandas as pd
    from rich.table import Table

# Column of the plots: heading, digits
_MEANS = {
    "top_height_m": ("top height\nm", 1),
    "basal_area_m2ha": ("G\nm²/ha", 1),
    "n_ha": ("N\n/ha", 0),
    "volume_m3ha": ("V\nm³/ha", 0),
    "biomass_tha": ("biomass\nt/ha", 0),
}


class HasPlots(Protocol):
    """What these views read: a landscape, or anything that answers like one."""

    @property
    def plots(self) -> pd.DataFrame:
        """A row per plot and year."""

    @property
    def years(self) -> tuple[int, ...]:
        """The calendar years."""

    @property
    def dominants(self) -> pd.DataFrame:
        """Share of the area by dominant species."""

    @property
    def stages(self) -> pd.DataFrame:
        """Share of the area by stage."""


def year_of(landscape: HasPlots, year: int | None) -> int:
    """Give the year asked for, or the last one.

    Raises
    ------
    InputError
        If no plot has that year.
    """
    years = landscape.years
    if year is None:
        return years[-1]
    if year not in years:
        raise InputError(
            f"no year {year}", where="landscape", expected=span_of(years[0], years[-1])
        )
    return year


def landscape_table(landscape: HasPlots, year: int | None = None) -> Table:
    """Give a table of a year: a row per dominant species, per stage, and one for all plots.

    Parameters
    ----------
    landscape : Landscape
        The plots.
    year : int, optional
        Calendar year; default: the last.

    Returns
    -------
    rich.table.Table
        Plots, share of the area, and means by area of top height, basal area, stems, stem volume
        and biomass.

    Raises
    ------
    InputError
        If no plot has that year.
    """
    from rich.table import Table

    at = year_of(landscape, year)
    plots = landscape.plots[landscape.plots["year"] == at]
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column(f"{at}\nplots of", vertical="bottom")
    for heading in ("plots", "area\n%", *(heading for heading, _ in _MEANS.values())):
        table.add_column(heading, justify="right", vertical="bottom")
    for column, shares in (("dominant", landscape.dominants), ("stage", landscape.stages)):
        for name in shares.columns:
            of = plots[plots[column] == name]
            if len(of):
                share = float(shares.loc[at, name])
                table.add_row(str(name).replace("_", " "), *_cells(of, share))
        table.add_row()
    table.add_row("all", *_cells(plots, 1.0))
    return table


def _cells(plots: pd.DataFrame, share: float) -> list[str]:
    cells = [str(len(plots)), f"{100.0 * share:.0f}"]
    for name, (_, digits) in _MEANS.items():
        has = plots[plots[name].notna()]
        mean = float(np.average(has[name], weights=has["area_ha"])) if len(has) else math.nan
        cells.append("–" if math.isnan(mean) else f"{mean:.{digits}f}")
    return cells
