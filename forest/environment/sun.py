"""One stochastic place of the light after another: on the sun's path, or in the sky.

Hart & Baker 2003, section 4.1, take a single sample a year, from the sun's path more often than
from elsewhere, in proportion to the intensities of sun and sky.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forest.environment.sky import (
    clear_beam,
    overcast_heights,
    overcast_shares,
    season_days,
    sun_places,
)
from forest.random import STREAM_LIGHT, uniforms


class LightPath:
    """Where light may come from at one latitude.

    Directions are drawn by the irradiance that they send to horizontal ground: every picture
    stands for the same light, and the plain mean of some pictures is the mean over light.

    Parameters
    ----------
    latitude_deg : float
        Latitude, degrees, north positive.
    sun_share : float
        Probability that the light comes from the sun, else from an overcast sky.
    lowest_deg : float
        Least elevation of the light above the horizon, degrees.
    """

    def __init__(self, latitude_deg: float, sun_share: float, lowest_deg: float) -> None:
        self._sun_share = sun_share
        lowest = np.sin(np.radians(lowest_deg))
        hours = np.radians(np.arange(-179.5, 180.0, 1.0))
        east, north, up = sun_places(latitude_deg, season_days(latitude_deg), hours)
        energy = np.where(up >= lowest, clear_beam(up), 0.0).ravel()
        #: Places of the sun over the growing season, unit vectors, float64 (n, 3).
        self.sun = np.column_stack([part.ravel() for part in (east, north, up)])
        self._running = np.cumsum(energy) / energy.sum()
        self._sky_share = float(overcast_shares(np.array([lowest]))[0])

    def draw(self, seed: int, step: int, picture: int) -> tuple[NDArray[np.float64], float, float]:
        """Draw the direction of one of a year's pictures, and the shift of its pixels.

        Returns
        -------
        toward : float64 (3,)
            Unit vector towards the light; x east, y north, z up.
        shift_x, shift_y : float
            Shift of the pixels against the plot's corner, pixels, 0 to 1.
        """
        kind, height, azimuth, _ = uniforms(seed, STREAM_LIGHT, 0, 2 * picture, step)
        shift_x, shift_y, _, _ = uniforms(seed, STREAM_LIGHT, 0, 2 * picture + 1, step)
        if kind < self._sun_share:
            place = min(int(np.searchsorted(self._running, height)), len(self.sun) - 1)
            return self.sun[place], shift_x, shift_y
        up = float(overcast_heights(np.array([height * self._sky_share]))[0])
        flat = np.sqrt(1.0 - up * up)
        angle = 2.0 * np.pi * azimuth
        toward = np.array([flat * np.cos(angle), flat * np.sin(angle), up])
        return toward, shift_x, shift_y
