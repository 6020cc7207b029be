"""Competition indices and stand density: small examples by hand, and the slow twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.measure import density
from forest.measure.competition import (
    basal_area_of_larger,
    hegyi_nearest,
    hegyi_within,
    height_diversity,
    relative_species_profile,
    share_inside,
    size_differentiation,
    species_profile,
)
from forest.measure.site_index import site_index
from forest.measure.structure import Neighbours
from tests.reference.mensuration import hegyi

NAN = math.nan


def test_hegyi_by_hand():
    x, y = np.array([10.0, 13.0, 10.0, 10.5]), np.array([10.0, 10.0, 14.0, 10.0])
    dbh = np.array([20.0, 30.0, 10.0, NAN])
    got = hegyi_within(x, y, dbh, (40, 40), False, radius_m=4.5)
    assert got == pytest.approx(
        [30 / 20 / 3 + 10 / 20 / 4, 20 / 30 / 3, 20 / 10 / 4, NAN], nan_ok=True
    )
    three = Neighbours(x[:3], y[:3], (40, 40), False)
    assert hegyi_nearest(three, dbh[:3]) == pytest.approx(
        [30 / 20 / 3 + 10 / 20 / 4, 20 / 30 / 3 + 10 / 30 / 5, 20 / 10 / 4 + 30 / 10 / 5]
    )
    # on the edge of an open plot half of the circle, and so half of the competitors, are unseen
    x, y, dbh = np.array([0.0, 3.0]), np.array([20.0, 20.0]), np.array([20.0, 20.0])
    assert hegyi_within(x, y, dbh, (40, 40), False, radius_m=4)[0] == pytest.approx(2 / 3)
    with pytest.raises(InputError, match="above 0 m"):
        hegyi_within(x, y, dbh, (40, 40), False, radius_m=0)
    assert np.isnan(hegyi_within(x, y, dbh * NAN, (40, 40), True)).all()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 12), radius=st.floats(0.5, 15.0))
def test_hegyi_equals_the_slow_twin(seed, n, radius):
    rng = np.random.default_rng(seed)
    size = (6.0, 9.0)
    x, y = rng.uniform(0, size, (n, 2)).T
    dbh = np.where(rng.random(n) < 0.2, NAN, rng.uniform(5, 50, n))
    torus = hegyi_within(x, y, dbh, size, True, radius_m=radius)
    assert torus == pytest.approx(hegyi(x, y, dbh, size, True, radius), nan_ok=True)
    inside = share_inside(np.column_stack((x, y)), size, radius)
    there = hegyi_within(x, y, dbh, size, False, radius_m=radius)
    assert there * inside == pytest.approx(hegyi(x, y, dbh, size, False, radius), nan_ok=True)


@settings(max_examples=25, deadline=None)
@given(x=st.floats(0, 6), y=st.floats(0, 9), radius=st.floats(0.5, 15.0))
def test_the_share_of_a_circle_in_the_plot(x, y, radius):
    across = np.linspace(0, 6, 601)[:-1] + 0.005
    width = np.sqrt(np.maximum(radius**2 - (across - x) ** 2, 0.0))
    chord = np.clip(y + width, 0, 9) - np.clip(y - width, 0, 9)
    area = chord.sum() * 0.01
    (share,) = share_inside(np.array([[x, y]]), (6.0, 9.0), radius)
    assert share == pytest.approx(area / (math.pi * radius**2), rel=2e-3)


def test_basal_area_of_larger_by_hand():
    got = basal_area_of_larger(np.array([0.1, 0.3, 0.1, 0.0, 0.2]), 0.5)
    assert got == pytest.approx([1.0, 0.0, 1.0, NAN, 0.6], nan_ok=True)


def test_size_differentiation_by_hand():
    x = np.arange(3.0)
    near = Neighbours(x, x * 0, (50, 50), False)
    got = size_differentiation(near, np.array([10.0, 20.0, 40.0]))
    assert got == pytest.approx([(0.5 + 0.75) / 2, 0.5, (0.5 + 0.75) / 2])
    alone = Neighbours(x[:1], x[:1], (50, 50), False)
    assert len(size_differentiation(alone, np.ones(1))) == 0


def test_species_profile_by_hand():
    # layers of a 20 m stand: up to 10 m, to 16 m, above
    height = np.array([20.0, 16.1, 16.0, 10.0])
    assert species_profile(height, np.zeros(4)) == pytest.approx(
        -(0.5 * math.log(0.5) + 2 * 0.25 * math.log(0.25))
    )
    kinds = np.array([3, 7, 3, 3])
    assert species_profile(height, kinds) == pytest.approx(math.log(4))
    assert relative_species_profile(height, kinds) == pytest.approx(math.log(4) / math.log(6))
    assert species_profile(np.array([20.0, 20.0]), np.zeros(2)) == 0.0
    assert math.isnan(species_profile(np.empty(0), np.empty(0)))


def test_height_diversity_by_hand():
    height, amount = np.array([0.5, 1.9, 2.0, 7.0]), np.array([1.0, 1.0, 2.0, 4.0])
    want = -(0.25 * math.log(0.25) * 2 + 0.5 * math.log(0.5))
    assert height_diversity(height, amount) == pytest.approx(want)
    assert height_diversity(height, amount, layer_m=10.0) == 0.0


def test_density_by_hand():
    assert density.reineke_sdi(500, 25.4) == pytest.approx(500)
    assert density.reineke_sdi(100, 50.8) == pytest.approx(100 * 2**1.605)
    assert density.summation_sdi(np.array([25.4, 50.8, NAN]), 0.1) == pytest.approx(
        10 * (1 + 2**1.605)
    )
    dbh = np.array([10.0, 40.0])
    uneven = density.reineke_sdi(2, math.sqrt(np.mean(dbh**2)))
    assert density.summation_sdi(dbh, 1.0) < uneven
    assert density.relative_density([509.0, 449.5], [1018.0, 899.0]) == pytest.approx(1.0)
    assert density.curtis_rd(36.0, 16.0) == pytest.approx(9.0)


def test_site_index_by_hand():
    age, height = np.arange(1.0, 5.0), np.array([NAN, 2.0, 4.0, 5.0])
    assert site_index(age, height, 3.5) == pytest.approx(4.5)
    with pytest.raises(InputError, match="base age 5; expected an age from 2 to 4"):
        site_index(age, height, 5.0)
    with pytest.raises(InputError, match="a stand with trees"):
        site_index(age, height * NAN, 2.0)
