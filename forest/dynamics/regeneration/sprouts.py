"""Sprouts: shoots from the stumps of felled and broken trees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.regeneration.cells import Cells
from forest.dynamics.regeneration.cohorts import Cohorts, no_cohorts
from forest.dynamics.regeneration.traits import SproutTraits
from forest.random import STREAM_SPROUT, uniforms


class Stumps(NamedTuple):
    """Stumps that may sprout; arrays of one entry per stump.

    Attributes
    ----------
    tree_id, species : int64
        The tree that stood there.
    x, y : float64
        Its place, m.
    dbh_cm : float64
        Its dbh; NaN below breast height.
    reserve_kg : float64
        What it had stored.
    """

    tree_id: NDArray[np.int64]
    species: NDArray[np.int64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    dbh_cm: NDArray[np.float64]
    reserve_kg: NDArray[np.float64]


def no_stumps() -> Stumps:
    """Give none."""
    none, empty = np.empty(0, np.int64), np.empty(0)
    return Stumps(none, none, empty, empty, empty, empty)


def sprout_cohorts(
    stumps: Stumps, cells: Cells, traits: SproutTraits, *, seed: int, year: int
) -> Cohorts:
    """Let stumps sprout: the sprouts of one are a cohort, with the stump's tree as mother.

    Whether a stump sprouts, and the fraction of a sprout in the mean number, are drawn by tree id.
    Sprouts share what the tree had stored, which is taken to be in its roots.
    """
    parts = []
    for k, tree_id in enumerate(stumps.tree_id):
        kind = int(stumps.species[k])
        draw, more, _, _ = uniforms(seed, STREAM_SPROUT, int(tree_id), 0, year)
        n = int(traits.per_stump[kind] + more)
        if draw < traits.share[kind] and n and not stumps.dbh_cm[k] > traits.max_dbh_cm[kind]:
            parts.append((k, n))
    if not parts:
        return no_cohorts()
    stump, count = (np.array(column, np.int64) for column in zip(*parts, strict=True))
    species = stumps.species[stump]
    return Cohorts(
        cell=cells.of(stumps.x[stump], stumps.y[stump]),
        species=species,
        n=count,
        height=traits.height_m[species],
        age=np.ones(len(stump)),
        mother=stumps.tree_id[stump],
        reserve=stumps.reserve_kg[stump] / count,
        sprout=np.ones(len(stump), np.bool_),
    )
