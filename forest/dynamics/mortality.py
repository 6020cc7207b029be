"""Which trees die in a year, and of what."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.trees.table import Trees


class Death(NamedTuple):
    """A tree that dies this year.

    Attributes
    ----------
    row : int
        Its row of the tree table.
    kind, cause : str
        As in `/events`: one of `forest.record.schema.EVENT_KINDS` and of `CAUSES`.
    """

    row: int
    kind: str
    cause: str


def starved(
    trees: Trees, buds: NDArray[np.int32], suppression_years: NDArray[np.float64]
) -> list[Death]:
    """Find the trees whose mass balance ends: suppressed for too long, or without a living site.

    Parameters
    ----------
    trees : Trees
    buds : int32 (n,)
        Living sites of each tree.
    suppression_years : float64 (species,)
        Bad years in a row after which a tree dies.
    """
    suppressed = trees.bad_years >= suppression_years[trees.species]
    return [
        Death(int(row), "died", "suppression" if suppressed[row] else "no_buds")
        for row in np.flatnonzero(suppressed | (buds == 0))
    ]
