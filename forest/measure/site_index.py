"""Site index: the top height of a stand at a base age, from the stand's own curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError

if TYPE_CHECKING:
    from forest.record.run import Run


def site_index(
    age: NDArray[np.float64], top_height_m: NDArray[np.float64], base_age: float
) -> float:
    """Interpolate top height at a base age, m.

    Parameters
    ----------
    age : float64 (n,)
        Ages, ascending, years.
    top_height_m : float64 (n,)
        Top heights; NaN where there was no tree.
    base_age : float
        Age to which the index refers.

    Raises
    ------
    InputError
        If the curve does not hold the base age: it is not drawn beyond its ends.
    """
    has = ~np.isnan(top_height_m)
    known = age[has]
    if not len(known) or not known[0] <= base_age <= known[-1]:
        span = f"an age from {known[0]:g} to {known[-1]:g}" if len(known) else "a stand with trees"
        raise InputError(f"base age {base_age:g}", where="site index", expected=span)
    return float(np.interp(base_age, known, top_height_m[has]))


def site_index_of(run: Run, *, base_age: float = 50.0, species: str = "all") -> float:
    """Give the site index of a run that began as a plantation: years count from its first.

    Parameters
    ----------
    run : Run
        With the table `stand`.
    base_age : float
        Age to which the index refers, years.
    species : str
        A species, or `all`.
    """
    stand = run.read("stand", ["year", "species", "top_height_m"])
    known = stand["species"].cat.categories
    if species not in known:
        raise InputError(
            f"unknown species '{species}'", where="site index", expected=", ".join(known)
        )
    curve = stand[stand["species"] == species]
    age = curve["year"].to_numpy(np.float64) - run.scenario.start_year + 1.0
    return site_index(age, curve["top_height_m"].to_numpy(np.float64), base_age)
