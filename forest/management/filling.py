"""Where a pattern of seedlings finds room between the trees that stand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.management.regions import inside
from forest.measure.stand import Plot
from forest.scenario import placing

if TYPE_CHECKING:
    from forest.scenario.acts import Planted

#: Where a planting does not say: nothing is planted nearer to a stem, m.
CLEAR_M = 1.0


def pattern_places(
    pattern: Planted,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    shares: list[float],
    plot: Plot,
    seed: int,
    time: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Place a pattern on the plot and leave out what has no room.

    Parameters
    ----------
    pattern : Planted
        With a pattern: its spacing or density, its region, its distance to stems.
    x, y : float64 (n,)
        Stems that stand, m.
    shares : list of float
        Of the species that are mixed.
    plot : Plot
    seed, time : int
        What the draws hang on.

    Returns
    -------
    x, y : float64 (k,)
        Places, m.
    species : int64 (k,)
        Indices into `shares`. Which species a place would have does not hang on what is left out.
    """
    if pattern.spacing_m is not None:
        new_x, new_y = placing.regular_spots(plot.size_m, pattern.spacing_m)
    else:
        assert pattern.density_ha is not None
        distance = pattern.min_distance_m or 0.0
        count = placing.random_count(plot.size_m, pattern.density_ha, distance)
        new_x, new_y = placing.random_spots(
            plot.size_m, count, distance, seed, periodic=plot.periodic, time=time
        )
    species = placing.draw_species(shares, len(new_x), seed, time)
    clear = CLEAR_M if pattern.clear_m is None else pattern.clear_m
    clear = max(clear, placing.SAME_SPOT_M)
    stems = placing.Spots(plot.size_m, clear, periodic=plot.periodic)
    for number, spot in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        stems.take(*spot, number)
    places = zip(new_x.tolist(), new_y.tolist(), strict=True)
    free = np.array([stems.neighbour(*place) is None for place in places], np.bool_)
    if pattern.within is not None:
        free &= inside(pattern.within, new_x, new_y, plot)
    return new_x[free], new_y[free], species[free]
