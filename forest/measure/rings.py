"""This year's rings at breast height, read from the stem's radius now and a year ago."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.measure.trees import BREAST_HEIGHT_M, TreeMeasures
from forest.trees.table import Trees


def ring_widths(trees: Trees, measures: TreeMeasures) -> NDArray[np.float64]:
    """Give the width of each tree's ring of this year at 1.3 m, mm; NaN below that height.

    The first ring is the whole radius that the stem has there at the end of its year, so that
    a tree's rings add up to its radius under bark. A ring may be missing: its width is then 0.

    Parameters
    ----------
    trees : Trees
        With `breast_serial` and `breast_radius` of the end of last year.
    measures : TreeMeasures
        This year's, of the same trees.
    """
    now = measures.breast_radius_m.astype(np.float64)
    before = np.where(trees.breast_serial >= 0, trees.breast_radius, np.float32(0.0))
    # A stem that broke below 1.3 m and regrew there is thinner than it was: no ring either.
    width = 1000.0 * np.maximum(now - before, 0.0)
    return np.where(measures.breast_serial >= 0, width, np.nan)


def remember_breast(trees: Trees, measures: TreeMeasures) -> None:
    """Write this year's metamer and radius at 1.3 m into the tree table, for the next ring."""
    trees.breast_serial[:] = measures.breast_serial
    trees.breast_radius[:] = measures.breast_radius_m


def ring_rows(
    year: int,
    step: int,
    trees: Trees,
    measures: TreeMeasures,
    eccentricity: NDArray[np.float64] | None = None,
    thick_side_deg: NDArray[np.float64] | None = None,
) -> dict[str, NDArray[Any]]:
    """Give this year's rows of the ring table, one for each tree that reaches 1.3 m.

    Parameters
    ----------
    year : int
        Calendar year of the ring.
    step : int
        The same year as the arena's `birth` counts it.
    trees : Trees
        As at the end of last year (see `ring_widths`); call `remember_breast` afterwards.
    measures : TreeMeasures
        This year's, of the same trees.
    eccentricity, thick_side_deg : float64 (trees,), optional
        Of the ring at breast height; circles without them.

    Returns
    -------
    dict of arrays
        `cambial_age` is 1 in the year in which the stem's metamer at 1.3 m was made.
    """
    width = ring_widths(trees, measures)
    has = np.flatnonzero(~np.isnan(width))
    n = len(has)
    return {
        "year": np.full(n, year, np.int32),
        "tree_id": trees.tree_id[has],
        "species": trees.species[has],
        "stem_height_m": np.full(n, BREAST_HEIGHT_M),
        "cambial_age": (step - measures.breast_birth[has] + 1).astype(np.int32),
        "width_mm": width[has],
        "eccentricity": np.zeros(n) if eccentricity is None else eccentricity[has],
        "thick_side_deg": np.full(n, np.nan) if thick_side_deg is None else thick_side_deg[has],
    }
