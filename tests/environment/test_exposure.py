"""The light of buds: the whole of section 4.1 against its slow twin, and its symmetries."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.environment.exposure import CanopySpec, Light, LightSpecies, ShadowSpec
from forest.environment.obstacles import Box
from forest.errors import InputError
from forest.trees.buds import Shoots
from forest.trees.metamers import LATERAL, TERMINAL
from tests.builders import random_arena
from tests.reference import markers
from tests.reference.shadow import (
    best_gradient,
    least_shadowed,
    living_buds,
    node_light,
    shadow_field,
    wrapped,
)

SPECIES = LightSpecies(
    shade_factor=np.array([1.0, 1.5]),
    leaf_area_m2=np.array([0.02, 0.03]),
    perception_angle_deg=np.array([90.0, 140.0]),
    perception_distance_m=np.array([0.8, 0.6]),
)
SHADOW = ShadowSpec(a=0.0625, b=2.0, q_max=4, full_light=1.0, voxel_m=0.25)
CANOPY = CanopySpec(voxel_m=0.5, extinction=0.5, sky_directions=5, sun_positions=2)


def make_light(shadow=SHADOW, canopy=None, *, periodic=True, obstacles=()) -> Light:
    return Light(
        shadow,
        canopy,
        size_m=(4.0, 3.0),
        periodic=periodic,
        voxel_m=0.25,
        species=SPECIES,
        obstacles=obstacles,
    )


def make_stand(seed: int, n_trees: int = 3, n_per_tree: int = 25):
    return random_arena(
        np.random.default_rng(seed), n_trees, n_per_tree, size_m=(4.0, 3.0), n_species=2
    )


def every_bud(metamers, trees) -> tuple[Shoots, np.ndarray]:
    """All living buds as if they shot, and their headings."""
    buds = markers.living_buds(metamers, trees)
    rows = np.array([b["row"] for b in buds], np.int64)
    shoots = Shoots(
        np.searchsorted(rows, np.arange(len(trees.size) + 1)),
        np.array([b["metamer"] for b in buds], np.int32),
        np.array([b["kind"] for b in buds], np.uint8),
        np.ones(len(trees.size), np.int64),
    )
    return shoots, np.array([b["heading"] for b in buds], np.float32)


def sites(trees) -> np.ndarray:
    """Indices of all metamers in use."""
    return np.concatenate(
        [np.arange(s, s + n) for s, n in zip(trees.start, trees.size, strict=True)]
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_light_equals_twin(seed, periodic):
    metamers, trees = make_stand(seed)
    make_light(periodic=periodic).expose(metamers, trees)
    twin = node_light(
        metamers,
        trees,
        voxel_m=0.25,
        shape=(16, 12),
        periodic=periodic,
        factor=[1.0, 1.5],
        a=SHADOW.a,
        b=SHADOW.b,
        q_max=SHADOW.q_max,
        full_light=SHADOW.full_light,
    )
    for k in sites(trees):
        assert metamers.light[k] == pytest.approx(twin.get(k, 0.0), rel=1e-5, abs=1e-6)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.booleans(), st.sampled_from(["gradient", "least_shadow"]))
def test_directions_equal_twin(seed, periodic, mode):
    metamers, trees = make_stand(seed)
    spec = ShadowSpec(a=0.0625, q_max=4, voxel_m=0.25, direction=mode)
    light = make_light(spec, periodic=periodic)
    light.expose(metamers, trees)
    listed = living_buds(metamers, trees, 0.25)
    rng = np.random.default_rng(seed)
    shoots, headings = every_bud(metamers, trees)
    found = light.directions(metamers, trees, shoots)
    assert found.dtype == np.float32
    weights = [SHADOW.a * 2.0**-q for q in range(5)]
    factor = [1.0, 1.5]
    for n in rng.permutation(len(listed))[:4]:
        _, species, voxel = listed[n]
        others = [(v, factor[s]) for m, (_, s, v) in enumerate(listed) if m != n]
        shadow = shadow_field(others, weights, (16, 12), periodic)
        if mode == "gradient":
            expected = best_gradient(shadow, wrapped(voxel, (16, 12), periodic), (16, 12), periodic)
        else:
            expected = least_shadowed(
                shadow,
                voxel,
                headings[n],
                reach=SPECIES.perception_distance_m[species] / 0.25,
                angle_deg=SPECIES.perception_angle_deg[species],
                shape=(16, 12),
                periodic=periodic,
            )
        np.testing.assert_allclose(found[n], expected, rtol=1e-5, atol=1e-6)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32), st.integers(-30, 30), st.integers(-30, 30))
def test_shift_by_whole_voxels_shifts_the_light_exactly(seed, dx, dy):
    metamers, trees = make_stand(seed)
    light = make_light(canopy=CANOPY)
    light.expose(metamers, trees)
    before = metamers.light.copy()
    # The far field's voxels are twice as wide, so steps are even.
    trees.base_voxel[:] = (trees.base_voxel + np.array([2 * dx, 2 * dy, 0])) % [16, 12, 99]
    light.expose(metamers, trees)
    assert np.array_equal(metamers.light, before)


def test_same_bits_for_any_thread_count_and_order_of_trees():
    metamers, trees = make_stand(8, 12, 60)
    light = make_light(canopy=CANOPY)
    fields = []
    for n in (1, 2):
        with using_threads(n):
            light.expose(metamers, trees)
            fields.append(metamers.light.copy())
    backwards = type(trees)(*(np.ascontiguousarray(column[::-1]) for column in trees))
    light.expose(metamers, backwards)
    fields.append(metamers.light.copy())
    assert np.array_equal(fields[0], fields[1])
    assert np.array_equal(fields[0], fields[2])


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_every_leaf_is_counted_once(seed, periodic):
    metamers, trees = make_stand(seed, 6, 40)
    light = make_light(canopy=CANOPY, periodic=periodic)
    light.expose(metamers, trees)
    area = [20_000, 30_000]
    expected = sum(area[s] for _, s, _ in living_buds(metamers, trees, 0.25))
    assert light._canopy.leaf.sum() == expected


def test_lone_bud_has_full_light_and_no_direction():
    metamers, trees = make_stand(1, 1, 1)
    metamers.state[trees.start[0]] = TERMINAL
    light = make_light()
    light.expose(metamers, trees)
    assert metamers.light[trees.start[0]] == 1.0
    shoots, _ = every_bud(metamers, trees)
    assert np.array_equal(light.directions(metamers, trees, shoots), [[0, 0, 0]])


def test_two_buds_of_a_node_shade_one_another():
    metamers, trees = make_stand(1, 1, 1)
    trees.species[0] = 0
    metamers.state[trees.start[0]] = TERMINAL | LATERAL
    make_light().expose(metamers, trees)
    assert metamers.light[trees.start[0]] == np.float32(1.0 - SHADOW.a)


def test_without_near_field_light_is_that_of_the_far_field():
    metamers, trees = make_stand(2)
    alone = make_light(None, CANOPY)
    alone.expose(metamers, trees)
    living = np.array(sorted({k for k, _, _ in living_buds(metamers, trees, 0.25)}))
    assert np.all(metamers.light[living] > alone.floor_light() - 0.5)
    assert np.all(metamers.light[living] <= 1.0)
    shoots, _ = every_bud(metamers, trees)
    assert not alone.directions(metamers, trees, shoots).any()


def test_no_trees_and_bare_trees():
    light = make_light(canopy=CANOPY)
    for n_trees in (0, 2):
        metamers, trees = make_stand(3, n_trees, 0)
        light.expose(metamers, trees)
        assert light.floor_light() == pytest.approx(1.0, abs=1e-6)


def test_the_floor_is_not_known_without_a_far_field():
    metamers, trees = make_stand(3, 2, 4)
    light = make_light(canopy=None)
    light.expose(metamers, trees)
    assert np.isnan(light.floor_light())


def test_roof_darkens_what_is_under_it():
    roof = Box((0.0, 0.0, 3.0), (4.0, 3.0, 3.5))
    metamers, trees = make_stand(1, 1, 1)
    metamers.state[trees.start[0]] = TERMINAL
    for canopy in (None, CANOPY):
        metamers.tip[trees.start[0]] = (0.0, 0.0, 2.6)
        make_light(canopy=canopy, obstacles=[roof]).expose(metamers, trees)
        assert metamers.light[trees.start[0]] == 0.0
    # Too deep for the near field: only the far field's shade is left.
    metamers.tip[trees.start[0]] = (0.0, 0.0, 0.1)
    make_light(obstacles=[roof]).expose(metamers, trees)
    assert metamers.light[trees.start[0]] == 1.0
    dark = make_light(canopy=CANOPY, obstacles=[roof])
    dark.expose(metamers, trees)
    assert metamers.light[trees.start[0]] < 1e-6
    assert dark.floor_light() < 1e-6


def test_voxels_must_fit_a_periodic_plot():
    with pytest.raises(InputError, match="expected"):
        Light(SHADOW, None, size_m=(4.1, 3.0), periodic=True, voxel_m=0.25, species=SPECIES)
    with pytest.raises(InputError, match=r"canopy\.voxel_m"):
        make_light(canopy=CanopySpec(voxel_m=0.6))
