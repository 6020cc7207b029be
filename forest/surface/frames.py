"""Sides of a tree's tubes, carried along its axes without twist."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.trees.skeleton import Skeleton

_SHORTEST = 1e-9  # m; what is shorter has no direction of its own
_ALONG = 1e-3  # a side so near to the heading cannot be carried on


@njit
def _carry(parent: Any, start: Any, end: Any, heading: Any, side: Any) -> None:
    for i in range(len(parent)):
        p = parent[i]
        length = np.sqrt(np.sum((end[i] - start[i]) ** 2))
        if length > _SHORTEST:
            heading[i] = (end[i] - start[i]) / length
        elif p >= 0:
            heading[i] = heading[p]
        else:
            heading[i] = (0.0, 0.0, 1.0)
        if p >= 0:
            side[i] = side[p]
        else:
            side[i] = (1.0, 0.0, 0.0)
        along = np.sum(side[i] * heading[i])
        side[i] -= along * heading[i]
        if np.sum(side[i] ** 2) < _ALONG**2:
            least = np.argmin(np.abs(heading[i]))
            side[i] = -heading[i, least] * heading[i]
            side[i, least] += 1.0
        side[i] /= np.sqrt(np.sum(side[i] ** 2))


def carry_frames(skeleton: Skeleton) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give each internode its direction and a direction across it.

    Returns
    -------
    heading, side : float64 (n, 3)
        Unit vectors at right angles. An internode takes its parent's side, turned as little as its
        own direction asks; one without length takes its parent's direction.
    """
    heading = np.empty((len(skeleton), 3))
    side = np.empty((len(skeleton), 3))
    _carry(skeleton.parent, skeleton.start, skeleton.end, heading, side)
    return heading, side
