"""Light, markers and the light's own view, taken from a stand."""

from __future__ import annotations

import numpy as np
import pytest

from forest.environment.marker_places import free_markers
from forest.environment.markers import Envelope, MarkerSpace
from forest.errors import InputError
from forest.stand import Stand
from forest.viewer.inside import (
    LIGHT_COLOURS,
    LightView,
    exposed,
    light_slice,
    markers_around,
    view_from_light,
)
from tests.reference.markers import marker_of_cell
from tests.tiny import assert_same_state, steps, tiny


@pytest.fixture(scope="module")
def stand() -> Stand:
    grown = Stand(tiny())
    steps(grown, 5)
    return grown


def test_looking_leaves_the_stand_as_it_is(stand: Stand) -> None:
    before = Stand.restore(stand.scenario, *stand.state())
    copy = exposed(stand)
    light_slice(copy, 1.0)
    view_from_light(copy)
    assert_same_state(stand, before)


def test_slices_are_the_far_field_and_full_light_above_it(stand: Stand) -> None:
    copy = exposed(stand)
    canopy = copy.surroundings.canopy
    assert canopy is not None
    low = light_slice(copy, 0.2)
    np.testing.assert_array_equal(low.light, canopy.transmission[0])
    assert low.light.min() < 1.0
    assert (light_slice(copy, 500.0).light == 1.0).all()
    with pytest.raises(InputError, match="no markers"):
        markers_around(copy, None)


def test_the_light_sees_some_leaves_and_no_more_than_all(stand: Stand) -> None:
    copy = exposed(stand)
    seen = view_from_light(copy)
    assert 0.0 < seen.share <= 1.1  # leaves between the pixels may count as whole
    again = view_from_light(exposed(stand))
    np.testing.assert_array_equal(seen.image, again.image)
    assert (view_from_light(copy, 1).toward != seen.toward).any()
    colours = {
        by: len(np.unique(_of(view_from_light(copy, by=by)), axis=0)) for by in LIGHT_COLOURS
    }
    assert colours["leaf"] > colours["tree"] > 2
    assert set(seen.lit) == set(copy.rows.tree_id.tolist())
    assert set(np.unique(seen.tree_id)) - {0} <= set(seen.lit)


def _of(seen: LightView) -> np.ndarray:
    return seen.image.reshape(-1, 3)


def test_rendered_light_is_what_the_picture_shows() -> None:
    """Of one picture a year, leaves' light is the share of them that the picture shows."""
    grown = Stand(tiny("environment={rendered={directions=1}}"))
    steps(grown, 4)
    copy = exposed(grown)
    picture = copy.surroundings.picture(copy.arena.metamers, copy.rows, copy.steps)
    for start, size in zip(copy.rows.start, copy.rows.size, strict=True):
        here = slice(start, start + size)
        np.testing.assert_array_equal(picture.share[here], copy.arena.metamers.light[here])
    assert picture.share.max() > 0.0


def test_all_markers_of_a_box_are_listed() -> None:
    space = MarkerSpace(7, 0.25, (2.0, 2.0), True, True)
    points, step = free_markers(space, np.zeros(3), np.array([1.99, 1.99, 0.99]), 10_000)
    cell = space.cell_m
    wanted = [
        marker_of_cell(7, i, j, k, cell) for i in range(8) for j in range(8) for k in range(4)
    ]
    assert step == 1
    np.testing.assert_allclose(sorted(map(tuple, points)), sorted(wanted), atol=1e-12)


def test_envelopes_bound_markers_and_those_gone_are_left_out() -> None:
    ball = Envelope("ellipsoid", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))
    cloud = np.array([(0.5, 0.5, 0.5), (0.6, 0.5, 0.5)])
    space = MarkerSpace(7, 0.1, (2.0, 2.0), False, False, [ball], cloud)
    points, _ = free_markers(space, np.zeros(3), np.full(3, 2.0), 1_000_000)
    inside = np.linalg.norm(points - 1.0, axis=1) <= 0.5
    assert inside.sum() > 300
    np.testing.assert_array_equal(points[~inside], cloud)
    state = space.state()
    low = np.zeros(3, np.int64)
    gone = np.zeros((6, 6, 6), np.uint64)
    gone[2:4] = np.uint64(2**64 - 1)
    space.restore({"gone": gone, "gone_low": low, "cloud_gone": np.array([1, 0], np.uint8)})
    left, _ = free_markers(space, np.zeros(3), np.full(3, 2.0), 1_000_000)
    assert len(left) == 1 + (inside & ((points[:, 2] < 0.8) | (points[:, 2] >= 1.6))).sum()
    assert (left == cloud[1]).all(axis=1).any()
    assert not (left == cloud[0]).all(axis=1).any()
    assert state["gone"].size == 0
