"""Random numbers of many trees at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.random import uniforms


@njit
def _fill(seed: Any, stream: Any, ids: Any, serial: Any, year: Any, out: Any) -> None:
    for k in range(len(ids)):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = uniforms(seed, stream, ids[k], serial, year)


def uniforms_of(
    seed: int, stream: int, ids: NDArray[np.int32], serial: int, year: int
) -> NDArray[np.float64]:
    """Draw four uniform numbers for each of some trees; see `forest.random.uniforms`.

    Parameters
    ----------
    seed, stream : int
    ids : int32 (n,)
        Tree ids.
    serial, year : int
        The same for all.

    Returns
    -------
    float64 (n, 4)
    """
    out = np.empty((len(ids), 4))
    _fill(
        np.int64(seed),
        np.int64(stream),
        np.ascontiguousarray(ids, np.int64),
        np.int64(serial),
        np.int64(year),
        out,
    )
    return out
