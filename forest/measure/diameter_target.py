"""Target diameter distributions of uneven-aged stands, and how near a stand has come to one.

De Liocourt (1898) found that in selection forests the number of trees falls from diameter class to
diameter class by the same quotient q: drawn over diameter, a reversed J. In old-growth stands the
middle classes often fall less steeply than the others, a rotated sigmoid (Goff & West 1975). Both
are fixed by a basal area, a largest diameter and q, as foresters mark selection cuttings (BDq). A
measured stand can be a target too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

CLASS_CM = 5.0

_WHOLE = 1e-6  # of a class: rounding of decimal limits


class Agreement(NamedTuple):
    """How far a stand's diameters and a target cover each other, 0 (nowhere) to 1 (alike)."""

    overlap_n: float  # by number of trees: 2 sum(min(stand, target)) / sum(stand + target)
    overlap_g: float  # the same of basal area
    overlap: float  # geometric mean of both


@dataclass(frozen=True)
class DiameterTarget:
    """A diameter distribution to be reached, k classes.

    Attributes
    ----------
    limits_cm : float64 (k + 1,)
        Limits of the classes, ascending; a tree belongs to the class that its dbh begins.
    n_ha : float64 (k,)
        Trees per ha.
    basal_area_m2ha : float64 (k,)
        Their basal area per ha.
    """

    limits_cm: NDArray[np.float64]
    n_ha: NDArray[np.float64]
    basal_area_m2ha: NDArray[np.float64]

    def classes(self, dbh_cm: ArrayLike, hectares: float) -> pd.DataFrame:
        """Set a stand beside the target, class by class.

        Parameters
        ----------
        dbh_cm : array-like (n,)
            Diameters of the stand's trees; NaN and those below the least class do not count.
        hectares : float
            Area on which they stand.

        Returns
        -------
        pandas.DataFrame
            A row per class, and a last one for trees that are thicker than any class: `from_cm`,
            `to_cm`, `n_ha`, `target_n_ha`, `surplus_n_ha` (below 0: trees that are missing),
            `basal_area_m2ha` and `target_basal_area_m2ha`.

        Raises
        ------
        InputError
            If the area is not above 0.
        """
        import pandas as pd

        limits = np.append(self.limits_cm, np.inf)
        number, ground = _by_class(dbh_cm, hectares, limits)
        wanted = np.append(self.n_ha, 0.0)
        return pd.DataFrame(
            {
                "from_cm": limits[:-1],
                "to_cm": limits[1:],
                "n_ha": number,
                "target_n_ha": wanted,
                "surplus_n_ha": number - wanted,
                "basal_area_m2ha": ground,
                "target_basal_area_m2ha": np.append(self.basal_area_m2ha, 0.0),
            }
        )

    def agreement(self, dbh_cm: ArrayLike, hectares: float) -> Agreement:
        """Say how far a stand has come: the share by which it and the target overlap.

        Parameters and what counts are those of `classes`. Trees thicker than the target's largest
        are surplus. 0 where no tree counts.
        """
        table = self.classes(dbh_cm, hectares)
        overlaps = [
            _overlap(table[name].to_numpy(), table[f"target_{name}"].to_numpy())
            for name in ("n_ha", "basal_area_m2ha")
        ]
        return Agreement(overlaps[0], overlaps[1], float(np.sqrt(overlaps[0] * overlaps[1])))


def reverse_j(
    q: float,
    basal_area_m2ha: float,
    largest_cm: float,
    *,
    least_cm: float = 5.0,
    class_cm: float = CLASS_CM,
) -> DiameterTarget:
    """Give de Liocourt's distribution: each class has q times the trees of the next thicker one.

    Parameters
    ----------
    q : float
        Quotient of two neighbouring classes; it belongs to a width of class.
    basal_area_m2ha : float
        Basal area of all classes, each tree as thick as the middle of its class.
    largest_cm : float
        Upper limit of the last class.
    least_cm : float
        Lower limit of the first one.
    class_cm : float
        Width of the classes.

    Returns
    -------
    DiameterTarget

    Raises
    ------
    InputError
        If a number is out of range, or the classes do not fill the span.
    """
    limits = _limits(least_cm, largest_cm, class_cm, "reverse_j")
    steps = np.full(len(limits) - 2, _quotient("reverse_j", "q", q))
    return _falling(steps, limits, basal_area_m2ha, "reverse_j")


def rotated_sigmoid(
    q: float,
    q_middle: float,
    middle_cm: tuple[float, float],
    basal_area_m2ha: float,
    largest_cm: float,
    *,
    least_cm: float = 5.0,
    class_cm: float = CLASS_CM,
) -> DiameterTarget:
    """Give a distribution that falls by q, but less steeply over the middle diameters.

    Parameters
    ----------
    q : float
        Quotient of neighbouring classes below and above the middle.
    q_middle : float
        Quotient where both classes' middles lie in `middle_cm`; 1 is a plateau.
    middle_cm : tuple of float
        From and to where.
    basal_area_m2ha, largest_cm, least_cm, class_cm : float
        As of `reverse_j`.

    Returns
    -------
    DiameterTarget

    Raises
    ------
    InputError
        If a number is out of range, or the classes do not fill the span.
    """
    where = "rotated_sigmoid"
    limits = _limits(least_cm, largest_cm, class_cm, where)
    outside, inside = _quotient(where, "q", q), _quotient(where, "q_middle", q_middle)
    if not middle_cm[0] < middle_cm[1]:
        raise InputError(
            f"middle_cm = {list(middle_cm)}", where=where, expected="two diameters, ascending"
        )
    middles = 0.5 * (limits[1:] + limits[:-1])
    within = (middles >= middle_cm[0]) & (middles <= middle_cm[1])
    steps = np.where(within[1:] & within[:-1], inside, outside)
    return _falling(steps, limits, basal_area_m2ha, where)


def stand_as_target(
    dbh_cm: ArrayLike, hectares: float, limits_cm: Sequence[float]
) -> DiameterTarget:
    """Take the diameters of a measured stand as the target.

    Parameters
    ----------
    dbh_cm : array-like (n,)
        Diameters of its trees; NaN and those outside the limits do not count.
    hectares : float
        Area on which they stand.
    limits_cm : sequence of float
        Limits of the classes.

    Raises
    ------
    InputError
        If the area is not above 0, the limits do not ascend, or no tree lies between them.
    """
    limits = np.asarray(limits_cm, np.float64)
    if len(limits) < 2 or not (np.diff(limits) > 0.0).all():
        raise InputError(
            "limits do not ascend", where="limits_cm", expected="two or more, each larger"
        )
    number, ground = _by_class(dbh_cm, hectares, limits)
    if not number.any():
        raise InputError(
            "no tree of these diameters",
            where="stand_as_target",
            expected=f"dbh from {limits[0]:g} to {limits[-1]:g} cm",
        )
    return DiameterTarget(limits, number, ground)


def _by_class(
    dbh_cm: ArrayLike, hectares: float, limits: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give number and basal area per ha of each class, (k,) for k + 1 limits."""
    if not hectares > 0.0:
        raise InputError(f"hectares = {hectares}", where="diameter target", expected="above 0 ha")
    dbh = np.asarray(dbh_cm, np.float64)
    dbh = dbh[(dbh >= limits[0]) & (dbh < limits[-1])]
    place = np.searchsorted(limits, dbh, side="right") - 1
    n = len(limits) - 1
    number = np.bincount(place, minlength=n) / hectares
    ground = np.bincount(place, _disc_m2(dbh), minlength=n) / hectares
    return number, ground


def _falling(
    quotients: NDArray[np.float64], limits: NDArray[np.float64], basal_area: float, where: str
) -> DiameterTarget:
    """Let numbers fall from class to class by the quotients, (k - 1,), to a basal area."""
    if not 0.0 < basal_area < np.inf:
        raise InputError(
            f"basal_area_m2ha = {basal_area}", where=where, expected="above 0 m2 per ha"
        )
    shape = np.concatenate(([1.0], 1.0 / np.cumprod(quotients)))
    each = _disc_m2(0.5 * (limits[1:] + limits[:-1]))
    number = shape * (basal_area / float(shape @ each))
    return DiameterTarget(limits, number, number * each)


def _limits(least: float, largest: float, width: float, where: str) -> NDArray[np.float64]:
    if not (0.0 <= least < largest < np.inf and width > 0.0):
        raise InputError(
            f"classes of {width:g} cm from {least:g} to {largest:g} cm",
            where=where,
            expected="0 <= least_cm < largest_cm and class_cm above 0",
        )
    n = round((largest - least) / width)
    if n < 1 or abs(least + n * width - largest) > _WHOLE * width:
        raise InputError(
            f"classes of {width:g} cm do not fill {least:g} to {largest:g} cm",
            where=where,
            expected="largest_cm = least_cm + a whole number of class_cm",
        )
    return least + width * np.arange(n + 1.0)


def _quotient(where: str, key: str, value: float) -> float:
    if not 0.0 < value < np.inf:
        raise InputError(f"{key} = {value}", where=where, expected="above 0; 1.2 to 1.8 as a rule")
    return value


def _disc_m2(diameter_cm: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(0.25e-4 * np.pi * diameter_cm**2, np.float64)


def _overlap(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    return float(2.0 * np.minimum(one, other).sum() / (one.sum() + other.sum()))
