"""The list of living buds, and what each of them found in the marker space."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: Sites are worked on in this many chunks, whatever the number of threads.
CHUNKS = 64

KIND_TERMINAL = np.uint8(0)
KIND_LATERAL = np.uint8(1)

_TERMINAL = 2
_LATERAL = 4
_NO_ROOM_TERMINAL = 32
_NO_ROOM_LATERAL = 64
_KEEP = 255 - _NO_ROOM_TERMINAL - _NO_ROOM_LATERAL


class Buds(NamedTuple):
    """All living buds, ordered by tree, metamer and kind (terminal before lateral).

    `position` is absolute (m, not wrapped); `heading` is the unit vector that a bud points to:
    that of its internode for a terminal bud, its own for a lateral one.
    """

    first_of_tree: NDArray[np.int64]
    tree_row: NDArray[np.int32]
    metamer: NDArray[np.int32]
    kind: NDArray[np.uint8]
    serial: NDArray[np.int32]
    species: NDArray[np.int16]
    position: NDArray[np.float64]
    heading: NDArray[np.float32]


class BudSpace(NamedTuple):
    """What each living bud found: Palubicki et al. 2009, section 4.1.

    Attributes
    ----------
    first_of_tree : int64 (n_trees + 1,)
        Buds of tree row t are entries ``first_of_tree[t]`` to ``first_of_tree[t + 1]``.
    tree_row, metamer : int32 (n,)
        Row of the tree and index of the metamer in the tree's extent.
    kind : uint8 (n,)
        0 for the terminal, 1 for the lateral bud of the metamer.
    found : int32 (n,)
        Markers that belong to the bud; it has space to grow (Q = 1) if there are any.
    direction : float32 (n, 3)
        Unit vector V, the normalized sum of unit vectors to its markers; zero if it has none.
    """

    first_of_tree: NDArray[np.int64]
    tree_row: NDArray[np.int32]
    metamer: NDArray[np.int32]
    kind: NDArray[np.uint8]
    found: NDArray[np.int32]
    direction: NDArray[np.float32]


@njit
def chunk_bounds(total: Any, chunk: Any) -> Any:
    """Bounds of one of the fixed chunks of `total` items."""
    return total * chunk // CHUNKS, total * (chunk + 1) // CHUNKS


@njit
def _tree_of(first_site: Any, site: Any) -> Any:
    """Row of the tree that holds a site (trees without metamers hold none)."""
    return np.searchsorted(first_site, site, side="right") - 1


@njit
def _count_in(state: Any, start: Any, end: Any) -> Any:
    """Count the living buds of the arena's metamers `start` to `end`."""
    buds = 0
    for k in range(start, end):
        buds += (state[k] & _TERMINAL != 0) + (state[k] & _LATERAL != 0)
    return buds


@driver
def _count_buds(
    first: Any, step: Any, metamers: Any, trees: Any, first_site: Any, count: Any
) -> None:
    for c in range(first, CHUNKS, step):
        site, end = chunk_bounds(first_site[-1], c)
        while site < end:
            t = _tree_of(first_site, site)
            shift = trees.start[t] - first_site[t]
            stop = min(end, first_site[t + 1])
            count[c] += _count_in(metamers.state, site + shift, stop + shift)
            site = stop


@njit
def _internode_direction(tip: Any, k: Any, parent: Any) -> Any:
    """Unit vector from the parent's tip (the tree's base if `parent` < 0) to that of `k`."""
    x = np.float64(tip[k, 0])
    y = np.float64(tip[k, 1])
    z = np.float64(tip[k, 2])
    if parent >= 0:
        x -= np.float64(tip[parent, 0])
        y -= np.float64(tip[parent, 1])
        z -= np.float64(tip[parent, 2])
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@njit
def _fill_tree(metamers: Any, trees: Any, t: Any, first: Any, end: Any, b: Any, buds: Any) -> Any:
    """List the buds of metamers `first` to `end` of a tree from entry `b` on; give the end."""
    tip, position, heading = metamers.tip, buds.position, buds.heading
    start = trees.start[t]
    for k in range(start + first, start + end):
        for kind in range(2):
            if not metamers.state[k] & (_TERMINAL if kind == 0 else _LATERAL):
                continue
            buds.tree_row[b] = t
            buds.metamer[b] = k - start
            buds.kind[b] = kind
            buds.serial[b] = metamers.serial[k]
            buds.species[b] = trees.species[t]
            position[b, 0] = trees.x[t] + np.float64(tip[k, 0])
            position[b, 1] = trees.y[t] + np.float64(tip[k, 1])
            position[b, 2] = np.float64(tip[k, 2])
            if kind == 0:
                parent = metamers.parent[k]
                p = start + parent if parent >= 0 else np.int64(-1)
                heading[b, 0], heading[b, 1], heading[b, 2] = _internode_direction(tip, k, p)
            else:
                for axis in range(3):
                    heading[b, axis] = metamers.bud[k, axis]
            b += 1
    return b


@driver
def _fill_buds(
    first: Any, step: Any, metamers: Any, trees: Any, first_site: Any, first_bud: Any, buds: Any
) -> None:
    for c in range(first, CHUNKS, step):
        site, end = chunk_bounds(first_site[-1], c)
        b = first_bud[c]
        while site < end:
            t = _tree_of(first_site, site)
            stop = min(end, first_site[t + 1])
            tree = first_site[t]
            b = _fill_tree(metamers, trees, t, site - tree, stop - tree, b, buds)
            site = stop


def _first_sites(trees: Trees) -> NDArray[np.int64]:
    """Number the metamers of all trees in table order; give the first of each tree."""
    return np.concatenate((np.zeros(1, np.int64), np.cumsum(trees.size, dtype=np.int64)))


def list_buds(metamers: Metamers, trees: Trees) -> Buds:
    """List the living buds of all trees."""
    first_site = _first_sites(trees)
    count = np.zeros(CHUNKS, np.int64)
    in_threads(_count_buds, metamers, trees, first_site, count)
    first_bud = np.concatenate((np.zeros(1, np.int64), np.cumsum(count)))
    n = int(first_bud[-1])
    buds = Buds(
        first_of_tree=np.empty(0, np.int64),
        tree_row=np.empty(n, np.int32),
        metamer=np.empty(n, np.int32),
        kind=np.empty(n, np.uint8),
        serial=np.empty(n, np.int32),
        species=np.empty(n, np.int16),
        position=np.empty((n, 3)),
        heading=np.empty((n, 3), np.float32),
    )
    in_threads(_fill_buds, metamers, trees, first_site, first_bud, buds)
    rows = np.arange(len(trees.size) + 1, dtype=np.int32)
    return buds._replace(first_of_tree=np.searchsorted(buds.tree_row, rows).astype(np.int64))


@njit
def bud_index(space: Any, tree_row: Any, metamer: Any, kind: Any) -> Any:
    """Find a bud in the list; -1 if the metamer bears no such living bud."""
    low = space.first_of_tree[tree_row]
    end = space.first_of_tree[tree_row + 1]
    high = end
    while low < high:
        middle = (low + high) // 2
        if space.metamer[middle] < metamer:
            low = middle + 1
        else:
            high = middle
    while low < end and space.metamer[low] == metamer:
        if space.kind[low] == kind:
            return low
        low += 1
    return np.int64(-1)


@njit
def _mark_tree(states: Any, found: Any, b: Any) -> None:
    """Set the bits of consecutive metamers of a tree, whose first bud is entry `b`."""
    for k in range(len(states)):
        state = np.int64(states[k]) & _KEEP
        if state & _TERMINAL:
            if found[b] == 0:
                state |= _NO_ROOM_TERMINAL
            b += 1
        if state & _LATERAL:
            if found[b] == 0:
                state |= _NO_ROOM_LATERAL
            b += 1
        states[k] = state


@driver
def _mark_room(
    begin: Any, step: Any, metamers: Any, trees: Any, first_site: Any, space: Any
) -> None:
    for c in range(begin, CHUNKS, step):
        site, end = chunk_bounds(first_site[-1], c)
        while site < end:
            t = _tree_of(first_site, site)
            stop = min(end, first_site[t + 1])
            first = space.first_of_tree[t]
            own = space.metamer[first : space.first_of_tree[t + 1]]
            b = first + np.searchsorted(own, site - first_site[t])
            shift = trees.start[t] - first_site[t]
            _mark_tree(metamers.state[site + shift : stop + shift], space.found, b)
            site = stop


def apply_space(metamers: Metamers, trees: Trees, space: BudSpace) -> None:
    """Set the bits NO_ROOM_* of buds that found no marker (Q = 0) and clear all others.

    Parameters
    ----------
    metamers, trees
        The arena, changed in place, and the table that `space` was made from.
    space : BudSpace
        This year's claims.
    """
    in_threads(_mark_room, metamers, trees, _first_sites(trees), space)
