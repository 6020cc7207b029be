"""A tree's age from the seed, its age where it is bored, and the years between."""

from __future__ import annotations

import pandas as pd

from forest.dendro.stems import stem_rings
from forest.errors import InputError


def ages(rings: pd.DataFrame, trees: pd.DataFrame) -> pd.DataFrame:
    """Tell a tree's age from the number of rings at a height.

    Parameters
    ----------
    rings : pandas.DataFrame
        Rows of `/rings`.
    trees : pandas.DataFrame
        Rows of `/trees`, of the same years.

    Returns
    -------
    pandas.DataFrame
        A row per tree and stem height with rings: `tree_id`, `stem_height_m`, `year` (of the last
        ring, to which the ages refer), `age_at_seed` (years since the tree was planted or
        recruited), `age_at_height` (rings from the pith, missing ones included) and
        `years_to_height`, their difference.

    Raises
    ------
    InputError
        If there are no rings, or a tree with a ring is not among the trees of that year.
    """
    last = pd.DataFrame(
        [
            {
                "tree_id": stem.tree_id,
                "stem_height_m": stem.stem_height_m,
                "year": int(stem.year[-1]),
                "age_at_height": int(stem.cambial_age[-1]),
            }
            for stem in stem_rings(rings)
        ]
    )
    known = trees[["tree_id", "year", "age"]].rename(columns={"age": "age_at_seed"})
    both = last.merge(known, on=["tree_id", "year"], how="left")
    unknown = both[both["age_at_seed"].isna()]
    if len(unknown):
        row = unknown.iloc[0]
        raise InputError(
            f"tree {row['tree_id']:.0f} has a ring of {row['year']:.0f} but no row of that year",
            where="trees",
            expected="the trees of all years that the rings are of",
        )
    both["age_at_seed"] = both["age_at_seed"].astype(int)
    both["years_to_height"] = both["age_at_seed"] - both["age_at_height"]
    columns = ["age_at_seed", "age_at_height", "years_to_height"]
    return both[["tree_id", "stem_height_m", "year", *columns]]
