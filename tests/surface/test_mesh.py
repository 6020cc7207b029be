"""The mesh's own figures, on solids whose figures are known."""

import numpy as np

from forest.surface.mesh import Mesh

_CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], np.float64)
_FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)], np.int32)


def _tetrahedron(shift: float = 0.0) -> Mesh:
    uv = np.tile(np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]), (4, 1, 1))
    return Mesh(_CORNERS + shift, _FACES, uv, {"order": np.arange(4, dtype=np.int32)})


def _torus() -> Mesh:
    n, k = 8, 6
    a, b = np.meshgrid(np.arange(n), np.arange(k), indexing="ij")
    big, small = 2.0 * np.pi * a / n, 2.0 * np.pi * b / k
    reach = 2.0 + 0.5 * np.cos(small)
    points = np.stack((reach * np.cos(big), reach * np.sin(big), 0.5 * np.sin(small)), axis=2)

    def at(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        return ((i % n) * k + j % k).ravel()

    low = np.column_stack((at(a, b), at(a + 1, b), at(a + 1, b + 1)))
    high = np.column_stack((at(a, b), at(a + 1, b + 1), at(a, b + 1)))
    faces = np.concatenate((low, high)).astype(np.int32)
    return Mesh(points.reshape(-1, 3), faces, np.zeros((len(faces), 3, 2)))


def test_volume_and_area() -> None:
    solid = _tetrahedron(shift=1e3)
    assert np.isclose(solid.volume, 1.0 / 6.0, rtol=1e-9)
    assert np.isclose(solid.area, 1.5 + 0.5 * np.sqrt(3.0))


def test_a_solid_is_watertight_until_a_face_is_lost_or_turned() -> None:
    solid = _tetrahedron()
    assert solid.is_watertight
    open_ = Mesh(solid.points, _FACES[:3], solid.uv[:3])
    assert not open_.is_watertight
    assert open_.edges_with_two_faces().sum() == 3
    turned = _FACES.copy()
    turned[0] = turned[0, ::-1]
    assert not Mesh(solid.points, turned, solid.uv).is_watertight
    assert not Mesh.together([]).is_watertight


def test_genus_counts_handles_of_each_part() -> None:
    parts = Mesh.together([_torus(), _tetrahedron(shift=5.0), _tetrahedron(shift=9.0)])
    assert parts.is_watertight
    assert parts.genus().tolist() == [1, 0, 0]
    assert np.bincount(parts.components()).tolist() == [96, 4, 4]
    assert parts.volume > 0.0


def test_normals_point_outward() -> None:
    solid = _tetrahedron()
    outward = np.sum(solid.normals() * (solid.points - solid.points.mean(axis=0)), axis=1)
    assert np.all(outward > 0.0)
    lone = Mesh(np.vstack((solid.points, (7.0, 7.0, 7.0))), _FACES, solid.uv)
    assert lone.normals()[-1].tolist() == [0.0, 0.0, 1.0]


def test_splitting_keeps_corners_and_their_coordinates() -> None:
    solid = Mesh.together([_tetrahedron(), _torus()])
    split = solid.split_at_seams()
    assert np.array_equal(split.source[split.triangles], solid.triangles)
    assert np.array_equal(split.uv[split.triangles], solid.uv)
    pairs = np.column_stack((split.source, split.uv))
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    assert len(split.source) > len(solid.points)


def test_together_keeps_what_all_have() -> None:
    both = Mesh.together([_tetrahedron(), _tetrahedron(2.0)])
    assert both.data["order"].tolist() == [0, 1, 2, 3] * 2
    assert Mesh.together([_torus(), _tetrahedron()]).data == {}
