"""Grass near the eye: blades as curved lines of a few shaded segments.

Weber and Penn 1995, section 6, after the particle grass of Reeves and Blau (1985).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dynamics.draws import uniforms_of
from forest.errors import InputError
from forest.random import STREAM_GRASS
from forest.surface.camera import Camera
from forest.surface.terrain import HeightField

#: Straight pieces of a blade.
SEGMENTS = 4

_CELL_M = 1.0  # blades are dealt to square cells of the ground
_FULL_M = 3.0  # all blades are drawn up to this distance from the eye,
_FALL = 1.8  # beyond it a share (_FULL_M / distance) ** _FALL,
_REACH_M = 60.0  # and none beyond this
_FADES = 0.7  # the blades get lower in the outer part of the reach
_TILT = 0.12  # least lean of a blade at its foot, m per m
_SHADED = 0.52  # light in the shade of a tree
_REPEAT = 1024  # cells after which the grass repeats itself, far beyond the reach
_MOST_PER_M2 = 4096

_Array = NDArray[np.float64]
RGB = tuple[float, float, float]


@dataclass(frozen=True)
class Grass:
    """A kind of grass.

    Attributes
    ----------
    height_m, height_variation : float
        Length of a blade, and the share by which single blades differ from it.
    per_m2 : float
        Blades drawn per square metre near the eye.
    curve : float
        How far the tip hangs out to its side, as a share of the length; 0 stands upright.
    foot, tip : tuple of float
        Colours, 0 to 1; the foot is dark, for little light gets there.
    """

    height_m: float
    per_m2: float
    curve: float
    foot: RGB
    tip: RGB
    height_variation: float = 0.4

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, most in (
            ("height_m", 5.0),
            ("per_m2", _MOST_PER_M2 / _CELL_M**2),
            ("curve", 1.0),
        ):
            value = getattr(self, name)
            if not 0.0 <= value <= most:
                raise InputError(f"{name} of grass is {value}", expected=f"0 to {most:g}")


#: The three kinds that a feature map's codes 1, 2 and 3 mean unless the scene says otherwise.
GRASSES: Mapping[str, Grass] = {
    "lawn": Grass(0.07, 900.0, 0.25, (0.15, 0.24, 0.07), (0.40, 0.57, 0.20)),
    "meadow": Grass(0.35, 420.0, 0.45, (0.16, 0.23, 0.07), (0.50, 0.62, 0.25)),
    "tall": Grass(0.75, 220.0, 0.60, (0.18, 0.20, 0.08), (0.66, 0.64, 0.34)),
}


class Blades(NamedTuple):
    """Blades of grass, one entry each.

    Attributes
    ----------
    vertices : float32 (n, SEGMENTS + 1, 3)
        Points of the blade from foot to tip, m.
    colour : uint8 (n, SEGMENTS + 1, 3)
        Colour at each; between them it is to be blended (Gouraud 1971).
    """

    vertices: NDArray[np.float32]
    colour: NDArray[np.uint8]


def grow_grass(
    kinds: Mapping[int, Grass],
    code_at: Callable[[_Array, _Array], NDArray[np.uint8]],
    terrain: HeightField,
    camera: Camera,
    *,
    seed: int = 0,
    tint: RGB = (1.0, 1.0, 1.0),
    shade_at: Callable[[_Array], _Array] | None = None,
) -> Blades:
    """Give the blades that the camera sees.

    Parameters
    ----------
    kinds : mapping of int to Grass
        By code of the feature map; codes without a kind bear none.
    code_at : callable
        Code of the grass at places x, y, e.g. `FeatureMap.grass_at`.
    terrain : HeightField
        The ground.
    camera : Camera
        Blades outside its view are left out.
    seed : int
    tint : tuple of float
        Factor on all colours, by which seasons differ.
    shade_at : callable, optional
        Whether points (n, 3) lie in the shade, 0 to 1; in full light unless given.

    Notes
    -----
    Where a blade stands and how it looks depends only on the seed, its cell of one metre and its
    number there. Of a cell the first few blades are drawn, the fewer the farther it is: nothing
    jumps while the eye moves.
    """
    cells = _cells_in_view(terrain, camera)
    distance = np.linalg.norm(cells - np.asarray(camera.eye, np.float64), axis=1)
    share = np.minimum(1.0, (_FULL_M / np.maximum(distance, 1e-9)) ** _FALL)
    most = max((kind.per_m2 for kind in kinds.values()), default=0.0) * _CELL_M**2
    count = np.ceil(most * share).astype(np.int64)
    cell = np.repeat(np.arange(len(cells)), count)
    number = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    column, row = np.floor(cells[cell, :2] / _CELL_M).astype(np.int64).T
    key = ((column % _REPEAT) * _REPEAT + row % _REPEAT) * _MOST_PER_M2 + number
    place, look = (uniforms_of(seed, STREAM_GRASS, key, serial, 0) for serial in (0, 1))
    x, y = (column + place[:, 0]) * _CELL_M, (row + place[:, 1]) * _CELL_M
    code = code_at(x, y)
    foot = np.column_stack((x, y, terrain.at(x, y)))
    light = np.ones(len(foot))
    parts = []
    for which, kind in kinds.items():
        # A cell deals as many blades as the densest kind needs; others take their share of them.
        here = np.flatnonzero((code == which) & (number < kind.per_m2 * _CELL_M**2 * share[cell]))
        if shade_at is not None and len(here):
            shaded = np.asarray(shade_at(foot[here]), np.float64)
            light[here] = 1.0 - (1.0 - _SHADED) * shaded
        outer = np.clip((1.0 - distance[cell[here]] / _REACH_M) / (1.0 - _FADES), 0.05, 1.0)
        height = kind.height_m * outer * (1.0 + kind.height_variation * (2.0 * look[here, 0] - 1.0))
        parts.append(
            _blades(kind, foot[here], height, place[here, 2:], look[here, 1:], light[here], tint)
        )
    none = Blades(
        np.empty((0, SEGMENTS + 1, 3), np.float32), np.empty((0, SEGMENTS + 1, 3), np.uint8)
    )
    return Blades(*(np.concatenate(column) for column in zip(none, *parts, strict=True)))


def _cells_in_view(terrain: HeightField, camera: Camera) -> _Array:
    """List the middles (n, 3) of the cells of ground that the camera sees within reach."""
    eye = np.asarray(camera.eye, np.float64)
    towards = np.asarray(camera.towards, np.float64) - eye
    reach = np.arange(-np.ceil(_REACH_M / _CELL_M), np.ceil(_REACH_M / _CELL_M) + 1.0)
    x, y = (a.ravel() for a in np.meshgrid(reach, reach))
    x = (np.floor(eye[0] / _CELL_M) + x + 0.5) * _CELL_M
    y = (np.floor(eye[1] / _CELL_M) + y + 0.5) * _CELL_M
    middle = np.column_stack((x, y, terrain.at(x, y)))
    ahead = towards / max(float(np.linalg.norm(towards)), 1e-12)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    width = float(np.linalg.norm(right))
    right = right / width if width > 1e-9 else np.array([1.0, 0.0, 0.0])
    up = np.cross(right, ahead)
    seen = middle - eye
    tall = np.tan(np.radians(0.5 * camera.field_of_view_deg))
    wide = tall * camera.width / camera.height
    depth = seen @ ahead
    margin = 2.0 * _CELL_M  # cells and blades reach beyond their middles
    inside = (np.linalg.norm(seen, axis=1) < _REACH_M) & (depth > -margin)
    for axis, slope in ((right, wide), (up, tall)):
        inside &= np.abs(seen @ axis) <= slope * np.maximum(depth, 0.0) + margin * (1.0 + slope)
    return np.asarray(middle[inside], np.float64)


def _blades(
    kind: Grass,
    foot: _Array,
    height: _Array,
    turn: _Array,
    look: _Array,
    light: _Array,
    tint: RGB,
) -> Blades:
    """Bend blades of one kind out of their feet and colour them."""
    along = np.linspace(0.0, 1.0, SEGMENTS + 1)
    angle = 2.0 * np.pi * turn[:, 0]
    aside = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(len(foot))))
    curve = kind.curve * (0.4 + 0.9 * turn[:, 1])
    out = (_TILT * along + curve[:, None] * along**2) * height[:, None]
    rise = along * height[:, None] * (1.0 - 0.45 * curve[:, None] * along)
    vertices = foot[:, None] + out[:, :, None] * aside[:, None]
    vertices[:, :, 2] += rise
    shade = np.asarray(kind.foot) + along[:, None] * (np.asarray(kind.tip) - np.asarray(kind.foot))
    grain = 0.8 + 0.4 * look[:, :1]
    yellow = np.column_stack((0.9 + 0.25 * look[:, 1], np.ones(len(foot)), 1.0 - 0.2 * look[:, 1]))
    colour = shade * (grain * light[:, None] * yellow)[:, None] * np.asarray(tint)
    return Blades(vertices.astype(np.float32), (255.0 * np.clip(colour, 0.0, 1.0)).astype(np.uint8))
