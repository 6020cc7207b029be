"""A scene, ready to be looked at from anywhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.camera import Camera
from forest.surface.grass import Grass
from forest.surface.instances import Instances, Model
from forest.surface.scene import Census
from forest.surface.terrain import HeightField

RGB = tuple[float, float, float]

_EYE_HEIGHT_M = 1.7
_BACK = 1.6  # an eye that stands before the edge is this far from it, per height of the trees
_MOST_BACK_M = 60.0

#: Where the day's haze ends and what it looks like.
HAZE_COLOUR: RGB = (0.78, 0.84, 0.90)
GROUND: RGB = (0.36, 0.33, 0.20)


@dataclass(frozen=True)
class Haze:
    """Air that things fade into.

    Attributes
    ----------
    visibility_m : float or None
        Distance at which 1 / e of a thing's own colour is left, m; None is clear air.
    colour : tuple of float
        Its colour, and the sky's at the horizon.
    """

    visibility_m: float | None = None
    colour: RGB = HAZE_COLOUR


@dataclass(frozen=True)
class Viewpoint:
    """Where one stands and what one looks at; None leaves it to the scene.

    Attributes
    ----------
    eye, towards : tuple of float or None
        x and y, and the height above the ground there, m.
    field_of_view_deg : float
        Vertical angle.
    """

    eye: tuple[float, float, float] | None = None
    towards: tuple[float, float, float] | None = None
    field_of_view_deg: float = 50.0


@dataclass(frozen=True)
class Scenery:
    """All that stands in a view.

    Attributes
    ----------
    models, instances : tuple of Model, Instances
        The trees.
    heights : float64 (models,)
        Height of each model, m.
    terrain : HeightField
        The ground.
    grasses : mapping of int to Grass
        By code.
    grass_at : callable
        Code of the grass at places x, y.
    origin_m : tuple of float
        What was taken off all x and y, m: `instances`, `terrain`, `extent` and the camera count
        from here, since what is drawn has single precision.
    extent : (x0, y0, x1, y1)
        The ground that is the scene's own, m; beyond it the ground only goes on.
    sun_azimuth_deg, sun_elevation_deg : float
        From north clockwise, and above the horizon.
    census : Census, optional
        Who the trees are, where they have names of their own.
    notes : tuple of str
        What a user should know of how it was made, a line each.
    """

    models: tuple[Model, ...]
    instances: Instances
    heights: NDArray[np.float64]
    terrain: HeightField
    extent: tuple[float, float, float, float]
    grasses: Mapping[int, Grass] = field(default_factory=dict)
    grass_at: Callable[[Any, Any], NDArray[np.uint8]] = lambda x, y: np.zeros(np.shape(x), np.uint8)
    ground: RGB = GROUND
    season: str = "summer"
    quality: float = 1.0
    sun_azimuth_deg: float = 225.0
    sun_elevation_deg: float = 42.0
    haze: Haze = Haze()
    view: Viewpoint = Viewpoint()
    size: tuple[int, int] = (1200, 750)
    seed: int = 1
    census: Census | None = None
    notes: tuple[str, ...] = ()
    origin_m: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the sun."""
        if not 0.0 < self.sun_elevation_deg <= 90.0:
            raise InputError(
                f"the sun stands at {self.sun_elevation_deg:g} degrees",
                expected="above 0, at most 90",
            )

    @property
    def sun(self) -> NDArray[np.float64]:
        """Unit vector towards the sun; x is east, y north."""
        azimuth, height = np.radians((self.sun_azimuth_deg, self.sun_elevation_deg))
        across = np.cos(height)
        return np.array([across * np.sin(azimuth), across * np.cos(azimuth), np.sin(height)])

    @property
    def tree_heights(self) -> NDArray[np.float64]:
        """Height of each tree, m."""
        return np.asarray(self.heights[self.instances.model] * self.instances.scale)

    def on_ground(self, x: float, y: float, above_m: float) -> tuple[float, float, float]:
        """Give a point some height above the ground."""
        return x, y, float(self.terrain.at(x, y)) + above_m

    def camera(self) -> Camera:
        """Give the camera; unless told otherwise it looks from before the south edge inwards."""
        x0, y0, x1, y1 = self.extent
        heights = self.tree_heights
        top = float(np.quantile(heights, 0.9)) if len(heights) else 2.0
        back = min(_BACK * top, _MOST_BACK_M)
        eye = self.view.eye or (0.5 * (x0 + x1), y0 - back, _EYE_HEIGHT_M)
        towards = self.view.towards or (0.5 * (x0 + x1), y0 + min(back, 0.5 * (y1 - y0)), 0.5 * top)
        if np.allclose(eye, towards):
            raise InputError("the eye looks at itself", expected="two different points")
        return Camera(
            eye=self.on_ground(*eye),
            towards=self.on_ground(*towards),
            width=self.size[0],
            height=self.size[1],
            field_of_view_deg=self.view.field_of_view_deg,
        )
