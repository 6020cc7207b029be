"""Where light comes from: directions of the diffuse sky and places of the sun over a season."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
#: Transmissivity of a clear atmosphere for the beam at the zenith.
_CLEAR_SKY = 0.7
#: Growing season, days of the year on the northern hemisphere (May to September).
_SEASON = (121, 273)


def sky_directions(n: int) -> NDArray[np.float64]:
    """Choose directions towards the sky that each send the same irradiance to the ground.

    The sky is the standard overcast one, radiance proportional to 1 + 2 cos(zenith angle). An
    odd number has one direction at the zenith; the others are opposite pairs, so that light
    leans to no side, at equal steps of the share of irradiance and golden-angle azimuths.

    Parameters
    ----------
    n : int
        Number of directions.

    Returns
    -------
    float64 (n, 3)
        Unit vectors, z up.

    References
    ----------
    Moon & Spencer 1942, "Illumination from a non-uniform sky".
    """
    pairs = n // 2
    up = overcast_heights((n % 2 + 2 * np.arange(pairs) + 1) / n)
    azimuth = _GOLDEN_ANGLE * np.arange(pairs)
    flat = np.sqrt(1 - up**2)[:, None] * np.column_stack((np.cos(azimuth), np.sin(azimuth)))
    upper = [np.array([[0.0, 0.0, 1.0]])] if n % 2 else []
    return np.concatenate(
        [*upper, np.column_stack((flat, up)), np.column_stack((-flat, up))], axis=0
    )


def overcast_heights(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find the cosines of the zenith angle above which an overcast sky sends these shares."""
    cosines = np.linspace(1.0, 0.0, 4001)
    return np.interp(share, overcast_shares(cosines), cosines)


def overcast_shares(cosines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the share of irradiance that an overcast sky sends from above these cosines."""
    shares: NDArray[np.float64] = (3 * (1 - cosines**2) + 4 * (1 - cosines**3)) / 7
    return shares


def season_days(latitude_deg: float) -> NDArray[np.float64]:
    """List every fourth day of the year of the growing season."""
    days = np.arange(_SEASON[0], _SEASON[1], 4.0)
    return days + 182.5 if latitude_deg < 0 else days


def sun_places(
    latitude_deg: float, days: NDArray[np.float64], hours: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Give the sun's directions to east, north and up, each (days, hours).

    Parameters
    ----------
    latitude_deg : float
    days : float64 (days,)
        Days of the year.
    hours : float64 (hours,)
        Hour angles, rad; 0 at noon.
    """
    latitude = np.radians(latitude_deg)
    declination = np.radians(23.45) * np.sin(2 * np.pi * (284 + days) / 365)
    sin_d = np.sin(declination)[:, None]
    cos_d = np.cos(declination)[:, None]
    east = -cos_d * np.sin(hours)
    north = np.cos(latitude) * sin_d - np.sin(latitude) * cos_d * np.cos(hours)
    up = np.sin(latitude) * sin_d + np.cos(latitude) * cos_d * np.cos(hours)
    return east, north, up


def clear_beam(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the clear-sky beam on horizontal ground, relative; 0 where the sun has set."""
    height = np.maximum(up, 1e-3)
    return np.where(up > 0, height * _CLEAR_SKY ** (1 / height), 0.0)


def sun_directions(n: int, latitude_deg: float) -> NDArray[np.float64]:
    """Choose places of the sun over the growing season that each send the same irradiance.

    The season's clear-sky beam on horizontal ground (May to September; November to March south
    of the equator) is cut by hour of the day into `n` parts of equal energy; each is
    represented by its mean direction. x points east, y north.

    Parameters
    ----------
    n : int
        Number of places.
    latitude_deg : float
        Latitude, degrees, north positive.

    Returns
    -------
    float64 (n, 3)
        Unit vectors, z up; symmetric about noon.

    References
    ----------
    Declination: Cooper 1969; beam: Bouguer's law with transmissivity 0.7 at the zenith.
    """
    hours = np.radians(np.arange(-179.5, 180.0, 1.0))
    east, north, up = sun_places(latitude_deg, season_days(latitude_deg), hours)
    energy = clear_beam(up)
    hourly = np.stack([(energy * part).sum(axis=0) for part in (east, north, up)], axis=1)
    share = energy.sum(axis=0) / energy.sum()
    # Running integrals at the parts' ends give each part's mean without splitting samples.
    ends = np.concatenate(([0.0], np.cumsum(share)))
    at = np.linspace(0.0, 1.0, n + 1)
    sums = np.concatenate((np.zeros((1, 3)), np.cumsum(hourly, axis=0)))
    part = np.diff(np.column_stack([np.interp(at, ends, sums[:, i]) for i in range(3)]), axis=0)
    return np.asarray(part / np.linalg.norm(part, axis=1)[:, None], dtype=np.float64)
