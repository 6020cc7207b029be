"""Where the thick side of a ring lies, told without the frame of its metamer."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def _columns(frame: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Give the world axes H, L, U of frames (n, 4) as arrays (n, 3)."""
    w, x, y, z = (frame / np.linalg.norm(frame, axis=1, keepdims=True)).T
    h = np.stack((1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)), axis=1)
    along = np.stack((2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)), axis=1)
    return h, along, np.cross(h, along)


def upright_azimuth(frame: NDArray[np.float32], angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn angles about metamers' headings into azimuths.

    Parameters
    ----------
    frame : float32 (n, 4)
        World frames H, L, U as quaternions.
    angle : float64 (n,)
        Angle about H from L towards U, rad.

    Returns
    -------
    float64 (n,)
        Azimuth from x towards y, rad in (-pi, pi], of that direction after the shortest turn that
        sets H upright. The lower side of a leaning metamer has the azimuth towards which it leans.
    """
    h, along, across = _columns(frame.astype(np.float64))
    way = np.cos(angle)[:, None] * along + np.sin(angle)[:, None] * across
    # the shortest turn from h to z: v -> v + k x v + k x (k x v) / (1 + h.z), with k = h x z
    k = np.stack((h[:, 1], -h[:, 0], np.zeros(len(h))), axis=1)
    once = np.cross(k, way)
    turned = way + once + np.cross(k, once) / np.maximum(1.0 + h[:, 2], 1e-9)[:, None]
    return np.asarray(np.arctan2(turned[:, 1], turned[:, 0]))
