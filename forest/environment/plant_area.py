"""Plant area that shades from afar and is no living bud: dead stems and their branches."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from forest.environment.canopy import CanopyField


class PlantArea(NamedTuple):
    """Plant area at places in space.

    Attributes
    ----------
    voxel : int64 (n, 3)
        Near-field voxels (x, y, z); on a torus any, on an open plot also outside the plot.
    area_mm2 : int64 (n,)
        Area in each, counted as that of leaves: half of the surface. Whole square millimetres,
        so that the order of summation does not matter.
    """

    voxel: NDArray[np.int64]
    area_mm2: NDArray[np.int64]

    @classmethod
    def at(cls, place_m: NDArray[np.float64], area_m2: NDArray[np.float64], voxel_m: float) -> Self:
        """Put areas, m2 (n,), at places, m (n, 3), of the plot."""
        voxel = np.floor(place_m / voxel_m).astype(np.int64)
        return cls(voxel, np.rint(area_m2 * 1e6).astype(np.int64))

    def joined(self, more: PlantArea | None) -> PlantArea:
        """Put both together."""
        if more is None:
            return self
        return PlantArea(
            np.concatenate((self.voxel, more.voxel)), np.concatenate((self.area_mm2, more.area_mm2))
        )

    def add_to(self, far: CanopyField, shape: tuple[int, int]) -> None:
        """Add the areas to a far field that has room for them.

        Parameters
        ----------
        far : CanopyField
        shape : (int, int)
            Near-field voxels of the plot along x and y.
        """
        if far.ratio == 0:
            return
        voxel = self.voxel
        if far.periodic:
            voxel = np.column_stack((voxel[:, :2] % shape, voxel[:, 2]))
        x, y, z = (voxel // far.ratio).T
        np.add.at(far.leaf, (np.maximum(z, 0), y - far.origin[1], x - far.origin[0]), self.area_mm2)
