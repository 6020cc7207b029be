"""Stresses in stems: cantilevers, the wind's profile, and their slow twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.mechanics.stability import stability
from forest.mechanics.stems import GRAVITY, Stem, read_stem
from forest.mechanics.stress import (
    ATTENUATION,
    Wind,
    bending_moments,
    largest_stress,
    streamlining,
    wind_forces,
    wind_profile,
)
from forest.trees.metamers import TERMINAL, Metamers
from tests.mechanics.stem_cases import SPECIES, pole, tapered, wood_of, woody_arena
from tests.reference import stems as slow
from tests.reference.plant import read_plant

seeds = st.integers(0, 2**32 - 1)


def _moments(stem: Stem, tip: np.ndarray, force: np.ndarray, azimuth: float) -> np.ndarray:
    moment = np.empty(len(force))
    bending_moments(stem, tip, force, float(np.cos(azimuth)), float(np.sin(azimuth)), moment)
    return moment


def _tips(m: Metamers, s: int, n: int) -> np.ndarray:
    return m.tip[s : s + n]


@given(seeds, st.floats(0.0, 6.0))
@settings(max_examples=25, deadline=None)
def test_moments_of_weight_and_wind(seed: int, azimuth: float) -> None:
    rng = np.random.default_rng(seed)
    m, trees = woody_arena(rng, 1, 30)
    of = wood_of(trees.species[0])
    stem = read_stem(m, trees, 0, SPECIES)
    force = rng.uniform(0.0, 20.0, len(stem.metamer))
    found = _moments(stem, _tips(m, int(trees.start[0]), int(trees.size[0])), force, azimuth)
    blows = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    nodes = read_plant(m, trees, 0)
    wanted = [slow.moment(nodes, k, of, list(force), blows) for k in range(len(force))]
    np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-5 * max(wanted))


def test_stress_of_a_horizontal_cantilever() -> None:
    """M = q L^2 / 2 at the clamp, sigma = 32 M / (pi d^3)."""
    m, trees = pole(tapered(30, 0.0, 0.05), 4.0, lean=np.pi / 2)
    out = stability(m, trees, SPECIES)
    moment = 850.0 * GRAVITY * np.pi * 0.05**2 * 4.0**2 / 2.0
    assert out.base_moment_nm[0] == pytest.approx(moment, rel=1e-5)
    stress = 32.0 * moment / (np.pi * 0.1**3)
    assert out.stress_share[0] == pytest.approx(stress / 36e6, rel=1e-5)
    assert out.stress_height_m[0] == 0.0


def test_lean_bends_by_its_sine() -> None:
    leaning = stability(*pole(tapered(30, 1.0, 0.1), 9.0, lean=0.2), SPECIES)
    flat = stability(*pole(tapered(30, 1.0, 0.1), 9.0, lean=np.pi / 2), SPECIES)
    share = leaning.base_moment_nm / flat.base_moment_nm
    np.testing.assert_allclose(share, np.sin(0.2), rtol=1e-4)


def test_stress_of_a_force_at_the_top() -> None:
    """On a cone the stress of a load near its tip is largest where x = 3/2 of the load's distance.

    sigma(x) ~ (x - a) / x^3, x from the tip and a the load's distance from it.
    """
    m, trees = pole(tapered(300, 1.0, 0.1), 9.0)
    m.state[299] |= TERMINAL
    stem = read_stem(m, trees, 0, SPECIES)
    a = 2.0
    force = np.zeros(300)
    force[299] = 100.0
    lower = stem._replace(leaf_height=np.full(300, 9.0 - a))
    moment = _moments(lower, m.tip[:300], force, 0.0)
    assert moment[0] == pytest.approx(100.0 * (9.0 - a), rel=1e-5)
    moment[stem.leaf_height > 9.0 - a] = 0.0
    stress, station = largest_stress(lower, moment)
    assert station * 9.0 / 300 == pytest.approx(9.0 - 1.5 * a, abs=0.1)
    radius = 0.1 * 1.5 * a / 9.0
    assert stress == pytest.approx(4.0 * 100.0 * 0.5 * a / (np.pi * radius**3), rel=0.02)


def test_wind_profile() -> None:
    assert wind_profile(20.0, 20.0, ATTENUATION) == pytest.approx(1.0)
    assert wind_profile(10.0, 20.0, ATTENUATION) == pytest.approx(np.exp(-1.0))
    assert wind_profile(10.0, 20.0, 0.0) == 1.0
    doubled = np.log((2.0 - 2.0 / 3.0) / 0.1) / np.log((1.0 / 3.0) / 0.1)
    assert wind_profile(40.0, 20.0, ATTENUATION) == pytest.approx(doubled)
    assert wind_profile(20.0 - 1e-6, 20.0, ATTENUATION) == pytest.approx(
        wind_profile(20.0 + 1e-6, 20.0, ATTENUATION)
    )


def test_crowns_give_way() -> None:
    assert streamlining(5.0) == pytest.approx(0.81, abs=0.005)
    assert streamlining(25.0) == streamlining(20.0) == pytest.approx(0.4)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_wind_forces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.0, 30.0, 7)
    area = rng.uniform(0.0, 3.0, 7)
    speed, canopy, drag = rng.uniform(1.0, 30.0), rng.uniform(5.0, 25.0), rng.uniform(0.2, 0.5)
    fall = rng.uniform(0.0, 3.0)
    force = np.empty(7)
    wind_forces(height, area, speed, (canopy, fall), drag, force)
    for k in range(7):
        if height[k] < canopy:
            u = speed * np.exp(-fall * (1.0 - height[k] / canopy))
        else:
            u = speed * np.log((height[k] / canopy - 2 / 3) / 0.1) / np.log(10 / 3)
        s = 0.4 if u > 20.0 else 10.0 / u - 0.1 if u > 11.0 else 10.0 / 11.0 - 0.1
        assert force[k] == pytest.approx(0.625 * drag * s * area[k] * u**2, rel=1e-9)


def test_wind_bends_trees() -> None:
    """More wind, more stress; from another side a leaning tree is bent otherwise."""
    m, trees = pole(tapered(40, 1.0, 0.1), 12.0, lean=0.1)
    m.state[20:40] |= TERMINAL
    closed = np.array([ATTENUATION])
    calm = stability(m, trees, SPECIES)
    with_lean = stability(m, trees, SPECIES, Wind(np.array([12.0]), 12.0, 0.0, closed))
    against = stability(m, trees, SPECIES, Wind(np.array([12.0]), 12.0, np.pi, closed))
    np.testing.assert_array_equal(with_lean.stress_share, calm.stress_share)
    np.testing.assert_array_equal(calm.wind_stress_share, calm.stress_share)
    assert with_lean.wind_stress_share[0] > calm.stress_share[0]
    assert with_lean.base_moment_nm[0] > against.base_moment_nm[0]
    stem = read_stem(m, trees, 0, SPECIES)
    force = np.empty(40)
    wind_forces(stem.leaf_height, 0.5 * stem.leaf_area, 12.0, (12.0, ATTENUATION), 0.35, force)
    pushed = calm.base_moment_nm[0] + force @ stem.leaf_height
    assert with_lean.base_moment_nm[0] == pytest.approx(pushed, rel=1e-5)
