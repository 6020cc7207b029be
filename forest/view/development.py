"""Six small plots of how a stand developed over the calendar years."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from forest.record.export import whole_file
from forest.view.looks import look_of

if TYPE_CHECKING:
    import pandas as pd

_ALL = "all"
_CLASSES_CM = 4.0  # width of a diameter class
_YEARS_SHOWN = 4  # of the diameter distribution


class HasTables(Protocol):
    """What these views read: an open run, or anything that answers like one."""

    tables: tuple[str, ...]

    @property
    def stand(self) -> pd.DataFrame:
        """The stand table."""

    def read(self, table: str, columns: Sequence[str]) -> pd.DataFrame:
        """Read some columns of a table."""


def _curves(table: pd.DataFrame) -> Iterable[tuple[str, pd.DataFrame, Any]]:
    """Give name, rows and colour of each species (if there are several) and of all."""
    names = [name for name in dict.fromkeys(table["species"].astype(str)) if name != _ALL]
    for name in names if len(names) > 1 else []:
        yield name, table[table["species"].astype(str) == name], look_of(name).line
    yield _ALL, table[table["species"].astype(str) == _ALL], "black"


def _over_years(column: str, title: str, second: str = "") -> Callable[[Any, pd.DataFrame], None]:
    """Make a painter of one column over the years, and of a second one dashed."""

    def paint(axes: Any, table: pd.DataFrame) -> None:
        for name, rows, colour in _curves(table):
            axes.plot(
                rows["year"], rows[column], color=colour, lw=1.6, label=name.replace("_", " ")
            )
            if second:
                axes.plot(rows["year"], rows[second], color=colour, lw=1.2, ls="--")
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_ylim(bottom=0.0)

    return paint


def _hectares(trees: pd.DataFrame, table: pd.DataFrame) -> float:
    """Find the plot's area from a year's count of trees and its number per ha."""
    whole = table[(table["species"].astype(str) == _ALL) & (table["n_ha"] > 0)].iloc[0]
    return float((trees["year"] == whole["year"]).sum() / whole["n_ha"])


def _paint_diameters(axes: Any, trees: pd.DataFrame, table: pd.DataFrame) -> None:
    """Draw the numbers of stems per diameter class in a few years."""
    from matplotlib import colormaps

    thick = trees[trees["dbh_cm"].notna()]
    years = np.unique(thick["year"].to_numpy())
    axes.set_title(f"Stems per ha by dbh, classes of {_CLASSES_CM:g} cm", loc="left", fontsize=10)
    axes.set_xlabel("dbh, cm", fontsize=9)
    if not len(years):
        return
    place = np.linspace(0, len(years) - 1, _YEARS_SHOWN + 1)[1:].round().astype(int)
    hectares = _hectares(trees, table)
    edges = np.arange(0.0, float(thick["dbh_cm"].max()) + 2 * _CLASSES_CM, _CLASSES_CM)
    colours = colormaps["viridis"](np.linspace(0.85, 0.1, _YEARS_SHOWN))
    for year, colour in zip(dict.fromkeys(years[place].tolist()), colours, strict=False):
        count, _ = np.histogram(thick.loc[thick["year"] == year, "dbh_cm"], edges)
        axes.stairs(count / hectares, edges, color=colour, lw=1.6, label=str(year))
    axes.legend(fontsize=8, frameon=False)


def _paint_light(axes: Any, table: pd.DataFrame) -> None:
    """Draw leaf area index, and the light on the ground on a scale of its own."""
    _over_years("lai", "Leaf area index; light on the ground (grey, right)")(axes, table)
    whole = table[table["species"].astype(str) == _ALL]
    right = axes.twinx()
    right.plot(whole["year"], whole["floor_light"], color="0.55", lw=1.6, ls=":")
    right.set_ylim(0.0, 1.0)
    right.tick_params(labelsize=8, colors="0.4")


def draw_development(run: HasTables, to: str | Path) -> None:
    """Plot a run's stems, basal area, heights, diameters, leaves and volume over the years.

    Several species have a curve each, in their colour; the black one is for all together.

    Parameters
    ----------
    run : Run
        The run; its stand table is read, and year and dbh from its tree table if it has one.
    to : path
        Picture file to write; the format follows the suffix.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    table = run.stand
    figure = Figure(figsize=(13.0, 7.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 3)
    _over_years("n_ha", "Stems per ha")(panels[0, 0], table)
    _over_years("basal_area_m2ha", "Basal area, m²/ha")(panels[0, 1], table)
    _over_years("top_height_m", "Top height, m; Lorey's height (dashed)", "lorey_height_m")(
        panels[0, 2], table
    )
    if "trees" in run.tables:
        _paint_diameters(panels[1, 0], run.read("trees", ["year", "dbh_cm"]), table)
    else:
        _over_years("qmd_cm", "Quadratic mean diameter, cm")(panels[1, 0], table)
    _paint_light(panels[1, 1], table)
    _over_years("volume_m3ha", "Stem volume, m³/ha")(panels[1, 2], table)
    for axes in panels.flat:
        axes.tick_params(labelsize=8)
        axes.grid(color="0.9", lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    if table["species"].astype(str).nunique() > 2:
        panels[0, 0].legend(fontsize=8, frameon=False)
    with whole_file(to, overwrite=True) as draft:
        figure.savefig(draft, dpi=110)
