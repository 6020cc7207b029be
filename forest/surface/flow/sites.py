"""Sites of bark on a surface: where background and features stand, and the frame of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.random import STREAM_BARK_FLOW, normals, uniforms
from forest.surface.blend.field import Blend
from forest.surface.flow.cover import Cover
from forest.surface.flow.trails import Trails, grain, limb_heading, tangent, unit_normals
from forest.surface.mesh import Mesh
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Bark:
    """The surface that bark stands on.

    Attributes
    ----------
    skeleton : Skeleton
        The tree.
    blend : Blend
        Its surface.
    trails : Trails or None
        The grain; None: along the limbs.
    """

    skeleton: Skeleton
    blend: Blend
    trails: Trails | None

    def grain(self, points: _Floats) -> _Floats:
        """Give the direction of the grain (n, 3)."""
        if self.trails is None:
            along = limb_heading(self.blend, points)
            return tangent(along, unit_normals(self.blend, points))
        return grain(points, self.trails, self.blend)

    def data(self, points: _Floats) -> dict[str, NDArray[np.generic]]:
        """Give the per-point arrays that every mesh of a tree has."""
        on = self.blend.limb(points)
        wood = self.blend.limbs.internode(on.axis, on.along)
        return {
            "radius_m": on.radius.astype(np.float32),
            "order": self.skeleton.order[wood],
            "birth_year": self.skeleton.birth_year[wood],
            "tree_id": np.full(len(points), self.skeleton.tree_id, np.int32),
            "axis": on.axis,
        }


@dataclass(frozen=True)
class Sites:
    """Places of bark, each with a frame: along the grain, across it, outward.

    Attributes
    ----------
    place, normal, along, across : float64 (n, 3)
        Place in m and unit vectors.
    number : int64 (n,)
        Lasting numbers, for random draws.
    age : float64 (n,)
        Age of the bark, years.
    radius_m : float64 (n,)
        Of the limb.
    uv : float64 (n, 2)
        Around the girth from a side of the limb and along it from its base, m.
    spacing_m : float
        Distance of neighbours.
    """

    place: _Floats
    normal: _Floats
    along: _Floats
    across: _Floats
    number: _Ints
    age: _Floats
    radius_m: _Floats
    uv: _Floats
    spacing_m: float

    def __len__(self) -> int:
        """Count the sites."""
        return len(self.place)


def sites_of(bark: Bark, cover: Cover, *, year: int | None, age: float | None = None) -> Sites:
    """Make a site of each particle of a cover.

    `year` is the calendar year in which the tree is seen (by default that of its youngest
    internode); `age` gives all bark one age instead.
    """
    points = cover.place
    on = bark.blend.limb(points)
    along = bark.grain(points)
    born = bark.skeleton.birth_year[bark.blend.limbs.internode(on.axis, on.along)]
    seen = int(bark.skeleton.birth_year.max()) if year is None else year
    cones = bark.blend.limbs.cones
    heading = limb_heading(bark.blend, points)
    start = cones.start[on.cone]
    out = points - start - np.sum((points - start) * heading, axis=1, keepdims=True) * heading
    side, other = _limb_frame(heading)
    turn = np.arctan2(np.sum(out * other, axis=1), np.sum(out * side, axis=1))
    return Sites(
        place=points,
        normal=cover.normal,
        along=along,
        across=np.cross(along, cover.normal),
        number=cover.number,
        age=np.maximum(seen - born, 0).astype(np.float64)
        if age is None
        else np.full(len(born), age),
        radius_m=on.radius,
        uv=np.column_stack((turn * on.radius, on.along)),
        spacing_m=cover.spacing_m,
    )


def _limb_frame(heading: _Floats) -> tuple[_Floats, _Floats]:
    """Give two unit vectors across each heading, the first as near to x (or y) as can be."""
    pick = np.where(np.abs(heading[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    side = pick - np.sum(pick * heading, axis=1, keepdims=True) * heading
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return side, np.cross(heading, side)


def chances(seed: int, what: int, number: _Ints) -> _Floats:
    """Draw four numbers, uniform in (0, 1), for each site (n, 4)."""
    draws = [uniforms(seed, STREAM_BARK_FLOW, what, int(k), 0) for k in number]
    return np.array(draws, np.float64).reshape(-1, 4)


def twists(seed: int, what: int, number: _Ints) -> _Floats:
    """Draw a standard normal number for each site."""
    draws = [normals(seed, STREAM_BARK_FLOW, what, int(k), 1)[0] for k in number]
    return np.array(draws, np.float64)


def mesh_of(bark: Bark, points: _Floats, triangles: NDArray[np.int32], uv: _Floats) -> Mesh:
    """Make a mesh of points, triangles and texture coordinates of the points."""
    return Mesh(points, triangles.astype(np.int32), uv[triangles], bark.data(points))
