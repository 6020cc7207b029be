"""Static equilibrium of trees of rods. Taylor-Hell 2005, sections 4 and 5.

The equilibrium Omega = rest + tau / R (eqs 3, 5, 7) is where the energy is least: elastic energy
of the rods plus potential energy of the dead loads. The paper relaxes towards it with alpha; that
takes many cycles where branches hang. Here a cycle is one step of Newton's method, and as linear
in the metamers: since a dead load on a chain of rods pulls on each segment's heading alone, the
stiffness couples a metamer to its parent only. It is eliminated from the tips to the base with the
moments, and the turns follow from the base to the tips with the frames. A step that would raise
the energy is shortened. Where the stiffness is not positive (a stem past Greenhill's load) rigidity
is added until the step leads downhill.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.growth.dealing import BINS, Deal
from forest.mechanics.elimination import balance
from forest.mechanics.quaternions import heading, inverse, product, rotated, side, turn, unit
from forest.mechanics.rods import Loads, Rods, read4, write4
from forest.mechanics.work import (
    AXIS,
    COLUMNS,
    END,
    FORCE,
    MOMENT,
    PULL,
    SIDE,
    STEP,
    SWING,
    TURN,
    Chain,
)
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: Cycles after which a tree that has not settled is left as it is until next year.
MOST_PASSES = 80
#: Longest turn of a metamer in a step, rad: beyond it the linear step means nothing.
_LONGEST_STEP = 1.0
#: Largest turn of a step at which a tree counts as not moving at all, rad: rounding errors.
_UNMOVED = 1e-10
#: Times that a step is halved before the tree is stiffened instead.
_HALVINGS = 4


class Settled(NamedTuple):
    """How the trees settled.

    Attributes
    ----------
    passes : int32 (trees,)
        Cycles of a pass to the base and one to the tips.
    turned : float64 (trees,)
        Largest turn of a metamer in the last step, rad; what is left is of the order of its
        square.
    stable : bool (trees,)
        Whether the tree springs back from a small push: where it has settled or, with
        `most_passes` 1, where it was.
    """

    passes: NDArray[np.int32]
    turned: NDArray[np.float64]
    stable: NDArray[np.bool_]


@njit
def _place(tree, work, i, part, before):  # type: ignore[no-untyped-def]
    """Turn metamer i by `part` of its step; its frame follows its parent's (eqs 10 to 12).

    Returns
    -------
    float
        Gain in energy over the state in which `before` of the step was taken, J.
    """
    length = np.float64(tree.length[i])
    elastic = 0.0
    for k in range(3):
        step = work[i, STEP + k]
        strain = work[i, TURN + k] - np.float64(tree.rest[i, k]) * length
        middle = strain + 0.5 * (part + before) * step
        elastic += np.float64(tree.rigidity[i, k]) * step * middle
    half = turn(
        0.5 * (work[i, TURN] + part * work[i, STEP]),
        0.5 * (work[i, TURN + 1] + part * work[i, STEP + 1]),
        0.5 * (work[i, TURN + 2] + part * work[i, STEP + 2]),
    )
    p = tree.parent[i]
    frame = read4(tree.joint, i)
    if p >= 0:
        frame = product((work[p, END], work[p, END + 1], work[p, END + 2], work[p, END + 3]), frame)
    frame = product(frame, half)
    axis = heading(frame)
    across = side(frame)
    end = unit(product(frame, half))
    raised = 0.0
    for k in range(3):
        raised -= work[i, FORCE + k] * (axis[k] - work[i, AXIS + k])
        work[i, AXIS + k] = axis[k]
        work[i, SIDE + k] = across[k]
        work[i, MOMENT + k] = 0.0
    for k in range(4):
        work[i, END + k] = end[k]
    for k in range(9):
        work[i, PULL + k] = 0.0
    return elastic * (part - before) / length + raised * length


@njit
def _shape(tree, work, part, before):  # type: ignore[no-untyped-def]
    """Give all metamers their frames with `part` of the step; base to tips.

    Returns the gain in energy over the state with `before` of it, J.
    """
    gain = 0.0
    for i in range(len(tree.parent)):
        gain += _place(tree, work, i, part, before)
    return gain


@njit
def _swing(tree, work):  # type: ignore[no-untyped-def]
    """Follow the step from the base to the tips and take it whole.

    Returns
    -------
    turned, gain : float
        Largest turn of a metamer, rad; gain in energy, J.
    """
    largest = 0.0
    gain = 0.0
    for i in range(len(tree.parent)):
        p = tree.parent[i]
        x = 0.0
        y = 0.0
        z = 0.0
        if p >= 0:
            x = work[p, SWING]
            y = work[p, SWING + 1]
            z = work[p, SWING + 2]
        r = PULL
        dx = -work[i, STEP] - work[i, r] * x - work[i, r + 1] * y - work[i, r + 2] * z
        dy = -work[i, STEP + 1] - work[i, r + 3] * x - work[i, r + 4] * y - work[i, r + 5] * z
        dz = -work[i, STEP + 2] - work[i, r + 6] * x - work[i, r + 7] * y - work[i, r + 8] * z
        size = (x + dx) ** 2 + (y + dy) ** 2 + (z + dz) ** 2
        largest = max(largest, size)
        if size > _LONGEST_STEP * _LONGEST_STEP:
            short = _LONGEST_STEP / np.sqrt(size)
            dx = short * (x + dx) - x
            dy = short * (y + dy) - y
            dz = short * (z + dz) - z
        work[i, SWING] = x + dx
        work[i, SWING + 1] = y + dy
        work[i, SWING + 2] = z + dz
        hx, hy, hz = work[i, AXIS], work[i, AXIS + 1], work[i, AXIS + 2]
        lx, ly, lz = work[i, SIDE], work[i, SIDE + 1], work[i, SIDE + 2]
        work[i, STEP] = hx * dx + hy * dy + hz * dz
        work[i, STEP + 1] = lx * dx + ly * dy + lz * dz
        work[i, STEP + 2] = (
            (hy * lz - hz * ly) * dx + (hz * lx - hx * lz) * dy + (hx * ly - hy * lx) * dz
        )
        gain += _place(tree, work, i, 1.0, 0.0)
    return np.sqrt(largest), gain


@njit
def _hang(tree, curvature, work):  # type: ignore[no-untyped-def]
    """Sum what hangs on each segment (tips to base) and start from the last curvature.

    A segment's pull is the force beyond its tip, and half of what acts at its middle.

    Returns
    -------
    float
        Scale of the energy: what falling by the whole length of the rods would set free, J.
    """
    n = len(tree.parent)
    for i in range(n):
        length = np.float64(tree.length[i])
        for k in range(3):
            work[i, FORCE + k] = 0.0
            work[i, STEP + k] = 0.0
            work[i, TURN + k] = np.float64(curvature[i, k]) * length
    scale = 0.0
    for i in range(n - 1, -1, -1):
        p = tree.parent[i]
        own = (
            np.float64(tree.wind[i, 0]),
            np.float64(tree.wind[i, 1]),
            -np.float64(tree.weight[i, 0]),
        )
        work[i, FORCE + 2] -= tree.weight[i, 1]
        for k in range(3):
            if p >= 0:
                work[p, FORCE + k] += work[i, FORCE + k] + own[k]
            work[i, FORCE + k] += 0.5 * own[k]
            scale += abs(work[i, FORCE + k]) * np.float64(tree.length[i])
    return scale


@njit
def _descend(tree, work, slack):  # type: ignore[no-untyped-def]
    """Take the step that `balance` found, or the part of it that does not raise the energy.

    Parameters
    ----------
    slack : float
        Rounding error of the energy, J.

    Returns
    -------
    turned, part : float
        Largest turn of the whole step, rad; the part that was taken, 0 if none would do.
    """
    turned, gain = _swing(tree, work)
    part = 1.0
    tries = 0
    while not gain <= slack:
        before = part
        tries += 1
        part = 0.5 * part if tries <= _HALVINGS else 0.0
        gain += _shape(tree, work, part, before)
        if part == 0.0:
            break
    return turned, part


@njit
def settle_tree(tree, curvature, work, tolerance, most):  # type: ignore[no-untyped-def]
    """Bring one tree of rods to equilibrium under its loads.

    Parameters
    ----------
    tree : Chain
    curvature : float32 (n, 3)
        Where to start from, rad/m.
    work : float64 (n, COLUMNS)
        Scratch; afterwards its TURN (+ the returned part of its STEP) and frames are the result.
    tolerance : float
        Turn that may be left, rad.
    most : int
        Largest number of cycles.

    Returns
    -------
    passes, turned, stable, part : int, float, bool, float
        As in `Settled`; the part of STEP that has been taken but not yet added to TURN.
    """
    slack = 1e-13 * _hang(tree, curvature, work)
    _shape(tree, work, 0.0, 0.0)
    stiffer = 0.0
    part = 0.0
    turned = np.inf
    passes = 0
    stable = False
    # Newton's error is the square of its step; the factor is for stems near their buckling load
    # and for metamers that turn by tenths of a radian, where the stiffness is not exact
    near = np.sqrt(0.01 * tolerance)
    while passes < most:
        passes += 1
        stable = balance(tree, work, part, stiffer) and stiffer == 0.0
        turned, part = _descend(tree, work, slack)
        if part == 1.0 and turned <= (near if stable else _UNMOVED):
            break
        if part < 0.3:
            stiffer = max(0.2, 4.0 * stiffer)
        elif part == 1.0:
            stiffer = 0.25 * stiffer if stiffer > 0.02 else 0.0
    return passes, turned, stable, part


@njit
def _write(tree, rods, tip, bud, work, part):  # type: ignore[no-untyped-def]
    """Store the settled shape; lateral buds turn with their metamers."""
    for i in range(len(tree.parent)):
        p = tree.parent[i]
        length = np.float64(tree.length[i])
        for k in range(3):
            work[i, TURN + k] += part * work[i, STEP + k]
            rods.curvature[i, k] = work[i, TURN + k] / length
            work[i, SWING + k] = work[i, AXIS + k] * length
            if p >= 0:
                work[i, SWING + k] += work[p, SWING + k]
            tip[i, k] = work[i, SWING + k]
        half = turn(0.5 * work[i, TURN], 0.5 * work[i, TURN + 1], 0.5 * work[i, TURN + 2])
        end = (work[i, END], work[i, END + 1], work[i, END + 2], work[i, END + 3])
        frame = product(end, inverse(half))
        moved = product(frame, inverse(read4(rods.frame, i)))
        v = rotated(moved, (np.float64(bud[i, 0]), np.float64(bud[i, 1]), np.float64(bud[i, 2])))
        bud[i, 0] = v[0]
        bud[i, 1] = v[1]
        bud[i, 2] = v[2]
        write4(rods.frame, i, frame)


@driver
def _settle_chunks(first, step, arena, trees, shared, rods, loads, work, tolerance, most, out):  # type: ignore[no-untyped-def]
    for b in range(first, BINS, step):
        for k in range(shared.first[b], shared.first[b + 1]):
            row = shared.rows[k]
            s = trees.start[row]
            e = s + trees.size[row]
            here = work[shared.place[b] : shared.place[b] + trees.size[row]]
            tree = Chain(
                arena.parent[s:e],
                arena.length[s:e],
                rods.joint[s:e],
                rods.rest[s:e],
                rods.rigidity[s:e],
                loads.weight[s:e],
                loads.wind[s:e],
            )
            passes, turned, stable, part = settle_tree(
                tree, rods.curvature[s:e], here, tolerance, most
            )
            mine = Rods(
                tree.joint,
                tree.rest,
                rods.curvature[s:e],
                tree.rigidity,
                rods.frame[s:e],
                rods.ringed[s:e],
            )
            _write(tree, mine, arena.tip[s:e], arena.bud[s:e], here, part)
            out.passes[row] = passes
            out.turned[row] = turned
            out.stable[row] = stable


def settle(
    arena: Metamers,
    trees: Trees,
    shared: Deal,
    rods: Rods,
    loads: Loads,
    work: NDArray[np.float64],
    *,
    tolerance: float = 1e-4,
    most_passes: int = MOST_PASSES,
) -> Settled:
    """Bring all trees to equilibrium; change `tip` and `bud`, and the rods' curvature and frame.

    Taylor-Hell 2005, eqs 3, 5, 7 and 10 to 12. Rods keep their length. A tree starts from its
    last curvature. A column past its Greenhill load stands only if it is upright to the last bit;
    it is then not `stable`.

    Parameters
    ----------
    work : float64 (metamers, COLUMNS)
        Scratch for this deal; see `Bench`.
    tolerance : float
        Turn of a metamer that may be left to the exact equilibrium, rad: 1e-4 is 2 mm at the top
        of a tree of 20 m.
    most_passes : int
        Cycles after which a tree that has not settled is left as it is. Its `turned` is then
        above a tenth of the tolerance's square root.
    """
    n = len(trees.tree_id)
    out = Settled(np.zeros(n, np.int32), np.zeros(n), np.ones(n, np.bool_))
    in_threads(
        _settle_chunks,
        arena,
        trees,
        shared,
        rods,
        loads,
        work,
        float(tolerance),
        np.int64(most_passes),
        out,
    )
    return out


class Bench:
    """Scratch memory of `settle` that is kept from year to year and grows when trees do."""

    def __init__(self) -> None:
        self._work = np.empty((0, int(COLUMNS)))

    def work(self, shared: Deal) -> NDArray[np.float64]:
        """Give scratch for this deal."""
        need = int(shared.place[-1])
        if len(self._work) < need:
            self._work = np.empty((need + need // 4 + 64, int(COLUMNS)))
        return self._work
