"""The far field: how much light the canopy above lets through.

Leaf area is gathered in coarse voxels as whole square millimetres. For each of a fixed set of
directions the grid is swept once from the top down by the Beer-Lambert law; the weighted mean
over directions is the relative irradiance T of a horizontal surface, 0 to 1.

A ray goes from the middle of one layer to the middle of the next, at most one voxel sideways at
a time: steeper ways are cut into an even number of steps, the first half of them through the
leaves of the upper layer, the others through those of the lower one. What a voxel's column does
not hit exactly is interpolated between four columns. T holds at the voxels' centres, so half of
a voxel's own leaves are counted.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from forest._jit import inline, njit, njit_parallel

#: Rows of the grid are dealt to this many chunks, whatever the number of threads.
CHUNKS = 16


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


@inline
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
def _sweep_row(
    y: Any, z: Any, step: Any, depth: Any, rays: Any, planes: Any, periodic: Any, result: Any
) -> None:
    """Take one row of all directions one step down; add up those that reach a layer's middle."""
    nz, _, nx = depth.shape
    through = np.empty(nx, np.float32)
    sums = result[z, y]
    for d in range(len(rays.steps)):
        steps = rays.steps[d]
        if step >= steps:
            continue
        # Every direction turns its own two planes: after n steps the light is in plane n % 2.
        turn = ((nz - 1 - z) * steps + step) % 2
        source = planes[turn, d]
        target = planes[1 - turn, d]
        layer = z + 1 if 2 * step < steps and steps > 1 else z
        if layer < nz:
            _step_row(source, target, y, rays, d, depth[layer, y], through)
        else:
            target[y + 1] = np.float32(1.0)
        if step == steps - 1:
            weight = rays.weight[d]
            out = target[y + 1, 1 : nx + 1]
            for x in range(nx):
                sums[x] += weight * out[x]
            if steps == 1:
                for x in range(nx):
                    out[x] *= through[x]
        _fill_margin(target, y, periodic)


@njit_parallel
def sweep(depth: Any, rays: Any, periodic: Any, result: Any, ground: Any) -> None:
    """Compute the relative irradiance of all voxels and of the ground.

    Parameters
    ----------
    depth : float32 (nz, ny, nx)
        Vertical optical depth of each voxel; the top layer is empty.
    rays : Rays
    periodic : int
        1 on a torus; else full light enters from the sides.
    result : float32 (nz, ny, nx)
        Out: T at the voxels' centres.
    ground : float32 (ny, nx)
        Out: T below the lowest layer.
    """
    nz, ny, nx = depth.shape
    n = len(rays.steps)
    planes = np.ones((2, n, ny + 2, nx + 2), np.float32)
    most = 0
    for d in range(n):
        most = max(most, rays.steps[d])
    for z in range(nz - 1, -1, -1):
        for step in range(most):
            for chunk in prange(CHUNKS):
                for y in range(chunk * ny // CHUNKS, (chunk + 1) * ny // CHUNKS):
                    if step == 0:
                        result[z, y] = np.float32(0.0)
                    _sweep_row(y, z, step, depth, rays, planes, periodic, result)
    for y in range(ny):
        for x in range(nx):
            total = np.float32(0.0)
            for d in range(n):
                light = planes[(nz * rays.steps[d]) % 2, d, y + 1, x + 1]
                if rays.steps[d] > 1:
                    light *= _transmit(rays.half[d] * depth[0, y, x])
                total += rays.weight[d] * light
            ground[y, x] = total


class CanopyField(NamedTuple):
    """The far field as kernels take it; grids are indexed [iz, iy, ix].

    Attributes
    ----------
    leaf : int64 (nz, ny, nx)
        Leaf area in each voxel, mm^2.
    transmission : float32 (nz, ny, nx)
        Relative irradiance T at each voxel's centre, 0 to 1.
    origin : int64 (2,)
        Coarse voxel (x, y) of the grid's first voxel; z starts at the ground.
    ratio : int
        Near-field voxels along the edge of a coarse one; 0 if there is no far field (T is 1).
    lift : int
        Near-field voxels above a site at which T is read.
    periodic : int
        1 on a torus.
    """

    leaf: NDArray[np.int64]
    transmission: NDArray[np.float32]
    origin: NDArray[np.int64]
    ratio: int
    lift: int
    periodic: int


class Frame(NamedTuple):
    """Where a far field's grid lies: see `CanopyField`; `top` is its highest layer."""

    x: Any
    y: Any
    top: Any
    ratio: Any
    inverse: Any
    lift: Any


@inline
def frame_of(field: Any) -> Any:
    """Take a field's place out of its arrays, for use in loops."""
    inverse = 1.0 / max(field.ratio, 1)
    top = field.leaf.shape[0] - 1
    return Frame(field.origin[0], field.origin[1], top, field.ratio, inverse, field.lift)


@inline
def coarse(index: Any, inverse: Any) -> Any:
    """Divide a voxel's number by a ratio, rounding down, without the slow integer division.

    The half keeps the quotient clear of whole numbers, so that rounding errors do not matter.
    """
    return np.int64(np.floor((index + 0.5) * inverse))


@inline
def layers_above(frame: Any, iz: Any) -> Any:
    """Find the two layers between whose centres a site reads T, and the share of the upper.

    The point lies `lift` near-field voxels above the site's.
    """
    twice = 2 * frame.ratio
    above = max(2 * (iz + frame.lift) + 1 - frame.ratio, 0)
    lower = min(coarse(above, 0.5 * frame.inverse), frame.top)
    share = np.float32((above - lower * twice) * (0.5 * frame.inverse))
    return lower, min(lower + 1, frame.top), share


class Canopy:
    """The far field of one stand: its grids, kept from year to year, and its rays.

    Parameters
    ----------
    shape : (int, int)
        Near-field voxels of the plot along x and y.
    near_voxel_m : float
        Edge of a near-field voxel, m.
    ratio : int
        Near-field voxels along the edge of a coarse voxel.
    lift : int
        Near-field voxels above a site at which T is read: the depth of the near field.
    periodic : bool
        Whether the plot is a torus.
    extinction : float
        Extinction coefficient k, per leaf area index.
    directions : float64 (d, 3)
        Unit vectors towards the light.
    weights : float64 (d,)
        Their shares of the irradiance.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        *,
        near_voxel_m: float,
        ratio: int,
        lift: int,
        periodic: bool,
        extinction: float,
        directions: NDArray[np.float64],
        weights: NDArray[np.float64],
    ) -> None:
        self.ratio = ratio
        self.lift = lift
        self.periodic = periodic
        self.rays = make_rays(directions, weights)
        self._depth_per_leaf = np.float32(extinction * 1e-6 / (ratio * near_voxel_m) ** 2)
        self._plot = np.array([-(-n // ratio) for n in shape], np.int64)
        self._allocate(np.zeros(2, np.int64), self._plot, 1)

    def _allocate(self, low: NDArray[np.int64], high: NDArray[np.int64], layers: int) -> None:
        nx, ny = (int(n) for n in high - low)
        self.origin = low
        self.leaf = np.zeros((layers, ny, nx), np.int64)
        self.transmission = np.ones((layers, ny, nx), np.float32)
        self.ground = np.ones((ny, nx), np.float32)

    @property
    def field(self) -> CanopyField:
        """The grids as kernels take them."""
        return CanopyField(
            self.leaf,
            self.transmission,
            self.origin,
            self.ratio,
            self.lift,
            int(self.periodic),
        )

    def clear(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        """Empty the leaves and make room for sites in the near-field voxels `low` to `high`.

        An open grid covers the plot and all sites. Above the highest site one layer is empty.
        """
        grid_low = np.zeros(2, np.int64)
        grid_high = self._plot.copy()
        layers = 1
        if np.all(low <= high):
            layers = max(int(high[2]) // self.ratio, 0) + 2
            if not self.periodic:
                grid_low = np.minimum(grid_low, low[:2] // self.ratio)
                grid_high = np.maximum(grid_high, high[:2] // self.ratio + 1)
        end = self.origin + self.leaf.shape[:0:-1]
        fits = np.all(grid_low >= self.origin) and np.all(grid_high <= end)
        if fits and layers <= len(self.leaf):
            self.leaf[...] = 0
            return
        self._allocate(
            np.minimum(grid_low, self.origin),
            np.maximum(grid_high, end),
            max(layers, len(self.leaf)),
        )

    def illuminate(self, covered: NDArray[np.float32] | None = None) -> None:
        """Compute T from the leaves and from the depth of obstacles on the same grid."""
        depth = self.leaf.astype(np.float32)
        depth *= self._depth_per_leaf
        if covered is not None:
            depth += covered
        sweep(depth, self.rays, int(self.periodic), self.transmission, self.ground)
        np.minimum(self.transmission, np.float32(1.0), out=self.transmission)
        np.minimum(self.ground, np.float32(1.0), out=self.ground)

    def floor_light(self) -> float:
        """Mean T at the ground of the plot, 0 to 1."""
        x, y = -self.origin
        plot = self.ground[y : y + self._plot[1], x : x + self._plot[0]]
        return float(plot.mean(dtype=np.float64))
