"""What stems bear: the next level's stems, and leaves (Weber & Penn 1995, 4.3, 4.5, 4.9).

Children stand at even distances along the course of a family, from the bare base up; a clone
bears those of its own part. Those of a fan all stand at the end.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import driver, njit
from forest.parametric.alone import CHUNKS, part
from forest.parametric.frames import copy, load_frame, turn_about, turn_x, turn_y, turn_z
from forest.parametric.ratios import shape_ratio
from forest.parametric.stems import OF_CHILD, OF_LEAF, descend, draw, either, sections_of

_DEGREE = np.pi / 180.0


@driver
def child_count(number: Any, most: Any, leaves: Any, shoots: Any, i: Any) -> Any:
    """Children on the whole course of stem i, to the nearest whole one (4.3, 4.5)."""
    if number == 0:
        share = 1.0
    elif leaves:
        share = 0.5 + 0.5 * shoots.reach[i]
    elif number == 1:
        share = 0.2 + 0.8 * shoots.share[i]
    else:
        share = 1.0 - 0.5 * shoots.reach[i]
    return np.int64(np.floor(most * share + 0.5))


@njit
def first_child(count: Any, bare: Any, from_z: Any) -> Any:
    """Number of the first child at or above z, of `count` from the bare base to the end."""
    return max(np.int64(0), np.int64(np.ceil((from_z - bare) / (1.0 - bare) * count - 0.5)))


@njit
def bare_share(number: Any, tree: Any, length: Any, scale: Any) -> Any:
    """Share of a stem that bears nothing: the trunk's base (BaseSize * scale, in metres)."""
    return min(tree.base_size * scale / length, 0.999) if number == 0 else 0.0


@driver
def count_children(
    number: Any, tree: Any, levels: Any, scale: Any, most: Any, leaves: Any, shoots: Any, row: Any
) -> Any:
    """Count what all stems of a level bear; `row` (n,) gets the row of each one's first."""
    total = np.int64(0)
    for i in range(len(shoots.key)):
        row[i] = total
        count = child_count(number, most, leaves, shoots, i)
        bare = bare_share(number, tree[0], shoots.length[i], scale)
        total += max(0, count - first_child(count, bare, shoots.start[i] / levels[number].segments))
    return total


@njit
def around(level: Any, j: Any, u: Any, turned: Any) -> Any:
    """Turn about the parent of child j, given its predecessor's; radians (4.3)."""
    chance = either(u) * level.rotate_variation
    if level.rotate >= 0.0:
        return turned + (level.rotate + chance) * _DEGREE
    side = 1.0 if j % 2 == 0 else -1.0
    return side * (180.0 + level.rotate + chance) * _DEGREE


@njit
def fanned(level: Any, j: Any, count: Any) -> Any:
    """Turn of one of a fan's members in its plane; nRotate is the fan's angle (4.5), radians."""
    return ((j + 0.5) / count - 0.5) * level.rotate * _DEGREE


@njit
def down_angle(level: Any, ratio: Any, u: Any) -> Any:
    """Angle between child and parent, radians (4.3); `ratio` is 0 at the parent's top."""
    if level.down_angle_variation >= 0.0:
        return (level.down_angle + either(u) * level.down_angle_variation) * _DEGREE
    return (
        level.down_angle + level.down_angle_variation * (1.0 - 2.0 * (0.2 + 0.8 * ratio))
    ) * _DEGREE


@driver
def node_at(number: Any, level: Any, tree: Any, shoots: Any, i: Any, z: Any) -> Any:
    """Node below z on stem i, and how far above it z is, m."""
    total = np.int64(level.segments) * sections_of(level, tree, number)
    along = (z - shoots.start[i] / level.segments) * total
    # What stands at a joint, but for rounding, belongs to the segment above.
    k = min(max(np.int64(along + 1e-9), np.int64(0)), np.int64(shoots.nodes[i]) - 2)
    return np.int64(shoots.first[i]) + k, (along - k) * shoots.length[i] / total


@driver
def spring(
    first: Any,
    step: Any,
    number: Any,
    tree: Any,
    levels: Any,
    whole: Any,
    shoots: Any,
    sections: Any,
    before: Any,
    rows: Any,
    out: Any,
    scratch: Any,
) -> None:
    """Fill the origins of the next level; `before` = stems and nodes of the levels below this one.

    Nodes of `shoots` and `sections` are counted from this level's first; `rows` are those of
    `count_children`.
    """
    for chunk in range(first, CHUNKS, step):
        _spring(chunk, number, tree, levels, whole, shoots, sections, before, rows, out, scratch)


@driver
def _spring(
    chunk: Any, number: Any, tree: Any, levels: Any, whole: Any, shoots: Any, sections: Any,
    before: Any, rows: Any, out: Any, scratch: Any,
) -> None:  # fmt: skip
    t, parent, level = tree[0], levels[number], levels[number + 1]
    f, place = scratch[chunk, :9], scratch[chunk, 9:12]
    start, end = part(chunk, len(shoots.key))
    for i in range(start, end):
        row = np.int64(rows[i])
        length = shoots.length[i]
        bare = bare_share(number, t, length, whole.scale)
        count = child_count(number, abs(level.branches), False, shoots, i)
        first = first_child(count, bare, shoots.start[i] / parent.segments)
        turned = level.rotate * first * _DEGREE
        for j in range(first, count):
            z = bare + (1.0 - bare) * (j + 0.5) / count
            a, b, c, _ = draw(whole.seed, shoots.key[i], OF_CHILD + j)
            down = down_angle(level, (1.0 - z) / (1.0 - bare), b)
            if level.branches < 0.0:
                z = 1.0
            ratio = (1.0 - z) / (1.0 - bare)
            node, far = node_at(number, parent, t, shoots, i, z)
            load_frame(f, sections.side, sections.heading, node)
            for k in range(3):
                place[k] = sections.position[node, k] + far * f[6 + k]
            if level.branches < 0.0:
                turn_y(f, fanned(level, j, count))
            else:
                turned = around(level, j, a, turned)
                turn_z(f, turned)
            turn_x(f, down)
            most = max(0.0, level.length + either(c) * level.length_variation)
            if number == 0:
                shape = shape_ratio(
                    np.int64(t.shape), ratio, t.prune_width_peak, t.prune_power_low,
                    t.prune_power_high, whole.printed,
                )  # fmt: skip
                out.length[row] = length * most * shape
            else:
                out.length[row] = most * length * (1.0 - 0.6 * z)
            frac = (z - sections.z[node]) / (sections.z[node + 1] - sections.z[node])
            out.limit[row] = (1.0 - frac) * sections.radius[node] + frac * sections.radius[node + 1]
            for k in range(3):  # an assignment of slices would allocate
                out.position[row, k] = place[k]
                out.heading[row, k] = f[6 + k]
                out.side[row, k] = f[k]
            out.longest[row] = most * length
            out.parent_length[row], out.parent_radius[row] = length, shoots.radius[i]
            out.offset[row] = z * length
            out.parent[row], out.node[row] = before[0] + i, before[1] + node
            out.key[row] = descend(whole.seed, shoots.key[i], OF_CHILD + j)
            row += 1


@njit
def orient(f: Any, place: Any, bend: Any) -> None:
    """Turn a leaf's upper face (the frame's y) outwards and up (4.9)."""
    outward = np.arctan2(place[1], place[0]) - np.arctan2(f[4], f[3])
    turn_about(f, 0.0, 0.0, 1.0, bend * outward, np.int64(9))
    flat = np.sqrt(f[3] * f[3] + f[4] * f[4])
    if flat > 0.0:
        angle = bend * np.arctan2(flat, f[5])
        turn_about(f, f[4] / flat, -f[3] / flat, 0.0, angle, np.int64(9))


@njit
def put_out(f: Any, at: Any, turned: Any, down: Any) -> None:
    """Set y and z of f to those of `at` after turn_z(turned) and turn_x(down)."""
    c, s = np.cos(turned), np.sin(turned)
    u, v = np.cos(down), np.sin(down)
    for k in range(3):
        y = c * at[3 + k] - s * at[k]
        f[3 + k] = u * y + v * at[6 + k]
        f[6 + k] = u * at[6 + k] - v * y


@driver
def bear_leaves(
    first: Any,
    step: Any,
    number: Any,
    tree: Any,
    levels: Any,
    whole: Any,
    shoots: Any,
    sections: Any,
    before: Any,
    most: Any,
    rows: Any,
    out: Any,
    scratch: Any,
) -> None:
    """Fill the leaves; `out` = (position, direction, normal, stem, node)."""
    for chunk in range(first, CHUNKS, step):
        _bear(
            chunk, number, tree, levels, whole, shoots, sections, before, most, rows, out, scratch
        )


@driver
def _bear(
    chunk: Any, number: Any, tree: Any, levels: Any, whole: Any, shoots: Any, sections: Any,
    before: Any, most: Any, rows: Any, out: Any, scratch: Any,
) -> None:  # fmt: skip
    t, parent, level = tree[0], levels[number], levels[number + 1]
    position, direction, normal, stem, at_node = out
    f, place, at = scratch[chunk, :9], scratch[chunk, 9:12], scratch[chunk, 12:21]
    fan = t.leaves < 0.0
    start, end = part(chunk, len(shoots.key))
    for i in range(start, end):
        row = np.int64(rows[i])
        bare = bare_share(number, t, shoots.length[i], whole.scale)
        count = child_count(number, most, True, shoots, i)
        first = first_child(count, bare, shoots.start[i] / parent.segments)
        turned = level.rotate * first * _DEGREE
        loaded: Any = -1
        for j in range(first, count):
            z = bare + (1.0 - bare) * (j + 0.5) / count
            if j == first or j % 2 == 0:  # a draw of four serves two leaves
                drawn = draw(whole.seed, shoots.key[i], OF_LEAF + j // 2)
            a, b = (drawn[0], drawn[1]) if j % 2 == 0 else (drawn[2], drawn[3])
            node, far = node_at(number, parent, t, shoots, i, 1.0 if fan else z)
            if node != loaded:  # most stay on the segment of the one before
                load_frame(at, sections.side, sections.heading, node)
                loaded = node
            down = down_angle(level, (1.0 - z) / (1.0 - bare), b)
            if fan:
                copy(f, at)
                turn_y(f, fanned(level, j, count))
                turn_x(f, down)
            else:
                turned = around(level, j, a, turned)
                put_out(f, at, turned, down)
            for k in range(3):
                place[k] = sections.position[node, k] + far * at[6 + k]
            if t.leaf_bend > 0.0:
                orient(f, place, t.leaf_bend)
            for k in range(3):  # an assignment of slices would allocate
                position[row, k] = place[k]
                direction[row, k] = f[6 + k]
                normal[row, k] = f[3 + k]
            stem[row], at_node[row] = before[0] + i, before[1] + node
            row += 1
