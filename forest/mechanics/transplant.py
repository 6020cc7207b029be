"""The rods of a tree that is turned, stretched and thickened, and keeps its shape under load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.mechanics.rods import Rods


def transplanted(
    rods: Sequence[NDArray[Any]],
    parent: NDArray[np.int32],
    azimuth: float,
    ratio: float,
    thicker: NDArray[np.float64],
) -> Rods:
    """Give the rods of a tree of another size and place.

    With all lengths multiplied by s and diameters by q, its weight is s q^2 times as great, its
    moments s^2 q^2 and its rigidity q^4: the load then turns it by s^2 / q^2 times as much per
    length. The rest curvature is set such that the loaded tree still has its shape.

    Parameters
    ----------
    rods : sequence of arrays
        The fields of `Rods` of one tree, n metamers.
    parent : int32 (n,)
    azimuth : float
        Turn about the vertical, from x to y, rad.
    ratio : float
        s.
    thicker : float64 (n,)
        q of each metamer.
    """
    old = Rods(*rods)
    q = thicker[:, None]
    shape = old.curvature.astype(np.float64) / ratio
    load = (old.curvature.astype(np.float64) - old.rest) * ratio**2 / q**2
    joint = old.joint.copy()
    base = parent < 0
    joint[base] = _turned(old.joint[base], azimuth)  # the frame at the ground; others are relative
    return Rods(
        joint=joint,
        rest=(shape - load).astype(np.float32),
        curvature=shape.astype(np.float32),
        rigidity=(old.rigidity * q**4).astype(np.float32),
        frame=_turned(old.frame, azimuth),
        ringed=(old.ringed * thicker).astype(np.float32),
    )


def _turned(quaternions: NDArray[np.float32], azimuth: float) -> NDArray[np.float32]:
    """Turn frames (n, 4) about the vertical: the product of that turn and each of them."""
    c, s = np.cos(0.5 * azimuth), np.sin(0.5 * azimuth)
    w, x, y, z = quaternions.astype(np.float64).T
    turned = (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w)
    return np.stack(turned, axis=1).astype(np.float32)
