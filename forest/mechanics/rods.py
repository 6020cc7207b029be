"""Trees as chains of elastic rods: what is stored, and the frames of new metamers.

Taylor-Hell 2005, sections 4 and 5. A metamer bends and twists but does not stretch. Its frame
H, L, U turns at the rate `curvature` along it: by half the turn before its middle, by the other
half after it. The metamer's straight segment has the heading H of its middle, so that a chain is
second-order accurate and keeps its length. A child starts from its parent's end frame, turned by
its `joint`. The trunk is clamped at its base: its joint is the frame there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.dealing import BINS, Deal
from forest.mechanics.quaternions import (
    between,
    cross,
    heading,
    inverse,
    product,
    side,
    turn,
)
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: Fields of the rods: name -> (dtype, items per metamer, meaning).
FIELDS: dict[str, tuple[type, int, str]] = {
    "joint": (np.float32, 4, "rotation from the parent's end frame to the start of this one"),
    "rest": (np.float32, 3, "rotation rate when unloaded, about H, L, U, rad/m"),
    "curvature": (np.float32, 3, "rotation rate when last settled, about H, L, U, rad/m"),
    "rigidity": (np.float32, 3, "torsional rigidity GJ; flexural EI about L and about U, N m2"),
    "frame": (np.float32, 4, "world frame H, L, U of the middle when last settled or made"),
    "ringed": (np.float32, 1, "radius up to which wood is already part of the rigidity, m"),
}


class Rods(NamedTuple):
    """What bends in a metamer; arrays parallel to the arena's. See `FIELDS`.

    Quaternions are (w, x, y, z); the paper's symbols are Omega for `curvature`, Omega underlined
    for `rest` and R for `rigidity`.
    """

    joint: NDArray[np.float32]
    rest: NDArray[np.float32]
    curvature: NDArray[np.float32]
    rigidity: NDArray[np.float32]
    frame: NDArray[np.float32]
    ringed: NDArray[np.float32]


class Loads(NamedTuple):
    """Dead loads on the metamers; arrays parallel to the arena's.

    Attributes
    ----------
    weight : float32 (n, 2)
        Weight that acts at the metamer's middle (its wood) and at its tip (leaves, fruit), N.
    wind : float32 (n, 2)
        Horizontal force (x, y) that acts at its middle, N.
    """

    weight: NDArray[np.float32]
    wind: NDArray[np.float32]


def allocate_rods(capacity: int) -> Rods:
    """Make rods of zeros for `capacity` metamers; memory is touched only when it is used."""
    return Rods(*(np.zeros((capacity, k) if k > 1 else capacity, t) for t, k, _ in FIELDS.values()))


@njit
def read4(field, i):  # type: ignore[no-untyped-def]
    """A stored quaternion in float64, its float32 rounding taken off its length."""
    w = np.float64(field[i, 0])
    x = np.float64(field[i, 1])
    y = np.float64(field[i, 2])
    z = np.float64(field[i, 3])
    scale = 1.5 - 0.5 * (w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


@njit
def write4(field, i, q):  # type: ignore[no-untyped-def]
    """Store a quaternion."""
    field[i, 0] = q[0]
    field[i, 1] = q[1]
    field[i, 2] = q[2]
    field[i, 3] = q[3]


@njit
def _grown_heading(tip, i, p):  # type: ignore[no-untyped-def]
    """The unit vector along metamer i from the tip of its parent p (-1: from the ground)."""
    x = np.float64(tip[i, 0])
    y = np.float64(tip[i, 1])
    z = np.float64(tip[i, 2])
    if p >= 0:
        x -= tip[p, 0]
        y -= tip[p, 1]
        z -= tip[p, 2]
    norm = np.sqrt(x * x + y * y + z * z)
    if norm == 0.0:
        return 0.0, 0.0, 1.0
    return x / norm, y / norm, z / norm


@njit
def _frame_tree(parent, begin, tip, length, rods, tropism, stiffness):  # type: ignore[no-untyped-def]
    """Give the metamers of a tree from `begin` on their frames; see `frame_new`."""
    n = len(parent)
    for i in range(begin, n):
        p = np.int64(parent[i])
        h = _grown_heading(tip, i, p)
        if p < 0:
            end = (1.0, 0.0, 0.0, 0.0)
        else:
            end = read4(rods.frame, p)
            if p < begin:  # a new parent counts as straight: its children were made so
                half = 0.5 * np.float64(length[p])
                c = rods.curvature[p]
                end = product(end, turn(half * c[0], half * c[1], half * c[2]))
        frame = product(between(heading(end), h), end)
        write4(rods.frame, i, frame)
        write4(rods.joint, i, product(inverse(end), frame))
        torque = cross(h, tropism)
        across = side(frame)
        axes = (h, across, cross(h, across))
        for k in range(3):
            a = axes[k]
            rate = (a[0] * torque[0] + a[1] * torque[1] + a[2] * torque[2]) / stiffness[k]
            rods.rest[i, k] = rate
            rods.curvature[i, k] = rate
            rods.rigidity[i, k] = 0.0
        rods.ringed[i] = 0.0


@driver
def _frame_chunks(first, step, arena, trees, shared, rods, year, tropism, stiffness):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            s = trees.start[row]
            e = s + trees.size[row]
            sp = trees.species[row]
            begin = np.int64(trees.size[row])
            while begin > 0 and arena.birth[s + begin - 1] == year:
                begin -= 1
            # Planted or recruited since the last step: all of it is new, whatever age it came with.
            if begin > 0 and arena.birth[s] >= year - 1:
                begin = np.int64(0)
            _frame_tree(
                arena.parent[s:e],
                begin,
                arena.tip[s:e],
                arena.length[s:e],
                Rods(
                    rods.joint[s:e],
                    rods.rest[s:e],
                    rods.curvature[s:e],
                    rods.rigidity[s:e],
                    rods.frame[s:e],
                    rods.ringed[s:e],
                ),
                (tropism[sp, 0], tropism[sp, 1], tropism[sp, 2]),
                (stiffness[sp, 0], stiffness[sp, 1], stiffness[sp, 2]),
            )


def frame_new(
    arena: Metamers,
    trees: Trees,
    shared: Deal,
    rods: Rods,
    step: int,
    tropism: NDArray[np.float64],
    stiffness: NDArray[np.float64],
) -> None:
    """Make rods of the metamers that grew in this step, and of trees planted just before it.

    The joint is the smallest rotation from the heading of the parent's end to the direction in
    which the metamer grew (it replaces divergence and deviation, Taylor-Hell 2005, section 5.1),
    so that nothing moves unless it bends. The rest rotation rate is that of the tropism (eqs 4 and
    6, with the unit heading); the metamer takes it when the tree is settled next. Rigidity and
    ring are zero until wood is laid.

    Parameters
    ----------
    step : int
        The step; metamers whose `birth` it is stand at the end of their tree's extent.
    tropism : float64 (species, 3)
        Tropic force F of a unit of heading: its direction and the torque across it, N m.
    stiffness : float64 (species, 3)
        Rigidity of a new shoot that resists the tropism: GJ, EI, EI, N m2.
    """
    in_threads(_frame_chunks, arena, trees, shared, rods, np.int64(step), tropism, stiffness)
