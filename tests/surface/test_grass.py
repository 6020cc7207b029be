"""Blades of grass near the eye."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.camera import Camera
from forest.surface.grass import GRASSES, SEGMENTS, Blades, Grass, grow_grass
from forest.surface.terrain import HeightField

HILL = HeightField(np.add.outer(np.arange(40.0, 0.0, -1.0), np.arange(30.0)), 5.0, (-70.0, -90.0))


def everywhere(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.ones(np.shape(x), np.uint8)


def look(eye: tuple[float, float, float], towards: tuple[float, float, float]) -> Camera:
    return Camera(eye, towards, 300, 200, 40.0)


def grown(kind: Grass, camera: Camera, terrain: HeightField, **more: object) -> Blades:
    return grow_grass({1: kind}, everywhere, terrain, camera, **more)  # type: ignore[arg-type]


@given(name=st.sampled_from(sorted(GRASSES)), turn=st.floats(0.0, 6.28), seed=st.integers(0, 99))
@settings(max_examples=25, deadline=None)
def test_blades_stand_on_the_ground_and_rise(name: str, turn: float, seed: int) -> None:
    kind = GRASSES[name]
    z = float(HILL.at(3.0, 4.0)) + 1.7
    camera = look((3.0, 4.0, z), (3.0 + 9.0 * np.cos(turn), 4.0 + 9.0 * np.sin(turn), z - 1.5))
    blades = grown(kind, camera, HILL, seed=seed)
    assert blades.vertices.shape == (len(blades.colour), SEGMENTS + 1, 3)
    assert len(blades.colour) > 500
    x, y, z = np.moveaxis(blades.vertices.astype(np.float64), 2, 0)
    np.testing.assert_allclose(z[:, 0], HILL.at(x[:, 0], y[:, 0]), atol=1e-4)
    assert (np.diff(z, axis=1) > 0.0).all()
    length = np.linalg.norm(np.diff(blades.vertices, axis=1), axis=2).sum(axis=1)
    assert length.max() < 1.75 * kind.height_m
    brightness = blades.colour.astype(int).sum(axis=2)
    assert (brightness[:, -1] > brightness[:, 0]).all()  # dark foot, light tip


def test_blades_are_curved_lines() -> None:
    camera = look((0.0, 0.0, 1.5), (0.0, 5.0, 0.0))
    for curve, bent in ((0.0, False), (0.8, True)):
        kind = Grass(0.4, 100.0, curve, (0, 0, 0), (1, 1, 1))
        steps = np.diff(grown(kind, camera, HeightField.flat()).vertices, axis=1)
        way = steps / np.linalg.norm(steps, axis=2, keepdims=True)
        turn = np.degrees(np.arccos(np.clip((way[:, 0] * way[:, -1]).sum(axis=1), -1.0, 1.0)))
        assert (turn.min() > 10.0) if bent else (turn.max() < 1.0)


def test_density_falls_with_range() -> None:
    kind = Grass(0.3, 200.0, 0.4, (0, 0, 0), (1, 1, 1))
    blades = grown(kind, look((0.5, 0.5, 1.6), (0.5, 20.0, 0.0)), HeightField.flat())
    feet = blades.vertices[:, 0]
    within = np.abs(feet[:, 0] - 0.5) < 0.2 * feet[:, 1]
    y = feet[within, 1]
    density = [
        np.sum((y >= near) & (y < near + 4.0)) / (0.4 * (near + 2.0) * 4.0) for near in (4, 12, 30)
    ]
    assert density[0] > 2.0 * density[1] > 4.0 * density[2] > 0.0
    assert y.max() < 62.0


def test_blades_stay_while_the_eye_moves() -> None:
    kind = GRASSES["meadow"]
    one = grown(kind, look((0.0, 0.0, 1.7), (0.0, 9.0, 0.0)), HeightField.flat())
    other = grown(kind, look((0.1, 0.2, 1.7), (0.0, 9.0, 0.0)), HeightField.flat())
    feet = [{tuple(foot) for foot in blades.vertices[:, 0].tolist()} for blades in (one, other)]
    assert len(feet[0] & feet[1]) > 0.9 * len(feet[0])


def test_kinds_shade_and_view() -> None:
    camera = look((0.0, 0.0, 1.7), (0.0, 9.0, 0.0))
    flat = HeightField.flat()
    lit = grown(GRASSES["meadow"], camera, flat)
    dark = grown(GRASSES["meadow"], camera, flat, shade_at=lambda p: np.ones(len(p)))
    assert dark.colour.mean() < 0.7 * lit.colour.mean()
    assert len(grow_grass({2: GRASSES["lawn"]}, everywhere, flat, camera).colour) == 0
    up = look((0.0, 0.0, 20.0), (0.0, 1.0, 40.0))
    assert len(grown(GRASSES["meadow"], up, flat).colour) == 0
    high = look((0.0, 0.0, 500.0), (0.0, 0.1, 0.0))
    assert len(grown(GRASSES["meadow"], high, flat).colour) == 0
    with pytest.raises(InputError, match="curve"):
        Grass(0.3, 10.0, 2.0, (0, 0, 0), (1, 1, 1))
