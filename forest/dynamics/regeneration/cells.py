"""The ground of the plot in cells, each with its seeds and seedlings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Cells:
    """Rectangular cells that fill the plot, row by row from its corner.

    Attributes
    ----------
    nx, ny : int
        Cells along x and y.
    dx, dy : float
        Their edges, m.
    periodic : bool
        Whether the plot is a torus.
    """

    nx: int
    ny: int
    dx: float
    dy: float
    periodic: bool

    @classmethod
    def over(cls, size_m: tuple[float, float], cell_m: float, periodic: bool) -> Cells:
        """Cut a plot into cells at least `cell_m` wide, if it is."""
        nx, ny = (max(int(size / cell_m + 1e-9), 1) for size in size_m)
        return cls(nx, ny, size_m[0] / nx, size_m[1] / ny, periodic)

    @property
    def count(self) -> int:
        """Number of cells."""
        return self.nx * self.ny

    @property
    def area(self) -> float:
        """Area of a cell, m2."""
        return self.dx * self.dy

    def of(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.int64]:
        """Give the cells in which places inside the plot lie; beyond its edge the nearest."""
        ix = np.clip(np.floor(x / self.dx).astype(np.int64), 0, self.nx - 1)
        iy = np.clip(np.floor(y / self.dy).astype(np.int64), 0, self.ny - 1)
        return np.asarray(iy * self.nx + ix)

    def of_voxels(self, shape: tuple[int, ...], voxel_m: float) -> NDArray[np.int64]:
        """Give the cell in which the centre of each voxel of a layer (ny, nx) lies, in a row."""
        y, x = ((np.arange(n) + 0.5) * voxel_m for n in shape)
        grid_y, grid_x = np.meshgrid(y, x, indexing="ij")
        return self.of(grid_x.ravel(), grid_y.ravel())

    def around(self, cell: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Tell which cells are among these or touch one of them, wherever the plot wraps."""
        grid = np.zeros((self.ny, self.nx), np.bool_)
        grid.ravel()[cell] = True
        for axis in (0, 1):
            grid |= np.roll(grid, 1, axis) | np.roll(grid, -1, axis)
        return grid.ravel()

    def per_hectare(self) -> float:
        """Give the factor from a number on the plot to one on a hectare."""
        return 10_000.0 / (self.area * self.count)

    def sum(self, cell: NDArray[np.int64], weight: Any) -> NDArray[np.float64]:
        """Sum up weights by cell."""
        return np.bincount(cell, weight, self.count).astype(np.float64)
