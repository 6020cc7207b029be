"""Any skeleton with its leaves as polygons, lines and points."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest.species import load_species
from forest.surface import Drawing, describe, fractions
from forest.surface.description import LEAF_ITEM, SIDES
from forest.surface.frames import carry_frames
from forest.trees.leaves import OUTLINES, leaves_of, living_sites, no_leaves
from forest.trees.skeleton import Skeleton
from tests.reference import detail as slow
from tests.surface.bushes import bush

BEECH = load_species("fagus_sylvatica")
SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 60)


def look(tree: Skeleton, range_m: float) -> Drawing:
    shares = fractions(range_m, evergreen=False)
    return describe(tree, leaves_of(tree, BEECH, per_site=2)).drawn(shares)


def area(corners: NDArray[np.float64]) -> float:
    edges = np.diff(corners, axis=1)
    return float(0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum())


@given(SEEDS, SIZES)
@settings(max_examples=25, deadline=None)
def test_frames_are_the_twin_s(seed: int, n: int) -> None:
    tree = bush(seed, n)
    heading, side = carry_frames(tree)
    for i, (h, s) in enumerate(slow.frames(tree)):
        np.testing.assert_allclose(heading[i], h, atol=1e-9)
        np.testing.assert_allclose(side[i], s, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(side, axis=1), 1.0)
    np.testing.assert_allclose(np.sum(side * heading, axis=1), 0.0, atol=1e-9)


@given(SEEDS, SIZES, st.floats(0.0, 1500.0))
@settings(max_examples=25, deadline=None)
def test_what_is_drawn_is_what_the_loop_says(seed: int, n: int, range_m: float) -> None:
    tree = bush(seed, n)
    drawing = look(tree, range_m)
    level = np.minimum(tree.order, 2)
    for k in range(3):
        of_level = sorted(np.flatnonzero(level == k), key=lambda i: (tree.axis[i], i))
        polygons, lines = slow.stem_shares(k, range_m, 0.5)
        here = drawing.triangles.item == k
        tubes = [of_level[j] for j in slow.loop(len(of_level), polygons * 16, 16)]
        assert list(drawing.triangles.element[here]) == [
            i for i in tubes for _ in range(2 * SIDES[k])
        ]
        threads = [of_level[j] for j in slow.loop(len(of_level), lines * 16, 16)]
        here = drawing.lines.item == k
        assert list(drawing.lines.element[here]) == threads
        np.testing.assert_array_equal(drawing.lines.vertices[here, 1], tree.end[threads])
    polygons, points = slow.leaf_shares(range_m, "summer", False)
    blades = slow.loop(2 * int(living_sites(tree).sum()), polygons * 4, 4)
    here = drawing.triangles.item == LEAF_ITEM
    fan = len(OUTLINES[0]) - 2
    assert list(drawing.triangles.element[here]) == [i for i in blades for _ in range(fan)]
    dots = slow.loop(2 * int(living_sites(tree).sum()), points * 8, 8)
    assert list(drawing.points.element) == dots
    for part in drawing:
        assert np.isfinite(part.vertices).all()


@given(SEEDS, SIZES)
@settings(max_examples=25, deadline=None)
def test_near_by_every_leaf_has_its_area(seed: int, n: int) -> None:
    tree = bush(seed, n)
    drawing = look(tree, 5.0)
    blades = drawing.triangles.vertices[drawing.triangles.item == LEAF_ITEM]
    np.testing.assert_allclose(
        area(blades), living_sites(tree).sum() * BEECH.leaves.area_m2, rtol=1e-9
    )


def straight(n: int, radius: float) -> Skeleton:
    """Make a pole of `n` internodes of a metre, leaning to the east."""
    along = np.array([0.6, 0.0, 0.8])
    return Skeleton(
        parent=np.arange(-1, n - 1, dtype=np.int32),
        start=np.arange(n)[:, None] * along,
        end=np.arange(1, n + 1)[:, None] * along,
        radius=np.full(n, radius),
        axis=np.zeros(n, np.int32),
        order=np.zeros(n, np.int32),
        birth_year=np.full(n, 2000, np.int32),
        leafy=np.zeros(n, np.bool_),
        serial=np.arange(n, dtype=np.int32),
    )


def test_a_pole_is_a_closed_prism_that_faces_outwards() -> None:
    pole = straight(40, 0.1)
    corners = describe(pole, no_leaves()).drawn(fractions(5.0, evergreen=True)).triangles.vertices
    assert len(corners) == 40 * 2 * 12
    np.testing.assert_allclose(area(corners), 40 * 12 * 2 * 0.1 * np.sin(np.pi / 12), rtol=1e-9)
    middle = corners.mean(axis=1)
    along = np.array([0.6, 0.0, 0.8])
    outward = middle - (middle @ along)[:, None] * along
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.sum(normal * outward, axis=1) > 0.0).all()
    places, used = np.unique(corners.reshape(-1, 3).round(9), axis=0, return_counts=True)
    assert len(places) == 41 * 12  # neighbours share their cross sections
    assert used.min() == 3


def test_half_a_pole_is_spread_over_the_pole() -> None:
    pole = straight(160, 0.1)
    drawing = describe(pole, no_leaves()).drawn(fractions(600.0, evergreen=True))
    assert list(np.unique(drawing.triangles.element) // 16) == list(np.repeat(np.arange(10), 8))
    assert len(drawing.lines.element) == 160
    assert len(drawing.points.element) == 0


def test_a_lobed_trunk() -> None:
    tree = bush(3, 12)
    shares = fractions(1.0, evergreen=False)
    round_, lobed = (
        describe(tree, no_leaves(), lobes=lobes).drawn(shares).triangles
        for lobes in ((3, 0.0), (3, 0.25))
    )
    trunk = round_.item == 0
    np.testing.assert_array_equal(round_.vertices[~trunk], lobed.vertices[~trunk])
    first = np.flatnonzero(trunk)[: 2 * SIDES[0] : 2]  # lower corners of the trunk's foot
    foot = tree.start[round_.element[first[0]]]
    was, now = (np.linalg.norm(t.vertices[first, 0] - foot, axis=1) for t in (round_, lobed))
    angle = 2.0 * np.pi * np.arange(SIDES[0]) / SIDES[0]
    np.testing.assert_allclose(now / was, 1.0 + 0.25 * np.sin(3.0 * angle))
