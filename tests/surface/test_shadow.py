"""Shadow maps show what rays to the sun meet, and mark what lies behind."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.surface import Instances, Model, own_shadows, prepare, scene_shadow
from forest.surface.camera import Camera
from forest.surface.detail import LAST_LEVEL
from forest.surface.light import BARKS, bark_step, bark_steps
from forest.surface.shadow import _along_stems
from forest.trees.leaves import OVAL, Leaves
from forest.trees.skeleton import Skeleton
from tests.reference import frame as reference
from tests.surface.stands import BARK, FOLIAGE, bushy, scattered

_SLACK = 1e-6


def _sun(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    height, bearing = rng.uniform(0.2, math.pi / 2), rng.uniform(0.0, 2.0 * math.pi)
    level = math.cos(height)
    return np.array([level * math.cos(bearing), level * math.sin(bearing), math.sin(height)])


@given(seed=st.integers(0, 10_000), season=st.sampled_from(["summer", "winter"]))
@settings(max_examples=15, deadline=None)
def test_a_cell_shows_what_a_ray_meets_first(seed: int, season: str) -> None:
    model = bushy(seed, 12)
    picture = own_shadows([model], _sun(seed), season=season)[0].map
    solid = model.lists[: LAST_LEVEL + (2 if season == "summer" else 1)]
    corners = np.concatenate([part.vertices.reshape(-1, 3, 3) for part in solid])
    triangles = np.float64(corners) @ picture.axes.T
    rng = np.random.default_rng(seed)
    for _ in range(10):
        row, col = (int(rng.integers(0, n)) for n in picture.depth.shape)
        x = picture.corner[0] + (col + 0.5) * picture.cell_m
        y = picture.corner[1] + (row + 0.5) * picture.cell_m
        least = reference.nearest_hit(triangles, x, y, -_SLACK)
        most = reference.nearest_hit(triangles, x, y, _SLACK)
        assert least - 1e-4 <= picture.depth[row, col] <= most + 1e-4 or least == most == -math.inf
        if most == -math.inf:
            assert picture.depth[row, col] == -math.inf


@given(seed=st.integers(0, 10_000), trees=st.integers(0, 5))
@settings(max_examples=15, deadline=None)
def test_a_scene_is_made_of_its_models_maps(seed: int, trees: int) -> None:
    models, stand = [bushy(seed, 20), bushy(seed + 1, 5)], scattered(seed, trees, 2, size_m=8.0)
    shadows = scene_shadow(models, stand, _sun(seed), 0.2)
    own = [one.map for one in shadows.own]
    rng = np.random.default_rng(seed)
    for _ in range(30):
        row, col = (int(rng.integers(0, n)) for n in shadows.map.depth.shape)
        expected = reference.cast(shadows.map, own, stand, row, col)
        found = float(shadows.map.depth[row, col])
        assert found == expected or abs(found - expected) < 1e-5
        assert (shadows.map.owner[row, col] < 0) == (expected == -math.inf)


def _discs(heights: list[float]) -> Model:
    """Make a thin stem with a level square leaf of 1 m over its top at each height."""
    n = len(heights)
    line = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]])
    one = np.zeros(1, np.int32)
    stem = Skeleton(
        parent=one - 1, start=line[:1], end=line[1:], radius=np.array([0.01]), axis=one, order=one,
        birth_year=one, leafy=np.ones(1, np.bool_), serial=one,
    )  # fmt: skip
    leaves = Leaves(
        position=np.array([[-0.5, 0.0, z] for z in heights]).reshape(-1, 3),
        direction=np.tile([1.0, 0.0, 0.0], (n, 1)),
        normal=np.tile([0.0, 0.0, 1.0], (n, 1)),
        length=np.ones(n),
        width=np.ones(n),
        shape=np.full(n, OVAL, np.int8),
        stem=np.zeros(n, np.int32),
    )
    return Model.of(stem, leaves, evergreen=False, bark=BARK, foliage=FOLIAGE)


def test_the_leaf_above_shades_the_one_below() -> None:
    marks = own_shadows([_discs([1.0, 2.0])], (0.0, 0.0, 1.0))[0].shaded
    assert marks[-1].tolist() == [True, False]
    assert marks[0].tolist() == [True]  # the stem, too
    bare = own_shadows([_discs([1.0, 2.0])], (0.0, 0.0, 1.0), season="winter")[0].shaded
    assert bare[0].tolist() == [False]


def test_a_low_sun_passes_between_leaves() -> None:
    marks = own_shadows([_discs([1.0, 2.0])], (1.0, 0.0, 0.2))[0].shaded
    assert marks[-1].tolist() == [False, False]


def test_the_ground_under_a_tree_is_in_its_shade() -> None:
    models, one = [_discs([2.0])], Instances.of([0], [[10.0, 20.0, 5.0]], [2.0])
    sun = np.array([0.6, 0.0, 0.8])
    shadows = scene_shadow(models, one, sun, 0.05)
    # The leaf is 4 m over the ground: its shade lies 3 m away from the sun.
    ground = [[7.0, 20.0, 5.0], [7.8, 20.0, 5.0], [8.2, 20.0, 5.0], [10.0, 21.0, 5.0]]
    assert shadows.shaded(ground).tolist() == [1.0, 1.0, 0.0, 0.0]
    edge = shadows.shaded([[x, 20.0, 5.0] for x in np.linspace(7.5, 8.5, 200)])
    assert np.any((edge > 0.0) & (edge < 1.0))
    assert shadows.shaded([[7.0, 20.0, 11.0]]).tolist() == [0.0]  # above the tree


def test_a_tree_behind_a_wall_of_trees_is_dark() -> None:
    """A single leaf low behind a tall dense wall lies in its shade, one before it in the sun."""
    wall = _discs([0.25 * k for k in range(1, 40)])
    single = _discs([1.0])
    places = [[0.0, 0.5 * k, 0.0] for k in range(-20, 21)] + [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    stand = Instances.of([0] * 41 + [1, 1], places, [1.0] * 43)
    sun = (1.0, 0.0, 1.0)
    shadows = scene_shadow([wall, single], stand, sun, 0.05)
    camera = Camera((0.0, -30.0, 1.0), (0.0, 0.0, 1.0))
    alone = Instances(*(column[41:] for column in stand))
    light = scene_shadow([wall, single], alone, sun, 0.05)
    for shade, expected in ((shadows, [True, False]), (light, [False, False])):
        place = stand if shade is shadows else alone
        frame = prepare([wall, single], place, camera, sun=sun, shadows=shade)
        last = frame.point_colour[-2:].astype(int).sum(axis=1)  # in order of models and instances
        assert (last < 1.1 * 255 * sum(FOLIAGE["summer"])).tolist() == expected


@given(seed=st.integers(0, 10_000), axes=st.integers(0, 3))
@settings(max_examples=25, deadline=None)
def test_marks_of_stems_are_means_along_their_axes(seed: int, axes: int) -> None:
    rng = np.random.default_rng(seed)
    lines, marks, expected = [], [], []
    for k in range(axes):
        lengths = rng.uniform(0.01, 0.8, int(rng.integers(1, 12)))
        own = rng.integers(0, 2, len(lengths)).astype(float)
        at = np.append(0.0, np.cumsum(lengths))
        points = np.float32(np.column_stack((0.0 * at + 5.0 * k, 0.0 * at, at)))
        lines.append(np.hstack((points[:-1], points[1:])))
        marks.append(own)
        expected += [
            reference.mean_along(own.tolist(), lengths.tolist(), i, 1.0) for i in range(len(own))
        ]
    if axes:
        found = _along_stems(np.concatenate(marks).astype(np.float32), np.concatenate(lines))
        np.testing.assert_allclose(found, expected, atol=1e-4)
    nothing = _along_stems(np.empty(0, np.float32), np.empty((0, 6), np.float32))
    assert len(nothing) == 0


def test_a_trunk_has_no_hard_edges_of_shade() -> None:
    """Internodes of 10 cm behind a leaf darken and lighten again within a metre both ways."""
    line = np.zeros((80, 6), np.float32)
    line[:, 2], line[:, 5] = np.arange(80) / 10, np.arange(1, 81) / 10
    line[1:, 2] = line[:-1, 5]
    marks = np.zeros(80, np.float32)
    marks[40:43] = 1.0
    shade = _along_stems(marks, line)
    assert 0.1 < shade.max() < 0.2
    assert np.abs(np.diff(shade)).max() < 0.06
    assert shade[:30].max() == 0.0


def test_twigs_of_pale_trees_are_darker() -> None:
    steps = bark_steps((0.8, 0.8, 0.7))
    assert steps.shape == (BARKS, 3)
    assert (np.diff(steps, axis=0) < 0.0).all()
    assert bark_step([0.3, 0.06, 0.01, 0.001]).tolist() == [0, 0, BARKS - 1, BARKS - 1]
