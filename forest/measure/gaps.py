"""Gaps in the canopy: where no high tree's crown covers the plot, how much of it, in what sizes.

The plot is a raster of about 0.5 m. A cell is open if its centre lies under the crown of no tree
taller than a limit; open cells that share an edge are one gap, across the plot's edges too where it
is periodic. Crowns are octagons where the table of trees has their reach in eight directions (that
of a live stand), else discs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from forest.errors import InputError
from forest.measure.stand import TOP_TREES_HA, Plot, top_height
from forest.measure.structure import crown_raster

if TYPE_CHECKING:
    import pandas as pd

#: Trees up to this share of the top height do not close a gap.
SHARE_OF_TOP_HEIGHT = 1.0 / 3.0

#: Limits of the size classes of gaps, m2.
SIZE_CLASSES_M2 = (0.0, 5.0, 25.0, 50.0, 100.0, 200.0, 400.0, 1000.0, float("inf"))

_REACH = tuple(f"crown_radius_{45 * k:03d}_m" for k in range(8))
_SECTOR = np.pi / 4.0


@dataclass(frozen=True)
class Gaps:
    """The gaps of a plot, g of them.

    Attributes
    ----------
    label : int32 (ny, nx)
        Of each cell of the raster, rows along y: 0 under the canopy, k in the k-th gap, from 1 on.
    area_m2 : float64 (g,)
        Area of each gap.
    taller_than_m : float
        The height that a tree had to pass to close the canopy; NaN on a plot without trees.
    plot : Plot
        Size and boundary.
    """

    label: NDArray[np.int32]
    area_m2: NDArray[np.float64]
    taller_than_m: float
    plot: Plot

    def share(self, *, least_m2: float = 0.0) -> float:
        """Give the share of the plot in gaps of this area or more, 0..1."""
        kept = self.area_m2[self.area_m2 >= least_m2]
        return float(kept.sum()) / (self.plot.size_m[0] * self.plot.size_m[1])

    def sizes(self, limits_m2: Sequence[float] = SIZE_CLASSES_M2) -> pd.DataFrame:
        """Sort the gaps by area.

        Parameters
        ----------
        limits_m2 : sequence of float
            Limits of the classes, ascending; a gap belongs to the class that its area begins.

        Returns
        -------
        pandas.DataFrame
            A row per class: `from_m2`, `to_m2`, `gaps`, `gaps_ha` and `share` of the plot.

        Raises
        ------
        InputError
            If the limits do not ascend.
        """
        import pandas as pd

        limits = np.asarray(limits_m2, np.float64)
        if len(limits) < 2 or not (np.diff(limits) > 0.0).all():
            raise InputError(
                "limits do not ascend", where="limits_m2", expected="two or more, each larger"
            )
        n = len(limits) - 1
        place = np.searchsorted(limits, self.area_m2, side="right") - 1
        inside = (place >= 0) & (place < n)
        count = np.bincount(place[inside], minlength=n)
        area = np.bincount(place[inside], self.area_m2[inside], minlength=n)
        return pd.DataFrame(
            {
                "from_m2": limits[:-1],
                "to_m2": limits[1:],
                "gaps": count,
                "gaps_ha": count / self.plot.hectares,
                "share": area / (self.plot.size_m[0] * self.plot.size_m[1]),
            }
        )


def gaps(trees: pd.DataFrame, plot: Plot, *, taller_than_m: float | None = None) -> Gaps:
    """Find the gaps between the crowns of a plot.

    Parameters
    ----------
    trees : pandas.DataFrame
        n rows of one year, the whole stand: `x_m`, `y_m`, `dbh_cm`, `height_m`, `crown_radius_m`;
        with `crown_radius_000_m` and so on (`forest.measure.tables.measure_stand`), the crowns of
        trees that have these are octagons.
    plot : Plot
        Size and boundary.
    taller_than_m : float, optional
        Height that a tree must pass to close the canopy; default: a third of the top height.

    Returns
    -------
    Gaps
        On a plot without trees the whole of it is one gap.

    Raises
    ------
    InputError
        If the limit is below 0.
    """
    dbh, height = (trees[name].to_numpy(np.float64) for name in ("dbh_cm", "height_m"))
    if taller_than_m is None:
        top = top_height(dbh, height, TOP_TREES_HA * plot.hectares)
        limit = SHARE_OF_TOP_HEIGHT * top
    elif taller_than_m >= 0.0:
        limit = float(taller_than_m)
    else:
        raise InputError(
            f"taller_than_m = {taller_than_m}", where="gaps", expected="a height, 0 m or more"
        )
    covered = _canopy(trees[height > limit], plot)
    labels = label_patches(~covered, plot.periodic)
    cell = plot.size_m[0] * plot.size_m[1] / covered.size
    area = np.asarray(np.bincount(labels.ravel(), minlength=1)[1:] * cell, np.float64)
    return Gaps(labels, area, limit, plot)


def gap_share(
    trees: pd.DataFrame,
    plot: Plot,
    *,
    taller_than_m: float | None = None,
    least_m2: float = 0.0,
) -> float:
    """Give the share of the plot in canopy gaps of at least an area, 0..1; see `gaps`."""
    return gaps(trees, plot, taller_than_m=taller_than_m).share(least_m2=least_m2)


def label_patches(marked: NDArray[np.bool_], periodic: bool) -> NDArray[np.int32]:
    """Number the patches of marked cells that share edges, from 1 on; 0 where nothing is marked.

    Parameters
    ----------
    marked : bool (ny, nx)
        The raster.
    periodic : bool
        Whether its opposite edges meet.

    Returns
    -------
    int32 (ny, nx)
    """
    labels, n = label(marked)
    if periodic and n:
        meet = np.concatenate(
            [np.stack((labels[0], labels[-1])), np.stack((labels[:, 0], labels[:, -1]))], axis=1
        )
        one, other = meet[:, (meet > 0).all(axis=0)] - 1
        links = coo_array((np.ones(len(one)), (one, other)), shape=(n, n))
        _, patch = connected_components(links, directed=False)
        labels = np.concatenate(([0], patch + 1))[labels]
    return np.asarray(labels, np.int32)


def _canopy(high: pd.DataFrame, plot: Plot) -> NDArray[np.bool_]:
    """Lay the crowns of trees on the raster, (ny, nx)."""
    x, y, radius = (high[name].to_numpy(np.float64) for name in ("x_m", "y_m", "crown_radius_m"))
    shaped = np.zeros(len(high), np.bool_)
    if set(_REACH) <= set(high.columns):
        reach = high[list(_REACH)].to_numpy(np.float64)
        shaped = ~np.isnan(reach).any(axis=1)
    discs = ~shaped
    one = np.zeros(discs.sum(), np.int64)
    covered: NDArray[np.bool_] = crown_raster(x[discs], y[discs], radius[discs], one, 1, *plot)[0]
    for row in np.flatnonzero(shaped):
        _lay_octagon(x[row], y[row], reach[row], plot, covered)
    return covered


def _lay_octagon(
    x: float, y: float, reach: NDArray[np.float64], plot: Plot, covered: NDArray[np.bool_]
) -> None:
    """Mark the cells whose centre lies in an octagon with its corners amid the eight sectors."""
    ny, nx = covered.shape
    dx, dy = plot.size_m[0] / nx, plot.size_m[1] / ny
    most = float(reach.max())
    columns = np.arange(np.floor((x - most) / dx), np.floor((x + most) / dx) + 1.0)
    rows = np.arange(np.floor((y - most) / dy), np.floor((y + most) / dy) + 1.0)
    away_x = (columns[None, :] + 0.5) * dx - x
    away_y = (rows[:, None] + 0.5) * dy - y
    # the triangle between two corners whose angle a cell lies in, counted from the corner before
    turn = np.mod(np.arctan2(away_y, away_x) / _SECTOR - 0.5, 8.0)
    before = np.minimum(turn.astype(np.int64), 7)
    a, b = reach[before], reach[(before + 1) % 8]
    angle = (turn - before) * _SECTOR
    distance = np.hypot(away_x, away_y)
    # of the edge, at the angle, from the foot: sine rule of the two triangles that it cuts off
    edge = a * np.sin(angle) + b * np.sin(_SECTOR - angle)
    inside = distance * edge <= a * b * np.sin(_SECTOR)
    inside &= (a > 0.0) & (b > 0.0)
    j, i = np.nonzero(inside)
    row, column = rows[j].astype(np.int64), columns[i].astype(np.int64)
    if plot.periodic:
        covered[row % ny, column % nx] = True
    else:
        kept = (row >= 0) & (row < ny) & (column >= 0) & (column < nx)
        covered[row[kept], column[kept]] = True
