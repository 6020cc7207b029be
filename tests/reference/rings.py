"""Where the thick side of a ring lies, with rotation matrices."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tests.reference.rods import matrix
from tests.reference.stems import upright


def azimuth(frame: NDArray[np.float64], angle: float) -> float:
    """Azimuth of a direction of the section, after the shortest turn that sets the frame upright.

    `frame` is a quaternion; `angle` is about H from L towards U, rad.
    """
    axes = matrix(frame)
    way = math.cos(angle) * axes[:, 1] + math.sin(angle) * axes[:, 2]
    flat = upright(axes[:, 0]) @ way
    return math.atan2(flat[1], flat[0])
