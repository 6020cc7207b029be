"""This year's rings at the heights that a scenario asks for, and where the crown begins.

A ring's width is the difference of the radii before and after thickening of one and the same
metamer, so that the widths at a height add up to the radius under bark there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.measure.trees import TreeMeasures
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: Codes of the rows' `place`.
AT_HEIGHT, AT_CROWN_BASE = 0, 1


class RingYear(NamedTuple):
    """What a year's rings are read from.

    Attributes
    ----------
    year, step : int
        Calendar year, and the same as the arena's `birth` counts it.
    before : float32 (capacity of the arena,)
        `Metamers.pipe` before this year's thickening.
    pipe_exponent : float64 (species,)
    """

    year: int
    step: int
    before: NDArray[np.float32]
    pipe_exponent: NDArray[np.float64]


def radii(
    metamers: Metamers,
    trees: Trees,
    metamer: NDArray[np.int32],
    now: RingYear,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the radii of one metamer per tree before and after the year, m; NaN without one.

    Parameters
    ----------
    metamer : int32 (trees,)
        In the tree's extent; -1 for none.
    """
    has = metamer >= 0
    place = trees.start + np.where(has, metamer, 0)
    inverse = 1.0 / now.pipe_exponent[trees.species]
    fields = (now.before, metamers.pipe)
    before, after = (
        np.where(has, 0.5 * field[place].astype(np.float64) ** inverse, np.nan) for field in fields
    )
    # what has been made this year had no wood before
    return np.where(has & (metamers.birth[place] == now.step), 0.0, before), after


def breast_ring_widths(
    metamers: Metamers, trees: Trees, measures: TreeMeasures, now: RingYear
) -> NDArray[np.float64]:
    """Give the width of each tree's ring of this year at 1.3 m, mm; NaN below that height.

    The first ring is the whole radius that the stem has there at the end of its year. A ring may
    be missing: its width is then 0.
    """
    before, after = radii(metamers, trees, measures.breast_metamer, now)
    return 1000.0 * (after - before)


def remember_discs(trees: Trees, metamers: Metamers, measures: TreeMeasures) -> None:
    """Note in the tree table which metamers stand at breast height and at the rings' heights.

    Wood does not climb: next year's rings are read from the same metamers.
    """
    trees.breast_serial[:] = measures.breast_serial
    heights = trees.disc_serial.shape[1]
    metamer = measures.disc_metamer[:, :heights]
    serial = metamers.serial[trees.start[:, None] + np.maximum(metamer, 0)]
    trees.disc_serial[:] = np.where(metamer >= 0, serial, -1)


def ring_rows(
    metamers: Metamers,
    trees: Trees,
    measures: TreeMeasures,
    heights: NDArray[np.float64],
    crown_base: bool,
    now: RingYear,
) -> dict[str, NDArray[Any]]:
    """Give this year's rows of the ring table: a row for each tree and height that it reaches.

    Parameters
    ----------
    heights : float64 (k,)
        Heights of the discs, m.
    crown_base : bool
        Whether to add the ring where the crown begins this year.

    Returns
    -------
    dict of arrays
        `metamer` is the arena index of the wood of each ring, for what else is known of it; all
        others are columns of `/rings` without eccentricity and thick side. `cambial_age` is 1 in
        the year in which the metamer was made.
    """
    columns = [measures.disc_metamer[:, k] for k in range(len(heights))]
    tall: list[NDArray[np.float64]] = [np.full(len(trees.tree_id), h) for h in heights]
    if crown_base:
        columns.append(measures.disc_metamer[:, -1])
        tall.append(np.where(measures.disc_metamer[:, -1] >= 0, measures.crown_base_m, np.nan))
    parts: list[dict[str, NDArray[Any]]] = []
    for k, (metamer, height) in enumerate(zip(columns, tall, strict=True)):
        before, after = radii(metamers, trees, metamer, now)
        has = np.flatnonzero(metamer >= 0)
        place = trees.start[has] + metamer[has]
        parts.append(
            {
                "year": np.full(len(has), now.year, np.int32),
                "tree_id": trees.tree_id[has],
                "species": trees.species[has],
                "place": np.full(len(has), AT_HEIGHT if k < len(heights) else AT_CROWN_BASE),
                "stem_height_m": height[has],
                "cambial_age": (now.step - metamers.birth[place] + 1).astype(np.int32),
                "width_mm": 1000.0 * (after - before)[has],
                "metamer": place,
            }
        )
    if not parts:
        return {}
    rows = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    order = np.lexsort((rows["stem_height_m"], rows["place"], rows["tree_id"]))
    return {name: column[order] for name, column in rows.items()}
