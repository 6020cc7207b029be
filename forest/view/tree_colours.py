"""Colours of trees by what is known of them, on one scale through all years."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.view.looks import look_of

if TYPE_CHECKING:
    import pandas as pd

    from forest.record.run import Run


class Scale(NamedTuple):
    """A scale of colours from 0 up: column of `/trees`, title, unit, and name of its colours."""

    column: str
    title: str
    unit: str
    colours: str

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title}, {self.unit}" if self.unit else self.title


#: What trees are coloured by, in films and in the viewer.
SCALES = {
    "dbh": Scale("dbh_cm", "dbh", "cm", "viridis_r"),
    "height": Scale("height_m", "Height", "m", "viridis_r"),
    "light": Scale("light", "Relative light of the crown", "", "cividis"),
    "age": Scale("age", "Age", "years", "YlOrBr"),
}
COLOURS = ("species", *SCALES)

#: Trees that have just gone, and dead ones that stand.
FATE_COLOURS = {
    "died": (0.42, 0.38, 0.36),
    "felled": (0.84, 0.19, 0.15),
    "windthrown": (0.96, 0.55, 0.10),
    "snag": (0.58, 0.56, 0.54),
}
#: Residual trees, where colours stand for the species of the others.
RESIDUAL = (0.55, 0.62, 0.52)
_NOT_KNOWN = (0.72, 0.72, 0.69)
_PALEST = 0.1  # of a map: what is paler does not stand out from the ground


def on_scale(share: NDArray[np.float64], colours: str) -> NDArray[np.float64]:
    """Give the colour (n, 3), 0 to 1, of each share, 0 to 1, of a scale; grey for NaN."""
    from matplotlib import colormaps

    at = _PALEST + (1.0 - _PALEST) * np.clip(share, 0.0, 1.0)
    rgb = np.asarray(colormaps[colours](np.nan_to_num(at)), np.float64)[:, :3]
    rgb[np.isnan(share)] = _NOT_KNOWN
    return rgb


class TreeColours(NamedTuple):
    """How trees are coloured.

    Attributes
    ----------
    by : str
        One of `COLOURS`.
    top : float
        The value at the scale's upper end; its lower end is 0.
    species : tuple of str
        All species, in their order.
    residual : bool
        Whether residual trees stand among the others.
    """

    by: str
    top: float
    species: tuple[str, ...]
    residual: bool = False

    @classmethod
    def of_run(cls, run: Run, by: str) -> TreeColours:
        """Fit a scale to all years of a run.

        Raises
        ------
        InputError
            If trees cannot be coloured by that.
        """
        if by not in COLOURS:
            raise InputError(f"cannot colour by '{by}', {nearest(by, COLOURS)}")
        top = 1.0
        if by not in ("species", "light"):
            column = SCALES[by].column
            values = run.read("trees", [column])[column].to_numpy(np.float64)
            top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
        return cls(by, max(top, 1e-6), run.species_names, "residual" in run.tables)

    def of(self, trees: pd.DataFrame) -> NDArray[np.float64]:
        """Give each tree's colour (n, 3), 0 to 1; those with a `fate` have its colour."""
        if self.by == "species":
            names = trees["species"].astype(str)
            rgb = np.array([look_of(name).line for name in names], np.float64).reshape(-1, 3)
            rgb[trees["tree_id"].to_numpy() < 0] = RESIDUAL
        else:
            scale = SCALES[self.by]
            values = trees[scale.column].to_numpy(np.float64)
            rgb = on_scale(values / self.top, scale.colours)
        if "fate" in trees:
            fates = trees["fate"].to_numpy()
            for fate, colour in FATE_COLOURS.items():
                rgb[fates == fate] = colour
        return rgb
