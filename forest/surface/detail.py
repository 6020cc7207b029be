"""How much of a tree is drawn at a distance (Weber and Penn 1995, section 5).

A tree is kept as four lists of elements: its trunk, its main branches, all its other branches, and
its leaves. With distance, branches that were tubes are drawn as lines and leaves that were blades
as points; then single elements are left out. Nothing is converted or stored: only the limits of
the loop over a list change, one element at a time, so that no jump is seen while one moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError, nearest

#: Elements in a mass: of stems, of leaves drawn as polygons, and of leaves drawn as points. The
#: paper says 4 for all leaves, but its Table 2 follows from 8 for points.
STEM_MASS, LEAF_POLYGON_MASS, LEAF_POINT_MASS = 16, 4, 8

#: The last level of stems; deeper ones are drawn with it.
LAST_LEVEL = 2

SEASONS = ("spring", "summer", "fall", "winter")

_FINEST = 10.0  # quality

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sight:
    """What a tree is looked at with.

    Attributes
    ----------
    season : str
        One of `SEASONS`. Without leaves, or with young ones, branches are seen from farther off.
    quality : float
        Above 0, at most 10, usually up to 1: how far branches are drawn.
    image_height : float
        Height of the picture, pixels.
    field_of_view_deg : float
        Its vertical angle, degree.

    Raises
    ------
    InputError
        If the season is unknown or a number out of its range.
    """

    season: str = "summer"
    quality: float = 1.0
    image_height: float = 1000.0
    field_of_view_deg: float = 60.0

    def __post_init__(self) -> None:
        """Check the user's words."""
        if self.season not in SEASONS:
            raise InputError(f"unknown season {self.season!r}, {nearest(self.season, SEASONS)}")
        if not 0.0 < self.quality <= _FINEST:
            raise InputError(
                f"quality is {self.quality:g}", expected=f"above 0 and at most {_FINEST:g}"
            )
        for name, least, most in (
            ("image_height", 0.0, np.inf),
            ("field_of_view_deg", 0.0, 180.0),
        ):
            value = getattr(self, name)
            if not least < value < most:
                raise InputError(f"{name} is {value}", expected=f"above {least} and below {most}")

    def calibrated(self, range_m: ArrayLike) -> _Array:
        """Give r2: the range at which a picture of 1000 pixels and 60 degrees looks the same."""
        range_m = np.asarray(range_m, dtype=np.float64)
        if not np.all(range_m >= 0.0):
            raise InputError("a range below 0 or not a number", expected="metres from the eye")
        scale = 1000.0 / self.image_height * self.field_of_view_deg / 60.0
        return np.asarray(range_m * scale, dtype=np.float64)


class Fractions(NamedTuple):
    """Shares of a tree's elements that are drawn, 0 to 1; the leading axes are those of the ranges.

    Attributes
    ----------
    stem_polygons, stem_lines : float64 (..., 3)
        Of the trunk, the main branches and the other branches.
    leaf_polygons, leaf_points : float64 (...)
        Of the leaves.
    """

    stem_polygons: _Array
    stem_lines: _Array
    leaf_polygons: _Array
    leaf_points: _Array


def fractions(range_m: ArrayLike, sight: Sight | None = None, *, evergreen: bool) -> Fractions:
    """Give the shares of a tree's elements that are drawn at given ranges.

    Parameters
    ----------
    range_m : array_like
        Distances from the eye to the trees, m.
    sight : Sight, optional
        Season, quality, picture; as it stands there unless given.
    evergreen : bool
        Whether the trees keep their leaves. Others have none in winter, on which the paper is
        silent.

    Raises
    ------
    InputError
        If a range is below 0 or not a number.

    Notes
    -----
    With r2 the calibrated range, s the quality (half of it under full leaves) and d = 200 (in
    spring 100), Weber and Penn 1995, section 5, draw

    * the trunk's polygons: all to 300, 1.5 - r2 / 600 to 800; its lines: all from 100 on;
    * main branches' polygons: all to 200 s; lines: all to 200 s,
      2.2 - 1.2 (r2 / 200 s)^0.3 to 2000 s;
    * other branches' polygons: all to 50 s, 2 - r2 / 50 s to 100 s; lines: all to 100 s,
      2 - (r2 / 100 s)^0.5 to 500 s;
    * leaves' polygons: all to d / 4, 4/3 - r2 / (3 d / 4) to d; points: all to d, 1.5 - r2 / 2 d
      beyond, but at least one of each mass.
    """
    sight = sight or Sight()
    r2 = sight.calibrated(range_m)
    leafy_season = sight.season in ("summer", "fall")
    s = sight.quality / 2.0 if evergreen or leafy_season else sight.quality
    d = 100.0 if sight.season == "spring" else 200.0
    polygons = _levels(_trunk_polygons(r2), r2 < 200.0 * s, _twig_polygons(r2, s))
    lines = _levels(r2 >= 100.0, _branch_lines(r2, s), _twig_lines(r2, s))
    leaf_polygons = np.where(r2 < d, _share(4.0 / 3.0 - r2 / (0.75 * d)), 0.0)
    leaf_points = np.where(
        r2 < d, 1.0, np.maximum(_share(1.5 - r2 / (2.0 * d)), 1.0 / LEAF_POINT_MASS)
    )
    bare = float(sight.season != "winter" or evergreen)
    return Fractions(polygons, lines, bare * leaf_polygons, bare * leaf_points)


def _levels(*shares: NDArray[np.float64] | NDArray[np.bool_]) -> _Array:
    return np.stack([np.asarray(share, dtype=np.float64) for share in shares], axis=-1)


def _share(value: _Array) -> _Array:
    return np.clip(value, 0.0, 1.0)


def _trunk_polygons(r2: _Array) -> _Array:
    return np.where(r2 < 800.0, _share(1.5 - r2 / 600.0), 0.0)


def _branch_lines(r2: _Array, s: float) -> _Array:
    reach = 200.0 * s
    fading = _share(2.2 - 1.2 * (r2 / reach) ** 0.3)
    return np.where(r2 < reach, 1.0, np.where(r2 < 10.0 * reach, fading, 0.0))


def _twig_polygons(r2: _Array, s: float) -> _Array:
    return np.where(r2 < 100.0 * s, _share(2.0 - r2 / (50.0 * s)), 0.0)


def _twig_lines(r2: _Array, s: float) -> _Array:
    reach = 100.0 * s
    fading = _share(2.0 - np.sqrt(r2 / reach))
    return np.where(r2 < reach, 1.0, np.where(r2 < 5.0 * reach, fading, 0.0))


def drawn(total: int, fraction: float, mass_size: int) -> NDArray[np.int64]:
    """List the elements that the paper's loop draws.

    The elements, in order of creation, are cut into masses of `mass_size`; of each mass the first
    few are drawn, so that what is left out is spread over the tree. Of the first masses one more
    is drawn, for the part of the number that is not whole. The last mass may be short.

    Parameters
    ----------
    total : int
        Elements there are.
    fraction : float
        Share to draw, 0 to 1.
    mass_size : int
        Elements in a mass.

    Returns
    -------
    int64 array
        Their indices, rising. The work is in proportion to these, not to `total`.
    """
    if fraction <= 0.0 or total == 0:
        return np.empty(0, np.int64)
    if fraction >= 1.0:
        return np.arange(total)
    number = fraction * mass_size
    whole = int(number)
    masses = total / mass_size
    starts = np.arange(0, total, mass_size)
    more = int(np.ceil(masses * (number - whole)))  # masses with one element more
    index = starts[:, None] + np.arange(whole + 1)
    keep = index < total
    keep[more:, whole] = False
    return index[keep]
