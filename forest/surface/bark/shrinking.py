"""Bark for a finished tree: its epidermis shrinks instead of the tree growing (5.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError


def shrinking(
    girth: NDArray[np.float64], shrink: float | NDArray[np.float64], steps: int = 20
) -> NDArray[np.float64]:
    """Give the girths that stretch bark as much as shrinking does.

    Epidermis that shrinks on a tree of unchanging girth tears like one that keeps its length on a
    tree that grows; only the scale of the picture differs. So the table ends with the girth now.
    Every step shrinks by the same ratio.

    Parameters
    ----------
    girth : float64 (strips)
        The tree's, m.
    shrink : float, or float64 (strips)
        What remains of the epidermis, 0 to 1. One number keeps the share of fractures the same all
        along the tree; `length / girth` gives every strip the same length of epidermis
        (figures 22b and 22c).
    steps : int

    Returns
    -------
    float64 (steps + 1, strips)
        For `grow_bark`, m.
    """
    girth = np.asarray(girth, np.float64)
    remains = np.broadcast_to(np.asarray(shrink, np.float64), girth.shape)
    if not np.all((remains > 0.0) & (remains <= 1.0)):
        raise InputError("what remains of the epidermis", where="bark: shrink", expected="0 to 1")
    if steps < 1:
        raise InputError(f"{steps} steps", where="bark: shrink", expected="1 or more")
    table: NDArray[np.float64] = girth * remains ** (1.0 - np.arange(steps + 1) / steps)[:, None]
    table[-1] = girth
    return table
