"""Discs of known rings, and knots cut out of known cones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from forest.dendro.cores import bore
from forest.dendro.disc import CORNERS, Disc
from forest.dendro.knots import cone_outlines
from forest.dendro.section import plane_of
from forest.dendro.turns import shortest_turn, unit
from forest.errors import InputError
from tests.reference.discs import in_cones, in_polygon, reach

from .test_cores import one_stem, rings, stem_of


def area(outline):
    x, y = outline.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def test_a_round_disc_by_hand():
    disc = Disc.of(one_stem([4, 0, 6]), 0.2)
    assert disc.radius == pytest.approx(0.010)
    assert disc.bark_thickness == pytest.approx(0.0025)  # a fifth of 25 mm over bark, on two sides
    assert disc.years.tolist() == [2001, 2002, 2003]
    assert disc.cambial_ages.tolist() == [1, 2, 3]
    assert disc.ring_areas == pytest.approx(np.pi * np.array([16, 0, 84]) * 1e-6)
    np.testing.assert_array_equal(disc.outlines[0], disc.outlines[1])  # the missing ring
    assert np.hypot(*disc.bark_outline.T) == pytest.approx(0.0125)
    assert np.hypot(*disc.outlines[2].T) == pytest.approx(0.010)
    assert disc.widths_at(123.0) == pytest.approx([0.004, 0, 0.006])


def test_wood_that_was_there_before_the_record():
    stem = one_stem([2, 1])._replace(undated_mm=5.0)
    disc = Disc.of(stem, 0.1)
    assert disc.radii == pytest.approx([0.007, 0.008])
    assert np.hypot(*disc.undated_outline.T) == pytest.approx(0.005)
    assert disc.ring_areas.sum() + np.pi * 0.005**2 == pytest.approx(disc.area)
    assert disc.widths_at(0.0) == pytest.approx([0.002, 0.001])
    assert bore(stem, 0.0).width_mm == pytest.approx([2, 1])


@settings(max_examples=25, deadline=None)
@given(rings, st.integers(0, CORNERS - 1))
def test_outlines_are_where_the_rings_end(some, corner):
    disc = Disc.of(stem_of(some), 0.1)
    azimuth = 2 * np.pi * corner / CORNERS
    x, y = np.cos(azimuth), np.sin(azimuth)
    for k, outline in enumerate(disc.outlines):
        assert outline.shape == (CORNERS, 2)
        far = reach(some, k + 1, x, y) / 1000
        # near the thin side of a ring as eccentric as it can be, a root of almost nothing
        assert outline[corner] == pytest.approx([far * x, far * y], abs=1e-8)
        assert area(outline) == pytest.approx(np.pi * disc.radii[k] ** 2, rel=2e-3)
    degrees = 360 * corner / CORNERS
    assert disc.widths_at(degrees) == pytest.approx(bore(stem_of(some), degrees).width_mm / 1000)
    assert disc.widths_at(degrees).sum() == pytest.approx(np.hypot(*disc.outlines[-1][corner]))
    assert disc.ring_areas.sum() == pytest.approx(disc.area, rel=1e-12)
    assert disc.ring_widths.sum() == pytest.approx(disc.radius, rel=1e-12)


def test_the_thick_side_is_as_wide_as_the_ring_says():
    disc = Disc.of(one_stem([4, 2], eccentricity=[0.0, 0.25], thick_side_deg=90.0), 0.1)
    assert disc.widths_at(90.0) == pytest.approx([0.004, 0.0025])
    assert disc.widths_at(270.0) == pytest.approx([0.004, 0.0015])
    assert disc.outlines[1][CORNERS // 4] == pytest.approx([0.0, 0.0065])
    assert disc.centres[1] == pytest.approx([0.0, 0.0005])


directions = st.tuples(*[st.sampled_from([-1.0, -0.3, 0.0, 0.2, 1.0])] * 3).filter(any)


@settings(max_examples=25, deadline=None)
@given(directions, directions, st.sampled_from([-0.1, 0.0, 0.13]), st.integers(0, 999))
def test_knots_hold_the_points_of_their_cones(normal, direction, shift, seed):
    direction = unit(direction)
    plane = plane_of(shift * unit(normal), normal)
    along, radius = np.array([0.0, 0.1, 0.3]), np.array([0.0, 0.04, 0.05])
    found = cone_outlines(plane, np.zeros(3), direction, along, radius)
    rng = np.random.default_rng(seed)
    for x, y in rng.uniform(-0.35, 0.35, (60, 2)):
        point = plane.origin + x * plane.across + y * plane.up
        depth = in_cones(point, (0, 0, 0), direction, along, radius)
        if abs(depth) > 1e-3 and abs(point @ direction - 0.3) > 1e-3:
            assert any(in_polygon(x, y, o.tolist()) for o in found) == (depth > 0), (x, y)


def test_a_cone_is_cut_square_and_lengthwise_by_hand():
    along, radius = np.array([0.0, 2.0]), np.array([0.0, 1.0])
    up = np.array([0.0, 0.0, 1.0])
    (round_,) = cone_outlines(plane_of((0, 0, 1), up), np.zeros(3), up, along, radius)
    assert np.hypot(*round_.T) == pytest.approx(0.5, rel=1e-3)
    assert abs(area(round_)) == pytest.approx(np.pi / 4, rel=0.02)
    (triangle,) = cone_outlines(plane_of((0, 0, 1), (1, 0, 0)), np.zeros(3), up, along, radius)
    assert abs(area(triangle)) == pytest.approx(2.0)


@settings(max_examples=25, deadline=None)
@given(directions, directions)
@example((-1.0, -1.0, -1.0), (0.2, 0.2, 0.2))
@example((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
def test_turns_are_the_shortest(first, second):
    a, b = unit(first), unit(second)
    turn = shortest_turn(a, b)
    assert turn @ a == pytest.approx(b, abs=1e-9)
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.trace(turn) == pytest.approx(1 + 2 * a @ b, abs=1e-9)


@pytest.mark.parametrize(
    ("origin", "normal", "says"),
    [
        ((0, 0, 0), (0, 0, 0), "the normal has no length"),
        ((0, 0), (0, 0, 1), "an origin and a normal in x y z"),
        ((0, 0, np.nan), (0, 0, 1), "an origin and a normal in x y z"),
    ],
)
def test_what_is_no_plane_is_refused(origin, normal, says):
    with pytest.raises(InputError, match=says):
        plane_of(origin, normal)
