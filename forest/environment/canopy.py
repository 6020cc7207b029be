"""The far field: how much light the canopy above lets through.

Leaf area is gathered in coarse voxels as whole square millimetres, so that the order of
summation does not matter. `sweep` turns it into the relative irradiance T of each voxel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.environment.sweep import make_rays, sweep

#: Leaf area indices at which `Canopy.layer_transmission` is told: so far apart, and so many.
LAYER_STEP = 1.0 / 64.0
_LAYER_STEPS = 1025


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


@njit
def frame_of(field: Any) -> Any:
    """Take a field's place out of its arrays, for use in loops."""
    inverse = 1.0 / max(field.ratio, 1)
    top = field.leaf.shape[0] - 1
    return Frame(field.origin[0], field.origin[1], top, field.ratio, inverse, field.lift)


@njit
def coarse(index: Any, inverse: Any) -> Any:
    """Divide a voxel's number by a ratio, rounding down, without the slow integer division.

    The half keeps the quotient clear of whole numbers, so that rounding errors do not matter.
    """
    return np.int64(np.floor((index + 0.5) * inverse))


@njit
def layers_above(frame: Any, iz: Any) -> Any:
    """Find the two layers between whose centres a site reads T, and the share of the upper.

    The point lies `lift` near-field voxels above the site's.
    """
    twice = 2 * frame.ratio
    above = max(2 * (iz + frame.lift) + 1 - frame.ratio, 0)
    lower = min(coarse(above, 0.5 * frame.inverse), frame.top)
    share = np.float32((above - lower * twice) * (0.5 * frame.inverse))
    return lower, min(lower + 1, frame.top), share


@njit
def through(transmission: Any, lai: Any) -> Any:
    """Give the share of the light that a thin layer lets through, between its table's steps."""
    at = lai / LAYER_STEP
    low = np.int64(min(at, len(transmission) - 2.0))
    share = min(at - low, 1.0)
    return transmission[low] + share * (transmission[low + 1] - transmission[low])


@njit
def through_layers(transmission: Any, lai: Any) -> Any:
    """Give that share, float64, for an array of leaf area indices."""
    found = np.empty(lai.size)
    for k, one in enumerate(lai.flat):
        found[k] = through(transmission, one)
    return found.reshape(lai.shape)


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

    Attributes
    ----------
    layer_transmission : float64 (n,)
        What a thin layer of leaves lets through; see `through_layers`.
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
        # what a layer of this leaf area index lets through of light from all directions alike
        slant = 2.0 * self.rays.half.astype(np.float64)
        depth = extinction * LAYER_STEP * np.arange(_LAYER_STEPS)
        through = np.exp(-depth[:, None] * slant) * self.rays.weight.astype(np.float64)
        self.layer_transmission: NDArray[np.float64] = through.sum(axis=1)
        self._undergrowth: NDArray[np.float64] | None = None
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
        if self._undergrowth is not None:  # half of the layer's own leaves, as everywhere in T
            share = through_layers(self.layer_transmission, 0.5 * self._undergrowth)
            self._on_plot(self.transmission[0])[...] *= share.astype(np.float32)

    def _on_plot(self, layer: NDArray[np.float32]) -> NDArray[np.float32]:
        """Cut the plot out of a layer of the grid."""
        x, y = -self.origin
        return layer[y : y + self._plot[1], x : x + self._plot[0]]

    @property
    def ground_light(self) -> NDArray[np.float32]:
        """T at the ground of the plot, above its undergrowth; float32 (ny, nx) coarse voxels."""
        return self._on_plot(self.ground)

    def grow_under(self, lai: NDArray[np.float64]) -> None:
        """Let undergrowth stand on the ground in the years to come.

        It shades the lowest layer and the floor. `ground_light`, which falls on it, leaves it out,
        so that its own leaves are counted only by what grows in it.

        Parameters
        ----------
        lai : float64 (ny, nx)
            Its leaf area index in the plot's coarse voxels.
        """
        self._undergrowth = lai

    def floor_light(self) -> float:
        """Mean T on the plot's floor, below all that grows there, 0 to 1."""
        if self._undergrowth is None:
            return float(self.ground_light.mean(dtype=np.float64))
        share = through_layers(self.layer_transmission, self._undergrowth)
        return float((self.ground_light * share).mean(dtype=np.float64))
