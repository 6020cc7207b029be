"""Increment cores: what a borer takes out of a stem whose rings are eccentric.

The outline of the wood at the end of year t is a circle around a centre that has moved from the
pith towards the thick sides,

    R_t = sum w_s,   C_t = sum w_s e_s (cos a_s, sin a_s),   s = 1 .. t,

with the mean width w, the eccentricity e and the azimuth a of the thick side of each ring. As e is
at most 1 the circles lie within each other. A ring's area is then that of the mean widths,
pi (R_t^2 - R_{t-1}^2), whatever its eccentricity, and its width seen from the pith in
the direction b is w (1 + e cos(b - a)): exactly on the thick and the thin side, elsewhere up to
terms of the second order in C / R.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from forest.dendro.series import Radius
from forest.dendro.stems import StemRings, rings_at
from forest.errors import InputError
from forest.random import STREAM_CORE, normals

#: A bore that passes the pith's centre at this distance or nearer goes through it.
PITH_RADIUS_MM = 1.0

#: Innermost rings on a core from whose mean width the missing ones are estimated.
_INNER_RINGS = 5

_LARGEST_AIM_SD_DEG = 30.0  # three of them are a right angle


@dataclass(frozen=True)
class Core:
    """An increment core: the rings from the bark to the pith, or to where the bore passes it.

    Attributes
    ----------
    tree_id : int
    species : str
    stem_height_m : float
        Height of the bore, m.
    azimuth_deg : float
        Direction from the pith to the place where the borer entered, degrees from x towards y.
    aim_deg : float
        Angle by which the bore points past the pith, degrees; positive is to the left.
    year : int array (n,)
        Calendar years of the rings on the core, innermost first.
    width_mm : float64 array (n,)
        Widths along the core, mm; 0 for a missing ring.
    first_cambial_age : int
        Cambial age of the innermost ring on the core.
    pith_offset : int
        Rings of the stem that are not on the core.
    estimated_pith_offset : int
        Their number as one who sees the core alone estimates it: the radius of the arc inside
        the innermost ring over the mean width of the five innermost rings (Duncan 1989).
    miss_mm : float
        Distance between the bore and the pith, mm.
    """

    tree_id: int
    species: str
    stem_height_m: float
    azimuth_deg: float
    aim_deg: float
    year: NDArray[np.int64]
    width_mm: NDArray[np.float64]
    first_cambial_age: int
    pith_offset: int
    estimated_pith_offset: int
    miss_mm: float

    def as_radius(self) -> Radius:
        """Give the core as a series among others."""
        return Radius(
            tree_id=self.tree_id,
            species=self.species,
            stem_height_m=self.stem_height_m,
            year=self.year,
            width_mm=self.width_mm,
            first_cambial_age=self.first_cambial_age,
            azimuth_deg=self.azimuth_deg,
            estimated_pith_offset=self.estimated_pith_offset,
            miss_mm=self.miss_mm,
        )


def radial_widths(stem: StemRings, azimuth_deg: float) -> NDArray[np.float64]:
    """Give the widths of a stem's rings along an azimuth, w (1 + e cos(azimuth - thick side)).

    Parameters
    ----------
    stem : StemRings
        Rings of one tree and height.
    azimuth_deg : float
        Degrees from x towards y.

    Returns
    -------
    float64 (n,)
        Widths in mm. A core through the pith holds these up to terms of the second order in the
        eccentricity, since its rings are circles.
    """
    mean, shift = _mean_and_shift(stem)
    return np.asarray(mean + shift @ _direction(math.radians(azimuth_deg)))


def bore(stem: StemRings, azimuth_deg: float, aim_deg: float = 0.0) -> Core:
    """Bore into a stem from an azimuth, towards the pith or past it.

    Parameters
    ----------
    stem : StemRings
        Rings of one tree and height.
    azimuth_deg : float
        Side on which the borer enters, degrees from x towards y.
    aim_deg : float
        Angle between the bore and the line to the pith, degrees, within a right angle.

    Returns
    -------
    Core
        A ring that the bore only enters, without coming to its inner side, is not on the core.
        A bore within `PITH_RADIUS_MM` of the pith's centre holds all rings. One that stays
        within the last ring holds none.
    """
    mean, shift = _mean_and_shift(stem)
    radius = stem.undated_mm + np.concatenate(([0.0], np.cumsum(mean)))
    centre = np.vstack((np.zeros(2), np.cumsum(shift, axis=0)))
    inward, aim = math.radians(azimuth_deg), math.radians(aim_deg)
    to_bark = _exit(radius[-1:], centre[-1:], _direction(inward), 0.0)[0]
    miss = float(to_bark) * math.sin(aim)
    if abs(miss) <= PITH_RADIUS_MM:
        miss = 0.0
    # Along the bore `s` counts outward from the point nearest to the pith.
    along = _direction(inward + aim)
    across = np.array((-along[1], along[0]))
    touched = np.abs(-miss - centre @ across) <= radius
    innermost = int(np.argmax(touched)) if touched.any() else len(mean)
    s = _exit(radius[innermost:], centre[innermost:], along, -miss)
    widths = np.maximum(np.diff(s), 0.0)  # outlines that touch may cross by a rounding error
    first_age = int(stem.cambial_age[0]) + innermost
    return Core(
        tree_id=stem.tree_id,
        species=stem.species,
        stem_height_m=stem.stem_height_m,
        azimuth_deg=azimuth_deg % 360.0,
        aim_deg=aim_deg,
        year=stem.year[innermost:],
        width_mm=widths,
        first_cambial_age=first_age,
        pith_offset=first_age - 1,
        estimated_pith_offset=_estimated_offset(float(radius[innermost]), widths),
        miss_mm=abs(miss),
    )


def core(
    rings: pd.DataFrame,
    tree_id: int,
    azimuth_deg: float,
    *,
    stem_height_m: float = 1.3,
    aim_sd_deg: float = 0.0,
    seed: int = 1,
) -> Core:
    """Take an increment core from a tree.

    Parameters
    ----------
    rings : pandas.DataFrame
        Rows of `/rings`; the tree is bored at the end of the last year in which it has a ring.
    tree_id : int
        The tree.
    azimuth_deg : float
        Side on which the borer enters, degrees from x towards y.
    stem_height_m : float
        Height of the bore, m: one at which rings are on record.
    aim_sd_deg : float
        Standard deviation of the angle by which the bore points past the pith, 0 to 30 degrees;
        the angle is at most three of them.
    seed : int
        Of the random numbers. The same bore of the same tree is the same in every campaign.

    Returns
    -------
    Core

    Raises
    ------
    InputError
        If the tree or the height has no rings, the azimuth is not finite, or `aim_sd_deg` is out
        of its range.
    """
    return take_core(
        rings_at(rings, tree_id, stem_height_m), azimuth_deg, aim_sd_deg=aim_sd_deg, seed=seed
    )


def take_core(
    stem: StemRings, azimuth_deg: float, *, aim_sd_deg: float = 0.0, seed: int = 1
) -> Core:
    """Take an increment core from a stem at a height; see `core`."""
    if not math.isfinite(azimuth_deg):
        raise InputError(f"azimuth {azimuth_deg:g}", where="core", expected="a number of degrees")
    if not 0.0 <= aim_sd_deg <= _LARGEST_AIM_SD_DEG:
        raise InputError(
            f"aim_sd_deg is {aim_sd_deg:g}",
            where="core",
            expected=f"0 to {_LARGEST_AIM_SD_DEG:g} degrees",
        )
    height_mm = round(1000.0 * stem.stem_height_m)
    tenths = round(10.0 * azimuth_deg) % 3600
    draw, _ = normals(seed, STREAM_CORE, stem.tree_id, height_mm, tenths)
    return bore(stem, azimuth_deg, aim_sd_deg * min(max(float(draw), -3.0), 3.0))


def _mean_and_shift(stem: StemRings) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give each ring's mean width and how far its centre lies from the one before, mm."""
    thick = np.radians(stem.thick_side_deg)
    towards = np.column_stack((np.cos(thick), np.sin(thick)))
    return stem.width_mm, (stem.width_mm * stem.eccentricity)[:, None] * towards


def _direction(azimuth: float) -> NDArray[np.float64]:
    return np.array((math.cos(azimuth), math.sin(azimuth)))


def _exit(
    radius: NDArray[np.float64],
    centre: NDArray[np.float64],
    along: NDArray[np.float64],
    beside: float,
) -> NDArray[np.float64]:
    """Give how far along a line it leaves each circle.

    The line has the direction `along` and passes the origin at `beside` on its left.
    """
    across = np.array((-along[1], along[0]))
    from_centre = beside - centre @ across
    return np.asarray(
        centre @ along + np.sqrt(np.maximum(radius**2 - from_centre**2, 0.0)), np.float64
    )


def _estimated_offset(inside_mm: float, widths: NDArray[np.float64]) -> int:
    """Estimate the rings inside the innermost one; 0 if the core gives nothing to go by."""
    there = widths[widths > 0.0][:_INNER_RINGS]
    return round(inside_mm / float(there.mean())) if len(there) else 0
