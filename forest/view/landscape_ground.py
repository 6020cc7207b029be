"""Ground and sky of a view: meshes that are fine near the eye and coarse far off."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.surface.camera import Camera
from forest.surface.shadow import SceneShadow
from forest.view.scenery.scenery import RGB, Scenery

#: Tint of grass and of ground covered by it in each season.
GRASS_TINT: dict[str, RGB] = {
    "spring": (0.95, 1.10, 0.85),
    "summer": (1.0, 1.0, 1.0),
    "fall": (1.12, 0.92, 0.95),
    "winter": (1.02, 0.80, 1.15),
}

_FIRST_M = 0.10  # step of the ground's mesh at the eye's foot
_GROWTH = 0.022  # by which each step is longer than the one before it
_FAR_M = 4000.0
_SKY_M = 5000.0
_ZENITH = np.array([0.30, 0.50, 0.78])
_AMBIENT, _SUN = 0.56, 0.58  # shares of the light on level ground, from the sky and the sun
_CLEAR_M = 9000.0  # even clear air fades the far ground
_BLADES_HIDE = 0.75  # of the ground under grass

_Array = NDArray[np.float64]


def hazed(colour: _Array, points: _Array, camera: Camera, scenery: Scenery) -> NDArray[np.uint8]:
    """Mix colours (n, 3), 0 to 1, with the haze between points (n, 3) and the eye, as bytes."""
    visibility = scenery.haze.visibility_m or _CLEAR_M
    distance = np.linalg.norm(points - np.asarray(camera.eye, np.float64), axis=1)
    clear = np.exp(-distance / visibility)[:, None]
    mixed = clear * colour + (1.0 - clear) * np.asarray(scenery.haze.colour)
    return np.asarray(255.0 * np.clip(mixed, 0.0, 1.0), np.uint8)


def ground(
    scenery: Scenery, camera: Camera, shadows: SceneShadow | None
) -> tuple[_Array, NDArray[np.int64], NDArray[np.uint8]]:
    """Lay the ground around the eye.

    Returns
    -------
    points : float64 (n, 3)
    faces : int64 (m, 4)
        Indices of the corners.
    colour : uint8 (n, 3)
        Of the points.
    """
    eye = np.asarray(camera.eye, np.float64)
    above = float(eye[2] - scenery.terrain.at(eye[0], eye[1]))
    x, y = (_steps(above, camera.field_of_view_deg) + eye[axis] for axis in (0, 1))
    east, north = (a.ravel() for a in np.meshgrid(x, y))
    points = np.column_stack((east, north, scenery.terrain.at(east, north)))
    corner = np.arange(len(points)).reshape(len(y), len(x))
    faces = np.stack(
        (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]), axis=-1
    ).reshape(-1, 4)
    sun = np.maximum(scenery.terrain.normal(east, north) @ scenery.sun, 0.0)
    if shadows is not None:
        sun = sun * (1.0 - shadows.shaded(points))
    sun = sun / max(float(scenery.sun[2]), 0.25)
    light = (_AMBIENT + _SUN * sun)[:, None]
    return points, faces, hazed(_soil(scenery, east, north) * light, points, camera, scenery)


def sky(scenery: Scenery, camera: Camera) -> tuple[_Array, NDArray[np.int64], NDArray[np.uint8]]:
    """Make the dome of the sky around the eye, in the haze's colour at the horizon; as `ground`."""
    turns = 48
    rise = np.radians(np.concatenate(([-90.0, -30.0, -8.0], np.linspace(0.0, 90.0, 31))))
    angle = np.linspace(0.0, 2.0 * np.pi, turns, endpoint=False)
    height, around = (a.ravel() for a in np.meshgrid(rise, angle, indexing="ij"))
    way = np.column_stack(
        (np.cos(height) * np.cos(around), np.cos(height) * np.sin(around), np.sin(height))
    )
    corner = np.arange(len(way)).reshape(len(rise), turns)
    beside = np.roll(corner, -1, axis=1)
    faces = np.stack((corner[:-1], beside[:-1], beside[1:], corner[1:]), axis=-1).reshape(-1, 4)
    blue = np.clip(np.sin(np.maximum(height, 0.0)) * 1.7, 0.0, 1.0) ** 0.6
    if scenery.haze.visibility_m is not None:
        blue = blue * np.clip(scenery.haze.visibility_m / 1500.0, 0.25, 1.0)
    colour = blue[:, None] * _ZENITH + (1.0 - blue[:, None]) * np.asarray(scenery.haze.colour)
    points = np.asarray(camera.eye, np.float64) + _SKY_M * way
    return points, faces, np.asarray(255.0 * colour, np.uint8)


def _steps(above_m: float, field_of_view_deg: float) -> _Array:
    """Give places along an axis on both sides of the eye's foot, the farther the coarser."""
    growth = _GROWTH * np.clip(field_of_view_deg / 50.0, 0.35, 1.0)
    first = max(_FIRST_M, 0.004 * above_m)
    number = int(np.ceil(np.log1p(_FAR_M * growth / first) / np.log1p(growth)))
    side = first * np.expm1(np.arange(1, number + 1) * np.log1p(growth)) / growth
    return np.concatenate((-side[::-1], [0.0], side))


def _soil(scenery: Scenery, x: _Array, y: _Array) -> _Array:
    """Colour the ground: litter and soil in patches, and grass seen from above where it grows."""
    patches = (
        np.sin(0.9 * x + 1.9 * np.sin(0.37 * y))
        + np.sin(0.8 * y + np.sin(0.7 * x))
        + np.sin(2.9 * x - 1.7 * y) * np.sin(3.3 * y + 0.5 * x)
    )
    fine = np.modf(np.abs(np.sin(np.round(x, 3) * 12.9898 + np.round(y, 3) * 78.233)) * 43758.5)[0]
    colour: Any = np.asarray(scenery.ground) * (1.0 + 0.07 * patches + 0.16 * (fine - 0.5))[:, None]
    code = scenery.grass_at(x, y)
    for which, grass in scenery.grasses.items():
        here = code == which
        blend = 0.45 * np.asarray(grass.foot) + 0.55 * np.asarray(grass.tip)
        green = blend * np.asarray(GRASS_TINT[scenery.season])
        grain = (1.0 + 0.06 * patches[here] + 0.14 * (fine[here] - 0.5))[:, None]
        colour[here] = (1.0 - _BLADES_HIDE) * colour[here] + _BLADES_HIDE * green * grain
    return np.asarray(colour, np.float64)
