"""Near-field voxels: where a site stands, and how the sites of all trees are dealt to threads."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from forest._jit import inline, njit_parallel
from forest.trees.metamers import LATERAL, TERMINAL
from forest.trees.table import Trees

#: Sites per block: small enough to balance threads, large enough to hide the loop's cost.
BLOCK = 2048
#: Hands to which blocks are dealt in turn; fixed, so that no result depends on the threads.
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


@inline
def count_buds(state: Any) -> Any:
    """Count the living buds at a node: 0, 1 or 2."""
    n = 0
    if state & TERMINAL:
        n += 1
    if state & LATERAL:
        n += 1
    return n


@inline
def site_voxel(base_voxel: Any, base_offset: Any, tip: Any, voxel_m: Any) -> Any:
    """Find the voxel of one coordinate of a site.

    The base is a whole voxel plus an offset and the rest is float32, so that a tree moved by
    whole voxels keeps the same fractions exactly.
    """
    return np.int64(base_voxel) + np.int64(np.floor((base_offset + tip) / voxel_m))


@inline
def wrap(index: Any, n: Any) -> Any:
    """Bring an index into 0..n-1 on a torus; the division is rarely needed."""
    if index < 0 or index >= n:
        index %= n
    return index


@njit_parallel
def bound_blocks(metamers: Any, trees: Any, blocks: Any, voxel_m: Any) -> Any:
    """Bound the voxels of the living buds of each block.

    Returns
    -------
    int64 (blocks, 6)
        Lowest and highest ix, iy, iz, not wrapped; lowest above highest where no bud lives.
    """
    n = len(blocks.tree)
    bounds = np.empty((n, 6), np.int64)
    for hand in prange(HANDS):
        for block in range(hand, n, HANDS):
            tree = blocks.tree[block]
            for axis in range(3):
                # Rounding and floor are monotone, so bounds of tips give bounds of voxels.
                low = np.float32(np.inf)
                high = np.float32(-np.inf)
                for k in range(blocks.first[block], blocks.last[block]):
                    if metamers.state[k] & (TERMINAL | LATERAL):
                        tip = metamers.tip[k, axis]
                        low = min(low, tip)
                        high = max(high, tip)
                if low <= high:
                    base = trees.base_voxel[tree, axis]
                    offset = trees.base_offset[tree, axis]
                    bounds[block, 2 * axis] = site_voxel(base, offset, low, voxel_m)
                    bounds[block, 2 * axis + 1] = site_voxel(base, offset, high, voxel_m)
                else:
                    bounds[block, 2 * axis] = 1
                    bounds[block, 2 * axis + 1] = 0
    return bounds
