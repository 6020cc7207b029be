"""Sweeps of light through the far field, by the Beer-Lambert law.

For each direction the grid is swept once from the top down; the weighted mean over directions is
the relative irradiance T of a horizontal surface, 0 to 1.

A ray goes from the middle of one layer to the middle of the next, at most one voxel sideways at
a time: flatter ways are cut into an even number of steps, the first half of them through the
leaves of the upper layer, the others through those of the lower one. What a voxel's column does
not hit exactly is interpolated between four columns. T holds at the voxels' centres, so half of
a voxel's own leaves are counted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads

#: Directions are dealt to this many groups, whatever the number of threads.
GROUPS = 4


class Rays(NamedTuple):
    """The directions of a sweep.

    Attributes
    ----------
    shift : int64 (d, 2)
        Voxels to add to (x, y) to find the lower corner of the four columns a step comes from.
    part : float32 (d, 4)
        Shares of the four columns (x first).
    path : float32 (d,)
        Way of a step through a voxel's leaves, as a multiple of the voxel's height.
    half : float32 (d,)
        Way through half a layer, likewise.
    steps : int64 (d,)
        Steps from layer to layer: 1 or an even number.
    weight : float32 (d,)
        Share of the irradiance above the canopy; the sum is 1.
    """

    shift: NDArray[np.int64]
    part: NDArray[np.float32]
    path: NDArray[np.float32]
    half: NDArray[np.float32]
    steps: NDArray[np.int64]
    weight: NDArray[np.float32]


def make_rays(directions: NDArray[np.float64], weights: NDArray[np.float64]) -> Rays:
    """Prepare unit vectors towards the light and their shares of the irradiance."""
    flat = directions[:, :2] / directions[:, 2:]
    reach = np.abs(flat).max(axis=1)
    steps = np.where(reach <= 1.0, 1, 2 * np.ceil(reach / 2)).astype(np.int64)
    move = flat / steps[:, None]
    shift = np.minimum(np.floor(move), 0.0)
    x, y = (move - shift).T
    part = np.column_stack(((1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y))
    slant = 1.0 / directions[:, 2]
    return Rays(
        shift.astype(np.int64),
        np.ascontiguousarray(part, np.float32),
        (slant / np.maximum(steps, 2)).astype(np.float32),
        (slant / 2).astype(np.float32),
        steps,
        (weights / weights.sum()).astype(np.float32),
    )


@njit
def _transmit(depth: Any) -> Any:
    """Compute exp(-depth) for depth >= 0 in float32, without a call so that rows vectorise.

    A Pade approximant of the 64th root: relative error below 1e-5 down to exp(-8), absolute
    below 1e-8 beyond.
    """
    y = min(depth * np.float32(1.0 / 64.0), np.float32(3.0))
    curve = np.float32(1.0) + y * y * np.float32(1.0 / 12.0)
    slope = y * np.float32(0.5)
    root = (curve - slope) / (curve + slope)
    root *= root
    root *= root
    root *= root
    root *= root
    root *= root
    return root * root


@njit
def _fill_margin(plane: Any, y: Any, periodic: Any) -> None:
    """Copy a finished row to the margins on the other side of a torus."""
    rows = plane.shape[0]
    nx = plane.shape[1] - 2
    if periodic:
        plane[y + 1, 0] = plane[y + 1, nx]
        plane[y + 1, nx + 1] = plane[y + 1, 1]
        if y == 0:
            plane[rows - 1] = plane[1]
        if y == rows - 3:
            plane[0] = plane[rows - 2]


@njit
def _step_row(
    source: Any, target: Any, y: Any, rays: Any, d: Any, depth: Any, through: Any
) -> None:
    """Carry the light of one direction one step down to a row, and through its leaves."""
    nx = len(depth)
    path = rays.path[d]
    for x in range(nx):
        through[x] = _transmit(path * depth[x])
    dy = y + 1 + rays.shift[d, 1]
    dx = 1 + rays.shift[d, 0]
    near = source[dy]
    far = source[dy + 1]
    near_left = near[dx : dx + nx]
    near_right = near[dx + 1 : dx + 1 + nx]
    far_left = far[dx : dx + nx]
    far_right = far[dx + 1 : dx + 1 + nx]
    a, b, c, e = rays.part[d]
    out = target[y + 1, 1 : nx + 1]
    for x in range(nx):
        light = a * near_left[x] + b * near_right[x] + c * far_left[x] + e * far_right[x]
        out[x] = light * through[x]


@njit
def _sweep_direction(
    d: Any, depth: Any, rays: Any, planes: Any, periodic: Any, result: Any, ground: Any
) -> None:
    """Sweep the grid once from the top down; add the direction's share to T and to the ground."""
    nz, ny, nx = depth.shape
    steps = rays.steps[d]
    weight = rays.weight[d]
    through = np.empty(nx, np.float32)
    planes[:] = np.float32(1.0)
    turn = 0
    for z in range(nz - 1, -1, -1):
        for step in range(steps):
            source = planes[turn]
            turn = 1 - turn
            target = planes[turn]
            layer = z + 1 if 2 * step < steps and steps > 1 else z
            for y in range(ny):
                out = target[y + 1, 1 : nx + 1]
                if layer < nz:
                    _step_row(source, target, y, rays, d, depth[layer, y], through)
                else:
                    out[:] = np.float32(1.0)
                if step == steps - 1:
                    sums = result[z, y]
                    for x in range(nx):
                        sums[x] += weight * out[x]
                    if steps == 1:
                        for x in range(nx):
                            out[x] *= through[x]
                _fill_margin(target, y, periodic)
    for y in range(ny):
        for x in range(nx):
            light = planes[turn, y + 1, x + 1]
            if steps > 1:
                light *= _transmit(rays.half[d] * depth[0, y, x])
            ground[y, x] += weight * light


@njit
def _sweep_group(
    group: Any, depth: Any, rays: Any, periodic: Any, result: Any, ground: Any
) -> None:
    _, ny, nx = depth.shape
    planes = np.empty((2, ny + 2, nx + 2), np.float32)
    for d in range(group, len(rays.steps), GROUPS):
        _sweep_direction(d, depth, rays, planes, periodic, result, ground)


@driver
def _sweep_groups(
    first: Any, step: Any, depth: Any, rays: Any, periodic: Any, results: Any, grounds: Any
) -> None:
    for group in range(first, GROUPS, step):
        _sweep_group(group, depth, rays, periodic, results[group], grounds[group])


@driver
def _add_groups(
    first: Any, step: Any, results: Any, grounds: Any, result: Any, ground: Any
) -> None:
    """Add the groups' sums in order: the same bits for any number of threads."""
    nz, ny, nx = result.shape
    one = np.float32(1.0)
    for y in range(first, ny, step):
        for z in range(nz):
            for x in range(nx):
                total = np.float32(0.0)
                for group in range(GROUPS):
                    total += results[group, z, y, x]
                result[z, y, x] = min(total, one)
        for x in range(nx):
            total = np.float32(0.0)
            for group in range(GROUPS):
                total += grounds[group, y, x]
            ground[y, x] = min(total, one)


def sweep(
    depth: NDArray[np.float32],
    rays: Rays,
    periodic: int,
    result: NDArray[np.float32],
    ground: NDArray[np.float32],
) -> None:
    """Compute the relative irradiance of all voxels and of the ground.

    Parameters
    ----------
    depth : float32 (nz, ny, nx)
        Vertical optical depth of each voxel; the top layer is empty.
    rays : Rays
    periodic : int
        1 on a torus; else full light enters from the sides.
    result : float32 (nz, ny, nx)
        Out: T at the voxels' centres, at most 1.
    ground : float32 (ny, nx)
        Out: T below the lowest layer, at most 1.
    """
    # Each group of directions has sums of its own: a few threads that never wait for each other.
    results = np.zeros((GROUPS, *depth.shape), np.float32)
    grounds = np.zeros((GROUPS, *depth.shape[1:]), np.float32)
    in_threads(_sweep_groups, depth, rays, periodic, results, grounds)
    in_threads(_add_groups, results, grounds, result, ground)
