"""Competition: what each tree has around and above itself, and the layers of the stand.

Trees below 1.3 m have no dbh: they neither have an index nor count as competitors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest.errors import InputError
from forest.measure.structure import Neighbours, shannon

#: Trees that stand closer are taken to be this far apart, m.
LEAST_DISTANCE_M = 0.1

#: Lower limits of the layers of Pretzsch's A, as shares of the highest tree's height.
LAYERS = (0.0, 0.5, 0.8)


def hegyi_within(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    dbh_cm: NDArray[np.float64],
    size_m: tuple[float, float],
    periodic: bool,
    *,
    radius_m: float = 6.0,
) -> NDArray[np.float64]:
    """Give Hegyi's index with all competitors within a radius: sum of d_j / (d_i distance_ij).

    Parameters
    ----------
    x, y : float64 (n,)
        Places, m.
    dbh_cm : float64 (n,)
        Diameters; NaN for a tree without.
    size_m : tuple of float
        Size of the plot, m.
    periodic : bool
        Whether distances wrap; a tree then meets its competitors' images too, as many as there
        are within the radius.
    radius_m : float
        How far competition reaches.

    Returns
    -------
    float64 (n,)
        Index, 1/m (Hegyi 1974); NaN for a tree without dbh. On an open plot it is divided by the
        share of the tree's circle that lies in the plot.

    Raises
    ------
    InputError
        If the radius is not above 0.
    """
    if not radius_m > 0.0:
        raise InputError(f"radius_m = {radius_m}", where="hegyi_within", expected="above 0 m")
    index = np.full(len(x), np.nan)
    has = np.flatnonzero(~np.isnan(dbh_cm))
    if not has.size:
        return index
    places = np.column_stack((x, y))[has]
    dbh = dbh_cm[has]
    others, whose = _images(places, size_m, radius_m) if periodic else (places, np.arange(len(has)))
    pairs = cKDTree(places).sparse_distance_matrix(cKDTree(others), radius_m, output_type="ndarray")
    pairs = pairs[pairs["i"] != pairs["j"]]  # the first of `others` are the trees themselves
    i, j = pairs["i"], whose[pairs["j"]]
    weight = dbh[j] / dbh[i] / np.maximum(pairs["v"], LEAST_DISTANCE_M)
    index[has] = np.bincount(i, weight, minlength=len(has))
    if not periodic:
        index[has] /= share_inside(places, size_m, radius_m)
    return index


def hegyi_nearest(neighbours: Neighbours, dbh_cm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give Hegyi's index with the nearest neighbours as competitors, 1/m, (n,).

    Parameters
    ----------
    neighbours : Neighbours
        Of trees that all have a dbh. Edges are not corrected for.
    dbh_cm : float64 (n,)
        Their diameters.
    """
    distance = np.maximum(neighbours.distance, LEAST_DISTANCE_M)
    ratio = dbh_cm[neighbours.index] / dbh_cm[:, None]
    return np.asarray((ratio / distance).sum(axis=1), np.float64)


def share_inside(
    places: NDArray[np.float64], size_m: tuple[float, float], radius_m: float
) -> NDArray[np.float64]:
    """Give the share of the circle around each place in the plot, (n, 2), that lies in the plot."""
    area = np.zeros(len(places))
    for across in (places[:, 0], size_m[0] - places[:, 0]):
        for along in (places[:, 1], size_m[1] - places[:, 1]):
            area += _quarter_disc(across, along, radius_m)
    return area / (np.pi * radius_m**2)


def basal_area_of_larger(
    basal_area_m2: NDArray[np.float64], hectares: float
) -> NDArray[np.float64]:
    """Give the basal area of the thicker trees (BAL), m2/ha, (n,); NaN for a tree without dbh.

    Trees of the same basal area do not count for each other (Wykoff 1990).
    """
    ascending = np.sort(basal_area_m2)
    upto = np.concatenate(([0.0], np.cumsum(ascending)))
    larger = upto[-1] - upto[np.searchsorted(ascending, basal_area_m2, side="right")]
    return np.where(basal_area_m2 > 0.0, larger / hectares, np.nan)


def size_differentiation(
    neighbours: Neighbours, dbh_cm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Give the mean of 1 - thinner / thicker over each tree and its four nearest neighbours.

    0 if all are alike (von Gadow 1993). Fewer neighbours where there are no four.

    Parameters
    ----------
    neighbours : Neighbours
        Of trees that all have a dbh.
    dbh_cm : float64 (n,)
        Their diameters.

    Returns
    -------
    float64 (n,)
        Empty below two trees.
    """
    if not neighbours.index.shape[1]:
        return np.empty(0)
    own = dbh_cm[:, None]
    theirs = dbh_cm[neighbours.index]
    return np.asarray(1.0 - (np.minimum(own, theirs) / np.maximum(own, theirs)).mean(axis=1))


def species_profile(height_m: NDArray[np.float64], species: NDArray[Any]) -> float:
    """Give Pretzsch's index A: Shannon's diversity of species and height layers, by numbers.

    The layers are the top fifth of the greatest height, the 30 % below it and the lower half
    (Pretzsch 1996). A one-layered pure stand has 0; NaN without trees.
    """
    if not len(height_m):
        return float("nan")
    layer = np.searchsorted(np.array(LAYERS[1:]) * height_m.max(), height_m, side="left")
    _, kind = np.unique(species, return_inverse=True)
    return shannon(np.bincount(kind * len(LAYERS) + layer).astype(np.float64))


def relative_species_profile(height_m: NDArray[np.float64], species: NDArray[Any]) -> float:
    """Give A as a share of its greatest value, ln(3 species), 0..1."""
    kinds = len(np.unique(species))
    return species_profile(height_m, species) / float(np.log(max(kinds, 1) * len(LAYERS)))


def height_diversity(
    height_m: NDArray[np.float64], amount: NDArray[np.float64], *, layer_m: float = 2.0
) -> float:
    """Give Shannon's diversity of the amounts in height layers of equal depth; NaN without any.

    Parameters
    ----------
    height_m : float64 (n,)
        Heights.
    amount : float64 (n,)
        What is counted, e.g. basal area, leaf area, or ones.
    layer_m : float
        Depth of a layer.
    """
    if not len(height_m):
        return float("nan")
    layer = np.floor(height_m / layer_m).astype(np.int64)
    return shannon(np.asarray(np.bincount(layer, amount), np.float64))


def _images(
    places: NDArray[np.float64], size_m: tuple[float, float], radius_m: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Lay the plot out around itself as far as the radius reaches; the trees come first."""
    across, along = (int(np.ceil(radius_m / side)) for side in size_m)
    copies = [(i, j) for i in range(-across, across + 1) for j in range(-along, along + 1)]
    copies.sort(key=lambda copy: copy != (0, 0))
    shift = np.array(copies) * np.asarray(size_m)
    images = (shift[:, None, :] + places).reshape(-1, 2)
    whose = np.tile(np.arange(len(places)), len(copies))
    near = ((images >= -radius_m) & (images <= np.asarray(size_m) + radius_m)).all(axis=1)
    near[: len(places)] = True
    return images[near], whose[near]


def _quarter_disc(
    across: NDArray[np.float64], along: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Give the area of a quarter disc around a rectangle's corner that lies in the rectangle."""
    a = np.minimum(across, radius)
    b = np.minimum(along, radius)
    # under the edge at height b up to where the circle meets it, then under the circle
    meeting = np.minimum(np.sqrt(radius**2 - b**2), a)

    def under_circle(x: NDArray[np.float64]) -> NDArray[np.float64]:
        root = np.sqrt(np.maximum(radius**2 - x**2, 0.0))
        return np.asarray(0.5 * (x * root + radius**2 * np.arcsin(x / radius)))

    return np.asarray(b * meeting + under_circle(a) - under_circle(meeting))
