"""From seedling to tree: those tall enough get a place of their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.regeneration.cells import Cells
from forest.dynamics.regeneration.cohorts import Cohorts
from forest.random import STREAM_RECRUIT, uniforms
from forest.scenario.placing import Spots

#: Least distance between a recruit and any stem, m.
LEAST_DISTANCE_M = 0.2
#: Places in its cell that a seedling tries.
TRIES = 8


class Places(NamedTuple):
    """Recruits and where they stand; arrays of one entry per recruit.

    Attributes
    ----------
    x, y : float64
        Places, m.
    cohort : int64
        Index of the cohort that each comes from.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    cohort: NDArray[np.int64]


def find_places(
    cohorts: Cohorts,
    cells: Cells,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    seed: int,
    year: int,
) -> Places:
    """Place every seedling of some cohorts, anywhere in its cell but not beside a stem.

    Parameters
    ----------
    cohorts : Cohorts
        Those that are tall enough.
    cells : Cells
    x, y : float64 (trees,)
        Stems that stand.
    seed, year : int
        Seed of the scenario and calendar year, of which places are a function.

    Returns
    -------
    Places
        A seedling that found none in `TRIES` tries is not among them.
    """
    size = cells.nx * cells.dx, cells.ny * cells.dy
    stems = Spots(size, LEAST_DISTANCE_M, periodic=cells.periodic)
    for tree in np.flatnonzero(cells.around(cohorts.cell)[cells.of(x, y)]).tolist():
        stems.take(float(x[tree]), float(y[tree]), tree)
    found: list[tuple[float, float, int]] = []
    asked: dict[int, int] = {}  # tries in each cell so far: no two have the same draw
    for k, cell in enumerate(cohorts.cell.tolist()):
        iy, ix = divmod(cell, cells.nx)
        for _ in range(int(cohorts.n[k])):
            for _ in range(TRIES):
                asked[cell] = asked.get(cell, 0) + 1
                u, v, _, _ = uniforms(seed, STREAM_RECRUIT, cell, asked[cell], year)
                at = (ix + u) * cells.dx, (iy + v) * cells.dy
                if stems.neighbour(*at) is None:
                    stems.take(*at, -1)
                    found.append((*at, k))
                    break
    columns = zip(*found, strict=True) if found else ((), (), ())
    at_x, at_y, cohort = columns
    return Places(np.array(at_x), np.array(at_y), np.array(cohort, np.int64))
