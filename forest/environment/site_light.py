"""What light every bud gets: Q = T max(C - s + a, 0) (Palubicki et al. 2009, section 4.1).

s is the near field's shadow, a the bud's own part of it, C full light, and T the far field's
relative irradiance just above the near field, so that no leaf shades a bud twice.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.environment.canopy import CanopyField, coarse, frame_of, layers_above
from forest.environment.light_grid import ShadowField, place_in, window_of
from forest.environment.voxels import HANDS, Blocks, count_buds, site_voxel, wrap
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: The plot's rows are cut into this many slabs; each is filled by one thread.
SLABS = 4


class Units(NamedTuple):
    """Whole-number shade (1/16) and leaf area (mm^2) of a bud, per species."""

    shade: NDArray[np.uint16]
    leaf: NDArray[np.int32]


class Plot(NamedTuple):
    """The voxel edge and, in near-field voxels, the plot's extent and its first slab's row."""

    voxel_m: np.float32
    nx: int
    ny: int
    periodic: int
    first_row: int
    slab_rows: int


@njit
def _three(column: Any, row: Any) -> Any:
    """Take the three numbers of a row out of its array, for use in loops."""
    return column[row, 0], column[row, 1], column[row, 2]


@njit
def _misses(low: Any, high: Any, first: Any, last: Any, plot: Any) -> Any:
    """Tell whether the rows low..high, wrapped on a torus, miss the rows first..last - 1."""
    if not plot.periodic:
        return high < first or low >= last
    width = high - low
    start = low % plot.ny
    return (start >= last or start + width < first) and start + width - plot.ny < first


@njit
def _deposit_block(
    metamers: Any,
    trees: Any,
    tree: Any,
    sites: Any,
    rows: Any,
    plot: Any,
    near: Any,
    far: Any,
    units: Any,
) -> None:
    """Add the buds of a block that stand in a slab of rows to both grids."""
    # Arrays are taken out of their tuples before the loop: each access would count references.
    state = metamers.state
    tip = metamers.tip
    counts = near.counts
    leaves = far.leaf
    window = window_of(near)
    frame = frame_of(far)
    limit = np.int64(near.limit)
    shade = np.int64(units.shade[trees.species[tree]])
    leaf = np.int64(units.leaf[trees.species[tree]])
    base_x, base_y, base_z = _three(trees.base_voxel, tree)
    at_x, at_y, at_z = _three(trees.base_offset, tree)
    for k in range(sites[0], sites[1]):
        buds = count_buds(state[k])
        if buds == 0:
            continue
        iy = site_voxel(base_y, at_y, tip[k, 1], plot.voxel_m)
        if plot.periodic:
            iy = wrap(iy, plot.ny)
        if iy < rows[0] or iy >= rows[1]:
            continue
        ix = site_voxel(base_x, at_x, tip[k, 0], plot.voxel_m)
        if plot.periodic:
            ix = wrap(ix, plot.nx)
        iz = site_voxel(base_z, at_z, tip[k, 2], plot.voxel_m)
        if limit > 0:
            z = iz - window.z
            y = iy - window.y
            x = ix - window.x
            counts[z, y, x] = np.uint16(min(np.int64(counts[z, y, x]) + shade * buds, limit))
        if frame.ratio > 0:
            z = max(coarse(iz, frame.inverse), 0)
            y = coarse(iy, frame.inverse) - frame.y
            x = coarse(ix, frame.inverse) - frame.x
            leaves[z, y, x] += leaf * buds


@driver
def _deposit_slabs(
    start: Any,
    step: Any,
    metamers: Any,
    trees: Any,
    blocks: Any,
    bounds: Any,
    plot: Any,
    near: Any,
    far: Any,
    units: Any,
) -> None:
    for slab in range(start, SLABS, step):
        first = plot.first_row + slab * plot.slab_rows
        last = first + plot.slab_rows
        for block in range(len(blocks.tree)):
            low = bounds[block, 2]
            high = bounds[block, 3]
            if low > high or _misses(low, high, first, last, plot):
                continue
            _deposit_block(
                metamers,
                trees,
                blocks.tree[block],
                (blocks.first[block], blocks.last[block]),
                (first, last),
                plot,
                near,
                far,
                units,
            )


def deposit(
    metamers: Metamers,
    trees: Trees,
    blocks: Blocks,
    bounds: NDArray[np.int64],
    plot: Plot,
    near: ShadowField,
    far: CanopyField,
    units: Units,
) -> None:
    """Add all living buds to the near and far grids; each slab of rows belongs to one thread."""
    in_threads(_deposit_slabs, metamers, trees, blocks, bounds, plot, near, far, units)


@njit
def _read_block(
    metamers: Any,
    trees: Any,
    tree: Any,
    sites: Any,
    plot: Any,
    near: Any,
    far: Any,
    most: Any,
) -> None:
    """Set the light of a block's nodes; `most` is C plus a bud's own shadow."""
    state = metamers.state
    tip = metamers.tip
    light = metamers.light
    shadow = near.shadow
    transmission = far.transmission
    window = window_of(near)
    frame = frame_of(far)
    unit = near.unit
    has_near = near.limit > 0
    has_far = far.ratio > 0
    base_x, base_y, base_z = _three(trees.base_voxel, tree)
    at_x, at_y, at_z = _three(trees.base_offset, tree)
    for k in range(sites[0], sites[1]):
        if count_buds(state[k]) == 0:
            light[k] = np.float32(0.0)
            continue
        ix = site_voxel(base_x, at_x, tip[k, 0], plot.voxel_m)
        iy = site_voxel(base_y, at_y, tip[k, 1], plot.voxel_m)
        iz = site_voxel(base_z, at_z, tip[k, 2], plot.voxel_m)
        if plot.periodic:
            ix = wrap(ix, plot.nx)
            iy = wrap(iy, plot.ny)
        found = 1.0
        if has_far:
            y = coarse(iy, frame.inverse) - frame.y
            x = coarse(ix, frame.inverse) - frame.x
            lower, upper, share = layers_above(frame, iz)
            low = transmission[lower, y, x]
            found = np.float64(low + share * (transmission[upper, y, x] - low))
        if has_near:
            z, y, x = place_in(window, ix, iy, iz)
            left = most - unit * shadow[z, y, x] if z >= 0 else most
            found *= max(left, 0.0)
        light[k] = np.float32(found)


@driver
def _read_chunks(
    first: Any,
    step: Any,
    metamers: Any,
    trees: Any,
    blocks: Any,
    plot: Any,
    near: Any,
    far: Any,
    units: Any,
    full_light: Any,
) -> None:
    n = len(blocks.tree)
    for hand in range(first, HANDS, step):
        for block in range(n * hand // HANDS, n * (hand + 1) // HANDS):
            tree = blocks.tree[block]
            own = near.unit * units.shade[trees.species[tree]] * near.weights[0]
            sites = (blocks.first[block], blocks.last[block])
            _read_block(metamers, trees, tree, sites, plot, near, far, full_light + own)


def read_light(
    metamers: Metamers,
    trees: Trees,
    blocks: Blocks,
    plot: Plot,
    near: ShadowField,
    far: CanopyField,
    units: Units,
    full_light: float,
) -> None:
    """Set `metamers.light` of every node; 0 where no bud lives."""
    in_threads(_read_chunks, metamers, trees, blocks, plot, near, far, units, full_light)


def no_shadow() -> ShadowField:
    """Stand in for the near field where there is none."""
    return ShadowField(
        np.zeros((1, 1, 1), np.uint16),
        np.zeros((1, 1, 1), np.int32),
        np.zeros(1, np.int32),
        np.zeros(3, np.int64),
        np.zeros(2, np.int64),
        0,
        0.0,
        0,
    )


def no_canopy() -> CanopyField:
    """Stand in for the far field where there is none."""
    return CanopyField(
        np.zeros((1, 1, 1), np.int64),
        np.ones((1, 1, 1), np.float32),
        np.zeros(2, np.int64),
        0,
        0,
        0,
    )
