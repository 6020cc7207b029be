"""The stand table for the terminal, in the columns of a yield table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from forest.view.development import HasTables

if TYPE_CHECKING:
    from rich.table import Table

_EVERY_YEARS = 10

# Column of the stand table: heading, digits
_COLUMNS = {
    "n_ha": ("N\n/ha", 0),
    "basal_area_m2ha": ("G\nm²/ha", 1),
    "qmd_cm": ("Dq\ncm", 1),
    "top_height_m": ("Htop\nm", 1),
    "volume_m3ha": ("V\nm³/ha", 0),
    "lai": ("LAI\n", 1),
    "floor_light": ("floor\nlight", 2),
}


def _cell(value: float, digits: int) -> str:
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def stand_table(run: HasTables) -> Table:
    """Give a table of the whole stand in the first, every tenth and the last year.

    Parameters
    ----------
    run : Run
        The run; its stand table is read.

    Returns
    -------
    rich.table.Table
        Year, and per ha: stems, basal area, quadratic mean diameter, top height, stem volume,
        leaf area index and light on the ground.
    """
    from rich.table import Table

    whole = run.stand[run.stand["species"].astype(str) == "all"].reset_index(drop=True)
    table = Table(box=None, header_style="bold", padding=(0, 2, 0, 0))
    table.add_column("year", justify="right", vertical="bottom")
    for heading, _ in _COLUMNS.values():
        table.add_column(heading, justify="right")
    for i, row in whole.iterrows():
        if i == 0 or (i + 1) % _EVERY_YEARS == 0 or i == len(whole) - 1:
            cells = (_cell(row[name], digits) for name, (_, digits) in _COLUMNS.items())
            table.add_row(str(int(row["year"])), *cells)
    return table
