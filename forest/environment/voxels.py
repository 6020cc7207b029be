"""Near-field voxels: where a site stands, and how the sites of all trees are dealt to threads."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees

#: Sites per block: small enough to balance threads, large enough to hide the loop's cost.
BLOCK = 2048
#: Hands among which blocks are dealt, in their order; fixed, so that no result depends on threads.
HANDS = 64


class Blocks(NamedTuple):
    """Runs of metamers, each within one tree.

    `tree` is the row of the tree table; `first` and `last` bound the run in the arena.
    """

    tree: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]


def deal_blocks(trees: Trees) -> Blocks:
    """Cut the trees' extents into blocks of at most `BLOCK` metamers."""
    size = trees.size.astype(np.int64)
    pieces = -(-size // BLOCK)
    tree = np.repeat(np.arange(len(size), dtype=np.int64), pieces)
    piece = np.arange(len(tree), dtype=np.int64) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    first = trees.start[tree] + piece * BLOCK
    last = np.minimum(first + BLOCK, trees.start[tree] + size[tree])
    return Blocks(tree, first, last)


@njit
def count_buds(state: Any) -> Any:
    """Count the living buds at a node: 0, 1 or 2."""
    n = 0
    if state & TERMINAL:
        n += 1
    if state & LATERAL:
        n += 1
    return n


@njit
def site_voxel(base_voxel: Any, base_offset: Any, tip: Any, voxel_m: Any) -> Any:
    """Find the voxel of one coordinate of a site.

    The base is a whole voxel plus an offset and the rest is float32, so that a tree moved by
    whole voxels keeps the same fractions exactly.
    """
    return np.int64(base_voxel) + np.int64(np.floor((base_offset + tip) / voxel_m))


@njit
def wrap(index: Any, n: Any) -> Any:
    """Bring an index into 0..n-1 on a torus; the division is rarely needed."""
    if index < 0 or index >= n:
        index %= n
    return index


@njit
def _bound_tips(metamers: Any, first: Any, last: Any) -> Any:
    """Bound the tips with living buds; rounding is monotone, so their voxels are bounded too."""
    # Arrays are taken out of their tuple before loops: each access would count references.
    state = metamers.state
    tip = metamers.tip
    infinite = np.float32(np.inf)
    x0 = y0 = z0 = infinite
    x1 = y1 = z1 = -infinite
    for k in range(first, last):
        if state[k] & (TERMINAL | LATERAL):
            x0 = min(x0, tip[k, 0])
            x1 = max(x1, tip[k, 0])
            y0 = min(y0, tip[k, 1])
            y1 = max(y1, tip[k, 1])
            z0 = min(z0, tip[k, 2])
            z1 = max(z1, tip[k, 2])
    return (x0, y0, z0), (x1, y1, z1)


@driver
def _bound_chunks(
    first: Any, step: Any, metamers: Any, trees: Any, blocks: Any, voxel_m: Any, bounds: Any
) -> None:
    n = len(blocks.tree)
    for hand in range(first, HANDS, step):
        for block in range(n * hand // HANDS, n * (hand + 1) // HANDS):
            tree = blocks.tree[block]
            low, high = _bound_tips(metamers, blocks.first[block], blocks.last[block])
            for axis in range(3):
                bounds[block, 2 * axis] = 1
                bounds[block, 2 * axis + 1] = 0
                if low[axis] <= high[axis]:
                    base = trees.base_voxel[tree, axis]
                    offset = trees.base_offset[tree, axis]
                    bounds[block, 2 * axis] = site_voxel(base, offset, low[axis], voxel_m)
                    bounds[block, 2 * axis + 1] = site_voxel(base, offset, high[axis], voxel_m)


def bound_blocks(
    metamers: Metamers, trees: Trees, blocks: Blocks, voxel_m: np.float32
) -> NDArray[np.int64]:
    """Bound the voxels of the living buds of each block.

    Returns
    -------
    int64 (blocks, 6)
        Lowest and highest ix, iy, iz, not wrapped; lowest above highest where no bud lives.
    """
    bounds = np.empty((len(blocks.tree), 6), np.int64)
    in_threads(_bound_chunks, metamers, trees, blocks, voxel_m, bounds)
    return bounds
