"""Branches that are bent by hand: an axis turns at its joints until a metamer is where it shall be.

Power, Prusinkiewicz et al. 1999, "Interactive arrangement of botanical L-system models": inverse
kinematics over the joints of an axis, which keeps all lengths. Of the many ways to get there it
seeks the one that bends like a rod pulled at that point: the turn of each joint is its flexibility
times the moment of the pull, so that thin parts bend more. Steps are those of damped least
squares, each joint weighted by its flexibility; at first they also seek the least turns of all that
lead there, later only the way. No joint turns by more than a largest angle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.errors import InputError
from forest.mechanics.quaternions import cross, inverse, product, rotated, turn, unit
from forest.mechanics.rods import Rods, read4, write4
from forest.trees.metamers import MAIN, Arena
from forest.trees.table import Trees

#: Largest turn of one joint, rad.
MOST_TURN = np.radians(20.0)
#: Near enough to the target, m.
NEAR = 1e-4
_STEPS = 300
_PATIENCE = 60
#: First steps, in which turns that are not needed are taken back.
_RELAXING = 40
#: Longest step of the end, as a share of the chain's length.
_STRIDE = 0.2
_DAMPING = 1e-6


@njit
def _solve(a, b):  # type: ignore[no-untyped-def]
    """Solve a symmetric 3 x 3 system; `a` is (xx, yy, zz, xy, xz, yz)."""
    xx, yy, zz, xy, xz, yz = a
    c00 = yy * zz - yz * yz
    c01 = xz * yz - xy * zz
    c02 = xy * yz - xz * yy
    det = xx * c00 + xy * c01 + xz * c02
    if det <= 0.0:
        return 0.0, 0.0, 0.0
    c11 = xx * zz - xz * xz
    c12 = xy * xz - xx * yz
    c22 = xx * yy - xy * xy
    return (
        (c00 * b[0] + c01 * b[1] + c02 * b[2]) / det,
        (c01 * b[0] + c11 * b[1] + c12 * b[2]) / det,
        (c02 * b[0] + c12 * b[1] + c22 * b[2]) / det,
    )


@njit
def _limited(q, most):  # type: ignore[no-untyped-def]
    """Give a turn, or the largest one about its axis; and whether it was too large."""
    w, x, y, z = q
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    if sine <= np.sin(0.5 * most):
        return (w, x, y, z), False
    scale = np.sin(0.5 * most) / sine
    return (np.cos(0.5 * most), x * scale, y * scale, z * scale), True


@njit
def _place(chain, turns, placed, along):  # type: ignore[no-untyped-def]
    """Put a chain's points where the turns of its joints bring them."""
    q = (1.0, 0.0, 0.0, 0.0)
    for j in range(3):
        placed[0, j] = chain[0, j]
    for k in range(len(turns)):
        q = unit(product(q, (turns[k, 0], turns[k, 1], turns[k, 2], turns[k, 3])))
        write4(along, k, q)
        step = rotated(
            q,
            (
                chain[k + 1, 0] - chain[k, 0],
                chain[k + 1, 1] - chain[k, 1],
                chain[k + 1, 2] - chain[k, 2],
            ),
        )
        for j in range(3):
            placed[k + 1, j] = placed[k, j] + step[j]


@njit
def _spin_of(turns, along, k, share):  # type: ignore[no-untyped-def]
    """Give a share of the turn of a joint as a vector in the world, rad."""
    w = turns[k, 0]
    sine = np.sqrt(turns[k, 1] ** 2 + turns[k, 2] ** 2 + turns[k, 3] ** 2)
    if sine == 0.0 or share == 0.0:
        return 0.0, 0.0, 0.0
    scale = share * 2.0 * np.arctan2(sine, w) / sine
    spin = (scale * turns[k, 1], scale * turns[k, 2], scale * turns[k, 3])
    if k == 0:
        return spin
    return rotated((along[k - 1, 0], along[k - 1, 1], along[k - 1, 2], along[k - 1, 3]), spin)


@njit
def _pull(placed, flexibility, bound, error, turns, along, share):  # type: ignore[no-untyped-def]
    """Give the pull at the end that moves it by `error`, through the joints that are free.

    A share of the turns that they have is taken back at the same time.
    """
    m = len(flexibility)
    xx = yy = zz = xy = xz = yz = 0.0
    ex, ey, ez = error
    for k in range(m):
        if bound[k]:
            continue
        x = placed[m, 0] - placed[k, 0]
        y = placed[m, 1] - placed[k, 1]
        z = placed[m, 2] - placed[k, 2]
        back = cross(_spin_of(turns, along, k, share), (x, y, z))
        ex += back[0]
        ey += back[1]
        ez += back[2]
        w = flexibility[k]
        xx += w * (y * y + z * z)
        yy += w * (x * x + z * z)
        zz += w * (x * x + y * y)
        xy -= w * x * y
        xz -= w * x * z
        yz -= w * y * z
    damping = _DAMPING * (xx + yy + zz)
    return _solve((xx + damping, yy + damping, zz + damping, xy, xz, yz), (ex, ey, ez))


@njit
def reach(chain, target, flexibility, most, turns):  # type: ignore[no-untyped-def]
    """Turn a chain's joints until its end is as near to a target as it can come.

    Parameters
    ----------
    chain : float64 (m + 1, 3)
        Its points from the first joint to its end, m.
    target : float64 (3,)
        Where the end shall go, m.
    flexibility : float64 (m,)
        Turn of each joint per moment, relative to one another; 0 for a joint that is stiff.
    most : float
        Largest turn of a joint, rad.
    turns : float64 (m, 4)
        Filled: the turn of each joint, in the frame of the chain as it was.

    Returns
    -------
    float
        Distance that is left, m.
    """
    m = len(flexibility)
    now = np.zeros((m, 4))
    now[:, 0] = 1.0
    turns[:] = now
    placed = np.empty((m + 1, 3))
    along = np.empty((m, 4))
    bound = np.zeros(m, np.bool_)
    new = np.empty((m, 4))
    length = 0.0
    for k in range(m):
        length += np.sqrt(np.sum((chain[k + 1] - chain[k]) ** 2))
    best = np.inf
    waited = 0
    for count in range(_STEPS):
        share = 1.0 if count < _RELAXING else 0.0
        _place(chain, now, placed, along)
        x = target[0] - placed[m, 0]
        y = target[1] - placed[m, 1]
        z = target[2] - placed[m, 2]
        left = np.sqrt(x * x + y * y + z * z)
        waited += 1
        if left < best * (1.0 - 1e-6):
            best = left
            turns[:] = now
            waited = 0
        if best <= NEAR or waited > _PATIENCE:
            break
        scale = min(1.0, _STRIDE * length / left)
        error = (x * scale, y * scale, z * scale)
        bound[:] = False
        for _again in range(m + 1):
            pull = _pull(placed, flexibility, bound, error, now, along, share)
            more = False
            for k in range(m):
                if bound[k] or flexibility[k] == 0.0:
                    write4(new, k, now[k])
                    continue
                ax = placed[m, 0] - placed[k, 0]
                ay = placed[m, 1] - placed[k, 1]
                az = placed[m, 2] - placed[k, 2]
                w = flexibility[k]
                back = _spin_of(now, along, k, share)
                moment = cross((ax, ay, az), pull)
                spin = turn(
                    w * moment[0] - back[0], w * moment[1] - back[1], w * moment[2] - back[2]
                )
                own = (now[k, 0], now[k, 1], now[k, 2], now[k, 3])
                if k > 0:
                    below = (along[k - 1, 0], along[k - 1, 1], along[k - 1, 2], along[k - 1, 3])
                    spin = product(inverse(below), product(spin, below))
                limited, too_far = _limited(product(spin, own), most)
                write4(new, k, limited)
                if too_far:
                    bound[k] = True  # what it cannot give the others must
                    more = True
            if not more:
                break
            for k in range(m):
                if bound[k]:
                    now[k] = new[k]
            _place(chain, now, placed, along)
            ex = target[0] - placed[m, 0]
            ey = target[1] - placed[m, 1]
            ez = target[2] - placed[m, 2]
            gap = np.sqrt(ex * ex + ey * ey + ez * ez)
            scale = min(1.0, _STRIDE * length / max(gap, 1e-12))
            error = (ex * scale, ey * scale, ez * scale)
        now[:] = new
    return best


@njit
def carry(parent, tip, path, turns, moved, turned, placed):  # type: ignore[no-untyped-def]
    """Let a tree go along with the joints of a path that turn.

    Parameters
    ----------
    parent : int32 (n,)
    tip : float32 (n, 3)
        Upper ends as they were, m.
    path : int64 (m,)
        Metamers at whose feet the joints are, from the lowest to the highest; not the base.
    turns : float64 (m, 4)
        As `reach` fills them.
    moved : bool (n,)
        Filled: which metamers go along.
    turned : float64 (n, 4)
        Filled: how much each metamer turns.
    placed : float64 (n, 3)
        Filled: upper ends as they are then, m.
    """
    k = 0
    for i in range(len(parent)):
        p = parent[i]
        q = (1.0, 0.0, 0.0, 0.0)
        if p >= 0:
            q = (turned[p, 0], turned[p, 1], turned[p, 2], turned[p, 3])
        moved[i] = p >= 0 and moved[p]
        if k < len(path) and path[k] == i:
            own = (turns[k, 0], turns[k, 1], turns[k, 2], turns[k, 3])
            if own[1] != 0.0 or own[2] != 0.0 or own[3] != 0.0:
                q = unit(product(q, own))
                moved[i] = True
            k += 1
        write4(turned, i, q)
        if not moved[i]:
            for j in range(3):
                placed[i, j] = tip[i, j]
            continue
        step = rotated(
            q,
            (
                np.float64(tip[i, 0]) - tip[p, 0],
                np.float64(tip[i, 1]) - tip[p, 1],
                np.float64(tip[i, 2]) - tip[p, 2],
            ),
        )
        for j in range(3):
            placed[i, j] = placed[p, j] + step[j]


@njit
def turn_rods(parent, length, moved, turned, rods):  # type: ignore[no-untyped-def]
    """Turn the frames of metamers, and the joints at which they turn by more than their parent.

    The rest curvature stays as it is, so that the tree rests in its new shape as it did in the old.
    """
    for i in range(len(parent)):
        p = parent[i]
        if not moved[i]:
            continue
        mine = (turned[i, 0], turned[i, 1], turned[i, 2], turned[i, 3])
        below = (turned[p, 0], turned[p, 1], turned[p, 2], turned[p, 3])
        if mine == below:
            continue
        half = 0.5 * np.float64(length[p])
        c = rods.curvature[p]
        end = product(read4(rods.frame, p), turn(half * c[0], half * c[1], half * c[2]))
        start = product(end, read4(rods.joint, i))
        there = product(inverse(product(below, end)), product(mine, start))
        write4(rods.joint, i, unit(there))
    for i in range(len(parent)):
        if moved[i]:
            q = (turned[i, 0], turned[i, 1], turned[i, 2], turned[i, 3])
            write4(rods.frame, i, unit(product(q, read4(rods.frame, i))))


@njit
def turn_directions(moved, turned, bud):  # type: ignore[no-untyped-def]
    """Turn the directions of lateral buds."""
    for i in range(len(bud)):
        if moved[i]:
            q = (turned[i, 0], turned[i, 1], turned[i, 2], turned[i, 3])
            to = rotated(q, (np.float64(bud[i, 0]), np.float64(bud[i, 1]), np.float64(bud[i, 2])))
            for j in range(3):
                bud[i, j] = to[j]


def axis_path(parent: NDArray[Any], state: NDArray[Any], place: int) -> NDArray[np.int64]:
    """List the metamers of an axis from its start up to one of them, relative to the tree."""
    path = [place]
    while state[path[-1]] & MAIN and parent[path[-1]] >= 0:
        path.append(int(parent[path[-1]]))
    return np.array(path[::-1], np.int64)


def bend_axis(
    arena: Arena,
    trees: Trees,
    row: int,
    serial: int,
    target: NDArray[np.float64],
    pipe_exponent: float,
    grown: bool,
    *,
    where: str,
) -> tuple[float, NDArray[np.bool_]]:
    """Bend an axis of a tree until a metamer's upper end is as near to a target as it can come.

    The joints are those at the feet of the axis's metamers, up to that one; a stem is clamped at
    its foot. The flexibility of each is that of its metamer's wood, length / d^4. All that the
    axis carries goes along rigidly, and its buds turn with it; rods rest in the new shape.

    Parameters
    ----------
    arena, trees : Arena, Trees
        Changed in place.
    row : int
        Row of the tree.
    serial : int
        Serial number of the metamer.
    target : float64 (3,)
        Relative to the tree's base, m.
    pipe_exponent : float
        n of the tree's species: diameter = pipe^(1/n).
    grown : bool
        Whether the tree has rods: it has grown for a year.
    where : str
        Names the act in messages.

    Returns
    -------
    left : float
        Distance from the target that is left, m.
    moved : bool (n,)
        Metamers that moved, of the tree's extent.

    Raises
    ------
    InputError
        If there is no such metamer, or nothing below it can bend; then nothing moves.
    """
    here = slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))
    fields: list[Any] = [field[here] for field in arena.metamers]
    metamers = type(arena.metamers)(*fields)
    tree_id = int(trees.tree_id[row])
    place = int(np.searchsorted(metamers.serial, serial))
    if place == len(metamers.serial) or metamers.serial[place] != serial:
        raise InputError(
            f"tree {tree_id} has no metamer {serial}",
            where=where,
            expected="a serial number of the tree's skeleton",
        )
    path = axis_path(metamers.parent, metamers.state, place)
    if metamers.parent[path[0]] < 0:
        path = path[1:]
    if not len(path):
        raise InputError(
            f"metamer {serial} is clamped in the ground",
            where=where,
            expected=f"a metamer above it of tree {tree_id}",
        )
    tip = metamers.tip.astype(np.float64)
    chain = np.concatenate((tip[metamers.parent[path[:1]]], tip[path]))
    pipe = np.maximum(metamers.pipe[path].astype(np.float64), 1e-30)
    stiffness = pipe ** (4.0 / pipe_exponent)
    flexibility = metamers.length[path] / stiffness
    turns = np.empty((len(path), 4))
    left = reach(
        chain, np.asarray(target, np.float64), flexibility / flexibility.max(), MOST_TURN, turns
    )
    turned, placed, moved = (
        np.empty((len(tip), 4)),
        np.empty_like(tip),
        np.zeros(len(tip), np.bool_),
    )
    carry(metamers.parent, metamers.tip, path, turns, moved, turned, placed)
    metamers.tip[:] = placed
    turn_directions(moved, turned, metamers.bud)
    if grown and arena.companions:
        rods = Rods(*(field[here] for field in arena.companions))
        turn_rods(metamers.parent, metamers.length, moved, turned, rods)
    return float(left), moved
