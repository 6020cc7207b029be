"""Frames of rings made by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd


def ring_frame(
    tree_id: int,
    first_year: int,
    width_mm: Sequence[float],
    *,
    eccentricity: float | Sequence[float] = 0.0,
    thick_side_deg: float | Sequence[float] = np.nan,
    stem_height_m: float = 1.3,
    species: str = "picea_abies",
) -> pd.DataFrame:
    """Rows of `/rings` of one tree and height, with the file's dtypes."""
    n = len(width_mm)
    return pd.DataFrame(
        {
            "year": np.arange(first_year, first_year + n, dtype=np.int32),
            "tree_id": np.full(n, tree_id, np.int32),
            "species": pd.Categorical([species] * n),
            "stem_height_m": np.full(n, stem_height_m, np.float32),
            "cambial_age": np.arange(1, n + 1, dtype=np.int32),
            "width_mm": np.asarray(width_mm, np.float32),
            "eccentricity": np.broadcast_to(np.float32(eccentricity), n),
            "thick_side_deg": np.broadcast_to(np.float32(thick_side_deg), n),
        }
    )
