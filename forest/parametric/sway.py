"""Trees in the wind: only the turns between segments change (Weber & Penn 1995, 4.7)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from forest._jit import njit
from forest.errors import InputError
from forest.parametric.frames import load_frame, turn_x, turn_y
from forest.parametric.stems import OF_SWAY, draw

if TYPE_CHECKING:
    from forest.parametric.tree import ParametricTree

_DEGREE = np.pi / 180.0


def sway(
    tree: ParametricTree,
    time_s: float,
    wind_speed: float,
    gust: float = 0.0,
    *,
    time_scale: float = 1.0,
) -> ParametricTree:
    """Give a tree's shape at a moment of a wind.

    Parameters
    ----------
    tree : ParametricTree
        The still tree; it can be used for any number of moments.
    time_s : float
        The moment, s.
    wind_speed, gust : float
        The wind blows between `wind_speed` and `wind_speed + gust`; the paper names no unit.
    time_scale : float
        How much faster than printed everything swings. As printed an aspen's trunk takes
        6283 s for one swing; 2000 makes that about three seconds.

    Returns
    -------
    ParametricTree
        With the same stems, radii and leaves; without wind and gust, `tree` itself.

    Raises
    ------
    InputError
        If a number is not finite, or wind or gust is negative.
    """
    for name, value in (("wind speed", wind_speed), ("gust", gust)):
        if not 0.0 <= value <= 1000.0:
            raise InputError(f"{name} {value:g} is not allowed", expected="0 to 1000")
    if not (np.isfinite(time_s) and np.isfinite(time_scale)):
        raise InputError("the moment is not a finite number")
    if wind_speed == 0.0 and gust == 0.0:
        return tree
    nodes, leaves = tree.nodes, tree.leaves
    moved = nodes._replace(
        position=nodes.position.copy(), heading=nodes.heading.copy(), side=nodes.side.copy()
    )
    wind = (float(wind_speed), float(gust), float(time_s) * float(time_scale))
    _bend(tree.stems, nodes, tree.joints, np.uint64(tree.seed), wind, moved)
    shifted = leaves._replace(
        position=leaves.position.copy(),
        direction=leaves.direction.copy(),
        normal=leaves.normal.copy(),
    )
    _carry(leaves, tree.joints.leaf_node, nodes, moved, shifted)
    return replace(tree, nodes=moved, leaves=shifted)


@njit
def sway_angles(
    wind: Any, length: Any, radius: Any, radius_here: Any, z: Any, offset: Any, segments: Any
) -> Any:
    """Turn about one axis of a joint, degrees; `wind` = (speed, gust, scaled time in s)."""
    speed, gust, time = wind
    if z < 1.0 and radius_here > 0.0:
        stiff = 4.0 * length * (1.0 - z) / radius_here
    else:
        stiff = 4.0 * length / radius  # the limit at the tip of a cone
    a1 = speed / 50.0 * stiff
    a2 = gust / 50.0 * stiff + a1 / 2.0
    b = offset + radius / length * time / 15.0
    return (a1 * np.sin(b) + a2 * np.sin(0.7 * b)) / segments


@njit
def transfer(v: Any, row: Any, old: Any, new: Any, out: Any) -> None:
    """Write the vector v[row] of frame `old` as it stands in frame `new`."""
    x = v[row, 0] * old[0] + v[row, 1] * old[1] + v[row, 2] * old[2]
    y = v[row, 0] * old[3] + v[row, 1] * old[4] + v[row, 2] * old[5]
    z = v[row, 0] * old[6] + v[row, 1] * old[7] + v[row, 2] * old[8]
    for k in range(3):
        out[row, k] = x * new[k] + y * new[3 + k] + z * new[6 + k]


@njit
def shift(place: Any, row: Any, node: Any, nodes: Any, moved: Any, old: Any, new: Any) -> None:
    """Carry a place beside a node along with it; `old` and `new` are the node's frames."""
    place[row] -= nodes.position[node]
    transfer(place, row, old, new, place)
    place[row] += moved.position[node]


@njit
def _bend(stems: Any, nodes: Any, joints: Any, seed: Any, wind: Any, moved: Any) -> None:
    """Set the moved nodes, stem by stem; a parent is moved before what it bears."""
    old, new, was = np.empty(9), np.empty(9), np.empty(9)
    for s in range(len(stems.level)):
        first = np.int64(stems.first[s])
        node = np.int64(joints.node[s])
        if node >= 0:
            # A clone turns away from the segment that ends where it begins.
            below = node - 1 if stems.is_clone[s] else node
            load_frame(old, nodes.side, nodes.heading, below)
            load_frame(new, moved.side, moved.heading, below)
            shift(moved.position, first, below, nodes, moved, old, new)
        else:
            load_frame(old, nodes.side, nodes.heading, first)
            new[:] = old
        u, v, _, _ = draw(seed, joints.key[s], OF_SWAY)
        segments = np.int64(joints.segments[s])
        per = (np.int64(stems.nodes[s]) - 1) // (segments - joints.start[s])
        for k in range(stems.nodes[s]):
            row = first + k
            if k > 0:
                moved.position[row] = nodes.position[row]
                shift(moved.position, row, row - 1, nodes, moved, was, new)
                old[:] = was
            # Frame of this node, as it turned from the one before in the still tree.
            transfer(nodes.side, row, old, new, moved.side)
            transfer(nodes.heading, row, old, new, moved.heading)
            load_frame(new, moved.side, moved.heading, row)
            load_frame(was, nodes.side, nodes.heading, row)
            if k % per == 0 and k + 1 < stems.nodes[s]:
                length, radius, z = stems.length[s], stems.radius[s], nodes.z[row]
                here = nodes.radius[row]
                turn = (2.0 * np.pi * u, 2.0 * np.pi * v)
                x = sway_angles(wind, length, radius, here, z, turn[0], segments)
                y = sway_angles(wind, length, radius, here, z, turn[1], segments)
                turn_x(new, x * _DEGREE)
                turn_y(new, y * _DEGREE)
                moved.side[row], moved.heading[row] = new[0:3], new[6:9]


@njit
def _carry(leaves: Any, leaf_node: Any, nodes: Any, moved: Any, out: Any) -> None:
    """Move the leaves with the nodes below them."""
    old, new = np.empty(9), np.empty(9)
    for i in range(len(leaf_node)):
        node = np.int64(leaf_node[i])
        load_frame(old, nodes.side, nodes.heading, node)
        load_frame(new, moved.side, moved.heading, node)
        shift(out.position, i, node, nodes, moved, old, new)
        transfer(leaves.direction, i, old, new, out.direction)
        transfer(leaves.normal, i, old, new, out.normal)
