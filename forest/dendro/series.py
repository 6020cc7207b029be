"""From the rows of `/rings` to dated series: one column of widths for each disc or radius."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from forest.dendro.names import short_ids
from forest.dendro.stems import stem_rings

#: What `RingSeries.about` holds, with its dtypes.
ABOUT = {
    "tree_id": "int64",
    "species": "str",
    "stem_height_m": "float64",
    "azimuth_deg": "float64",
    "first_year": "int64",
    "last_year": "int64",
    "first_cambial_age": "int64",
    "pith_offset": "int64",
    "estimated_pith_offset": "float64",
    "miss_mm": "float64",
    "year_shift": "int64",
}


@dataclass(frozen=True)
class RingSeries:
    """Dated ring widths, and what is known of each series.

    Attributes
    ----------
    widths : pandas.DataFrame
        Widths in mm, indexed by calendar `Year` without gaps, one column per series. A missing
        ring is 0; NaN stands before the first and after the last ring of a series.
    about : pandas.DataFrame
        A row per series, indexed by its `id`: `tree_id`, `species`, `stem_height_m`,
        `azimuth_deg` (of a radius; NaN for means around the stem), `first_year`, `last_year`,
        `first_cambial_age` (of the innermost ring in the series), `pith_offset` (rings between it
        and the pith; 0 if the series begins at the pith), `estimated_pith_offset` (as one who sees
        the core alone would estimate it; NaN where it is not a core), `miss_mm` (how far a core
        passes the pith) and `year_shift` (see `moved`).
    """

    widths: pd.DataFrame
    about: pd.DataFrame

    def moved(self, years: int) -> RingSeries:
        """Give the series dated `years` later (earlier, if negative).

        Readers of ring files refuse years after the present: a run into the future is moved
        before it is written. `about.year_shift` adds up all moves, so that the run's own years
        are `first_year - year_shift` to `last_year - year_shift`.
        """
        widths = self.widths.copy()
        widths.index = widths.index + years
        about = self.about.copy()
        for name in ("first_year", "last_year", "year_shift"):
            about[name] += years
        return RingSeries(widths, about)


@dataclass(frozen=True)
class Radius:
    """One series before it has an id: rings of a disc, or those that a core holds."""

    tree_id: int
    species: str
    stem_height_m: float
    year: np.ndarray
    width_mm: np.ndarray
    first_cambial_age: int
    azimuth_deg: float = np.nan
    estimated_pith_offset: float = np.nan
    miss_mm: float = np.nan


def ring_series(rings: pd.DataFrame) -> RingSeries:
    """Give the mean ring widths of every tree and stem height as dated series.

    Parameters
    ----------
    rings : pandas.DataFrame
        Rows of `/rings`, all or some: whole trees, heights or years.

    Returns
    -------
    RingSeries
        In order of tree and height. The id of a series is `T`, the number of the tree and, where
        the tree has several heights, a letter (`A` the lowest); if that is longer than six
        characters it is shortened (`forest.dendro.short_ids`), and `about` says whose it is.

    Raises
    ------
    InputError
        If a column is lacking, there are no rings, or a ring stands there twice.
    """
    return assemble(
        [
            Radius(
                tree_id=stem.tree_id,
                species=stem.species,
                stem_height_m=stem.stem_height_m,
                year=stem.year,
                width_mm=stem.width_mm,
                first_cambial_age=int(stem.cambial_age[0]),
            )
            for stem in stem_rings(rings)
        ]
    )


def assemble(radii: Sequence[Radius]) -> RingSeries:
    """Name radii and lay them side by side. There is at least one, and none is empty."""
    of_tree: dict[int, int] = {}
    for radius in radii:
        of_tree[radius.tree_id] = of_tree.get(radius.tree_id, 0) + 1
    seen: dict[int, int] = {}
    names = []
    for radius in radii:
        number = seen[radius.tree_id] = seen.get(radius.tree_id, -1) + 1
        letter = _letters(number) if of_tree[radius.tree_id] > 1 else ""
        names.append(f"T{radius.tree_id}{letter}")
    ids = short_ids(names)
    years = pd.RangeIndex(
        min(int(r.year[0]) for r in radii), max(int(r.year[-1]) for r in radii) + 1, name="Year"
    )
    columns = np.full((len(years), len(radii)), np.nan)
    for k, radius in enumerate(radii):
        first = int(radius.year[0]) - years[0]
        columns[first : first + len(radius.year), k] = radius.width_mm
    rows: dict[str, list[Hashable]] = {
        "tree_id": [r.tree_id for r in radii],
        "species": [r.species for r in radii],
        "stem_height_m": [r.stem_height_m for r in radii],
        "azimuth_deg": [r.azimuth_deg for r in radii],
        "first_year": [int(r.year[0]) for r in radii],
        "last_year": [int(r.year[-1]) for r in radii],
        "first_cambial_age": [r.first_cambial_age for r in radii],
        "pith_offset": [r.first_cambial_age - 1 for r in radii],
        "estimated_pith_offset": [r.estimated_pith_offset for r in radii],
        "miss_mm": [r.miss_mm for r in radii],
        "year_shift": [0] * len(radii),
    }
    about = pd.DataFrame(rows, index=pd.Index(ids, name="id")).astype(ABOUT)
    return RingSeries(pd.DataFrame(columns, index=years, columns=ids), about)


def _letters(number: int) -> str:
    """Count A to Z, AA, AB and so on."""
    text = ""
    number += 1
    while number:
        number, letter = divmod(number - 1, 26)
        text = chr(ord("A") + letter) + text
    return text
