"""A landscape as a mosaic of its plots in a few years, and what became of its area over time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from forest.record.export import whole_file
from forest.view.landscape_table import HasPlots, year_of
from forest.view.looks import RGB, look_of

if TYPE_CHECKING:
    import pandas as pd

_MOSAICS = 4
_LONGEST = 24  # characters of a label
_PALEST = 0.25  # share of a species' colour in a tile without height
_NOTHING: RGB = (0.88, 0.87, 0.84)

_STAGES: dict[str, RGB] = {
    "bare": _NOTHING,
    "regeneration": (0.93, 0.90, 0.55),
    "thicket": (0.78, 0.85, 0.45),
    "pole": (0.55, 0.75, 0.40),
    "timber": (0.30, 0.60, 0.38),
    "mature": (0.13, 0.42, 0.33),
    "old": (0.07, 0.24, 0.25),
    "layered": (0.52, 0.42, 0.66),
}


def draw_landscape(landscape: HasPlots, to: str | Path, *, year: int | None = None) -> None:
    """Draw the plots as tiles in up to four years, and the area by species and stage over time.

    A tile has the colour of its dominant species, the stronger the higher its top height. Plots of
    one scenario and setting stand together, replicate by replicate, each set from a new row on.

    Parameters
    ----------
    landscape : Landscape
        The plots.
    to : path
        Picture file to write; the format follows the suffix.
    year : int, optional
        The last year that is shown; default: the last there is.

    Raises
    ------
    InputError
        If no plot has that year.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    last = year_of(landscape, year)
    years = [one for one in landscape.years if one <= last]
    shown = np.unique(np.linspace(0, len(years) - 1, _MOSAICS + 1).round().astype(int))[1:]
    shown = shown if len(shown) else np.array([0])
    mosaic = _mosaic(landscape.plots)
    highest = float(np.nanmax([landscape.plots["top_height_m"].max(), 1.0]))
    across = 11.0 / _MOSAICS
    up = min(max(across * mosaic.shape[0] / mosaic.shape[1], 1.2), 5.0)
    figure = Figure(figsize=(11.0, up + 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    parts: Any = figure.subfigures(2, 1, height_ratios=(up + 0.5, 3.9))
    above, below = parts
    panels = above.subplots(1, len(shown), squeeze=False)[0]
    for axes, k in zip(panels, shown, strict=True):
        of = landscape.plots[landscape.plots["year"] == years[k]]
        _lay(axes, _tiles(of, mosaic, highest))
        axes.set_title(str(years[k]), loc="left", fontsize=10)
    for row, label in mosaic.labels:
        panels[0].text(-0.7, row, label, fontsize=8, rotation=90, ha="right", va="center")
    left, right = below.subplots(1, 2)
    _stack(left, landscape.dominants, years, "Dominant species, share of the area")
    _stack(right, landscape.stages, years, "Development stage, share of the area")
    above.suptitle(
        f"{len(mosaic.place)} plots; the stronger the colour, the higher the stand "
        f"(up to {highest:.0f} m)",
        fontsize=10,
        x=0.01,
        ha="left",
    )
    with whole_file(to, overwrite=True) as draft:
        figure.savefig(draft, dpi=110)


class _Mosaic(NamedTuple):
    """Where each plot's tile lies."""

    place: dict[str, tuple[int, int]]  # row and column, by run
    shape: tuple[int, int]
    labels: list[tuple[float, str]]  # the middle row of each set, and what tells it apart


def _mosaic(plots: pd.DataFrame) -> _Mosaic:
    first = plots.drop_duplicates("run")
    settings = list(plots.columns[1 : plots.columns.get_loc("replicate")])
    varied = [name for name in settings if first[name].nunique(dropna=False) > 1]
    groups = first.groupby(settings, sort=False, dropna=False)
    sets = [(_label(of.iloc[0], varied), list(of["run"])) for _, of in groups]
    if max(len(runs) for _, runs in sets) == 1:
        sets = [("", [run for _, runs in sets for run in runs])]
    columns = _columns([len(runs) for _, runs in sets])
    place, labels, row = {}, [], 0
    for label, runs in sets:
        for k, run in enumerate(runs):
            place[run] = (row + k // columns, k % columns)
        rows = math.ceil(len(runs) / columns)
        labels.append((row + 0.5 * (rows - 1), label))
        row += rows
    return _Mosaic(place, (row, columns), labels)


def _label(plot: pd.Series[Any], varied: list[str]) -> str:
    texts = [
        str(plot[name]) if name == "scenario" else f"{name.split('.')[-1]} = {plot[name]}"
        for name in varied
    ]
    return "\n".join(text if len(text) <= _LONGEST else text[:_LONGEST] + "…" for text in texts)


def _columns(sizes: list[int]) -> int:
    """Choose how many tiles stand side by side: about a square, with few places left empty."""
    side = math.sqrt(sum(sizes))
    widest = min(max(sizes), math.ceil(1.5 * side))
    return min(
        range(min(widest, math.ceil(0.7 * side)), widest + 1),
        key=lambda n: (sum(-size % n for size in sizes), abs(n - side)),
    )


def _lay(axes: Any, tiles: np.ndarray[Any, np.dtype[np.float64]]) -> None:
    axes.imshow(tiles, interpolation="nearest")
    axes.set_xticks(np.arange(-0.5, tiles.shape[1]), [])
    axes.set_yticks(np.arange(-0.5, tiles.shape[0]), [])
    axes.tick_params(length=0)
    axes.grid(color="white", lw=1.5)
    axes.spines[:].set_visible(False)


def _tiles(
    plots: pd.DataFrame, mosaic: _Mosaic, highest: float
) -> np.ndarray[Any, np.dtype[np.float64]]:
    tiles = np.ones((*mosaic.shape, 3))
    for run, dominant, height in zip(
        plots["run"], plots["dominant"], plots["top_height_m"], strict=True
    ):
        full = np.array(_colour(dominant))
        strength = 1.0
        if dominant != "none":
            strength = _PALEST + (1.0 - _PALEST) * height / highest
        tiles[mosaic.place[run]] = 1.0 - strength * (1.0 - full)
    return tiles


def _colour(name: str) -> RGB:
    return _NOTHING if name == "none" else look_of(name).line


def _stack(axes: Any, shares: pd.DataFrame, years: list[int], title: str) -> None:
    of = shares.loc[years]
    of = of.loc[:, of.gt(0.0).any()]
    colours = [_STAGES[name] if name in _STAGES else _colour(name) for name in of]
    labels = [str(name).replace("_", " ") for name in of]
    axes.stackplot(of.index, of.T.to_numpy(), colors=colours, labels=labels, lw=0)
    axes.set(ylim=(0.0, 1.0), xlim=(of.index[0], max(of.index[-1], of.index[0] + 1)))
    axes.set_title(title, loc="left", fontsize=10)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    handles, names = axes.get_legend_handles_labels()
    axes.legend(
        handles[::-1], names[::-1], fontsize=8, frameon=False, loc="center left",
        bbox_to_anchor=(1.0, 0.5),
    )  # fmt: skip
