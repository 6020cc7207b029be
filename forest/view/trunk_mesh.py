"""A trunk as a solid for viewers of meshes: its surface, and the rings on its ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forest.dendro.disc import outlines
from forest.dendro.life import StemLife
from forest.dendro.section import AROUND, yearly_surface

Grid = NDArray[np.float64]
Years = NDArray[np.int64]


def write_trunk(life: StemLife, to: str | Path, *, height_m: float | None = None) -> int:
    """Write the wood of a stem as VTK PolyData with the `year` of every cell.

    The surface has the last year, an end the year of each ring; wood without rings of its own has
    the year in which it came on record.

    Parameters
    ----------
    life : StemLife
        The stem.
    to : path
        File to write, ``.vtp``.
    height_m : float, optional
        Height above the base at which it is cut off; if not given it ends at its top, and has
        rings on its lower end only.

    Returns
    -------
    int
        Number of cells.

    Raises
    ------
    InputError
        If the stem is not so high.
    """
    import pyvista

    top = None if height_m is None else life.internode_at(height_m)
    side = yearly_surface(life, len(life.years) - 1, to=top)
    foot, foot_years = _end(life, 0, life.start[0])
    side[1] = foot[-1]  # the same to the last bit, so that the solid is closed
    grids: list[tuple[Grid, Years]] = [(foot, foot_years)]
    if top is None:
        side = side[1:]
    else:
        head, head_years = _end(life, top, life.end[top])
        side = side[1:-1]
        side[-1] = head[-1]
        grids.append((head[::-1], head_years[::-1]))
    grids.append((side, np.full(len(side) - 1, life.years[-1])))
    points, faces, years = [], [], []
    count = 0
    for grid, of_rows in grids:
        points.append(grid.reshape(-1, 3))
        faces.append(count + _quads(len(grid)))
        years.append(np.repeat(of_rows, AROUND))
        count += len(grid) * AROUND
    corners = np.concatenate(faces)
    mesh = pyvista.PolyData(
        np.concatenate(points), np.column_stack((np.full(len(corners), 4), corners)).ravel()
    )
    mesh.cell_data["year"] = np.concatenate(years).astype(np.int32)
    mesh.save(to)
    return int(mesh.n_cells)


def _end(life: StemLife, i: int, pith: Grid) -> tuple[Grid, Years]:
    """Lay the rings of an internode flat around its pith, and tell the year of each.

    The innermost row is the pith itself.
    """
    rings = np.flatnonzero(np.diff(life.radius[:, i], prepend=0.0) > 0.0)
    flat = outlines(life.radius[rings, i], life.centres[rings, i], AROUND)
    flat = np.concatenate((np.zeros((1, AROUND, 2)), flat))
    space = np.concatenate((flat, np.zeros((len(flat), AROUND, 1))), axis=2)
    return pith + space @ life.turn[i].T, life.years[rings]


def _quads(rows: int) -> NDArray[np.int64]:
    """Number the corners of the cells between rows of points that close around the stem."""
    row, column = np.divmod(np.arange((rows - 1) * AROUND), AROUND)
    right = (column + 1) % AROUND
    here, above = row * AROUND, (row + 1) * AROUND
    return np.stack((here + column, here + right, above + right, above + column), axis=1)
