"""The light of a stand: near field, far field and obstacles behind one interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.environment.canopy import Canopy, CanopyField
from forest.environment.directions import make_perception, preferred_directions
from forest.environment.light_grid import UNIT, ShadowField, ShadowGrid, propagate
from forest.environment.obstacles import Box, Mesh, Solid, coarse_depth, solid_voxels, voxelise
from forest.environment.plant_area import PlantArea
from forest.environment.site_light import (
    SLABS,
    Plot,
    Units,
    deposit,
    no_canopy,
    no_shadow,
    read_light,
)
from forest.environment.sky import sky_directions, sun_directions
from forest.environment.standing import StandingLeaves
from forest.environment.voxels import bound_blocks, deal_blocks
from forest.errors import InputError
from forest.trees.buds import Shoots
from forest.trees.metamers import Metamers
from forest.trees.table import Trees


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
        # A torus wraps at whole voxels; without fields and solids nothing is looked up in them.
        fits = periodic and bool(shadow or canopy or obstacles)
        nx, ny = (
            whole_voxels(size_m[i], voxel_m, exact=fits, what=f"plot size along {'xy'[i]}")
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

    def expose(
        self,
        metamers: Metamers,
        trees: Trees,
        others: PlantArea | None = None,
        standing: StandingLeaves | None = None,
    ) -> None:
        """Rebuild both fields from the living buds and set `metamers.light` of every node.

        `others` shades in the far field alone, `standing` in the near field alone.
        """
        blocks = deal_blocks(trees)
        bounds = bound_blocks(metamers, trees, blocks, self._voxel_m)
        occupied = bounds[bounds[:, 0] <= bounds[:, 1]]
        low = (
            occupied[:, 0::2].min(axis=0, initial=2**40) if len(occupied) else np.ones(3, np.int64)
        )
        high = occupied[:, 1::2].max(axis=0, initial=-(2**40)) if len(occupied) else 0 * low
        near = self._clear_near(low, high, standing)
        far = self._clear_far(low, high, others)
        plot = self._cut_slabs(low, high, max(far.ratio, 1))
        deposit(metamers, trees, blocks, bounds, plot, near, far, self._units)
        if others is not None:
            others.add_to(far, self._shape)
        if self._grid:
            propagate(near)
        if self._canopy:
            self._canopy.illuminate(coarse_depth(self._solid_voxels, far))
        read_light(metamers, trees, blocks, plot, near, far, self._units, self._full_light)

    def _clear_near(
        self, low: NDArray[np.int64], high: NDArray[np.int64], standing: StandingLeaves | None
    ) -> ShadowField:
        if self._grid is None:
            return no_shadow()
        if standing is not None and np.all(low <= high):
            reach = self._grid.q_max + int(np.abs(self._around.offset).max(initial=1))
            low, high = standing.widen(low, high, reach, self._periodic)
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
        if standing is not None:
            standing.add_to(self._grid.field, self._shape)
        return self._grid.field

    def _clear_far(
        self, low: NDArray[np.int64], high: NDArray[np.int64], others: PlantArea | None
    ) -> CanopyField:
        if self._canopy is None:
            return no_canopy()
        if len(self._solid_voxels):
            low = np.minimum(low, self._solid_voxels.min(axis=0))
            high = np.maximum(high, self._solid_voxels.max(axis=0))
        if others is not None and len(others.voxel):
            low = np.minimum(low, others.voxel.min(axis=0))
            high = np.maximum(high, others.voxel.max(axis=0))
        self._canopy.clear(low, high)
        return self._canopy.field

    def _cut_slabs(self, low: NDArray[np.int64], high: NDArray[np.int64], ratio: int) -> Plot:
        """Cut the rows into slabs of whole coarse voxels, so that no two threads share one."""
        nx, ny = self._shape
        first = 0 if self._periodic else int(low[1]) // ratio * ratio
        rows = ny if self._periodic else int(high[1]) + 1 - first
        slab = -(-max(rows, 1) // (SLABS * ratio)) * ratio
        return Plot(self._voxel_m, nx, ny, int(self._periodic), first, slab)

    def directions(self, metamers: Metamers, trees: Trees, shoots: Shoots) -> NDArray[np.float32]:
        """Give each shooting bud's direction of most light V in the field of the last `expose`.

        Returns
        -------
        float32 (n, 3)
            Unit vectors; zero where no direction is better, or without a near field.
        """
        if self._grid is None:
            return np.zeros((len(shoots.metamer), 3), np.float32)
        return preferred_directions(
            metamers,
            trees,
            shoots,
            self._grid.field,
            self.solid,
            self._around,
            self._units.shade,
            self._voxel_m,
            mode=self._mode,
        )

    @property
    def canopy(self) -> Canopy | None:
        """The far field."""
        return self._canopy

    def floor_light(self) -> float:
        """Mean relative irradiance at the ground of the plot, 0 to 1; NaN without a far field."""
        return self._canopy.floor_light() if self._canopy else float("nan")
