"""The rings of one stem at one height, taken out of the rows of `/rings`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from forest.errors import InputError, nearest

#: What a frame of rings must hold; see `/rings` in the run file.
RING_COLUMNS = (
    "year",
    "tree_id",
    "species",
    "stem_height_m",
    "cambial_age",
    "width_mm",
    "eccentricity",
    "thick_side_deg",
)


class StemRings(NamedTuple):
    """The rings of a tree at a height, innermost first, no year left out.

    Attributes
    ----------
    tree_id : int
    species : str
    stem_height_m : float
        Without the digits that float32 adds.
    year : int64 (n,)
        Calendar years that follow each other.
    cambial_age : int64 (n,)
        Rings from the pith.
    width_mm : float64 (n,)
        Mean widths, mm; 0 for a missing ring.
    eccentricity : float64 (n,)
        0 to 1.
    thick_side_deg : float64 (n,)
        Azimuth of the thick side, degrees from x towards y; 0 where the ring has none.
    undated_mm : float
        Radius of the wood inside the innermost ring, mm, where it was not on record; else 0.
    """

    tree_id: int
    species: str
    stem_height_m: float
    year: NDArray[np.int64]
    cambial_age: NDArray[np.int64]
    width_mm: NDArray[np.float64]
    eccentricity: NDArray[np.float64]
    thick_side_deg: NDArray[np.float64]
    undated_mm: float = 0.0


def stem_rings(rings: pd.DataFrame) -> list[StemRings]:
    """Cut a ring frame into stems and heights, in order of tree and height.

    A year without a row between two others is a missing ring: its width is 0. A stem that
    broke below the height and grew anew has a new pith there; only its own rings are given.

    Parameters
    ----------
    rings : pandas.DataFrame
        Rows of `/rings`, in any order.

    Raises
    ------
    InputError
        If a column is lacking, there are no rings, or a ring stands there twice.
    """
    for name in RING_COLUMNS:
        if name not in rings.columns:
            hint = nearest(name, map(str, rings.columns)) if len(rings.columns) else ""
            raise InputError(f"no column '{name}'", where="rings", expected=hint)
    if "place" in rings.columns:  # where the crown begins is other wood every year
        rings = rings[rings["place"] == "height"]
    if not len(rings):
        raise InputError("no rings", where="rings", expected="at least one row")
    year, tree = (rings[name].to_numpy(np.int64) for name in ("year", "tree_id"))
    height_mm = _in_mm(rings)
    order = np.lexsort((year, height_mm, tree))
    year, tree, height_mm = year[order], tree[order], height_mm[order]
    begins = (np.diff(tree) != 0) | (np.diff(height_mm) != 0)
    twice = np.flatnonzero(~begins & (np.diff(year) == 0))
    if len(twice):
        k = twice[0]
        raise InputError(
            f"tree {tree[k]} has two rings of {year[k]} at {height_mm[k] / 1000:g} m",
            where="rings",
            expected="one row per tree, stem height and year",
        )
    starts = np.concatenate(([0], np.flatnonzero(begins) + 1))
    species = rings["species"].iloc[order[starts]].astype(str).to_list()
    age = rings["cambial_age"].to_numpy(np.int64)[order]
    numbers = [
        rings[name].fillna(0.0).to_numpy(np.float64)[order]
        for name in ("width_mm", "eccentricity", "thick_side_deg")
    ]
    ends = [*starts[1:], len(order)]
    return [
        _one_stem(int(tree[a]), name, height_mm[a] / 1000, year[a:b], age[a:b], numbers, a)
        for a, b, name in zip(starts, ends, species, strict=True)
    ]


def rings_at(rings: pd.DataFrame, tree_id: int, stem_height_m: float) -> StemRings:
    """Take the rings of one tree and height (see `stem_rings`).

    Raises
    ------
    InputError
        If the tree has no rings, or none at that height.
    """
    of_tree = rings[rings["tree_id"] == tree_id]
    if not len(of_tree):
        ids = rings["tree_id"]
        has = f"one of {ids.nunique()} trees with rings, {ids.min()} to {ids.max()}"
        raise InputError(
            f"tree {tree_id} has no rings",
            where="rings",
            expected=has if len(ids) else "a table with rings",
        )
    here = at_height(of_tree, stem_height_m)
    if not here.any():
        known = ", ".join(f"{height / 1000:g}" for height in np.unique(_in_mm(of_tree)))
        raise InputError(
            f"tree {tree_id} has no rings at {stem_height_m:g} m",
            where="rings",
            expected=f"a height on record: {known} m",
        )
    return stem_rings(of_tree[here])[0]


def at_height(rings: pd.DataFrame, stem_height_m: float) -> NDArray[np.bool_]:
    """Tell which rows are of a stem height, to the millimetre."""
    if not math.isfinite(stem_height_m):
        raise InputError(f"height {stem_height_m:g}", where="rings", expected="a number of metres")
    return np.asarray(_in_mm(rings) == round(1000.0 * stem_height_m))


def _in_mm(rings: pd.DataFrame) -> NDArray[np.int64]:
    """Give the heights as whole millimetres: they are float32 in the file, and 1.3 is not."""
    return np.asarray(np.rint(1000.0 * rings["stem_height_m"].to_numpy(np.float64)), np.int64)


def _one_stem(
    tree_id: int,
    species: str,
    stem_height_m: float,
    year: NDArray[np.int64],
    age: NDArray[np.int64],
    numbers: list[NDArray[np.float64]],
    start: int,
) -> StemRings:
    """Take the rings since the last new pith and put a ring of width 0 into each gap."""
    younger = np.flatnonzero(np.diff(age) < 0)
    first = int(younger[-1]) + 1 if len(younger) else 0
    place = year[first:] - year[first]
    columns = []
    for column in numbers:
        whole = np.zeros(place[-1] + 1)
        whole[place] = column[start + first : start + len(year)]
        columns.append(whole)
    every = np.arange(place[-1] + 1)
    ages = age[first] + every
    ages[place] = age[first:]
    width, eccentricity, thick_side = columns
    return StemRings(
        tree_id,
        species,
        stem_height_m,
        year[first] + every,
        ages,
        width,
        eccentricity,
        thick_side,
    )
