"""Where seeds fall: dispersal kernels, on the grid of cells, and who was a seedling's mother."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.dynamics.regeneration.cells import Cells
from forest.random import STREAM_MOTHER, uniforms

#: Seeds that a kernel's table tells cell by cell on a torus; the rest falls everywhere alike.
_NEAR_SHARE = 0.98
_NEAR_QUANTILE = 2.0537489106318225  # of the standard normal, at that share
#: Plot lengths to which the table reaches: farther seeds have wrapped to all parts alike.
_MOST_WRAPS = 3.0
#: Cells around the mother's within which the kernel is averaged over a cell.
_FINE = 8
_SUBCELLS = 5
_CHUNKS = 64


def kernel_density(
    kernel: str, distance_m: float, shape: float, r: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Give the density of seeds at a distance from their mother; its integral is 1.

    Parameters
    ----------
    kernel : {"lognormal", "2dt"}
        exp(-(ln(r/m))^2 / (2 s^2)) / ((2 pi)^1.5 s r^2) (Greene et al. 2004), or
        p / (pi u (1 + r^2/u)^(p+1)) (Clark et al. 1999).
    distance_m : float
        Median distance m; square root of u.
    shape : float
        s; p.
    r : float64
        Distances, m.

    Returns
    -------
    float64
        Per m2.
    """
    if kernel == "2dt":
        u = distance_m * distance_m
        return np.asarray(shape / (np.pi * u) * (1.0 + r * r / u) ** (-shape - 1.0))
    far = np.maximum(r, 1e-6 * distance_m)
    logs = np.log(far / distance_m) / shape
    return np.asarray(np.exp(-0.5 * logs * logs) / ((2.0 * np.pi) ** 1.5 * shape * far * far))


def near_distance(kernel: str, distance_m: float, shape: float) -> float:
    """Give the distance, m, within which `_NEAR_SHARE` of the seeds fall."""
    if kernel == "2dt":
        return float(distance_m * math.sqrt((1.0 - _NEAR_SHARE) ** (-1.0 / shape) - 1.0))
    return float(distance_m * math.exp(shape * _NEAR_QUANTILE))


def kernel_table(kernel: str, distance_m: float, shape: float, cells: Cells) -> NDArray[np.float64]:
    """Give the share of a mother's seeds that falls into each cell, by the way to it.

    The mother stands at her cell's centre. On a torus seeds wrap and none is lost: the table sums
    to 1. On an open plot it holds the ways that lie on the plot; other seeds are lost.

    Returns
    -------
    float64 (my, mx)
        Entry [j, i] is that of the cell j rows and i columns on, modulo the table's size: the
        plot's on a torus, else twice as much.
    """

    def density(y: NDArray[Any], x: NDArray[Any]) -> NDArray[np.float64]:
        ways = np.hypot(y[:, None], x[None, :])
        return kernel_density(kernel, distance_m, shape, ways) * cells.area

    if cells.periodic:
        near = near_distance(kernel, distance_m, shape)
        near = min(near, _MOST_WRAPS * max(cells.nx * cells.dx, cells.ny * cells.dy))
        ry, rx = (int(near / edge) + 1 for edge in (cells.dy, cells.dx))
        size = cells.ny, cells.nx
    else:
        ry, rx = cells.ny - 1, cells.nx - 1
        size = 2 * cells.ny, 2 * cells.nx
    rows, columns = np.arange(-ry, ry + 1), np.arange(-rx, rx + 1)
    shares = density(rows * cells.dy, columns * cells.dx)
    fy, fx = min(_FINE, ry), min(_FINE, rx)
    shares[ry - fy : ry + fy + 1, rx - fx : rx + fx + 1] = _fine(density, cells, fy, fx)
    table = np.zeros(size)
    folded = (rows % size[0])[:, None] * size[1] + (columns % size[1])[None, :]
    table.ravel()[:] = np.bincount(folded.ravel(), shares.ravel(), minlength=table.size)
    total = float(table.sum())
    if cells.periodic and total < 1.0:
        return table + (1.0 - total) / table.size
    return table / total if total > 1.0 else table


def _fine(
    density: Callable[[NDArray[Any], NDArray[Any]], NDArray[np.float64]],
    cells: Cells,
    fy: int,
    fx: int,
) -> NDArray[np.float64]:
    """Average the kernel over the subcells of the cells around the mother's."""
    y, x = ((np.arange((2 * f + 1) * _SUBCELLS) + 0.5) / _SUBCELLS - f - 0.5 for f in (fy, fx))
    fine = density(y * cells.dy, x * cells.dx)
    blocks = fine.reshape(2 * fy + 1, _SUBCELLS, 2 * fx + 1, _SUBCELLS)
    return np.asarray(blocks.mean(axis=(1, 3)))


class Dispersal:
    """The seed rain of one species from the trees of the plot.

    Parameters
    ----------
    kernel, distance_m, shape
        See `kernel_density`.
    cells : Cells

    Attributes
    ----------
    table : float64 (my, mx)
        See `kernel_table`.
    """

    def __init__(self, kernel: str, distance_m: float, shape: float, cells: Cells) -> None:
        self._cells = cells
        self.table = kernel_table(kernel, distance_m, shape, cells)
        self._spectrum = fft.rfft2(self.table)

    def fall(self, borne: NDArray[np.float64]) -> NDArray[np.float64]:
        """Spread seeds over the cells.

        Parameters
        ----------
        borne : float64 (cells,)
            Seeds borne by the trees in each cell.

        Returns
        -------
        float64 (cells,)
            Seeds that are expected to fall into each.
        """
        if not borne.any():
            return np.zeros(self._cells.count)
        ny, nx = self._cells.ny, self._cells.nx
        source = np.zeros(self.table.shape)
        source[:ny, :nx] = borne.reshape(ny, nx)
        fallen = fft.irfft2(fft.rfft2(source) * self._spectrum, s=self.table.shape)
        return np.asarray(
            np.maximum(fallen[:ny, :nx], 0.0).ravel()
        )  # what rounding leaves below 0 is none


@njit
def _mother(y: Any, x: Any, table: Any, place: Any, borne: Any, left: Any) -> Any:
    """Find the tree at whose seeds for a cell a draw is used up; -1 if there is one left."""
    my, mx = table.shape
    for tree in range(len(borne)):
        dy = y - place[tree, 0]
        dx = x - place[tree, 1]
        if dy < 0:
            dy += my
        if dx < 0:
            dx += mx
        left -= borne[tree] * table[dy, dx]
        if left < 0.0:
            return tree
    return -1


@driver
def _draw_mothers(
    first: Any,
    step: Any,
    cell: Any,
    seeds: Any,
    nx: Any,
    table: Any,
    place: Any,
    borne: Any,
    key: Any,
    tree: Any,
) -> None:
    for chunk in range(first, _CHUNKS, step):
        for k in range(len(cell) * chunk // _CHUNKS, len(cell) * (chunk + 1) // _CHUNKS):
            y = cell[k] // nx
            x = cell[k] - y * nx
            draw, _, _, _ = uniforms(key[0], np.int64(STREAM_MOTHER), cell[k], key[1], key[2])
            tree[k] = _mother(y, x, table, place, borne, draw * seeds[k])


def draw_mothers(
    cell: NDArray[np.int64],
    seeds: NDArray[np.float64],
    cells: Cells,
    table: NDArray[np.float64],
    at: NDArray[np.int64],
    borne: NDArray[np.float64],
    *,
    seed: int,
    kind: int,
    year: int,
) -> NDArray[np.int64]:
    """Draw the mother of each new cohort, in proportion to the seeds that trees send to its cell.

    Parameters
    ----------
    cell : int64 (n,)
        Cells of the cohorts, each once.
    seeds : float64 (n,)
        Seeds that fall into them: what the trees do not send comes from outside.
    cells : Cells
    table : float64 (my, mx)
        Of the species; see `kernel_table`.
    at : int64 (trees,)
        Cells of the trees of the species.
    borne : float64 (trees,)
        Their seeds.
    seed, kind, year : int
        Seed of the scenario, index of the species and calendar year, of which draws are a function.

    Returns
    -------
    int64 (n,)
        Indices of trees; -1 where the seed came from outside.
    """
    tree = np.full(len(cell), -1, np.int64)
    fertile = np.flatnonzero(borne > 0.0)
    place = np.stack(np.divmod(at[fertile], cells.nx), axis=1)
    key = np.array([seed, kind, year], np.int64)
    nx = np.int64(cells.nx)
    in_threads(_draw_mothers, cell, seeds, nx, table, place, borne[fertile], key, tree)
    known = tree >= 0
    tree[known] = fertile[tree[known]]
    return tree
