"""A stand of many trees as one picture's triangles, lines and points.

Weber and Penn 1995, sections 5 and 6. Every tree that the camera may see is drawn in the detail of
its range (`forest.surface.detail`); colours are worked out here: sun, shade and haze.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest._jit import njit
from forest._threads import in_threads
from forest.errors import InputError
from forest.surface.detail import Sight, fractions
from forest.surface.instances import Colour, Elements, Instances, Model
from forest.surface.shadow import SceneShadow, ShadowMap


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from.

    Attributes
    ----------
    eye, towards : float (3,)
        The eye, and a point in the middle of the picture, m. z is up.
    width, height : int
        Size of the picture, pixels.
    field_of_view_deg : float
        Its vertical angle, degree.

    Raises
    ------
    InputError
        If eye and point are the same, or a size or the angle is out of range.
    """

    eye: tuple[float, float, float]
    towards: tuple[float, float, float]
    width: int = 1000
    height: int = 1000
    field_of_view_deg: float = 60.0


class Frame(NamedTuple):
    """What is drawn.

    Attributes
    ----------
    triangles : float32 (t, 3, 3)
        Corners, m.
    triangle_colour : uint8 (t, 3)
        Red, green, blue.
    lines : float32 (l, 2, 3)
    line_colour : uint8 (l, 3)
    points : float32 (p, 1, 3)
    point_colour : uint8 (p, 3)
    line_width : float32 (l,)
        Diameter of the branch, pixels at its range.
    point_size : float32 (p,)
        Side of a square that covers as much as the leaf and those left out around it, pixels.
    seen : int64 (n,)
        The instances that the camera may see, rising.
    """

    triangles: NDArray[np.float32]
    triangle_colour: NDArray[np.uint8]
    lines: NDArray[np.float32]
    line_colour: NDArray[np.uint8]
    points: NDArray[np.float32]
    point_colour: NDArray[np.uint8]
    line_width: NDArray[np.float32]
    point_size: NDArray[np.float32]
    seen: NDArray[np.int64]


def prepare(
    models: Sequence[Model],
    instances: Instances,
    camera: Camera,
    *,
    season: str = "summer",
    quality: float = 1.0,
    sun: ArrayLike = (-0.36, -0.48, 0.80),
    haze: float | None = None,
    haze_colour: Colour = (0.76, 0.82, 0.88),
    shadows: SceneShadow | None = None,
) -> Frame:
    """Work out what is drawn of a stand."""
    raise NotImplementedError
