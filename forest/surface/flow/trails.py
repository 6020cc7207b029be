"""The trails of particles, and the grain of the bark that they draw on the surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest.surface.blend.field import Blend
from forest.surface.mesh import Mesh

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

#: Points of trails that count for the grain at a place.
NEIGHBOURS = 12
#: A particle that moves less than this between two points of its trail has no direction, m.
_STILL = 1e-7


@dataclass(frozen=True)
class Trails:
    """The ways of particles over a surface, one after the other.

    Attributes
    ----------
    place : float64 (n, 3)
        Points, m.
    time_s : float64 (n,)
        When the particle was there, s of the flow.
    limb : int32 (n,)
        Axis that it was on.
    off_m : float64 (n,)
        How far from the surface it was, m.
    first : int64 (trails + 1,)
        First point of each trail.
    mother : int64 (trails,)
        Particle ahead of which it was put into the chain; -1 for those of the first ring.
    particle : int64 (trails,)
        Number of the particle.
    """

    place: _Floats
    time_s: _Floats
    limb: NDArray[np.int32]
    off_m: _Floats
    first: _Ints
    mother: _Ints
    particle: _Ints

    def __len__(self) -> int:
        """Count the trails."""
        return len(self.first) - 1

    def polylines(self, *, least_points: int = 2) -> list[_Floats]:
        """Give each trail's points, float64 (k, 3), of those long enough."""
        parts = np.split(self.place, self.first[1:-1])
        return [part for part in parts if len(part) >= least_points]

    @cached_property
    def heading(self) -> _Floats:
        """Unit direction of each point's trail there (n, 3); 0 where the particle stood still."""
        before = np.arange(-1, len(self.place) - 1)
        after = before + 2
        before[self.first[:-1]] = self.first[:-1]
        after[self.first[1:] - 1] = self.first[1:] - 1
        way = self.place[after] - self.place[before]
        size = np.linalg.norm(way, axis=1, keepdims=True)
        return np.asarray(np.where(size > _STILL, way / np.maximum(size, _STILL), 0.0))

    @cached_property
    def _tree(self) -> tuple[_Ints, cKDTree]:
        moving = np.flatnonzero(np.any(self.heading != 0.0, axis=1))
        return moving, cKDTree(self.place[moving])


def tangent(vectors: _Floats, normals: _Floats) -> _Floats:
    """Turn vectors (n, 3) into unit tangents; 0 where one is at right angles to the surface."""
    flat = vectors - np.sum(vectors * normals, axis=1, keepdims=True) * normals
    size = np.linalg.norm(flat, axis=1, keepdims=True)
    return np.asarray(np.where(size > 1e-9, flat / np.maximum(size, 1e-9), 0.0))


def limb_heading(blend: Blend, points: _Floats) -> _Floats:
    """Give the heading (n, 3) of the limb nearest to each point."""
    cones = blend.limbs.cones
    which = blend.limb(points).cone
    line = cones.end[which] - cones.start[which]
    return np.asarray(line / np.linalg.norm(line, axis=1, keepdims=True))


def unit_normals(blend: Blend, points: _Floats) -> _Floats:
    """Give the surface's unit normals (n, 3)."""
    slope = blend.gradient(points)
    return np.asarray(slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12))


def grain(
    where: Mesh | _Floats, trails: Trails, blend: Blend, *, reach_m: float = np.inf
) -> _Floats:
    """Give the direction of the grain at a mesh's points, or at any points on the surface.

    The mean of the nearest points of trails, weighted so that it changes without jumps. Points
    farther than the limb is thick do not count, nor those where particles slid back; where none
    is left, the grain is the direction of the limb.

    Parameters
    ----------
    where : Mesh or float64 (n, 3)
        Places on the surface, m.
    trails : Trails
        The trails of a flow over this surface.
    blend : Blend
        The surface.
    reach_m : float
        Farthest point of a trail that counts, m.

    Returns
    -------
    float64 (n, 3)
        Unit tangents.
    """
    points = where.points if isinstance(where, Mesh) else np.asarray(where, np.float64)
    normals = unit_normals(blend, points)
    along = tangent(limb_heading(blend, points), normals)
    moving, tree = trails._tree
    k = min(NEIGHBOURS + 1, len(moving))
    if k < 2 or len(points) == 0:
        return along
    away, near = tree.query(points, k=k, distance_upper_bound=reach_m)
    radius = np.where(np.isfinite(away[:, -1]), away[:, -1], reach_m)[:, None]
    weight = np.maximum(1.0 - (away / np.maximum(radius, 1e-12)) ** 2, 0.0) ** 2
    weight[~np.isfinite(away)] = 0.0
    ways = trails.heading[moving[np.minimum(near, len(moving) - 1)]]
    thick = 2.0 * blend.limb(points).radius[:, None]  # what is farther is on another limb
    backward = np.einsum("nkx,nx->nk", ways, along) < 0.0  # a hanging chain slides back
    weight[backward | (away > thick)] = 0.0
    mean = tangent(np.einsum("nk,nkx->nx", weight, ways), normals)
    return np.asarray(np.where(np.any(mean != 0.0, axis=1, keepdims=True), mean, along))


def angle_to_limb(directions: _Floats, points: _Floats, blend: Blend) -> _Floats:
    """Give the angle (n,) between directions on the surface and the limb there, degrees.

    The limb's heading is taken along the surface; positive leans to the right, seen from outside.
    """
    normals = unit_normals(blend, points)
    along = tangent(limb_heading(blend, points), normals)
    right = np.cross(along, normals)
    ahead = np.sum(directions * along, axis=1)
    return np.asarray(np.degrees(np.arctan2(np.sum(directions * right, axis=1), ahead)))
