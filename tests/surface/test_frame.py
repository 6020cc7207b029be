"""A frame of many trees is what its slow twin draws, and what a forester expects to see."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest._threads import using_threads
from forest.errors import InputError
from forest.surface import Camera, Frame, Instances, own_shadows, prepare, scene_shadow
from forest.surface.detail import SEASONS
from tests.reference import frame as reference
from tests.surface.stands import FOLIAGE, bushy, random_camera, scattered

_SUN = np.array([-0.36, -0.48, 0.80])


def _rows(*columns: NDArray[np.generic]) -> NDArray[np.float64]:
    """Put columns beside each other, a row for each primitive, and sort the rows."""
    table = np.hstack(
        [np.float64(column).reshape(len(column), math.prod(column.shape[1:])) for column in columns]
    )
    return table[np.lexsort(table.T[::-1])]


def _check(found: NDArray[np.float64], expected: list[reference.Row], corners: int) -> None:
    width = 3 * corners + 4
    slow = np.array(expected).reshape(-1, width)
    slow = _rows(slow)
    assert found.shape == slow.shape
    assert np.array_equal(found[:, : 3 * corners], slow[:, : 3 * corners])
    assert np.allclose(found[:, -4], slow[:, -4], rtol=1e-5)
    assert np.all(np.abs(found[:, -3:] - slow[:, -3:]) <= 2.0)  # steps of light and of colour


@given(
    seed=st.integers(0, 10_000),
    trees=st.integers(0, 5),
    size_m=st.sampled_from([5.0, 60.0, 600.0]),
    season=st.sampled_from(SEASONS),
    quality=st.sampled_from([0.3, 1.0]),
    haze=st.sampled_from([None, 100.0]),
    shaded=st.booleans(),
)
@settings(max_examples=25, deadline=None)
def test_as_the_twin(
    seed: int,
    trees: int,
    size_m: float,
    season: str,
    quality: float,
    haze: float | None,
    shaded: bool,
) -> None:
    models = [bushy(seed, 40), bushy(seed + 1, 1, evergreen=True)]
    instances = scattered(seed, trees, len(models), size_m=size_m)
    camera = random_camera(seed, size_m)
    shadows = scene_shadow(models, instances, _SUN, size_m / 50, season=season) if shaded else None
    grey = (0.7, 0.8, 0.9)
    fast = prepare(
        models, instances, camera, season=season, quality=quality, sun=_SUN, haze=haze,
        haze_colour=grey, shadows=shadows,
    )  # fmt: skip
    triangles, lines, points = reference.frame(
        reference.Scene(models, instances, camera, season, quality, _SUN, haze, grey, shadows)
    )
    none = np.zeros(len(fast.triangles))
    _check(_rows(fast.triangles, none, fast.triangle_colour), triangles, 3)
    _check(_rows(fast.lines, fast.line_width, fast.line_colour), lines, 2)
    _check(_rows(fast.points, fast.point_size, fast.point_colour), points, 1)


def _count(frame: Frame) -> int:
    return len(frame.triangles) + len(frame.lines) + len(frame.points)


def _from(range_m: float) -> Camera:
    return Camera((-range_m, 0.3, 1.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize("season", SEASONS)
def test_farther_draws_no_more_leaves_or_tubes(season: str) -> None:
    models, one = [bushy(3, 200)], Instances.of([0], [[0.0, 0.0, 0.0]], [1.0])
    frames = [prepare(models, one, _from(r), season=season) for r in (20.0, 80.0, 300.0, 900.0)]
    for nearer, farther in itertools.pairwise(frames):
        assert len(farther.triangles) <= len(nearer.triangles)
        assert len(farther.points) <= len(nearer.points)
        assert _count(farther) <= _count(nearer)
    assert _count(frames[-1]) < 0.5 * _count(frames[0])


def test_only_evergreens_have_leaves_in_winter() -> None:
    for evergreen in (False, True):
        models = [bushy(3, 50, evergreen=evergreen)]
        one = Instances.of([0], [[0.0, 0.0, 0.0]], [1.0])
        frame = prepare(models, one, _from(50.0), season="winter")
        assert (len(frame.points) > 0) == evergreen
        assert len(frame.lines) > 0


def test_what_is_outside_of_the_picture_is_left_out() -> None:
    models = [bushy(5, 30)]
    places = [[50.0, 0.0, 0.0], [-50.0, 0.0, 0.0], [50.0, 500.0, 0.0], [90.0, 10.0, 0.0]]
    stand = Instances.of([0] * 4, places, [1.0] * 4)
    camera = Camera((0.0, 0.0, 1.0), (100.0, 0.0, 1.0))
    frame = prepare(models, stand, camera)
    assert frame.seen.tolist() == [0, 3]
    two = Instances(*(column[[0, 3]] for column in stand))
    assert _count(frame) == _count(prepare(models, two, camera)) > 0


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_all_that_can_be_seen_is_drawn(seed: int) -> None:
    """Every tree of which a corner falls into the picture is among those seen."""
    models, camera = [bushy(seed, 30)], random_camera(seed, 60.0)
    stand = scattered(seed, 8, 1, size_m=60.0)
    seen = prepare(models, stand, camera).seen
    for i in range(8):
        corners = np.concatenate([part.vertices.reshape(-1, 3) for part in models[0].lists])
        way = stand.place[i] + stand.scale[i] * corners - np.array(camera.eye)
        x, y, z = (way @ camera.axes.T).T
        with np.errstate(divide="ignore", invalid="ignore"):
            across, up = camera.pixels_per_slope * np.stack((x, y)) / z
        inside = (z > 0) & (np.abs(across) < camera.width / 2) & (np.abs(up) < camera.height / 2)
        assert i in seen or not inside.any()


def test_haze_turns_far_trees_into_its_colour() -> None:
    models, one = [bushy(3, 50)], Instances.of([0], [[0.0, 0.0, 0.0]], [1.0])
    frame = prepare(models, one, _from(400.0), haze=20.0, haze_colour=(0.2, 0.4, 0.6))
    assert np.array_equal(np.unique(frame.point_colour, axis=0), [[51, 102, 153]])


def test_a_stand_without_trees() -> None:
    nothing = Instances.of([], [], [])
    models = [bushy(3, 50)]
    shadows = scene_shadow(models, nothing, _SUN)
    assert _count(prepare(models, nothing, _from(10.0), sun=_SUN, shadows=shadows)) == 0
    assert _count(prepare([], nothing, _from(10.0))) == 0
    assert shadows.shaded([[0.0, 0.0, 0.0]]).tolist() == [0.0]


def test_threads_change_nothing() -> None:
    models = [bushy(k, 60) for k in range(3)]
    stand = scattered(1, 40, 3, size_m=80.0)
    frames = []
    for threads in (1, 2, 3):
        with using_threads(threads):
            shadows = scene_shadow(models, stand, _SUN)
            frames.append(prepare(models, stand, _from(60.0), sun=_SUN, shadows=shadows))
            assert np.array_equal(shadows.map.depth, scene_shadow(models, stand, _SUN).map.depth)
    for other in frames[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(frames[0], other, strict=True))


def test_models_stand_on_their_foot() -> None:
    model = bushy(3, 50)
    assert np.array_equal(model.description.stems[0].centre[0, 0], [0.0, 0.0, 0.0])


def test_what_is_refused() -> None:
    models, one = [bushy(3, 50)], Instances.of([0], [[0.0, 0.0, 0.0]], [1.0])
    shadows = scene_shadow(models, one, _SUN)
    with pytest.raises(InputError, match="shadows of a sun"):
        prepare(models, one, _from(9.0), sun=(0.0, 0.0, 1.0), shadows=shadows)
    with pytest.raises(InputError, match="shadows of summer"):
        prepare(models, one, _from(9.0), sun=_SUN, season="winter", shadows=shadows)
    with pytest.raises(InputError, match="haze is -1"):
        prepare(models, one, _from(9.0), haze=-1.0)
    with pytest.raises(InputError, match="not above the horizon"):
        own_shadows(models, (1.0, 0.0, -0.1))
    with pytest.raises(InputError, match="did you mean 'summer'"):
        own_shadows(models, _SUN, season="sumer")
    with pytest.raises(InputError, match="larger cell_m"):
        scene_shadow(models, one, _SUN, 1e-5)
    with pytest.raises(InputError, match=r"camera\.width is 0"):
        Camera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), width=0)
    with pytest.raises(InputError, match="not all 0"):
        Camera((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    with pytest.raises(InputError, match="no colour for winter"):
        bare = {season: FOLIAGE[season] for season in SEASONS[:3]}
        type(models[0])(models[0].description, False, (0.1, 0.1, 0.1), bare)
