"""Where a picture is taken from, and what may be seen in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.directions import along, unit


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

    def __post_init__(self) -> None:
        """Check the user's numbers."""
        unit(np.subtract(self.towards, self.eye), "the way from camera.eye to camera.towards")
        for name, most in (("width", np.inf), ("height", np.inf), ("field_of_view_deg", 180.0)):
            value = getattr(self, name)
            if not 0.0 < value < most:
                raise InputError(f"camera.{name} is {value}", expected=f"above 0 and below {most}")

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors (3, 3): to the right, up and forward in the picture."""
        forward = unit(np.subtract(self.towards, self.eye), "camera.towards")
        right = np.cross(forward, (0.0, 0.0, 1.0))
        length = np.sqrt(np.sum(right**2))
        right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
        return np.stack((right, np.cross(right, forward), forward))

    @property
    def pixels_per_slope(self) -> float:
        """Size in pixels of what is as large as it is far."""
        return float(0.5 * self.height / np.tan(np.radians(0.5 * self.field_of_view_deg)))

    def may_see(
        self, centre: NDArray[np.float64], radius: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Tell which spheres, of centres (n, 3) and radii (n,), reach into the picture's pyramid.

        One that touches it only near an edge may be taken for seen, none the other way round.
        """
        way = centre - np.asarray(self.eye)
        x, y, z = (along(way, axis) for axis in self.axes)
        seen = z >= -radius
        tall = np.tan(np.radians(0.5 * self.field_of_view_deg))
        for place, slope in ((x, tall * self.width / self.height), (y, tall)):
            seen &= z * slope - np.abs(place) >= -radius * np.hypot(1.0, slope)
        return np.asarray(seen, np.bool_)
