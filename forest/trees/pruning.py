"""Cutting parts off a tree between two years: which, and what is left."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError
from forest.trees.metamers import BRANCHED, CONTINUED, MAIN, Arena, Metamers, close_ranks
from forest.trees.skeleton import number_axes
from forest.trees.table import Trees

if TYPE_CHECKING:
    from forest.scenario.acts import Branches as Choice


class Branches(NamedTuple):
    """The branches that stand on a tree's trunk (axes of order 1), each with all that it carries.

    Attributes
    ----------
    serial : int32 (k,)
        Serial number of each one's first metamer.
    height_m : float64 (k,)
        Height above the ground of its foot, m.
    azimuth_deg : float64 (k,)
        Where it points, from its foot to the tip of its axis: 0 along x, 90 along y, 0 to 360;
        NaN if it points straight up or down.
    """

    serial: NDArray[np.int32]
    height_m: NDArray[np.float64]
    azimuth_deg: NDArray[np.float64]


def branches_of(arena: Metamers, trees: Trees, row: int) -> Branches:
    """List the branches on the trunk of the tree in a row of the table."""
    part = _extent(trees, row)
    parent, order = arena.parent[part], arena.order[part]
    tip = arena.tip[part].astype(np.float64)
    axis = number_axes(parent, (arena.state[part] & MAIN) != 0)
    last = np.zeros(int(axis.max()) + 1, np.int64)
    last[axis] = np.arange(len(axis))  # a parent stands before its children: the tip comes last
    first = np.flatnonzero((order == 1) & (order[parent] == 0))
    foot = tip[parent[first]]
    x, y, _ = (tip[last[axis[first]]] - foot).T
    azimuth = np.where((x == 0) & (y == 0), np.nan, np.degrees(np.arctan2(y, x)) % 360.0)
    return Branches(arena.serial[part][first], foot[:, 2], azimuth)


def choose_branches(arena: Metamers, trees: Trees, row: int, choice: Choice) -> NDArray[np.int32]:
    """Choose branches on a tree's trunk: below a height or a share of the tree's height, or on a
    side between two heights.

    Returns
    -------
    int32 (k,)
        Serial numbers of their first metamers.
    """
    serial, height, azimuth = branches_of(arena, trees, row)
    if choice.below_m is not None:
        return serial[height < choice.below_m]
    if choice.below_share is not None:
        top = float(arena.tip[_extent(trees, row), 2].max())
        return serial[height < choice.below_share * top]
    if choice.side_deg is None:
        return serial[:0]
    away = np.abs((azimuth - choice.side_deg + 180.0) % 360.0 - 180.0)
    chosen = away <= choice.spread_deg
    if choice.from_m is not None:
        chosen &= height >= choice.from_m
    if choice.to_m is not None:
        chosen &= height <= choice.to_m
    return serial[chosen]


def find_cuts(
    arena: Metamers, trees: Trees, row: int, serials: ArrayLike, *, where: str
) -> NDArray[np.int64]:
    """Find the metamers at which a tree is to be cut, each once, in their order in its extent.

    Parameters
    ----------
    serials : sequence of int, or one
        Serial numbers of the lowest metamers that go.
    where : str
        Names the act in messages.

    Raises
    ------
    InputError
        If no metamer has such a serial, or if it is the tree's first.
    """
    part = _extent(trees, row)
    tree_id = int(trees.tree_id[row])
    wanted = np.unique(np.asarray(serials))
    # serials rise within a tree, so a search finds them
    here = arena.serial[part]
    place = np.minimum(np.searchsorted(here, wanted), len(here) - 1).astype(np.int64)
    missing = wanted[here[place] != wanted]
    if missing.size:
        raise InputError(
            f"tree {tree_id} has no metamer {missing[0]}",
            where=where,
            expected="a serial number of the tree's skeleton",
        )
    if place.size and place[0] == 0:
        raise InputError(
            f"metamer {wanted[0]} carries the whole tree {tree_id}",
            where=where,
            expected="a metamer above it; to remove a tree, fell it",
        )
    return place


def still_there(arena: Metamers, trees: Trees, row: int, serials: ArrayLike) -> NDArray[np.int32]:
    """Keep those of some serial numbers that a tree still has."""
    wanted = np.asarray(serials, np.int32)
    return wanted[np.isin(wanted, arena.serial[_extent(trees, row)])]


def cut_branches(
    place: Arena, trees: Trees, row: int, serials: ArrayLike, branch_pipe: float
) -> NDArray[np.int32]:
    """Remove metamers and everything they carry, and close the gaps in the tree's extent.

    Parameters
    ----------
    place : Arena
        The arena; changed in place.
    trees : Trees
        The tree table; `size` is changed in place.
    row : int
        Row of the tree.
    serials : sequence of int
        Serial numbers of the lowest metamers that go; one may stand above another.
    branch_pipe : float
        Thickness of a pipe along branches relative to the stem (kappa): the pipes of what goes
        are no longer sapwood below the cut.

    Returns
    -------
    int32 (k,)
        Serial numbers of all that went.

    Raises
    ------
    InputError
        If no metamer has such a serial, or if it is the tree's first; then nothing is cut.
    """
    arena = place.metamers
    cuts = find_cuts(arena, trees, row, serials, where="Stand.prune")
    part = _extent(trees, row)
    start, n = part.start, part.stop - part.start
    parent = arena.parent[part].copy()
    gone = np.zeros(n, np.bool_)
    gone[cuts] = True
    below = np.maximum(parent, 0)
    while below.any():  # reaches twice as far down each time; the base itself never goes
        gone |= gone[below]
        below = below[below]
    for cut in cuts[~gone[parent[cuts]]]:  # the others fall with these
        bit = CONTINUED if arena.state[start + cut] & MAIN else BRANCHED
        arena.state[start + parent[cut]] &= np.uint8(255 - bit)
        _release_sapwood(arena, start, parent, int(cut), branch_pipe)
    lost = arena.serial[part][gone]
    trees.size[row] = close_ranks(
        arena.parent[part], place.fields, start, n, gone.astype(np.int32), np.empty(n, np.int32)
    )
    return lost


def _release_sapwood(
    arena: Metamers, start: int, parent: NDArray[np.int32], cut: int, branch_pipe: float
) -> None:
    """Take the pipes of what is cut out of the sapwood below, down to the ground."""

    def thickness(place: int) -> float:
        return branch_pipe if arena.order[start + place] > 0 else 1.0

    lost = float(arena.sapwood[start + cut]) / thickness(cut)
    below = int(parent[cut])
    while below >= 0:
        left = float(arena.sapwood[start + below]) - lost * thickness(below)
        arena.sapwood[start + below] = max(0.0, left)
        below = int(parent[below])


def _extent(trees: Trees, row: int) -> slice:
    return slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))
