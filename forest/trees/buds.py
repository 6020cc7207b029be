"""Buds named by tree, metamer and kind, and where they point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit

TERMINAL_BUD = 0
LATERAL_BUD = 1


class Shoots(NamedTuple):
    """The buds that shoot this year, in order of tree, metamer and bud.

    Attributes
    ----------
    first : int64 (trees + 1,)
        `first[r]:first[r + 1]` are the shoots of tree row r.
    metamer : int32 (n,)
        Metamer that bears the bud, relative to the tree's extent.
    bud : uint8 (n,)
        TERMINAL_BUD or LATERAL_BUD.
    new : int64 (trees,)
        Metamers that each tree can gain at most.
    """

    first: NDArray[np.int64]
    metamer: NDArray[np.int32]
    bud: NDArray[np.uint8]
    new: NDArray[np.int64]


@njit
def bud_heading(arena, s, i, bud):  # type: ignore[no-untyped-def]
    """Direction of a bud: of its internode (terminal), or as phyllotaxis made it (lateral)."""
    if bud == LATERAL_BUD:
        return (
            np.float64(arena.bud[s + i, 0]),
            np.float64(arena.bud[s + i, 1]),
            np.float64(arena.bud[s + i, 2]),
        )
    x = np.float64(arena.tip[s + i, 0])
    y = np.float64(arena.tip[s + i, 1])
    z = np.float64(arena.tip[s + i, 2])
    p = arena.parent[s + i]
    if p >= 0:
        x -= arena.tip[s + p, 0]
        y -= arena.tip[s + p, 1]
        z -= arena.tip[s + p, 2]
    norm = np.sqrt(x * x + y * y + z * z)
    if norm == 0.0:
        return 0.0, 0.0, 1.0
    return x / norm, y / norm, z / norm
