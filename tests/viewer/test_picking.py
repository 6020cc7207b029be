"""What lies under the pointer, against the slow obvious way."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.viewer.picking import Ray, first_triangle, nearest_segment


def _slow(points: np.ndarray, triangles: np.ndarray, ray: Ray) -> tuple[int, float] | None:
    """Solve for the meeting point of each plane, and ask whether it lies inside."""
    best = None
    for k, corners in enumerate(points[triangles].astype(np.float64)):
        a, b, c = corners
        matrix = np.column_stack((b - a, c - a, -ray.direction))
        if abs(np.linalg.det(matrix)) < 1e-9:
            continue
        u, v, t = np.linalg.solve(matrix, ray.origin - a)
        if min(u, v) >= 0.0 and u + v <= 1.0 and t > 0.0 and (best is None or t < best[1]):
            best = (k, t)
    return best


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_the_first_triangle_is_found(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(30, 3)).astype(np.float32)
    triangles = random.permuted(np.tile(np.arange(30), (20, 1)), axis=1)[:, :3].astype(np.int32)
    direction = random.normal(size=3)
    ray = Ray(random.normal(size=3) * 3.0, direction / np.linalg.norm(direction))
    found, slow = first_triangle(points, triangles, ray), _slow(points, triangles, ray)
    if slow is None:
        assert found is None
    else:
        assert found is not None
        assert found[0] == slow[0]
        assert abs(found[1] - slow[1]) < 1e-6


def test_nothing_is_met_in_an_empty_scene() -> None:
    ray = Ray(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    none = np.zeros((0, 3))
    assert first_triangle(none.astype(np.float32), none.astype(np.int32), ray) is None
    assert nearest_segment(none, none, np.zeros(0), ray, 0.01) is None


def test_the_nearer_of_two_segments_is_meant_and_one_behind_is_not() -> None:
    ray = Ray(np.zeros(3), np.array([1.0, 0.0, 0.0]))
    start = np.array([[5.0, -1.0, 0.0], [3.0, 0.0, -1.0], [-2.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
    end = np.array([[5.0, 1.0, 0.0], [3.0, 0.0, 1.0], [-2.0, 1.0, 0.0], [1.0, 2.0, 1.0]])
    found = nearest_segment(start, end, np.full(4, 0.05), ray, 0.0)
    assert found is not None
    assert found[0] == 1
    np.testing.assert_allclose(found[1], 3.0)


def test_a_ray_meets_a_plane_before_it_only() -> None:
    ray = Ray(np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.6, -0.8]))
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(ray.on_plane(np.zeros(3), up), [0.0, 1.5, 0.0], atol=1e-12)
    assert ray.on_plane(np.array([0.0, 0.0, 5.0]), up) is None
    assert Ray(ray.origin, np.array([1.0, 0.0, 0.0])).on_plane(np.zeros(3), up) is None
