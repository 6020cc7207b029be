"""The neutral shape of leaves, whoever made them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: The outlines that a code of `Leaves.shape` stands for.
LEAF_SHAPES = (
    "oval",
    "triangle",
    "oak_3_lobes",
    "maple_3_lobes",
    "maple_5_lobes",
    "three_leaflets",
)


class Leaves(NamedTuple):
    """Leaves of one tree, a row each.

    Attributes
    ----------
    position : float64 (n, 3)
        Where the leaf is fixed, m.
    direction : float64 (n, 3)
        Unit vector from there to its tip.
    normal : float64 (n, 3)
        Unit vector out of its upper face.
    length, width : float64 (n,)
        Of its blade, m.
    shape : int8 (n,)
        Its outline, an index into `LEAF_SHAPES`.
    stem : int32 (n,)
        The stem that bears it.
    """

    position: NDArray[np.float64]
    direction: NDArray[np.float64]
    normal: NDArray[np.float64]
    length: NDArray[np.float64]
    width: NDArray[np.float64]
    shape: NDArray[np.int8]
    stem: NDArray[np.int32]
