"""The working plane of a brush: through the picked metamer, parallel to the screen."""

from __future__ import annotations

import numpy as np
import pytest

from forest.errors import InputError
from forest.stand import Stand
from forest.view.working_plane import WorkingPlane
from tests.tiny import tiny


def test_rays_meet_the_plane_at_the_metamers_depth() -> None:
    stand = Stand(tiny())
    stand.step()
    tree = stand.skeleton(1)
    looks = np.array([0.3, -2.0, 0.4])
    plane = WorkingPlane.at(tree, int(tree.serial[1]), looks)
    np.testing.assert_array_equal(plane.point, tree.end[1])
    assert np.linalg.norm(plane.normal) == pytest.approx(1.0)
    eye = plane.point - 5.0 * plane.normal + [0.0, 0.0, 0.7]
    rays = np.random.default_rng(1).normal(size=(20, 3)) * 0.2 + plane.normal
    places = plane.meet(eye, rays)
    np.testing.assert_allclose((places - plane.point) @ plane.normal, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.cross(places - eye, rays), 0.0, atol=1e-9)
    straight = plane.meet(plane.point - 3.0 * plane.normal, plane.normal)
    np.testing.assert_allclose(straight, plane.point)
    along = np.cross(plane.normal, [0.0, 0.0, 1.0])
    assert np.isnan(plane.meet(eye, along)).all()


def test_a_metamer_and_a_direction_are_needed() -> None:
    tree = Stand(tiny()).skeleton(1)
    with pytest.raises(InputError, match="has no metamer 99"):
        WorkingPlane.at(tree, 99, [1, 0, 0])
    with pytest.raises(InputError, match="is no direction"):
        WorkingPlane.at(tree, int(tree.serial[0]), [0, 0, 0])
