"""What the solver keeps of a metamer while a tree settles: columns of its scratch memory.

One row per metamer, so that a pass reads and writes memory in order. Vectors are in world axes
unless said otherwise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TURN = np.int64(0)  # 3: rotation along the metamer, Omega times length, about H, L, U, rad
STEP = np.int64(3)  # 3: change of TURN in this cycle; before, the metamer's own share of it
END = np.int64(6)  # 4: quaternion of the frame at its end
AXIS = np.int64(10)  # 3: heading H at its middle
SIDE = np.int64(13)  # 3: axis L at its middle
FORCE = np.int64(16)  # 3: force that pulls on its segment, N
SWING = np.int64(19)  # 3: turn of its end frame in this cycle, rad; at last its tip, m
MOMENT = np.int64(22)  # 3: gradient of the loads' energy beyond it to a turn of its end, N m
PULL = np.int64(25)  # 9: see below
COLUMNS = np.int64(34)

# On the way to the base, PULL holds what the part beyond the metamer adds to the stiffness against
# a turn of its end (xx, xy, xz, yy, yz, zz), and the moment that this part leaves over. From the
# metamer's elimination on it holds how its step follows from its parent's swing (3 x 3).
LEFT_OVER = np.int64(31)


class Chain(NamedTuple):
    """One tree of rods and its loads; see `Rods` and `Loads`. Arrays of its n metamers."""

    parent: NDArray[np.int32]
    length: NDArray[np.float32]
    joint: NDArray[np.float32]
    rest: NDArray[np.float32]
    rigidity: NDArray[np.float32]
    weight: NDArray[np.float32]
    wind: NDArray[np.float32]
