"""Increments: growth, losses and total production per hectare, from the tables of a run.

With V the stem volume of the living, M what died (or was thrown by the wind) in the year and C
what was felled, all over bark: net increment = V - V(year before) + C, gross increment = net + M.
A tree that dies has first grown for the year, so its last ring is in both M and the gross
increment; one felled between two years grew in neither.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest

if TYPE_CHECKING:
    import pandas as pd

    from forest.record.run import Run

_HECTARE_M2 = 10_000.0
_LOST = ("died", "windthrown")


def volume_growth(
    stand: pd.DataFrame,
    events: pd.DataFrame,
    hectares: float,
    *,
    species: str = "all",
    period: int = 5,
) -> pd.DataFrame:
    """Draw up the account of a stand's volume.

    Parameters
    ----------
    stand : pandas.DataFrame
        `/stand`: `year`, `species`, `volume_m3ha`; the first row of the first year of growth.
    events : pandas.DataFrame
        `/events`: `year`, `species`, `kind`, `volume_m3`.
    hectares : float
        Area of the plot.
    species : str
        A species, or `all`.
    period : int
        Years of the periodic increment.

    Returns
    -------
    pandas.DataFrame
        A row per year: `year`, `age` (years since the first row, that being 1), and in m3/ha
        `volume` (of the living), `mortality`, `removed`, `net_increment`, `gross_increment` (of
        the year), `pai` (periodic: mean net increment of the last `period` years), `production`
        (total: volume and all removed so far), `gross_production` (all that died as well), `mai`
        (mean annual: production / age). All but year and age end in `_m3ha`.

    Raises
    ------
    InputError
        If there is no such species or the period is not at least a year.

    Notes
    -----
    Of a stem cut by pruning the loss counts as negative increment.
    """
    import pandas as pd

    known = stand["species"].astype(str).unique()
    if species not in known:
        raise InputError(
            f"unknown species '{species}', {nearest(species, known)}", where="increments"
        )
    if period < 1:
        raise InputError(f"period = {period}", where="increments", expected="1 year or more")
    rows = stand[stand["species"] == species]
    year = rows["year"].to_numpy()
    volume = rows["volume_m3ha"].to_numpy(np.float64)
    of = events if species == "all" else events[events["species"] == species]
    lost = _per_year(of[of["kind"].isin(_LOST)], year, hectares)
    removed = _per_year(of[of["kind"] == "felled"], year, hectares)

    net = np.diff(volume, prepend=0.0) + removed
    production = np.cumsum(net)
    age = np.arange(1, len(year) + 1)
    before = np.concatenate((np.zeros(period), production))[: len(year)]
    return pd.DataFrame(
        {
            "year": year,
            "age": age,
            "volume_m3ha": volume,
            "mortality_m3ha": lost,
            "removed_m3ha": removed,
            "net_increment_m3ha": net,
            "gross_increment_m3ha": net + lost,
            "pai_m3ha": (production - before) / np.minimum(period, age),
            "production_m3ha": production,
            "gross_production_m3ha": production + np.cumsum(lost),
            "mai_m3ha": production / age,
        }
    )


def growth_table(run: Run, *, species: str = "all", period: int = 5) -> pd.DataFrame:
    """Draw up the account of a run's volume; see `volume_growth`."""
    width, depth = run.scenario.plot.size_m
    return volume_growth(
        run.read("stand", ["year", "species", "volume_m3ha"]),
        run.read("events", ["year", "species", "kind", "volume_m3"]),
        width * depth / _HECTARE_M2,
        species=species,
        period=period,
    )


def _per_year(
    events: pd.DataFrame, year: NDArray[np.int32], hectares: float
) -> NDArray[np.float64]:
    """Sum the volumes of events in each year, m3/ha."""
    sums = events.groupby("year")["volume_m3"].sum()
    return np.asarray(sums.reindex(year, fill_value=0.0), np.float64) / hectares
