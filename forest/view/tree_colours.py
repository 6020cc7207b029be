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

#: What trees are coloured by: column of `/trees`, what a scale says, and its colours.
SCALES = {
    "dbh": ("dbh_cm", "dbh, cm", "viridis"),
    "height": ("height_m", "height, m", "viridis"),
    "light": ("light", "relative light", "inferno"),
    "age": ("age", "age, years", "cividis"),
}
COLOURS = ("species", *SCALES)

#: Trees that have just gone.
FATE_COLOURS = {
    "died": (0.42, 0.38, 0.36),
    "felled": (0.84, 0.19, 0.15),
    "windthrown": (0.96, 0.55, 0.10),
}
_NOT_KNOWN = (0.75, 0.75, 0.75)


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
    """

    by: str
    top: float
    species: tuple[str, ...]

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
            column = SCALES[by][0]
            values = run.read("trees", [column])[column].to_numpy(np.float64)
            top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
        return cls(by, max(top, 1e-6), run.species_names)

    def of(self, trees: pd.DataFrame) -> NDArray[np.float64]:
        """Give each tree's colour (n, 3), 0 to 1; those with a `fate` have its colour."""
        if self.by == "species":
            names = trees["species"].astype(str)
            rgb = np.array([look_of(name).line for name in names], np.float64).reshape(-1, 3)
        else:
            rgb = self._on_scale(trees[SCALES[self.by][0]].to_numpy(np.float64))
        if "fate" in trees:
            fates = trees["fate"].to_numpy()
            for fate, colour in FATE_COLOURS.items():
                rgb[fates == fate] = colour
        return rgb

    def _on_scale(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        from matplotlib import colormaps

        rgb = colormaps[SCALES[self.by][2]](np.clip(values / self.top, 0.0, 1.0))[:, :3]
        rgb[np.isnan(values)] = _NOT_KNOWN
        return np.asarray(rgb, np.float64)
