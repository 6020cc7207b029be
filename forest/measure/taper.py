"""Stems of trees whose shape is not on file, drawn through what the run's tables tell of them.

Known of every tree are the diameter at the base and at 1.3 m, the radius at each disc (the sum of
its rings), the height, where the crown begins, and the volume of the stem. Cross sections between
them follow a monotone cubic (Fritsch & Carlson 1980). One section, at the crown's base or halfway
from the highest disc to the top, is not known; it is set so that the stem has its true volume, or
as nearly as it can.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.measure.stem import Stems

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

#: Length of the cylinders of a drawn stem, m.
STEP_M = 0.1

#: What `disc_diameters` reads of `/rings`.
RINGS_READ = ("year", "tree_id", "place", "stem_height_m", "cambial_age", "width_mm")

_BREAST_M = 1.3
_HALVINGS = 40
# The section that is not known keeps this share of the stem's unknown part to either side.
_APART = 0.1
_QUARTER_PI = 0.25 * np.pi


class _Knots(NamedTuple):
    """Known heights of n stems and the cross sections there, each (n, k); the last is the top."""

    height: Floats
    section: Floats


def disc_diameters(rings: pd.DataFrame) -> pd.DataFrame:
    """Sum the rings of each tree and disc to the diameter under bark in the last of their years.

    Parameters
    ----------
    rings : pandas.DataFrame
        Rows of `/rings` up to some year, with the columns `RINGS_READ`.

    Returns
    -------
    pandas.DataFrame
        A row per `tree_id`, a column per disc height, m; diameters in m. NaN where a tree has no
        ring of the last year: there its stem has not reached, or ended.
    """
    last = rings["year"].max()
    discs = rings[rings["place"].astype(str) == "height"]
    now = discs.loc[discs["year"] == last, ["tree_id", "stem_height_m", "cambial_age"]]
    both = discs.merge(now, on=["tree_id", "stem_height_m"], suffixes=("", "_now"))
    # a stem that broke and grew anew has only the rings since its last pith
    own = both[both["year"] > last - both["cambial_age_now"]]
    radius_mm = own.groupby(["tree_id", "stem_height_m"])["width_mm"].sum()
    wide = (0.002 * radius_mm.astype(np.float64)).unstack("stem_height_m")
    wide.columns = np.round(wide.columns.to_numpy(np.float64), 3)
    return wide


def taper_stems(trees: pd.DataFrame, discs: pd.DataFrame, bark_factor: Floats) -> Stems:
    """Draw the stems of trees through their known diameters, upright and with their true volume.

    Parameters
    ----------
    trees : pandas.DataFrame
        n rows of `/trees`, of living trees in one year.
    discs : pandas.DataFrame
        Of the same year; see `disc_diameters`.
    bark_factor : float64 (n,)
        Double bark thickness per diameter over bark.

    Returns
    -------
    Stems
        In the order of `trees`. Cylinders of `STEP_M`; the sections known are met exactly in the
        curve and to half a step in the cylinders.
    """
    height = trees["height_m"].to_numpy(np.float64)
    wood = 1.0 - bark_factor
    volume = trees["stem_volume_m3"].to_numpy(np.float64) * wood**2
    crown_base = trees["crown_base_m"].to_numpy(np.float64)
    at, diameter = _known(trees, discs, wood)
    reached = ~np.isnan(diameter) & (at < height[:, None])
    n = len(height)
    cells = np.maximum(np.ceil(height / STEP_M - 1e-9).astype(np.int64), 1)
    first = np.concatenate(([0], np.cumsum(cells)))
    end = np.empty(first[-1])
    section = np.empty(first[-1])
    for pattern in np.unique(reached, axis=0):
        rows = np.flatnonzero((reached == pattern).all(axis=1))
        knots = _with_crown(
            _Knots(
                np.broadcast_to(at[pattern], (len(rows), pattern.sum())),
                _QUARTER_PI * diameter[rows][:, pattern] ** 2,
            ),
            height[rows],
            crown_base[rows],
            volume[rows],
        )
        place = np.repeat(first[rows], cells[rows])
        number = np.arange(len(place)) - np.repeat(
            np.cumsum(cells[rows]) - cells[rows], cells[rows]
        )
        owner = np.repeat(np.arange(len(rows)), cells[rows])
        low = number * STEP_M
        high = np.minimum(low + STEP_M, height[rows][owner])
        end[place + number] = high
        wooden = _volume_below(knots, owner, high) - _volume_below(knots, owner, low)
        section[place + number] = np.maximum(wooden, 0.0) / np.maximum(high - low, 1e-12)
    metamer = (np.arange(first[-1]) - np.repeat(first[:-1], cells)).astype(np.int32)
    thick = np.sqrt(section / _QUARTER_PI)
    return Stems(first, metamer, end, end.copy(), thick, np.broadcast_to(bark_factor, n).copy())


def _known(trees: pd.DataFrame, discs: pd.DataFrame, wood: Floats) -> tuple[Floats, Floats]:
    """Give the heights of the known sections, (k,), and the diameters there, m, (n, k)."""
    others = [height for height in discs.columns if height not in (0.0, _BREAST_M)]
    columns = {
        0.0: 0.01 * trees["base_diameter_cm"].to_numpy(np.float64) * wood,
        _BREAST_M: 0.01 * trees["dbh_cm"].to_numpy(np.float64) * wood,
        **{h: discs[h].reindex(trees["tree_id"]).to_numpy(np.float64) for h in others},
    }
    at = np.array(sorted(columns))
    return at, np.column_stack([columns[height] for height in at])


def _with_crown(known: _Knots, height: Floats, crown_base: Floats, volume: Floats) -> _Knots:
    """Add the section that gives the stem its volume, and the top.

    It is not thicker than the section below. Bisection: the volume grows with the section.
    """
    highest = known.height[:, -1]
    free = height - highest
    place = np.clip(crown_base, highest + _APART * free, height - _APART * free)
    place = np.where(crown_base > highest, place, highest + 0.5 * free)
    low = np.zeros(len(height))
    high = known.section[:, -1].copy()
    at = np.column_stack((known.height, place, height))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        knots = _Knots(at, np.column_stack((known.section, middle, np.zeros(len(height)))))
        small = _interval_volumes(knots).sum(axis=1) < volume
        low = np.where(small, middle, low)
        high = np.where(small, high, middle)
    return _Knots(at, np.column_stack((known.section, 0.5 * (low + high), np.zeros(len(height)))))


def monotone_slopes(x: Floats, y: Floats) -> Floats:
    """Give the slopes of monotone cubics through the points of each row, (n, k), k above 2.

    scipy's `PchipInterpolator` gives the same; it takes one set of abscissae, and each tree here
    has its own.
    """
    step = np.diff(x, axis=1)
    rise = np.diff(y, axis=1) / step
    slope = np.zeros(y.shape)
    before, after = rise[:, :-1], rise[:, 1:]
    left = step[:, :-1] + 2.0 * step[:, 1:]
    right = 2.0 * step[:, :-1] + step[:, 1:]
    on = before * after > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        harmonic = (left + right) / (left / before + right / after)
    slope[:, 1:-1] = np.where(on, harmonic, 0.0)
    slope[:, 0] = _end_slope(step[:, 0], step[:, 1], rise[:, 0], rise[:, 1])
    slope[:, -1] = _end_slope(step[:, -1], step[:, -2], rise[:, -1], rise[:, -2])
    return slope


def _end_slope(step: Floats, next_step: Floats, rise: Floats, next_rise: Floats) -> Floats:
    """Give the slope at an end: of the parabola through three points, kept monotone."""
    slope = ((2.0 * step + next_step) * rise - step * next_rise) / (step + next_step)
    slope = np.where(slope * rise <= 0.0, 0.0, slope)
    steep = (rise * next_rise < 0.0) & (np.abs(slope) > 3.0 * np.abs(rise))
    return np.where(steep, 3.0 * rise, slope)


def _slopes(knots: _Knots) -> Floats:
    """Give the slopes of the sections; 0 at the top, as a cone has it."""
    slope = monotone_slopes(*knots)
    slope[:, -1] = 0.0
    return slope


def _interval_volumes(knots: _Knots) -> Floats:
    """Integrate the cubics between neighbouring knots, (n, k - 1)."""
    step = np.diff(knots.height, axis=1)
    slope = _slopes(knots)
    mean = 0.5 * (knots.section[:, :-1] + knots.section[:, 1:])
    return np.asarray(step * mean + step**2 * (slope[:, :-1] - slope[:, 1:]) / 12.0)


def _volume_below(knots: _Knots, owner: NDArray[np.int64], height: Floats) -> Floats:
    """Integrate the stems of these rows of `knots` from the base up to heights, (q,)."""
    upto = np.cumsum(_interval_volumes(knots), axis=1)
    upto = np.column_stack((np.zeros(len(upto)), upto))
    slope = _slopes(knots)
    at = (height[:, None] >= knots.height[owner, 1:-1]).sum(axis=1)
    low = knots.height[owner, at]
    step = knots.height[owner, at + 1] - low
    t = np.clip((height - low) / step, 0.0, 1.0)
    here, above = knots.section[owner, at], knots.section[owner, at + 1]
    rises, ends = slope[owner, at] * step, slope[owner, at + 1] * step
    part = (
        here * (t - t**3 + 0.5 * t**4)
        + above * (t**3 - 0.5 * t**4)
        + rises * (t**2 / 2.0 - 2.0 * t**3 / 3.0 + t**4 / 4.0)
        + ends * (t**4 / 4.0 - t**3 / 3.0)
    )
    return np.asarray(upto[owner, at] + step * part)
