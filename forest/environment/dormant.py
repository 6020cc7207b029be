"""Buds that stay dormant while growth is constrained to one bud (Palubicki et al. 2009, section 5).

"If a stroke begins at an existing bud, growth is constrained to this bud and its descendants (other
buds remain dormant)". Of several constraints on a tree each lets its own part grow; other trees
know nothing of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.environment.marker_buds import KIND_LATERAL, KIND_TERMINAL, Buds
from forest.trees.metamers import MAIN, Metamers
from forest.trees.table import Trees

#: Which buds of the metamer of a `Hold` grow.
BOTH = 0
TERMINAL_ALONE = 1
LATERAL_ALONE = 2


class Hold(NamedTuple):
    """What alone may grow of a tree.

    Attributes
    ----------
    tree_id : int
        A living tree.
    metamer : int
        Serial number of one of its metamers.
    bud : int
        `BOTH` of its buds, `TERMINAL_ALONE` or `LATERAL_ALONE`; each with all that came of it.
    """

    tree_id: int
    metamer: int
    bud: int = BOTH


def find_metamer(metamers: Metamers, trees: Trees, row: int, serial: int) -> int:
    """Find a metamer in the extent of the tree in a row; -1 if it is not there."""
    start, n = int(trees.start[row]), int(trees.size[row])
    here = metamers.serial[start : start + n]  # serials rise within a tree
    place = int(np.searchsorted(here, serial))
    return place if place < n and here[place] == serial else -1


def _may_grow(
    metamers: Metamers, trees: Trees, row: int, hold: Hold
) -> tuple[int, NDArray[np.bool_]]:
    """Give the place of the hold's metamer, and which metamers came of the buds that grow."""
    part = slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))
    parent = metamers.parent[part]
    place = find_metamer(metamers, trees, row, hold.metamer)
    children = parent == place
    if hold.bud != BOTH:
        on_axis = (metamers.state[part] & MAIN) != 0
        children &= on_axis == (hold.bud == TERMINAL_ALONE)
    grows: NDArray[np.bool_] = children
    below = np.maximum(parent, 0)
    while below.any():  # reaches twice as far down each time
        grows = grows | grows[below]
        below = below[below]
    return place, grows


def dormant_buds(
    buds: Buds, metamers: Metamers, trees: Trees, holds: Sequence[Hold]
) -> NDArray[np.bool_]:
    """Tell which buds stay dormant.

    Parameters
    ----------
    buds : Buds
        All living buds, n.
    metamers, trees : Metamers, Trees
        The arena and table that they were listed from.
    holds : sequence of Hold
        Their trees live and have their metamers.

    Returns
    -------
    bool (n,)
        True for all buds of the holds' trees but those that a hold of the tree lets grow.
    """
    dormant = np.zeros(len(buds.species), np.bool_)
    for tree_id in {hold.tree_id for hold in holds}:
        row = int(np.searchsorted(trees.tree_id, tree_id))
        own = slice(int(buds.first_of_tree[row]), int(buds.first_of_tree[row + 1]))
        index, kind = buds.metamer[own], buds.kind[own]
        free = np.zeros(len(index), np.bool_)
        for hold in holds:
            if hold.tree_id != tree_id:
                continue
            place, grows = _may_grow(metamers, trees, row, hold)
            at = index == place
            if hold.bud == TERMINAL_ALONE:
                at &= kind == KIND_TERMINAL
            elif hold.bud == LATERAL_ALONE:
                at &= kind == KIND_LATERAL
            free |= grows[index] | at
        dormant[own] = ~free
    return dormant
