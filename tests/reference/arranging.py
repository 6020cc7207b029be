"""A chain that is bent, the slow way: matrices, one joint after the other."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation


def carried(parent: Any, tip: Any, path: Any, turns: Any) -> np.ndarray[Any, Any]:
    """Turn the joints of a path from the highest down, each with all that stands above it.

    `turns` are quaternions (w, x, y, z) in the frame of the tree as it was.
    """
    placed = np.array(tip, np.float64)
    for k in reversed(range(len(path))):
        foot = placed[parent[path[k]]]
        above = np.zeros(len(parent), bool)
        for i in range(len(parent)):
            above[i] = i == path[k] or (parent[i] >= 0 and above[parent[i]])
        w, x, y, z = turns[k]
        placed[above] = foot + Rotation.from_quat([x, y, z, w]).apply(placed[above] - foot)
    return placed


def energy(flexibility: Any, turns: Any) -> float:
    """Give what a rod of these flexibilities stores in its turns."""
    angles = 2.0 * np.arccos(np.clip(np.abs(turns[:, 0]), 0.0, 1.0))
    return float(np.sum(angles**2 / flexibility))
