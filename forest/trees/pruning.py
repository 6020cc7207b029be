"""Cutting a part off a tree between two years."""

from __future__ import annotations

import numpy as np

from forest.errors import InputError
from forest.trees.metamers import BRANCHED, CONTINUED, MAIN, Arena, close_ranks
from forest.trees.table import Trees


def cut_branch(place: Arena, trees: Trees, row: int, serial: int, branch_pipe: float) -> int:
    """Remove a metamer and everything it carries, and close the gap in the tree's extent.

    Parameters
    ----------
    place : Arena
        The arena; changed in place.
    trees : Trees
        The tree table; `size` is changed in place.
    row : int
        Row of the tree.
    serial : int
        Serial number of the lowest metamer that goes.
    branch_pipe : float
        Thickness of a pipe along branches relative to the stem (kappa): the pipes of what goes
        are no longer sapwood below the cut.

    Returns
    -------
    int
        Metamers removed.

    Raises
    ------
    InputError
        If no metamer has that serial, or if it is the tree's first.
    """
    arena = place.metamers
    start, n = int(trees.start[row]), int(trees.size[row])
    part = slice(start, start + n)
    at = np.flatnonzero(arena.serial[part] == serial)
    tree_id = int(trees.tree_id[row])
    if at.size == 0:
        raise InputError(
            f"tree {tree_id} has no metamer {serial}",
            where="Stand.prune",
            expected="a serial number of the tree's skeleton",
        )
    cut = int(at[0])
    parent = arena.parent[part].copy()
    if parent[cut] < 0:
        raise InputError(
            f"metamer {serial} carries the whole tree {tree_id}",
            where="Stand.prune",
            expected="a metamer above it; use Stand.fell to remove a tree",
        )
    gone = np.zeros(n, np.int32)
    gone[cut] = 1
    for i in range(cut + 1, n):
        gone[i] = gone[parent[i]]
    bit = CONTINUED if arena.state[start + cut] & MAIN else BRANCHED
    arena.state[start + parent[cut]] &= np.uint8(255 - bit)
    order = arena.order[part]
    lost = float(arena.sapwood[start + cut]) / (branch_pipe if order[cut] > 0 else 1.0)
    below = int(parent[cut])
    while below >= 0:
        here = lost * (branch_pipe if order[below] > 0 else 1.0)
        arena.sapwood[start + below] = max(0.0, float(arena.sapwood[start + below]) - here)
        below = int(parent[below])
    kept = close_ranks(arena.parent[part], place.fields, start, n, gone, np.empty(n, np.int32))
    trees.size[row] = kept
    return n - int(kept)
