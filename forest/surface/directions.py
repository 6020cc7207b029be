"""Directions: unit vectors, and places along them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError


def unit(vector: ArrayLike, name: str) -> NDArray[np.float64]:
    """Scale a vector (3,) to length 1, or say that it has no direction."""
    found = np.asarray(vector, np.float64)
    length = np.sqrt(np.sum(found**2)) if found.shape == (3,) else 0.0
    if not 0.0 < length < np.inf:
        raise InputError(f"{name} is {vector!r}", expected="three numbers, not all 0")
    return np.asarray(found / length, np.float64)


def along(vectors: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give dot products; written out, since BLAS may sum in any order."""
    return np.asarray(
        vectors[:, 0] * axis[0] + vectors[:, 1] * axis[1] + vectors[:, 2] * axis[2], np.float64
    )
