"""Reaction wood: when it forms, which way it turns an axis, and on which side it is thick."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest.mechanics.righting import (
    BETA,
    STRAIN,
    answer_to_deviation,
    answer_to_lean,
    strained_turn,
)
from forest.mechanics.rods import Rods
from tests.mechanics.test_wood import UPRIGHT, lay, round_rods, traits_of
from tests.reference import wood as slow

DEGREE = np.pi / 180
GROUPS = ["picea_abies", "fagus_sylvatica"]
angles = st.floats(-np.pi, np.pi)


def pointing(lean: float, azimuth: float, roll: float) -> NDArray[np.float32]:
    """The frame of an axis that leans from the vertical towards an azimuth, rad."""
    half = 0.5 * np.array([azimuth, lean, roll])
    c, s = np.cos(half), np.sin(half)
    about_z = np.array([c[0], 0.0, 0.0, s[0]])
    about_y = np.array([c[1], 0.0, s[1], 0.0])
    about_h = np.array([c[2], s[2], 0.0, 0.0])
    q = _product(_product(about_z, about_y), _product(UPRIGHT, about_h))
    return q.astype(np.float32)


def _product(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *vector])


def _swing(rods: Rods) -> NDArray[np.float64]:
    """How the heading moves per length, in the world, as the rest curvature bends it."""
    frame = slow.frame_of(rods.frame[0].astype(float))
    return np.cross(frame @ rods.rest[0].astype(float), frame[:, 0])


@pytest.mark.parametrize("name", GROUPS)
@given(st.floats(20.0, 160.0), angles, angles)
def test_reaction_wood_turns_a_leaning_stem_back(
    name: str, lean: float, azimuth: float, roll: float
) -> None:
    """Conifers push from below, broadleaves pull from above; both turn the stem upwards."""
    rods = round_rods(1, 0.02, 8e9, frame=pointing(lean * DEGREE, azimuth, roll))
    frame = slow.frame_of(rods.frame[0].astype(float))
    out = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    np.testing.assert_allclose(frame[:, 0] @ out, np.sin(lean * DEGREE), atol=1e-5)
    ring = lay(rods, 0.022, traits_of(name), STRAIN)
    swing = _swing(rods)
    size = np.linalg.norm(swing)
    np.testing.assert_allclose(swing[2] / size, np.sin(lean * DEGREE), atol=1e-4)
    np.testing.assert_allclose(swing @ out / size, -np.cos(lean * DEGREE), atol=1e-4)
    side = frame @ [0.0, np.cos(ring[0, 1]), np.sin(ring[0, 1])]
    assert side[2] * (1 if name == "fagus_sylvatica" else -1) > 0
    assert ring[0, 0] == np.float32(0.5)


@pytest.mark.parametrize("name", GROUPS)
@given(st.floats(0.0, 4.9), angles, angles)
def test_no_reaction_wood_inside_the_threshold(
    name: str, lean: float, azimuth: float, roll: float
) -> None:
    rods = round_rods(1, 0.02, 8e9, frame=pointing(lean * DEGREE, azimuth, roll))
    ring = lay(rods, 0.022, traits_of(name, righting_from_deg=5.0), STRAIN)
    assert (ring == 0.0).all()
    assert (rods.rest == 0.0).all()


@pytest.mark.parametrize("name", GROUPS)
@pytest.mark.parametrize(("lean", "way"), [(30.0, -1), (90.0, 1), (57.0, 0), (63.0, 0)])
def test_reaction_wood_brings_a_branch_to_its_angle(name: str, lean: float, way: int) -> None:
    """A branch above its angle turns down, with the thick side exchanged; below it turns up."""
    woods = traits_of(name, branch_angle_deg=60.0, righting_from_deg=5.0)
    rods = round_rods(1, 0.01, 8e9, frame=pointing(lean * DEGREE, 0.7, 1.3))
    ring = lay(rods, 0.012, woods, STRAIN, order=1)
    assert np.sign(_swing(rods)[2]) == way
    if way:
        frame = slow.frame_of(rods.frame[0].astype(float))
        side = frame @ [0.0, np.cos(ring[0, 1]), np.sin(ring[0, 1])]
        assert np.sign(side[2]) == (way if name == "fagus_sylvatica" else -way)


def test_reaction_wood_grows_with_the_lean_up_to_full() -> None:
    answers = [
        answer_to_lean(pointing(lean * DEGREE, 0.0, 0.0), 0.0, 2 * DEGREE, 10 * DEGREE)[0]
        for lean in (1.0, 2.0, 7.0, 12.0, 90.0)
    ]
    np.testing.assert_allclose(answers, [0.0, 0.0, 0.5, 1.0, 1.0], atol=1e-4)


@pytest.mark.parametrize("upright", [UPRIGHT, pointing(np.pi, 0.0, 0.0)])
def test_an_axis_in_the_vertical_has_no_side_for_reaction_wood(upright: Any) -> None:
    assert answer_to_lean(np.float32(upright), 1.0, 0.0, 0.1) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", GROUPS)
def test_reaction_wood_stops_when_a_seedling_has_come_upright(name: str) -> None:
    """A weightless stem that turns as one piece: it nears the vertical and goes no further."""
    woods = traits_of(name, righting_from_deg=2.0)
    lean, radius, length = 30.0, 0.004, 0.5
    rods = round_rods(1, radius, 6e9)
    leans = []
    for _ in range(40):
        before = rods.rest[0, 1:].astype(float)
        rods.frame[0] = pointing(lean * DEGREE, 0.0, 0.0)
        radius += 0.0005
        lay(rods, radius, woods, STRAIN)
        rods.curvature[:] = rods.rest
        lean -= np.linalg.norm(rods.rest[0, 1:] - before) * length / DEGREE
        leans.append(lean)
    assert 1.9 < leans[-1] < 4.5
    assert all(b <= a for a, b in pairwise(leans))


@given(st.floats(0.005, 0.1), st.floats(1.05, 2.0), st.integers(2, 10))
def test_reaction_wood_bends_alike_in_one_ring_or_many(
    inner: float, growth: float, rings: int
) -> None:
    modulus, core, strain = 7e9, 9e9 * np.pi / 4 * inner**4, 0.002
    once = strained_turn(inner, inner * growth, core, modulus, strain)
    radii = inner * np.linspace(1.0, growth, rings + 1)
    total = 0.0
    for a, b in pairwise(radii):
        total += strained_turn(a, b, core, modulus, strain)
        core += modulus * np.pi / 4 * (b**4 - a**4)
    np.testing.assert_allclose(total, once, rtol=1e-5)


@pytest.mark.parametrize("name", GROUPS)
def test_beta_reaction_wood_is_thick_where_the_load_presses_or_pulls(name: str) -> None:
    """A level branch that hangs down: below in conifers, above in broadleaves."""
    level = np.array([1.0, 0.0, 0.0, 0.0])  # H along x, L along y, U up
    rods = round_rods(1, 0.01, 8e9, frame=level, curvature=[0.0, 0.3, 0.0])
    frame = slow.frame_of(level)
    assert np.cross(frame @ rods.curvature[0], frame[:, 0])[2] < 0  # it bends down
    ring = lay(rods, 0.011, traits_of(name), BETA, order=1)
    side = frame @ [0.0, np.cos(ring[0, 1]), np.sin(ring[0, 1])]
    np.testing.assert_allclose(side[2], 1.0 if name == "fagus_sylvatica" else -1.0, atol=1e-6)
    assert rods.rigidity[0, 1] > rods.rigidity[0, 2]  # stiffer against this bending


@pytest.mark.parametrize(("bend", "strength"), [(0.0, 0.0), (0.049, 0.0), (0.051, 1.0)])
def test_beta_reaction_wood_sets_in_beyond_the_limit(bend: float, strength: float) -> None:
    rest = np.array([0.0, 0.2, -0.1], np.float32)
    curvature = rest + np.array([0.3, 0.6 * bend, 0.8 * bend], np.float32)
    answer = answer_to_deviation(curvature, rest, 0.05)
    assert answer[0] == strength
    np.testing.assert_allclose(answer[1:], [-0.6 * strength, -0.8 * strength], atol=1e-4)


def test_beta_reaction_wood_cannot_right_a_straight_stem() -> None:
    rods = round_rods(1, 0.02, 8e9, frame=pointing(0.5, 0.0, 0.0))
    assert (lay(rods, 0.022, traits_of(), BETA) == 0.0).all()
    assert (rods.rest == 0.0).all()
