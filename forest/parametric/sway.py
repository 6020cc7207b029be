"""Trees in the wind: only the turns between segments change (Weber & Penn 1995, 4.7)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.errors import InputError
from forest.parametric.alone import CHUNKS, part, scratch
from forest.parametric.frames import load_frame, turn_x, turn_y
from forest.parametric.stems import OF_SWAY, draw

if TYPE_CHECKING:
    from forest.parametric.tree import ParametricTree

_DEGREE = np.pi / 180.0


class Still(NamedTuple):
    """What all moments of a wind share."""

    below: Any  # int32 (nodes,), the node that carries a node; -1 for the first
    position: Any  # float64 (nodes, 3), m, in the frame of that node
    heading: Any  # float64 (nodes, 3)
    side: Any  # float64 (nodes, 3)
    offset: Any  # float64 (stems, 2), sway_offset of the paper, radians
    leaf_position: Any  # float32 (leaves, 3), m, in the frame of the node below
    direction: Any  # float32 (leaves, 3)
    normal: Any  # float32 (leaves, 3)


def sway(
    tree: ParametricTree,
    times_s: Iterable[float],
    wind_speed: float,
    gust: float = 0.0,
    *,
    time_scale: float = 1.0,
) -> Iterator[ParametricTree]:
    """Give a tree's shapes at moments of a wind, one by one.

    What does not change from moment to moment is worked out once.

    Parameters
    ----------
    tree : ParametricTree
        The still tree.
    times_s : iterable of float
        The moments, s, in any order; none depends on another.
    wind_speed, gust : float
        The wind blows between `wind_speed` and `wind_speed + gust`; the paper names no unit.
    time_scale : float
        How much faster than printed everything swings. As printed an aspen's trunk takes
        6283 s for one swing; 2000 makes that about three seconds.

    Yields
    ------
    ParametricTree
        With the same stems, joints and radii as `tree`; without wind and gust, `tree` itself.

    Raises
    ------
    InputError
        If a number is not finite, or wind or gust is negative.
    """
    for name, value in (("wind speed", wind_speed), ("gust", gust)):
        if not 0.0 <= value <= 1000.0:
            raise InputError(f"{name} {value:g} is not allowed", expected="0 to 1000")
    times = [float(time) * float(time_scale) for time in times_s]
    if not np.isfinite(times).all():
        raise InputError("the moment is not a finite number")
    if wind_speed == 0.0 and gust == 0.0:
        return iter([tree] * len(times))
    winds = [(float(wind_speed), float(gust), time) for time in times]
    return _moments(tree, winds)


def _moments(
    tree: ParametricTree, winds: list[tuple[float, float, float]]
) -> Iterator[ParametricTree]:
    nodes, leaves, joints = tree.nodes, tree.leaves, tree.joints
    n, m = len(nodes.z), len(leaves.stem)
    still = Still(
        np.empty(n, np.int32), np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)),
        np.empty((len(joints.key), 2)),
        np.empty((m, 3), np.float32), np.empty((m, 3), np.float32), np.empty((m, 3), np.float32),
    )  # fmt: skip
    _settle(tree.stems, nodes, joints, np.uint64(tree.seed), still)
    in_threads(_settle_leaves, leaves, joints.leaf_node, nodes, scratch(), still)
    for wind in winds:
        moved = nodes._replace(
            position=np.empty((n, 3)), heading=np.empty((n, 3)), side=np.empty((n, 3))
        )
        _bend(tree.stems, nodes, joints, still, wind, np.empty(9), np.empty(9), moved)
        shifted = leaves._replace(
            position=np.empty((m, 3), np.float32),
            direction=np.empty((m, 3), np.float32),
            normal=np.empty((m, 3), np.float32),
        )
        in_threads(_carry, joints.leaf_node, still, moved, scratch(), shifted)
        yield replace(tree, nodes=moved, leaves=shifted)


@njit
def sway_angles(
    wind: Any, length: Any, radius: Any, radius_here: Any, z: Any, offset: Any, segments: Any
) -> Any:
    """Turn about one axis of a joint, degrees; `wind` = (speed, gust, scaled time in s)."""
    speed, gust, time = wind
    if radius <= 0.0:
        return 0.0  # a stem from a parent's pointed end
    if z < 1.0 and radius_here > 0.0:
        stiff = 4.0 * length * (1.0 - z) / radius_here
    else:
        stiff = 4.0 * length / radius  # the limit at the tip of a cone
    a1 = speed / 50.0 * stiff
    a2 = gust / 50.0 * stiff + a1 / 2.0
    b = offset + radius / length * time / 15.0
    return (a1 * np.sin(b) + a2 * np.sin(0.7 * b)) / segments


@njit
def into(v: Any, row: Any, f: Any, out: Any) -> None:
    """Write the vector v[row] in the frame f."""
    x, y, z = float(v[row, 0]), float(v[row, 1]), float(v[row, 2])
    for k in range(3):
        out[row, k] = x * f[3 * k] + y * f[3 * k + 1] + z * f[3 * k + 2]


@njit
def out_of(v: Any, row: Any, f: Any, out: Any) -> None:
    """Write the vector v[row], which is given in the frame f, in the tree's coordinates."""
    x, y, z = float(v[row, 0]), float(v[row, 1]), float(v[row, 2])
    for k in range(3):
        out[row, k] = x * f[k] + y * f[3 + k] + z * f[6 + k]


@njit
def _settle(stems: Any, nodes: Any, joints: Any, seed: Any, still: Any) -> None:
    """Write each node in the frame of the one that carries it."""
    f = np.empty(9)
    for s in range(len(stems.level)):
        u, v, _, _ = draw(seed, joints.key[s], OF_SWAY)
        still.offset[s, 0], still.offset[s, 1] = 2.0 * np.pi * u, 2.0 * np.pi * v
        for k in range(stems.nodes[s]):
            row = np.int64(stems.first[s]) + k
            below = row - 1
            if k == 0:
                # A clone turns away from the segment that ends where it begins.
                below = np.int64(joints.node[s]) - np.int64(1 if stems.is_clone[s] else 0)
            still.below[row] = below
            for c in range(3):
                still.position[row, c] = nodes.position[row, c]
            if below < 0:
                f[:] = 0.0
                f[0] = f[4] = f[8] = 1.0
            else:
                load_frame(f, nodes.side, nodes.heading, below)
                for c in range(3):
                    still.position[row, c] -= nodes.position[below, c]
            into(still.position, row, f, still.position)
            into(nodes.heading, row, f, still.heading)
            into(nodes.side, row, f, still.side)


@driver
def _settle_leaves(
    first: Any, step: Any, leaves: Any, leaf_node: Any, nodes: Any, room: Any, still: Any
) -> None:
    """Write each leaf in the frame of the node below it."""
    for chunk in range(first, CHUNKS, step):
        f = room[chunk, :9]
        start, end = part(chunk, len(leaf_node))
        for i in range(start, end):
            node = np.int64(leaf_node[i])
            load_frame(f, nodes.side, nodes.heading, node)
            for c in range(3):
                still.leaf_position[i, c] = leaves.position[i, c] - nodes.position[node, c]
            into(still.leaf_position, i, f, still.leaf_position)
            into(leaves.direction, i, f, still.direction)
            into(leaves.normal, i, f, still.normal)


@driver
def _bend(
    stems: Any, nodes: Any, joints: Any, still: Any, wind: Any, f: Any, new: Any, moved: Any
) -> None:
    """Set the moved nodes, stem by stem; a parent is moved before what it bears."""
    for s in range(len(stems.level)):
        segments = np.int64(joints.segments[s])
        per = (np.int64(stems.nodes[s]) - 1) // (segments - joints.start[s])
        length, radius = stems.length[s], stems.radius[s]
        for k in range(stems.nodes[s]):
            row = np.int64(stems.first[s]) + k
            below = np.int64(still.below[row])
            if below < 0:
                for c in range(9):
                    f[c] = 1.0 if c % 4 == 0 else 0.0
            else:
                load_frame(f, moved.side, moved.heading, below)
            out_of(still.position, row, f, moved.position)
            out_of(still.heading, row, f, moved.heading)
            out_of(still.side, row, f, moved.side)
            if below >= 0:
                for c in range(3):
                    moved.position[row, c] += moved.position[below, c]
            if k % per == 0 and k + 1 < stems.nodes[s]:
                here, z = nodes.radius[row], nodes.z[row]
                u, v = still.offset[s, 0], still.offset[s, 1]
                load_frame(new, moved.side, moved.heading, row)
                turn_x(new, sway_angles(wind, length, radius, here, z, u, segments) * _DEGREE)
                turn_y(new, sway_angles(wind, length, radius, here, z, v, segments) * _DEGREE)
                for c in range(3):
                    moved.side[row, c], moved.heading[row, c] = new[c], new[6 + c]


@driver
def _carry(
    first: Any, step: Any, leaf_node: Any, still: Any, moved: Any, room: Any, out: Any
) -> None:
    """Move the leaves with the nodes below them."""
    for chunk in range(first, CHUNKS, step):
        f = room[chunk, :9]
        start, end = part(chunk, len(leaf_node))
        for i in range(start, end):
            node = np.int64(leaf_node[i])
            load_frame(f, moved.side, moved.heading, node)
            out_of(still.leaf_position, i, f, out.position)
            for c in range(3):
                out.position[i, c] += moved.position[node, c]
            out_of(still.direction, i, f, out.direction)
            out_of(still.normal, i, f, out.normal)
