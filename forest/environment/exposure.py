"""What light every bud gets: Q = T max(C - s + a, 0) (Palubicki et al. 2009, section 4.1).

s is the near field's shadow, a the bud's own part of it, C full light, and T the far field's
relative irradiance just above the near field, so that no leaf shades a bud twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from forest._jit import inline, njit, njit_parallel
from forest.environment.canopy import Canopy, CanopyField, coarse, frame_of, layers_above
from forest.environment.directions import make_perception, preferred_directions
from forest.environment.light_grid import (
    UNIT,
    ShadowField,
    ShadowGrid,
    place_in,
    propagate,
    window_of,
)
from forest.environment.obstacles import Box, Mesh, Solid, coarse_depth, solid_voxels, voxelise
from forest.environment.sky import sky_directions, sun_directions
from forest.environment.voxels import (
    HANDS,
    bound_blocks,
    count_buds,
    deal_blocks,
    site_voxel,
    wrap,
)
from forest.errors import InputError
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: The plot's rows are cut into this many slabs; each is filled by one thread.
SLABS = 16


@dataclass(frozen=True)
class ShadowSpec:
    """Parameters of the near field, named as in a scenario's `[environment.shadow]`."""

    a: float = 0.05
    b: float = 2.0
    q_max: int = 6
    full_light: float = 1.0
    voxel_m: float = 0.2
    direction: Literal["gradient", "least_shadow"] = "gradient"


@dataclass(frozen=True)
class CanopySpec:
    """Parameters of the far field, named as in a scenario's `[environment.canopy]`."""

    voxel_m: float = 1.0
    extinction: float = 0.5
    sky_directions: int = 17
    sun_positions: int = 8
    diffuse_share: float = 0.5


class LightSpecies(NamedTuple):
    """What the light needs to know of each species; arrays of one entry per species.

    Attributes
    ----------
    shade_factor : float64
        Multiple of a that a bud casts; kept to 1/16.
    leaf_area_m2 : float64
        Leaf area of a bud site, m^2; kept to 1 mm^2.
    perception_angle_deg, perception_distance_m : float64
        Full opening and length of a bud's perception cone.
    """

    shade_factor: NDArray[np.float64]
    leaf_area_m2: NDArray[np.float64]
    perception_angle_deg: NDArray[np.float64]
    perception_distance_m: NDArray[np.float64]


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


@inline
def _three(column: Any, row: Any) -> Any:
    """Take the three numbers of a row out of its array, for use in loops."""
    return column[row, 0], column[row, 1], column[row, 2]


@inline
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


@njit_parallel
def deposit(
    metamers: Any,
    trees: Any,
    blocks: Any,
    bounds: Any,
    plot: Any,
    near: Any,
    far: Any,
    units: Any,
) -> None:
    """Add all living buds to the near and far grids; each slab of rows belongs to one thread."""
    for slab in prange(SLABS):
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
    near_on = near.limit > 0
    far_on = far.ratio > 0
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
        if far_on:
            y = coarse(iy, frame.inverse) - frame.y
            x = coarse(ix, frame.inverse) - frame.x
            lower, upper, share = layers_above(frame, iz)
            low = transmission[lower, y, x]
            found = np.float64(low + share * (transmission[upper, y, x] - low))
        if near_on:
            z, y, x = place_in(window, ix, iy, iz)
            left = most - unit * shadow[z, y, x] if z >= 0 else most
            found *= max(left, 0.0)
        light[k] = np.float32(found)


@njit_parallel
def read_light(
    metamers: Any,
    trees: Any,
    blocks: Any,
    plot: Any,
    near: Any,
    far: Any,
    units: Any,
    full_light: Any,
) -> None:
    """Set `metamers.light` of every node; 0 where no bud lives."""
    for hand in prange(HANDS):
        for block in range(hand, len(blocks.tree), HANDS):
            tree = blocks.tree[block]
            own = near.unit * units.shade[trees.species[tree]] * near.weights[0]
            sites = (blocks.first[block], blocks.last[block])
            _read_block(metamers, trees, tree, sites, plot, near, far, full_light + own)


def _no_shadow() -> ShadowField:
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


def _no_canopy() -> CanopyField:
    """Stand in for the far field where there is none."""
    return CanopyField(
        np.zeros((1, 1, 1), np.int64),
        np.ones((1, 1, 1), np.float32),
        np.zeros(2, np.int64),
        0,
        0,
        0,
    )


def whole_voxels(length_m: float, voxel_m: float, *, exact: bool, what: str) -> int:
    """Count the voxels along an edge; on a torus they must fit."""
    n = length_m / voxel_m
    if exact and abs(n - round(n)) > 1e-6 * max(n, 1.0):
        raise InputError(
            f"{what} of {length_m:g} m does not hold whole voxels of {voxel_m:g} m",
            expected=f"{max(round(n), 1) * voxel_m:g} m",
        )
    return max(round(n) if exact else int(np.ceil(n - 1e-6)), 1)


class Light:
    """The light of a stand: near field, far field and obstacles behind one interface.

    Parameters
    ----------
    shadow : ShadowSpec or None
        Near field; None leaves Q = T.
    canopy : CanopySpec or None
        Far field; None leaves T = 1, the paper's model.
    size_m : (float, float)
        Plot, m; its corner stands at (0, 0).
    periodic : bool
        Whether the plot is a torus.
    voxel_m : float
        Edge of the near-field voxels in which the trees' bases are given, m.
    species : LightSpecies
    latitude_deg : float
        Latitude for the sun's places, degrees.
    obstacles : sequence of Box or Mesh
        Solids that cast shade.

    Raises
    ------
    InputError
        If voxels do not fit into one another or into a periodic plot, or a mesh is unusable.
    """

    def __init__(
        self,
        shadow: ShadowSpec | None,
        canopy: CanopySpec | None,
        *,
        size_m: tuple[float, float],
        periodic: bool,
        voxel_m: float,
        species: LightSpecies,
        latitude_deg: float = 50.0,
        obstacles: Sequence[Box | Mesh] = (),
    ) -> None:
        nx, ny = (
            whole_voxels(size_m[i], voxel_m, exact=periodic, what=f"plot size along {'xy'[i]}")
            for i in range(2)
        )
        self._shape = (nx, ny)
        self._periodic = periodic
        self._voxel_m = np.float32(voxel_m)
        #: Mask of the voxels that obstacles fill.
        self.solid: Solid = voxelise(obstacles, (nx, ny), periodic=periodic, voxel_m=voxel_m)
        self._solid_voxels = solid_voxels(self.solid)
        self._units = Units(
            np.rint(np.asarray(species.shade_factor) * UNIT).astype(np.uint16),
            np.rint(np.asarray(species.leaf_area_m2) * 1e6).astype(np.int32),
        )
        self._around = make_perception(
            np.asarray(species.perception_distance_m, np.float64),
            np.asarray(species.perception_angle_deg, np.float64),
            voxel_m,
        )
        self._full_light = shadow.full_light if shadow else 1.0
        self._mode = shadow.direction if shadow else "gradient"
        self._grid: ShadowGrid | None = None
        self._canopy: Canopy | None = None
        if shadow:
            self._grid = ShadowGrid(
                (nx, ny),
                periodic=periodic,
                a=shadow.a,
                b=shadow.b,
                q_max=shadow.q_max,
                full_light=shadow.full_light,
            )
            full = int(np.ceil(shadow.full_light * UNIT / shadow.a))
            self._solid_count = np.uint16(min(full, self._grid.limit))
        if canopy:
            self._canopy = self._make_canopy(
                canopy, size_m, voxel_m, shadow.q_max if shadow else 0, latitude_deg
            )

    def _make_canopy(
        self,
        spec: CanopySpec,
        size_m: tuple[float, float],
        voxel_m: float,
        lift: int,
        latitude_deg: float,
    ) -> Canopy:
        ratio = whole_voxels(spec.voxel_m, voxel_m, exact=True, what="canopy.voxel_m")
        for i in range(2):
            whole_voxels(
                size_m[i], spec.voxel_m, exact=self._periodic, what=f"plot size along {'xy'[i]}"
            )
        sky = sky_directions(spec.sky_directions)
        sun = sun_directions(spec.sun_positions, latitude_deg)
        share = spec.diffuse_share if len(sun) else 1.0
        weights = np.concatenate(
            (np.full(len(sky), share / len(sky)), np.full(len(sun), (1 - share) / max(len(sun), 1)))
        )
        return Canopy(
            self._shape,
            near_voxel_m=voxel_m,
            ratio=ratio,
            lift=lift,
            periodic=self._periodic,
            extinction=spec.extinction,
            directions=np.concatenate((sky, sun)),
            weights=weights,
        )

    def expose(self, metamers: Metamers, trees: Trees) -> None:
        """Rebuild both fields from the living buds and set `metamers.light` of every node."""
        blocks = deal_blocks(trees)
        bounds = bound_blocks(metamers, trees, blocks, self._voxel_m)
        occupied = bounds[bounds[:, 0] <= bounds[:, 1]]
        low = (
            occupied[:, 0::2].min(axis=0, initial=2**40) if len(occupied) else np.ones(3, np.int64)
        )
        high = occupied[:, 1::2].max(axis=0, initial=-(2**40)) if len(occupied) else 0 * low
        near = self._clear_near(low, high)
        far = self._clear_far(low, high)
        plot = self._cut_slabs(low, high, max(far.ratio, 1))
        deposit(metamers, trees, blocks, bounds, plot, near, far, self._units)
        if self._grid:
            propagate(near)
        if self._canopy:
            self._canopy.illuminate(coarse_depth(self._solid_voxels, far))
        read_light(metamers, trees, blocks, plot, near, far, self._units, self._full_light)

    def _clear_near(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> ShadowField:
        if self._grid is None:
            return _no_shadow()
        if len(self._solid_voxels):
            top = int(self._solid_voxels[:, 2].max())
            high = high.copy()
            high[2] = max(high[2], min(top, high[2] + self._grid.q_max))
        self._grid.clear(low, high)
        if len(self._solid_voxels):
            place = self._solid_voxels - self._grid.origin
            inside = np.all((place >= 0) & (place < self._grid.counts.shape[::-1]), axis=1)
            x, y, z = place[inside].T
            self._grid.counts[z, y, x] = self._solid_count
        return self._grid.field

    def _clear_far(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> CanopyField:
        if self._canopy is None:
            return _no_canopy()
        if len(self._solid_voxels):
            low = np.minimum(low, self._solid_voxels.min(axis=0))
            high = np.maximum(high, self._solid_voxels.max(axis=0))
        self._canopy.clear(low, high)
        return self._canopy.field

    def _cut_slabs(self, low: NDArray[np.int64], high: NDArray[np.int64], ratio: int) -> Plot:
        """Cut the rows into slabs of whole coarse voxels, so that no two threads share one."""
        nx, ny = self._shape
        first = 0 if self._periodic else int(low[1]) // ratio * ratio
        rows = ny if self._periodic else int(high[1]) + 1 - first
        slab = -(-max(rows, 1) // (SLABS * ratio)) * ratio
        return Plot(self._voxel_m, nx, ny, int(self._periodic), first, slab)

    def directions(
        self,
        species: NDArray[np.int16],
        voxel: NDArray[np.int32],
        heading: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        """Give each bud's direction of most light V in the field of the last `expose`.

        Parameters
        ----------
        species : int16 (n,)
        voxel : int32 (n, 3)
            Near-field voxel (ix, iy, iz) of each bud; need not be wrapped.
        heading : float32 (n, 3)
            Unit direction of each bud.

        Returns
        -------
        float32 (n, 3)
            Unit vectors; zero where no direction is better, or without a near field.
        """
        field = self._grid.field if self._grid else _no_shadow()
        return preferred_directions(
            field,
            self.solid,
            self._around,
            self._units.shade,
            species,
            voxel,
            heading,
            mode=self._mode,
        )

    def floor_light(self) -> float:
        """Mean relative irradiance at the ground of the plot, 0 to 1; 1 without a far field."""
        return self._canopy.floor_light() if self._canopy else 1.0
