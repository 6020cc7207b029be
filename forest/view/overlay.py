"""What stands beside the stand in a film: the year, what colours mean, small charts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.view.bodies_picture import AROUND
from forest.view.looks import look_of
from forest.view.tree_colours import FATE_COLOURS, RESIDUAL, SCALES, TreeColours, on_scale

if TYPE_CHECKING:
    import pandas as pd

#: Charts of a stand: column of `/stand`, what is said of it.
CHARTS = {"n_ha": "N, per ha", "basal_area_m2ha": "G, m²/ha"}

_INK = (30, 34, 30)
_DPI = 100
_TEXT = 0.032  # height of letters, share of the frame's height; the year's are twice as high
_LEAST_CHART_PX = 300  # height of a frame below which it has no charts
_COLUMN = 0.23  # share of the frame's width
_LEFT, _WIDTH = 0.80, 0.17  # of charts in it


def font(size: float) -> Any:
    """Give a font that comes with the program's libraries, in pixels."""
    import matplotlib
    from PIL import ImageFont

    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return ImageFont.truetype(str(path), max(8, round(size)))


def stage_size(window: tuple[int, int]) -> tuple[int, int]:
    """Give the part of a frame in which the stand is seen, pixels: all but the column."""
    return window[0] - round(_COLUMN * window[0]), window[1]


class Overlay:
    """Draws a column at the right of a film's frames.

    Parameters
    ----------
    window : (int, int)
        Width and height of the frames, pixels.
    colours : TreeColours
        How trees are coloured.
    stand : DataFrame or None
        Rows of `/stand` of all species together, of the years shown, for the charts.
    fates : collection of str
        How trees go in those years.
    """

    def __init__(
        self,
        window: tuple[int, int],
        colours: TreeColours,
        stand: pd.DataFrame | None,
        fates: tuple[str, ...] = (),
    ) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from PIL import Image

        self.window = window
        self._marks: list[tuple[Any, NDArray[np.float64], NDArray[np.float64]]] = []
        self._axes: list[Any] = []
        width, height = window
        self._unit = _TEXT * height
        figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
        canvas = FigureCanvasAgg(figure)
        figure.patch.set_alpha(0.0)
        points = self._unit * 72.0 / _DPI
        if stand is not None and len(stand) > 1 and height >= _LEAST_CHART_PX:
            self._add_charts(figure, stand, 0.8 * points)
        self._add_legend(figure, colours, fates, points)
        canvas.draw()
        self._places = [
            axes.transData.transform(np.column_stack((years, values)))
            for axes, years, values in self._marks
        ]
        self._image = Image.fromarray(np.asarray(canvas.buffer_rgba()))
        self._large = font(2.0 * self._unit)

    def beside(self, picture: NDArray[np.uint8], moment: float) -> NDArray[np.uint8]:
        """Make the frame of a moment (calendar years) from a picture of `stage_size`."""
        from PIL import Image, ImageDraw

        frame = Image.new("RGB", self.window, tuple(round(255 * part) for part in AROUND))
        frame.paste(Image.fromarray(picture), (0, 0))
        frame.paste(self._image, (0, 0), self._image)
        draw = ImageDraw.Draw(frame)
        corner = (_LEFT * self.window[0], 0.5 * self._unit)
        draw.text(corner, str(int(np.ceil(moment))), font=self._large, fill=_INK)
        radius = max(2.0, 0.2 * self._unit)
        for (_, years, _), places in zip(self._marks, self._places, strict=True):
            x = np.interp(moment, years, places[:, 0])
            y = self.window[1] - np.interp(moment, years, places[:, 1])
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=(200, 50, 40))
        return np.asarray(frame)

    def _add_charts(self, figure: Any, stand: pd.DataFrame, points: float) -> None:
        years = stand["year"].to_numpy(np.float64)
        for k, (column, title) in enumerate(CHARTS.items()):
            axes = figure.add_axes((_LEFT, 0.71 - 0.23 * k, _WIDTH, 0.13))
            values = np.nan_to_num(stand[column].to_numpy(np.float64))
            axes.plot(years, values, color="0.2", lw=1.3)
            axes.set_ylim(0.0, 1.08 * max(values.max(), 1e-9))
            axes.set_xlim(years[0], years[-1])
            axes.set_title(title, loc="left", fontsize=points, pad=3)
            axes.tick_params(labelsize=0.85 * points, length=2, pad=2)
            axes.locator_params(axis="x", nbins=3, integer=True)
            axes.locator_params(axis="y", nbins=3)
            axes.spines[["top", "right"]].set_visible(False)
            self._marks.append((axes, years, values))

    def _add_legend(
        self, figure: Any, colours: TreeColours, fates: tuple[str, ...], points: float
    ) -> None:
        from matplotlib.lines import Line2D

        named: Mapping[str, Any] = {fate: FATE_COLOURS[fate] for fate in fates}
        if colours.by == "species":
            species = {name.replace("_", " "): look_of(name).line for name in colours.species}
            if colours.residual:
                species["residual tree"] = RESIDUAL
            named = {**species, **named}
        else:
            self._add_scale(figure, colours, points)
        handles = [
            Line2D([], [], ls="", marker="o", color=colour, label=name, ms=0.7 * points)
            for name, colour in named.items()
        ]
        if handles:
            figure.legend(
                handles=handles,
                loc="lower left",
                bbox_to_anchor=(_LEFT - 0.02, 0.01),
                fontsize=0.9 * points,
                frameon=False,
                handletextpad=0.2,
                labelspacing=0.3,
            )

    @staticmethod
    def _add_scale(figure: Any, colours: TreeColours, points: float) -> None:
        scale = SCALES[colours.by]
        axes = figure.add_axes((_LEFT, 0.30, _WIDTH, 0.025))
        steps = on_scale(np.linspace(0.0, 1.0, 128), scale.colours)[None]
        axes.imshow(steps, aspect="auto", extent=(0.0, colours.top, 0.0, 1.0))
        axes.set_yticks([])
        axes.set_title(scale.label, loc="left", fontsize=0.9 * points, pad=3)
        axes.tick_params(labelsize=0.8 * points, length=2, pad=2)
        axes.locator_params(axis="x", nbins=4)
