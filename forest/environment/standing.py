"""Trees that stand and do not grow: their leaves shade near and far, their parts take markers.

What they are is gathered once into voxels and points, since it is the same every year.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from forest.environment.light_grid import UNIT, ShadowField
from forest.environment.plant_area import PlantArea


class StandingLeaves(NamedTuple):
    """Leaves by near-field voxels; a voxel may be there several times.

    Attributes
    ----------
    voxel : int64 (n, 3)
        Near-field voxels (x, y, z), not wrapped.
    area_mm2 : int64 (n,)
        Leaf area in each, whole square millimetres.
    shade : int64 (n,)
        What each counts in the near field, in units of 1/16 of a bud of shade factor 1.
    """

    voxel: NDArray[np.int64]
    area_mm2: NDArray[np.int64]
    shade: NDArray[np.int64]

    @classmethod
    def at(
        cls,
        place_m: NDArray[np.float64],
        area_m2: NDArray[np.float64],
        voxel_m: float,
        buds_per_m2: float,
    ) -> Self:
        """Gather one tree's leaves.

        Parameters
        ----------
        place_m : float64 (n, 3)
            Where the leaves are.
        area_m2 : float64 (n,)
        voxel_m : float
            Edge of a near-field voxel, m.
        buds_per_m2 : float
            Buds of shade factor 1 that a square metre of leaves shades as.
        """
        if not len(place_m):
            none = np.zeros(0, np.int64)
            return cls(np.zeros((0, 3), np.int64), none, none)
        voxel = np.floor(place_m / voxel_m).astype(np.int64)
        low = voxel.min(axis=0)
        shape = tuple(voxel.max(axis=0) - low + 1)
        flat = np.ravel_multi_index(tuple((voxel - low).T), shape)
        key, of = np.unique(flat, return_inverse=True)
        area = np.bincount(of, weights=area_m2)
        return cls(
            np.column_stack(np.unravel_index(key, shape)).astype(np.int64) + low,
            np.rint(area * 1e6).astype(np.int64),
            np.rint(area * (buds_per_m2 * UNIT)).astype(np.int64),
        )

    @property
    def plant_area(self) -> PlantArea:
        """The leaves as the far field takes them."""
        return PlantArea(self.voxel, self.area_mm2)

    def widen(
        self, low: NDArray[np.int64], high: NDArray[np.int64], reach: int, periodic: bool
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Widen a box of voxels, ends included, to the leaves that are seen from within it.

        `reach` is how far they are, in voxels along each axis; a torus sees all of a layer.
        """
        axes = slice(2, 3) if periodic else slice(0, 3)
        voxel = self.voxel[:, axes]
        seen = np.all((voxel >= low[axes] - reach) & (voxel <= high[axes] + reach), axis=1)
        if not seen.any():
            return low, high
        low, high = low.copy(), high.copy()
        low[axes] = np.minimum(low[axes], voxel[seen].min(axis=0))
        high[axes] = np.maximum(high[axes], voxel[seen].max(axis=0))
        return low, high

    def add_to(self, near: ShadowField, shape: tuple[int, int]) -> None:
        """Add what lies inside a near field to its counts, which saturate.

        `shape` is the plot's, in voxels along x and y.
        """
        voxel = self.voxel
        if near.periodic:
            voxel = np.column_stack((voxel[:, :2] % shape, voxel[:, 2]))
        place = voxel - near.origin
        inside = np.all((place >= 0) & (place < near.counts.shape[::-1]), axis=1)
        x, y, z = place[inside].T
        if not len(x):
            return
        index = np.ravel_multi_index((z, y, x), near.counts.shape)
        flat, of = np.unique(index, return_inverse=True)
        more = np.zeros(len(flat), np.int64)
        np.add.at(more, of, self.shade[inside])
        counts = near.counts.reshape(-1)
        counts[flat] = np.minimum(counts[flat] + more, near.limit)


class StandingSites(NamedTuple):
    """Points that take all markers around them, as living buds do.

    Attributes
    ----------
    point : float64 (n, 3)
        Places, m, not wrapped.
    kind : int64 (n,)
        Index into `radius_m`.
    radius_m : float64 (kinds,)
        How far a point takes markers.
    """

    point: NDArray[np.float64]
    kind: NDArray[np.int64]
    radius_m: NDArray[np.float64]

    @classmethod
    def along(
        cls,
        start: NDArray[np.float64],
        end: NDArray[np.float64],
        wood_radius_m: NDArray[np.float64],
        leaves: NDArray[np.float64],
        radius_m: float,
    ) -> Self:
        """Set points along wood and at leaves.

        Parameters
        ----------
        start, end : float64 (n, 3)
            Ends of internodes, m.
        wood_radius_m : float64 (n,)
            Their radius, which is added to the points' own, rounded to halves of that.
        leaves : float64 (m, 3)
            Places of leaves, m.
        radius_m : float
            How far a living bud takes markers.

        Notes
        -----
        Points along an internode are no farther apart than half of `radius_m`, and one stands for
        all others of its kind in a cube of that edge.
        """
        half = 0.5 * radius_m
        pieces = np.maximum(np.ceil(np.linalg.norm(end - start, axis=1) / half), 1).astype(np.int64)
        of = np.repeat(np.arange(len(start)), pieces)
        number = np.arange(len(of)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        share = ((number + 1) / pieces[of])[:, None]
        wood = start[of] + share * (end[of] - start[of])
        halves = np.rint(wood_radius_m / half).astype(np.int64)
        point = np.concatenate((wood, leaves))
        kind = np.concatenate((halves[of], np.zeros(len(leaves), np.int64)))
        cell = np.column_stack((kind, np.floor(point / half).astype(np.int64)))
        cell -= cell.min(axis=0)
        flat = np.ravel_multi_index(tuple(cell.T), tuple(cell.max(axis=0) + 1))
        _, first = np.unique(flat, return_index=True)
        first.sort()
        known, index = np.unique(kind[first], return_inverse=True)
        return cls(
            point[first], index.astype(np.int64), np.asarray(radius_m + half * known, np.float64)
        )


class Standing(NamedTuple):
    """What stands and does not grow: `leaves` shade, `sites` take markers, where there are any."""

    leaves: StandingLeaves
    sites: StandingSites | None


def together(parts: Sequence[Standing]) -> Standing | None:
    """Put several trees together, all with sites or all without; None if there are none."""
    if not parts:
        return None
    leaves = StandingLeaves(
        np.concatenate([part.leaves.voxel for part in parts]),
        np.concatenate([part.leaves.area_mm2 for part in parts]),
        np.concatenate([part.leaves.shade for part in parts]),
    )
    sites = [part.sites for part in parts if part.sites is not None]
    if not sites:
        return Standing(leaves, None)
    first = np.cumsum([0, *(len(one.radius_m) for one in sites)])
    return Standing(
        leaves,
        StandingSites(
            np.concatenate([one.point for one in sites]),
            np.concatenate([one.kind + k for one, k in zip(sites, first[:-1], strict=True)]),
            np.concatenate([one.radius_m for one in sites]),
        ),
    )
