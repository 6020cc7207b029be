"""A triangle mesh of a tree's surface, closed, with texture coordinates in metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

_Floats = NDArray[np.float64]
_Indices = NDArray[np.int32]

#: Per-point arrays that every surface of a tree has, and their types.
POINT_DATA = {
    "radius_m": np.float32,
    "order": np.int32,
    "birth_year": np.int32,
    "tree_id": np.int32,
    "axis": np.int32,
}


class Split(NamedTuple):
    """A mesh whose points are doubled at seams, as viewers of textures want it.

    Attributes
    ----------
    source : int32 (k,)
        Index of each point in the mesh it was made of.
    triangles : int32 (m, 3)
        Indices of these points.
    uv : float64 (k, 2)
        Texture coordinates of each, m.
    """

    source: _Indices
    triangles: _Indices
    uv: _Floats


@dataclass(frozen=True)
class Mesh:
    """Triangles between points.

    Attributes
    ----------
    points : float64 (n, 3)
        m, z up, in the plot's coordinates.
    triangles : int32 (m, 3)
        Corners, anticlockwise seen from outside.
    uv : float64 (m, 3, 2)
        Texture coordinates of each corner, m: u around the girth from a seam, v along the axis
        from its base. They belong to corners, so that a seam doubles no point.
    data : dict of str to array (n,)
        What is known of each point. Those made of skeletons have all of `POINT_DATA`: radius_m
        (float32) of the wood there, order, birth_year, tree_id and axis (int32) of the limb.
    """

    points: _Floats
    triangles: _Indices
    uv: _Floats
    data: dict[str, NDArray[np.generic]] = field(default_factory=dict)

    @classmethod
    def together(cls, meshes: Sequence[Mesh]) -> Mesh:
        """Put meshes side by side in one, with the arrays of points that all of them have."""
        if not meshes:
            return cls(
                np.empty((0, 3)),
                np.empty((0, 3), np.int32),
                np.empty((0, 3, 2)),
                {name: np.empty(0, kind) for name, kind in POINT_DATA.items()},
            )
        first = np.cumsum([0, *(len(mesh.points) for mesh in meshes[:-1])])
        shared = [name for name in meshes[0].data if all(name in mesh.data for mesh in meshes)]
        return cls(
            np.concatenate([mesh.points for mesh in meshes]),
            np.concatenate(
                [mesh.triangles + np.int32(k) for mesh, k in zip(meshes, first, strict=True)]
            ),
            np.concatenate([mesh.uv for mesh in meshes]),
            {name: np.concatenate([mesh.data[name] for mesh in meshes]) for name in shared},
        )

    @property
    def volume(self) -> float:
        """Enclosed volume, m3 (the divergence theorem); parts that overlap count twice."""
        if not len(self.points):
            return 0.0
        a, b, c = self._corners(self.points - self.points.mean(axis=0))
        return float(np.sum(a * np.cross(b, c)) / 6.0)

    @property
    def area(self) -> float:
        """Area of all triangles, m2."""
        return float(0.5 * np.sum(np.linalg.norm(self.face_normals(), axis=1)))

    @property
    def is_watertight(self) -> bool:
        """Whether every edge has two faces that agree on what is outside."""
        return len(self.triangles) > 0 and bool(np.all(self.edges_with_two_faces()))

    def edges_with_two_faces(self) -> NDArray[np.bool_]:
        """Tell of each edge whether just two faces meet there, one running along it each way."""
        edge, turned = self._edges()
        _, first, count = np.unique(edge, return_index=True, return_counts=True)
        # Edges are sorted, so that `first` starts each edge's run; ways cancel in a good pair.
        ways = np.add.reduceat(np.where(turned, -1, 1), first) if len(first) else first
        return np.asarray((count == 2) & (ways == 0), np.bool_)

    def edges(self) -> NDArray[np.int64]:
        """Points at the ends of each edge, (e, 2), in the order of `edges_with_two_faces`."""
        return np.column_stack(np.divmod(np.unique(self._edges()[0]), max(len(self.points), 1)))

    def components(self) -> NDArray[np.int32]:
        """Number the connected parts, from 0: the part of each triangle, (m,)."""
        a, b, _ = self.triangles.T
        links = np.concatenate((self.triangles[:, :2], self.triangles[:, 1:]))
        n = len(self.points)
        graph = coo_array((np.ones(len(links), np.bool_), (links[:, 0], links[:, 1])), (n, n))
        part = connected_components(graph, directed=False)[1][a] if len(b) else a
        return np.unique(part, return_inverse=True)[1].reshape(-1).astype(np.int32)

    def genus(self) -> NDArray[np.int64]:
        """Count the handles of each connected part: 0 for what can be blown up to a ball.

        From Euler's formula, points - edges + faces = 2 - 2 genus, which holds where the part is
        watertight.
        """
        part = self.components()
        parts = int(part.max(initial=-1)) + 1
        faces = np.bincount(part, minlength=parts)
        of_point = np.full(len(self.points), -1)
        of_point[self.triangles.ravel()] = np.repeat(part, 3)
        points = np.bincount(of_point[of_point >= 0], minlength=parts)
        edge = np.unique(self._edges()[0])
        edges = np.bincount(of_point[edge // max(len(self.points), 1)], minlength=parts)
        return np.asarray((2 - (points - edges + faces)) // 2, np.int64)

    def face_normals(self) -> _Floats:
        """Normals (m, 3) of the triangles, outward, as long as twice their area in m2."""
        a, b, c = self._corners(self.points)
        return np.asarray(np.cross(b - a, c - a), np.float64)

    def normals(self) -> _Floats:
        """Unit normals (n, 3) of the points, outward: those of their faces, weighted by angle.

        A point of no face has the normal (0, 0, 1).
        """
        corners = self._corners(self.points)
        face = self.face_normals()
        face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300)
        total = np.zeros((len(self.points), 3))
        for k in range(3):
            ahead, back = corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]
            across = np.linalg.norm(np.cross(ahead, back), axis=1)
            angle = np.arctan2(across, np.sum(ahead * back, axis=1))
            for j in range(3):
                total[:, j] += np.bincount(
                    self.triangles[:, k], angle * face[:, j], minlength=len(total)
                )
        length = np.linalg.norm(total, axis=1, keepdims=True)
        none = length[:, 0] < 1e-12
        total[none] = (0.0, 0.0, 1.0)
        return np.asarray(total / np.where(none[:, None], 1.0, length), np.float64)

    def split_at_seams(self) -> Split:
        """Double the points whose corners differ in texture coordinates.

        Returns
        -------
        Split
            The mesh's own points come first, in their order, each with the coordinates of one of
            its corners; then those that were doubled.
        """
        n = len(self.points)
        corner = self.triangles.reshape(-1)
        uv = self.uv.reshape(-1, 2)
        own = np.zeros((n, 2))
        own[corner[::-1]] = uv[::-1]
        odd = np.flatnonzero(np.any(uv != own[corner], axis=1))
        keys = np.column_stack((corner[odd].astype(np.float64), uv[odd]))
        extra, which = np.unique(keys, axis=0, return_inverse=True)
        triangles = corner.copy()
        triangles[odd] = n + which.reshape(-1)
        return Split(
            np.concatenate((np.arange(n), extra[:, 0])).astype(np.int32),
            triangles.reshape(-1, 3).astype(np.int32),
            np.concatenate((own, extra[:, 1:])),
        )

    def _corners(self, points: _Floats) -> tuple[_Floats, _Floats, _Floats]:
        a, b, c = self.triangles.T
        return points[a], points[b], points[c]

    def _edges(self) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Name each face's edges by one number, sorted, and tell which run from high to low."""
        start = self.triangles.reshape(-1).astype(np.int64)
        end = np.roll(self.triangles, -1, axis=1).reshape(-1).astype(np.int64)
        edge = np.minimum(start, end) * len(self.points) + np.maximum(start, end)
        order = np.argsort(edge, kind="stable")
        return edge[order], (start > end)[order]
