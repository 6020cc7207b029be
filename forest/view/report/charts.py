"""Charts of a report, as SVG: the same bytes for the same run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from forest.view.looks import look_of
from forest.view.report.parts import Picture

if TYPE_CHECKING:
    import pandas as pd

_SIZE = (5.2, 3.0)
_CLASSES_CM = 4.0
_YEARS_SHOWN = 4  # of the diameter distribution
_ALL = "all"
_WORDS = 9  # font size
_STYLE = {"svg.fonttype": "none", "svg.hashsalt": "forest", "font.family": "sans-serif"}

#: Charts over the years: columns of `/stand`, title. The second column is dashed.
DEVELOPMENT = (
    (("n_ha",), "Stems, per ha"),
    (("basal_area_m2ha",), "Basal area G, m²/ha"),
    (("qmd_cm",), "Quadratic mean diameter Dq, cm"),
    (("top_height_m", "lorey_height_m"), "Top height, and Lorey's height (dashed), m"),
    (("volume_m3ha",), "Stem volume, m³/ha"),
    (("lai",), "Leaf area index"),
)


def chart(
    paint: Callable[[Any], None],
    *,
    title: str,
    alt: str,
    caption: str = "",
    size: tuple[float, float] = _SIZE,
) -> Picture:
    """Paint one pair of axes, in the style of all charts."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.add_subplot()
    paint(axes)
    axes.set_title(title, loc="left", fontsize=_WORDS + 1)
    axes.tick_params(labelsize=_WORDS - 1)
    axes.grid(color="0.9", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    to = BytesIO()
    with matplotlib.rc_context(_STYLE):
        figure.savefig(to, format="svg", metadata={"Date": None, "Creator": None})
    return Picture(to.getvalue(), "svg+xml", alt, caption)


def development(stand: pd.DataFrame) -> list[Picture]:
    """Draw the stand's numbers over the years, of each species and of all."""
    return [_over_years(stand, columns, title) for columns, title in DEVELOPMENT]


def _over_years(stand: pd.DataFrame, columns: Sequence[str], title: str) -> Picture:
    names = stand["species"].astype(str)
    species = [name for name in dict.fromkeys(names) if name != _ALL]

    def paint(axes: Any) -> None:
        for name in [*(species if len(species) > 1 else []), _ALL]:
            rows = stand[names == name]
            colour = "0.1" if name == _ALL else look_of(name).line
            for column, style in zip(columns, ("-", "--"), strict=False):
                label = name.replace("_", " ") if style == "-" else None
                axes.plot(
                    rows["year"], rows[column], style, color=colour, lw=1.5, ms=3, label=label
                )
        axes.set_ylim(bottom=0.0)
        if len(species) > 1 and columns == DEVELOPMENT[0][0]:
            axes.legend(fontsize=_WORDS - 1, frameon=False)

    whole = stand[names == _ALL]
    return chart(paint, title=title, alt=_course(title, whole["year"], whole[columns[0]]))


def _course(title: str, years: Any, values: Any) -> str:
    """Say in words where a curve begins and where it ends."""
    known = np.flatnonzero(np.isfinite(np.asarray(values, np.float64)))
    if not len(known):
        return f"{title}: no numbers"
    first, last = int(known[0]), int(known[-1])
    years, values = np.asarray(years), np.asarray(values, np.float64)
    return (
        f"{title}: {values[first]:.4g} in {years[first]}, {values[last]:.4g} in {years[last]}, "
        f"lowest {np.nanmin(values):.4g}, highest {np.nanmax(values):.4g}"
    )


def species_shares(stand: pd.DataFrame) -> Picture:
    """Draw the species' shares of the basal area over the years."""
    by_species = stand[stand["species"].astype(str) != _ALL].assign(
        species=lambda rows: rows["species"].astype(str)
    )
    wide = by_species.pivot(index="year", columns="species", values="basal_area_m2ha")
    shares = wide.div(wide.sum(axis=1).replace(0.0, np.nan), axis=0).fillna(0.0)
    last = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in shares.iloc[-1].items())
    return _stacked(
        {str(name): column for name, column in shares.items()},
        "Shares of the basal area",
        f"Species' shares of the basal area; in {shares.index[-1]} {last}",
        {str(name): look_of(str(name)).line for name in shares},
    )


def _stacked(
    columns: Mapping[str, Any], title: str, alt: str, colours: Mapping[str, Any]
) -> Picture:
    def paint(axes: Any) -> None:
        labels = [name.replace("_", " ") for name in columns]
        first = next(iter(columns.values()))
        axes.stackplot(
            first.index,
            *columns.values(),
            labels=labels,
            colors=[colours[name] for name in columns],
        )
        axes.set_ylim(bottom=0.0)
        axes.legend(fontsize=_WORDS - 1, loc="lower left", framealpha=0.8)

    return chart(paint, title=title, alt=alt)


def diameters(trees: pd.DataFrame, hectares: float) -> Picture:
    """Draw stems per ha by classes of dbh in a few years."""
    from matplotlib import colormaps

    thick = trees[trees["dbh_cm"].notna() & (trees["status"] == "living")]
    years = np.unique(thick["year"].to_numpy())
    place = np.linspace(0, len(years) - 1, _YEARS_SHOWN + 1)[1:].round().astype(int)
    shown = list(dict.fromkeys(years[place].tolist())) if len(years) else []
    top = float(thick["dbh_cm"].max()) if len(thick) else 1.0
    edges = np.arange(0.0, top + 2.0 * _CLASSES_CM, _CLASSES_CM)

    def paint(axes: Any) -> None:
        for year, tint in zip(shown, np.linspace(0.85, 0.1, len(shown)), strict=True):
            count, _ = np.histogram(thick.loc[thick["year"] == year, "dbh_cm"], edges)
            colour = colormaps["viridis"](tint)
            axes.stairs(count / hectares, edges, color=colour, lw=1.6, label=str(year))
        axes.set_xlabel("dbh, cm", fontsize=_WORDS)
        if shown:
            axes.legend(fontsize=_WORDS - 1, frameon=False)

    title = f"Stems per ha by dbh, classes of {_CLASSES_CM:g} cm"
    alt = f"{title}, in {', '.join(map(str, shown)) or 'no year'}; the thickest has {top:.1f} cm"
    return chart(paint, title=title, alt=alt)


def losses(ledger: pd.DataFrame, hectares: float) -> Picture | None:
    """Draw the trees that went each year by cause; None if none did."""
    from matplotlib import colormaps

    names = [
        str(name)
        for name in ledger
        if str(name).startswith(("died", "felled", "windthrown")) and ledger[name].sum()
    ]
    if not names:
        return None

    def paint(axes: Any) -> None:
        floor = np.zeros(len(ledger))
        for k, name in enumerate(names):
            count = ledger[name].to_numpy(np.float64) / hectares
            axes.bar(
                ledger.index,
                count,
                0.9,
                bottom=floor,
                color=colormaps["tab10"](k % 10),
                label=said(name),
            )
            floor += count
        axes.legend(fontsize=_WORDS - 1, frameon=False)

    sums = ", ".join(f"{said(name)} {int(ledger[name].sum())}" for name in names)
    title = "Trees that went, per ha and year"
    return chart(paint, title=title, alt=f"{title}; trees of the plot in all years: {sums}")


def said(column: str) -> str:
    """Write a column of the ledger as words: died_no_buds is died (no buds)."""
    kind, _, cause = column.partition("_")
    return f"{kind} ({cause.replace('_', ' ')})" if cause else kind


def curves(
    frame: pd.DataFrame,
    columns: Mapping[str, str],
    title: str,
    *,
    colours: Mapping[str, Any] | None = None,
    size: tuple[float, float] = _SIZE,
) -> Picture:
    """Draw columns of one row per year as curves; `columns` names them."""
    from matplotlib import colormaps

    def paint(axes: Any) -> None:
        for k, (column, label) in enumerate(columns.items()):
            colour = colours[column] if colours else colormaps["tab10"](k)
            axes.plot(frame["year"], frame[column], color=colour, lw=1.4, label=label)
        if (frame[list(columns)] < 0.0).any(axis=None):
            axes.axhline(0.0, color="0.6", lw=0.6)
        if len(columns) > 1:
            axes.legend(fontsize=_WORDS - 1, frameon=False)

    courses = (_course(label, frame["year"], frame[name]) for name, label in columns.items())
    return chart(paint, title=title, alt=f"{title}. {'; '.join(courses)}", size=size)
