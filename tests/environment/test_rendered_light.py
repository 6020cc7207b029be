"""Rendered light: against its slow twin, simple scenes, layers of known shade, whole stands."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.environment.obstacles import Box, solid_voxels, voxelise
from forest.environment.rendered_kernels import TILE, Looks
from forest.environment.rendered_light import RenderedLight, RenderedSpec
from forest.environment.sky import sun_places
from forest.environment.sun import LightPath
from forest.errors import InputError
from forest.stand import Stand
from forest.trees.metamers import TERMINAL, Metamers, allocate
from forest.trees.table import Trees, empty
from tests.builders import random_arena
from tests.reference.rendered_light import rendered_light
from tests.tiny import assert_same_state, assert_same_years, steps, tiny

SIZE = (4.0, 3.0)
AREA = 0.04
ZENITH = (0.0, 0.0, 1.0)
SLANT = (np.sqrt(0.5), 0.0, np.sqrt(0.5))


class From:
    """Light that always comes from one direction."""

    def __init__(self, toward, shift=(0.5, 0.5)) -> None:
        self.toward, self.shift = np.array(toward), shift

    def draw(self, seed, step, picture):
        return self.toward, *self.shift


def make_light(toward=None, *, periodic=True, obstacles=(), area=(AREA,), **spec) -> RenderedLight:
    """Rendered light with pixels of 5 cm, from one direction if one is given."""
    shape = round(SIZE[0] / 0.25), round(SIZE[1] / 0.25)
    light = RenderedLight(
        RenderedSpec(**{"pixel_m": 0.05, **spec}),
        size_m=SIZE,
        periodic=periodic,
        latitude_deg=50.0,
        seed=7,
        looks=Looks(np.array(area), np.array([2.0, 2.5][: len(area)])),
        solid=voxelise(obstacles, shape, periodic=periodic, voxel_m=0.25),
        voxel_m=0.25,
    )
    if toward is not None:
        light._path = From(toward)
    return light


def leaves(places, diameter_m=0.0) -> tuple[Metamers, Trees]:
    """Trees of one metamer each, with a leaf at the tip; without a diameter only the leaf."""
    n = len(places)
    metamers, trees = allocate(n), empty(n)
    places = np.asarray(places, float)
    trees.tree_id[:] = np.arange(1, n + 1)
    trees.x[:], trees.y[:] = places[:, 0], places[:, 1]
    trees.start[:] = np.arange(n)
    trees.size[:] = 1
    metamers.parent[:] = -1
    metamers.state[:] = TERMINAL
    metamers.tip[:] = 0.0
    metamers.tip[:, 2] = places[:, 2]
    metamers.pipe[:] = np.asarray(diameter_m) ** 2
    return metamers, trees


def seen(light: RenderedLight, places, diameter_m=0.0, step=1) -> list[float]:
    """The light of lone leaves at these places."""
    metamers, trees = leaves(places, diameter_m)
    light.expose(metamers, trees, step)
    return metamers.light.tolist()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.booleans(), st.sampled_from([0.04, 0.13]), st.booleans())
def test_equals_twin(seed, periodic, pixel_m, with_obstacles):
    metamers, trees = random_arena(
        np.random.default_rng(seed), 3, 12, size_m=(2.0, 1.5), n_species=2
    )
    metamers.pipe[:] *= 100.0
    walls = [Box((0.5, 0.5, 0.0), (1.0, 0.75, 0.5)), Box((0.0, 0.0, 0.25), (0.25, 0.5, 1.0))]
    solid = voxelise(walls if with_obstacles else [], (8, 6), periodic=periodic, voxel_m=0.25)
    area, exponent = [0.02, 0.003], [2.0, 2.5]
    light = RenderedLight(
        RenderedSpec(pixel_m=pixel_m),
        size_m=(2.0, 1.5),
        periodic=periodic,
        latitude_deg=50.0,
        seed=seed,
        looks=Looks(np.array(area), np.array(exponent)),
        solid=solid,
        voxel_m=0.25,
    )
    light.expose(metamers, trees, 3)
    toward, *shift = light._path.draw(seed, 3, 0)
    turns = (round(2.0 / pixel_m), round(1.5 / pixel_m)) if periodic else None
    twin, in_pixel = rendered_light(
        metamers,
        trees,
        leaf_area=area,
        exponent=exponent,
        voxels=[tuple(v) for v in solid_voxels(solid)],
        voxel_m=0.25,
        toward=toward,
        pixel=(2.0 / turns[0], 1.5 / turns[1]) if turns else (pixel_m, pixel_m),
        shift=tuple(shift),
        turns=turns,
    )
    nodes = np.concatenate(
        [
            np.arange(start, start + size)
            for start, size in zip(trees.start, trees.size, strict=True)
        ]
    )
    assert all(metamers.light[k] == np.float32(twin.get(k, 0.0)) for k in nodes)
    before = metamers.light.copy()
    picture = light.picture(metamers, trees, 3)
    np.testing.assert_array_equal(metamers.light, before)
    assert all(picture.share[k] == np.float32(twin.get(k, 0.0)) for k in nodes)
    assert _in_pixels(picture, trees, periodic) == _as_known(in_pixel, periodic)


def _in_pixels(picture, trees, periodic):
    """What each pixel of an index picture shows, by its place on a torus; else only how often."""
    found = {}
    for j, i in np.ndindex(*picture.tree.shape):
        tree, item = picture.tree[j, i], picture.item[j, i]
        if picture.obstacle[j, i]:
            found[i, j] = ("voxel", -1)
        elif tree >= 0:
            kind, own = ("leaf", item) if item >= 0 else ("limb", -1 - item)
            found[i, j] = (kind, int(trees.start[tree] + own))
    return _as_known(found, periodic)


def _as_known(found, periodic):
    if periodic:
        return found
    # The window of an open plot lies around its leaves; limbs and walls may stand out of it.
    return Counter(what for what in found.values() if what[0] == "leaf")


def test_a_lone_leaf_has_full_light():
    for periodic in (False, True):
        light = make_light(periodic=periodic, directions=3)
        for step in range(1, 6):
            assert seen(light, [(1.0, 1.0, 2.0)], 0.01, step) == pytest.approx([1.0])


def test_a_leaf_under_a_leaf_is_dark():
    light = make_light(ZENITH)
    assert seen(light, [(1.0, 1.0, 2.0), (1.0, 1.0, 3.0)]) == [0.0, 1.0]
    # Light from the side passes it by.
    light = make_light(SLANT)
    assert seen(light, [(1.0, 1.0, 2.0), (1.0, 1.0, 3.0)]) == [1.0, 1.0]
    assert seen(light, [(1.0, 1.0, 2.0), (2.0, 1.0, 3.0)]) == [0.0, 1.0]


def test_half_a_leaf_is_seen_under_a_shifted_one():
    assert seen(make_light(ZENITH), [(1.0, 1.0, 2.0), (1.1, 1.0, 3.0)]) == [0.5, 1.0]


def test_of_two_leaves_at_one_place_the_first_tree_gets_the_light():
    assert seen(make_light(ZENITH), [(1.0, 1.0, 2.0), (1.0, 1.0, 2.0)]) == [1.0, 0.0]


def test_a_limb_shades_and_is_no_leaf():
    # A bole of 0.5 m, which bears a leaf at its top, between the light and the other leaf.
    bole_and_leaf = [(2.0, 1.0, 3.0), (1.0, 1.0, 1.0)]
    assert seen(make_light(SLANT), bole_and_leaf, [0.5, 0.0]) == [1.0, 0.0]
    assert seen(make_light(SLANT), bole_and_leaf, [0.02, 0.0])[1] > 0.8
    assert seen(make_light(ZENITH), bole_and_leaf, [0.5, 0.0]) == [1.0, 1.0]


@pytest.mark.parametrize("periodic", [False, True])
def test_obstacles_shade(periodic):
    roof = Box((0.5, 0.5, 2.0), (1.5, 1.5, 2.5))
    under, beside, above = (1.0, 1.0, 1.0), (2.5, 1.0, 1.0), (1.0, 1.0, 3.0)
    light = make_light(ZENITH, periodic=periodic, obstacles=[roof])
    assert seen(light, [under, beside, above]) == [0.0, 1.0, 1.0]
    # A wall of a voxel's width to the east throws its shade as far as it is high.
    wall = Box((3.0, 0.0, 0.0), (3.25, 3.0, 1.0))
    light = make_light(SLANT, periodic=periodic, obstacles=[wall])
    assert seen(light, [(2.5, 1.5, 0.1), (1.8, 1.5, 0.1), (2.5, 1.5, 1.2)]) == [0.0, 1.0, 1.0]


def test_shade_comes_in_on_the_other_side_of_a_periodic_plot():
    pair = [(3.5, 1.0, 1.0), (0.5, 1.0, 2.0)]
    assert seen(make_light(SLANT), pair) == [0.0, 1.0]
    assert seen(make_light(SLANT, periodic=False), pair) == [1.0, 1.0]
    # The same after several turns: 9 m higher is 9 m, or two plots and 1 m, to the side.
    assert seen(make_light(SLANT), [(3.5, 1.0, 1.0), (0.5, 1.0, 10.0)]) == [0.0, 1.0]


@pytest.mark.parametrize(("pixel_m", "directions"), [(0.05, 12), (0.3, 100)])
def test_random_leaves_shade_as_beer_and_lambert_say(pixel_m, directions):
    """Horizontal leaves at random cover 1 - exp(-L) of the ground, seen from anywhere.

    Pixels wider than a leaf (0.2 m) change only the noise. The bound is 3 to 10 standard errors.
    """
    rng = np.random.default_rng(3)
    for lai in (0.5, 3.0):
        n = round(lai * SIZE[0] * SIZE[1] / AREA)
        places = rng.uniform((0.0, 0.0, 1.0), (*SIZE, 9.0), (n, 3))
        light = seen(make_light(pixel_m=pixel_m, directions=directions), places)
        covered = 1.0 - (1.0 - AREA / (SIZE[0] * SIZE[1])) ** n
        assert covered == pytest.approx(1.0 - np.exp(-lai), abs=0.01)
        assert np.mean(light) * lai == pytest.approx(covered, rel=0.025)


def test_the_sun_at_noon_of_the_equinox():
    for latitude in (-40.0, 0.0, 50.0):
        east, north, up = sun_places(latitude, np.array([81.0]), np.array([0.0]))
        assert np.degrees(np.arcsin(up[0, 0])) == pytest.approx(90.0 - abs(latitude), abs=1e-6)
        assert east[0, 0] == pytest.approx(0.0, abs=1e-12)
        assert north[0, 0] * latitude <= 0.0


def test_light_is_drawn_from_sun_and_sky_by_share():
    path = LightPath(50.0, 0.8, 10.0)
    drawn = np.array([path.draw(5, step, 1)[0] for step in range(1500)])
    np.testing.assert_allclose(np.linalg.norm(drawn, axis=1), 1.0)
    assert drawn[:, 2].min() >= np.sin(np.radians(10.0)) - 1e-9
    places = set(map(tuple, path.sun))
    on_path = np.array([tuple(toward) in places for toward in drawn])
    assert on_path.mean() == pytest.approx(0.8, abs=4 * np.sqrt(0.16 / len(drawn)))
    # The sun stands in the south, and never higher than at midsummer noon; the sky is all around.
    sun, sky = drawn[on_path], drawn[~on_path]
    assert sun[:, 1].mean() < -0.2
    assert sun[:, 2].max() <= np.sin(np.radians(90.0 - 50.0 + 23.45))
    assert abs(sky[:, 1].mean()) < 4 * 0.5 / np.sqrt(len(sky))
    # Mean of cos over light on the horizontal, (1 + 2 cos) cos; the lowest 10 degrees send 2 %.
    assert sky[:, 2].mean() == pytest.approx((2 / 3 + 1.0) * 3 / 7, abs=0.06)


def test_no_two_years_and_pictures_are_the_same():
    path = LightPath(50.0, 0.5, 10.0)
    shifts = {path.draw(5, step, picture)[1:] for step in range(20) for picture in range(5)}
    assert len(shifts) == 100
    assert path.draw(5, 3, 1)[1:] == path.draw(5, 3, 1)[1:]


def test_a_clearing_lets_light_in_over_its_wall():
    clearing = {"clearing_radius_m": 1.0, "clearing_height_m": 2.0, "periodic": False}
    places = [(2.0, 1.5, 0.5), (2.0, 1.5, 1.5), (0.5, 1.5, 1.0), (0.5, 1.5, 2.5)]
    # At the centre light from 45 degrees comes over the wall where this is not 1 m higher.
    assert seen(make_light(SLANT, **clearing), places) == [0.0, 1.0, 0.0, 1.0]
    assert seen(make_light(ZENITH, **clearing), places[:1]) == [1.0]


def test_response_flat_above_a_fifth():
    pairs = [(1.0, 1.0, 2.0), (1.15, 1.0, 3.0), (3.0, 1.0, 2.0), (3.0, 1.0, 3.0)]
    assert seen(make_light(ZENITH), pairs) == pytest.approx([0.75, 1.0, 0.0, 1.0])
    assert seen(make_light(ZENITH, response="flat_above_20"), pairs) == [1.0, 1.0, 0.0, 1.0]
    sliver = [(1.0, 1.0, 2.0), (1.0, 1.05, 3.0), (0.9, 0.9, 4.0)]
    found = seen(make_light(ZENITH), sliver)[0]
    assert 0.0 < found < 0.2
    flat = seen(make_light(ZENITH, response="flat_above_20"), sliver)[0]
    assert flat == pytest.approx(5 * found)


def test_same_bits_for_any_thread_count():
    assert SIZE[0] / 0.02 > TILE  # several tiles
    metamers, trees = random_arena(np.random.default_rng(8), 12, 60, size_m=SIZE)
    fields = []
    for n in (1, 2, 3):
        with using_threads(n):
            make_light(pixel_m=0.02, directions=2).expose(metamers, trees, 1)
        fields.append(metamers.light.copy())
    assert fields[0][trees.start[0] : trees.start[-1]].mean() > 0.1
    assert np.array_equal(fields[0], fields[1])
    assert np.array_equal(fields[0], fields[2])


def test_no_trees_and_no_leaves():
    for periodic in (False, True):
        light = make_light(periodic=periodic)
        light.expose(*leaves(np.zeros((0, 3))), 1)
        metamers, trees = leaves([(1.0, 1.0, 1.0)])
        metamers.state[:] = 0
        light.expose(metamers, trees, 1)
        assert metamers.light[0] == 0.0


@pytest.mark.parametrize(
    "changes",
    [
        ["environment={rendered={directions=2}}", "growth.bud_fate=balance"],
        ["environment={rendered={response='flat_above_20'}, markers={}}", "mode=paper"],
        [
            "plot.boundary=open",
            "environment={rendered={clearing_radius_m=6, clearing_height_m=1}}",
        ],
    ],
    ids=["periodic", "with markers, paper", "clearing"],
)
def test_a_stand_grows_in_rendered_light_and_resumes(changes):
    scenario = tiny("years=10", *changes)
    stand = Stand(scenario)
    steps(stand, 6)
    again = Stand.restore(scenario, *stand.state())
    assert_same_years(steps(stand, 4), steps(again, 4))
    assert_same_state(stand, again)
    assert stand.trees.height_m.max() > 0.8
    assert 0.0 < stand.trees.light.mean() <= 1.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["environment={rendered={}, shadow={}}"], ["environment.rendered", "with markers"]),
        (["environment={rendered={clearing_radius_m=3}}"], ["clearing_height_m", "not given"]),
        (
            ["environment={rendered={clearing_radius_m=3, clearing_height_m=9}}"],
            ["clearing_radius_m", "open"],
        ),
        (
            ["environment={rendered={pixel_m=0.005}}", "plot.size_m=[2000, 2000]"],
            ["environment.rendered.pixel_m", "at least 0.03"],
        ),
        (["environment={rendered={pixel=0.1}}"], ["did you mean 'pixel_m'?"]),
    ],
)
def test_refused(changes, words):
    with pytest.raises(InputError) as error:
        tiny(*changes)
    assert all(word in str(error.value) for word in words)
    assert "\n" not in str(error.value)
