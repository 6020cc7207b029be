"""Volumes of stems and logs: exactly, by sections, and as form factors of simple bodies."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError, nearest
from forest.measure.stem import Stems
from forest.measure.trees import BREAST_HEIGHT_M

if TYPE_CHECKING:
    import pandas as pd

_QUARTER_PI = 0.25 * np.pi


def huber(length: ArrayLike, lower: ArrayLike, middle: ArrayLike, upper: ArrayLike) -> ArrayLike:
    """Give a log's volume from its middle, L A_m (Huber).

    Parameters
    ----------
    length : array_like
        Length, m.
    lower, middle, upper : array_like
        Diameters at the thick end, half-way and at the thin end, m; not all rules use all.

    Returns
    -------
    array_like
        Volume, m3.
    """
    return np.asarray(length) * _area(middle)


def smalian(length: ArrayLike, lower: ArrayLike, middle: ArrayLike, upper: ArrayLike) -> ArrayLike:
    """Give a log's volume from its ends, L (A_0 + A_1) / 2 (Smalian); see `huber`."""
    return np.asarray(length) * (_area(lower) + _area(upper)) / 2.0


def newton(length: ArrayLike, lower: ArrayLike, middle: ArrayLike, upper: ArrayLike) -> ArrayLike:
    """Give a log's volume as L (A_0 + 4 A_m + A_1) / 6 (Newton); see `huber`.

    It is exact for the paraboloid, the cone and the neiloid.
    """
    return np.asarray(length) * (_area(lower) + 4.0 * _area(middle) + _area(upper)) / 6.0


#: The rules by which a section's volume is taken from its diameters.
RULES: dict[str, Callable[[ArrayLike, ArrayLike, ArrayLike, ArrayLike], ArrayLike]] = {
    "huber": huber,
    "smalian": smalian,
    "newton": newton,
}


def section_volume(
    stems: Stems, rule: str = "huber", *, section_m: float = 2.0, over_bark: bool = True
) -> NDArray[np.float64]:
    """Measure stems in sections from the base up, the last one as long as the rest of the stem.

    Parameters
    ----------
    stems : Stems
        n stems.
    rule : str
        One of `RULES`.
    section_m : float
        Length of a section, along the stem.
    over_bark : bool
        With or without bark.

    Returns
    -------
    float64 (n,)
        Volumes, m3.

    Raises
    ------
    InputError
        If there is no such rule or the length is not above 0.

    Notes
    -----
    Diameters are those of the stem's internodes; where a cut falls between two, the lower one's.
    """
    if rule not in RULES:
        raise InputError(f"unknown rule '{rule}', {nearest(rule, RULES)}", where="section_volume")
    if not section_m > 0.0:
        raise InputError(f"section_m = {section_m}", where="section_volume", expected="above 0 m")
    total = stems.length_m
    count = np.ceil(total / section_m).astype(np.int64)
    stem = np.repeat(np.arange(len(stems)), count)
    number = np.arange(len(stem)) - np.repeat(np.cumsum(count) - count, count)
    lower = np.asarray(number * section_m, np.float64)
    upper = np.minimum(lower + section_m, total[stem])
    at = [
        stems.diameter_along(stem, distance, over_bark=over_bark)
        for distance in (lower, 0.5 * (lower + upper), upper)
    ]
    volume = np.asarray(RULES[rule](upper - lower, *at), np.float64)
    return np.asarray(np.bincount(stem, volume, minlength=len(stems)), np.float64)


def merchantable_volume(
    stems: Stems, *, stump_m: ArrayLike, top_m: ArrayLike, over_bark: bool = True
) -> NDArray[np.float64]:
    """Sum what lies above the stump and is thick enough to sell.

    Parameters
    ----------
    stems : Stems
        n stems.
    stump_m : float or (n,)
        Height of the stump, along the stem.
    top_m : float or (n,)
        Smallest diameter over bark that is sold, m.
    over_bark : bool
        Whether the volume is with bark.

    Returns
    -------
    float64 (n,)
        Volumes, m3.
    """
    owner = stems.owner
    stump = np.broadcast_to(np.asarray(stump_m, np.float64), len(stems))[owner]
    limit = np.broadcast_to(np.asarray(top_m, np.float64), len(stems))[owner]
    above = np.maximum(stems.end_m - np.maximum(stems.start_m, stump), 0.0)
    sold = above * (stems.diameters() >= limit) * _area(stems.diameters(over_bark=over_bark))
    return np.asarray(np.bincount(owner, sold, minlength=len(stems)), np.float64)


def form_factor(
    volume_m3: ArrayLike, diameter_m: ArrayLike, height_m: ArrayLike
) -> NDArray[np.float64]:
    """Give a stem's volume per cylinder of its height; NaN where there is no diameter or height.

    With the diameter at 1.3 m it is the breast height form factor f1.3, with that at the base the
    absolute one, with that at a tenth of the height the normal (Hohenadl's) one.
    """
    cylinder = _area(diameter_m) * np.asarray(height_m, np.float64)
    share = np.full(np.shape(cylinder), np.nan)
    np.divide(volume_m3, cylinder, out=share, where=cylinder > 0.0)
    return share


def normal_form_factor(stems: Stems) -> NDArray[np.float64]:
    """Give Hohenadl's form factor of each stem, over bark: the cylinder is as thick as at 0.1 h."""
    height = stems.height_m
    return form_factor(stems.volume(), stems.diameter_at(0.1 * height), height)


def taper_curve(stems: Stems, *, steps: int = 20) -> pd.DataFrame:
    """Tell the stems' diameters at equal steps of relative height.

    Parameters
    ----------
    stems : Stems
        n stems.
    steps : int
        Steps from the base to the top.

    Returns
    -------
    pandas.DataFrame
        n (steps + 1) rows: `stem` (its number), `relative_height` (0 to 1), `height_m`,
        `diameter_over_bark_cm`, `diameter_under_bark_cm`, and `relative_diameter`, the diameter per
        that at breast height (NaN for a stem that does not reach it).
    """
    import pandas as pd

    share = np.linspace(0.0, 1.0, steps + 1)
    n = len(stems)
    height = np.outer(stems.height_m, share)
    over = np.stack([stems.diameter_at(height[:, k]) for k in range(steps + 1)], axis=1)
    keep = 1.0 - stems.bark_factor[:, None]
    breast = stems.diameter_at(BREAST_HEIGHT_M)[:, None]
    return pd.DataFrame(
        {
            "stem": np.repeat(np.arange(n), steps + 1),
            "relative_height": np.tile(share, n),
            "height_m": height.ravel(),
            "diameter_over_bark_cm": 100.0 * over.ravel(),
            "diameter_under_bark_cm": 100.0 * (over * keep).ravel(),
            "relative_diameter": (over / breast).ravel(),
        }
    )


def _area(diameter: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(_QUARTER_PI * np.asarray(diameter, np.float64) ** 2)
