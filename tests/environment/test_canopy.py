"""The far field against its slow twin, the closed form, and its limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.environment.canopy import Canopy
from forest.environment.sky import sky_directions, sun_directions
from tests.reference.canopy import relative_irradiance


def make_canopy(
    directions: np.ndarray, shape: tuple[int, int] = (6, 5), *, periodic: bool = True
) -> Canopy:
    return Canopy(
        (2 * shape[0], 2 * shape[1]),
        near_voxel_m=0.5,
        ratio=2,
        lift=0,
        periodic=periodic,
        extinction=0.5,
        directions=directions,
        weights=np.ones(len(directions)),
    )


def illuminate(canopy: Canopy, leaf_m2: np.ndarray) -> None:
    """Fill the lowest layers with leaves and compute T."""
    nz, ny, nx = leaf_m2.shape
    canopy.clear(np.zeros(3, np.int64), np.array([2 * nx - 1, 2 * ny - 1, 2 * nz - 1]))
    canopy.leaf[:nz] = np.rint(leaf_m2 * 1e6)
    canopy.illuminate()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.booleans(), st.integers(1, 7), st.integers(1, 5))
def test_equals_twin(seed, periodic, n_sky, layers):
    rng = np.random.default_rng(seed)
    directions = np.concatenate((sky_directions(n_sky), sun_directions(3, 50.0)))
    canopy = make_canopy(directions, periodic=periodic)
    leaf = rng.uniform(0.0, 3.0, (layers, 5, 6)) * (rng.random((layers, 5, 6)) < 0.6)
    illuminate(canopy, leaf)
    light, ground = relative_irradiance(
        0.5 * canopy.leaf * 1e-6, directions, np.ones(len(directions)), periodic
    )
    np.testing.assert_allclose(canopy.transmission, light, rtol=3e-5, atol=1e-7)
    np.testing.assert_allclose(canopy.ground, ground, rtol=3e-5, atol=1e-7)
    assert canopy.floor_light() == pytest.approx(ground.mean(), rel=1e-5)


def test_homogeneous_layer_is_beer_lambert():
    directions = np.concatenate((sky_directions(17), sun_directions(8, 60.0)))
    canopy = make_canopy(directions)
    illuminate(canopy, np.full((4, 5, 6), 0.7))
    for above, light in ((4.0, canopy.floor_light()), (2.5, canopy.transmission[1, 2, 3])):
        expected = np.exp(-0.5 * 0.7 * above / directions[:, 2]).mean()
        assert light == pytest.approx(expected, rel=1e-5)


def test_no_leaves_and_too_many():
    canopy = make_canopy(sky_directions(9))
    illuminate(canopy, np.zeros((3, 5, 6)))
    assert canopy.floor_light() == pytest.approx(1.0, abs=1e-6)
    assert canopy.transmission.max() <= 1.0
    illuminate(canopy, np.full((3, 5, 6), 1e4))
    assert canopy.floor_light() < 1e-9


def test_shift_on_a_torus_shifts_the_light_exactly():
    rng = np.random.default_rng(4)
    leaf = rng.uniform(0.0, 2.0, (5, 5, 6))
    canopy = make_canopy(np.concatenate((sky_directions(17), sun_directions(8, 50.0))))
    illuminate(canopy, leaf)
    before = canopy.transmission.copy()
    illuminate(canopy, np.roll(leaf, (2, 3), axis=(1, 2)))
    assert np.array_equal(canopy.transmission, np.roll(before, (2, 3), axis=(1, 2)))


def test_light_enters_an_open_plot_from_the_sides():
    leaf = np.full((6, 5, 6), 0.7)
    closed = make_canopy(sky_directions(17))
    opened = make_canopy(sky_directions(17), periodic=False)
    illuminate(closed, leaf)
    illuminate(opened, leaf)
    assert np.all(opened.ground > closed.ground)


def test_same_bits_for_any_thread_count():
    leaf = np.random.default_rng(5).uniform(0.0, 2.0, (5, 5, 6))
    fields = []
    for n in (1, 2):
        with using_threads(n):
            canopy = make_canopy(sky_directions(17))
            illuminate(canopy, leaf)
            fields.append(canopy.transmission)
    assert np.array_equal(*fields)


@pytest.mark.parametrize("n", [1, 2, 9, 17, 40])
def test_sky_leans_to_no_side_and_sends_its_share(n):
    directions = sky_directions(n)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(directions[:, :2].sum(axis=0), 0.0, atol=1e-12)
    if n == 40:
        # Irradiance-weighted mean of the cosine: int c^2 (1 + 2c) dc / int c (1 + 2c) dc = 5/7.
        assert directions[:, 2].mean() == pytest.approx(5 / 7, rel=1e-2)


@pytest.mark.parametrize("latitude", [50.0, 60.0, -40.0])
def test_sun_stands_high_on_the_side_of_the_equator(latitude):
    directions = sun_directions(8, latitude)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(directions[::-1, 0], -directions[:, 0], atol=1e-9)
    assert np.all(directions[2:6, 1] * np.sign(latitude) < 0)
    noon = np.sin(np.radians(90 - abs(latitude) + 23.45))
    assert directions[:, 2].max() < noon
    assert directions[:, 2].min() > 0.1
