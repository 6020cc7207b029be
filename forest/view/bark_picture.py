"""Bark maps on a sheet, a stem or a ball, lit from any side."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from forest.surface.bark.maps import BarkMaps

_Floats = NDArray[np.float64]
_GAMMA = 2.2
_SUN, _SKY = 1.35, 0.42
_BACK = np.array([0.93, 0.93, 0.92])
_OVERSAMPLING = 2


def lit(
    maps: BarkMaps,
    light_deg: tuple[float, float],
    *,
    shape: Literal["sheet", "stem", "ball"] = "sheet",
    view_m: float = 0.5,
    size: tuple[int, int] = (240, 240),
) -> NDArray[np.uint8]:
    """Draw bark under a distant light.

    Parameters
    ----------
    maps : BarkMaps
        Laid side by side where more is seen than there is; the top of maps that are no tile is
        followed by their bottom.
    light_deg : pair of float
        Where the light stands: bearing (0 behind the viewer, positive to the right) and height
        above the horizon.
    shape : str
        A sheet, an upright stem of the maps' girth, or a ball as wide as the picture.
    view_m : float
        How many metres the picture is high.
    size : (columns, rows)
        Pixels.

    Returns
    -------
    uint8 (rows, columns, 3)
    """
    columns, rows = (_OVERSAMPLING * side for side in size)
    scale = view_m / rows
    x, y = np.meshgrid(
        (np.arange(columns) - 0.5 * (columns - 1)) * scale,
        (0.5 * (rows - 1) - np.arange(rows)) * scale,
    )
    u, v, frame, seen = _shaped(maps, shape, x, y, 0.48 * min(columns, rows) * scale)
    row, column = _pixel(maps, u, v)
    tangent = maps.normal[row, column] / 127.5 - 1.0
    normal = np.einsum("...k,...kc->...c", tangent, frame)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    bearing, height = np.radians(light_deg)
    light = np.array(
        [np.sin(bearing) * np.cos(height), np.sin(height), np.cos(bearing) * np.cos(height)]
    )
    open_to_sky = maps.occlusion[row, column] / 255.0
    # Light that grazes the uncracked surface does not reach the ground of fractures.
    direct = np.clip(normal @ light, 0.0, None) * np.clip(
        3.0 * (frame[..., 2, :] @ light), 0.0, 1.0
    )
    half = light + np.array([0.0, 0.0, 1.0])
    half /= np.linalg.norm(half)
    rough = maps.roughness[row, column] / 255.0
    shine = 0.25 * (1.0 - rough) * np.clip(normal @ half, 0.0, 1.0) ** (4.0 / rough**3)
    colour = (maps.colour[row, column] / 255.0) ** _GAMMA
    bright = _SUN * direct * np.sqrt(open_to_sky) + _SKY * open_to_sky
    picture = np.clip(colour * bright[..., None] + (shine * direct)[..., None], 0.0, 1.0)
    picture = np.where(seen[..., None], picture ** (1.0 / _GAMMA), _BACK)
    k = _OVERSAMPLING
    fine = picture.reshape(size[1], k, size[0], k, 3).mean(axis=(1, 3))
    return np.asarray(np.rint(255.0 * fine), np.uint8)


def _shaped(
    maps: BarkMaps, shape: str, x: _Floats, y: _Floats, ball_m: float
) -> tuple[_Floats, _Floats, _Floats, NDArray[np.bool_]]:
    """Where on the bark each pixel looks (m), the tangent frame there, and whether it does."""
    frame = np.zeros((*x.shape, 3, 3))  # rows: right, up, out
    if shape == "sheet":
        frame[..., 0, 0] = frame[..., 1, 1] = frame[..., 2, 2] = 1.0
        return x, y, frame, np.ones(x.shape, np.bool_)
    if shape == "stem":
        radius = maps.width_m / (2.0 * np.pi)
        seen = np.abs(x) < radius
        sine = np.clip(x / radius, -1.0, 1.0)
        cosine = np.sqrt(1.0 - sine**2)
        frame[..., 0, 0], frame[..., 0, 2] = cosine, -sine
        frame[..., 1, 1] = 1.0
        frame[..., 2, 0], frame[..., 2, 2] = sine, cosine
        return radius * np.arcsin(sine), y, frame, seen
    seen = x**2 + y**2 < ball_m**2
    out = np.sqrt(np.clip(ball_m**2 - x**2 - y**2, 1e-9, None))
    normal = np.stack((x, y, out), axis=-1) / ball_m
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    east = np.stack((normal[..., 2], 0.0 * x, -normal[..., 0]), axis=-1)
    east /= np.linalg.norm(east, axis=-1, keepdims=True)
    frame[..., 0, :], frame[..., 1, :], frame[..., 2, :] = east, np.cross(normal, east), normal
    around = ball_m * np.arctan2(x, out)
    return around, ball_m * np.arcsin(np.clip(y / ball_m, -1.0, 1.0)), frame, seen


def _pixel(maps: BarkMaps, u: _Floats, v: _Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of the maps at places (m) from the middle of their seam and height."""
    rows, columns = maps.occlusion.shape
    column = np.floor((u / maps.width_m + 0.5) * columns).astype(np.int64) % columns
    row = np.floor((0.5 - v / maps.length_m) * rows).astype(np.int64) % rows
    return row, column
