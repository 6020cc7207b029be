"""The stems of one level, with their clones (Weber & Penn 1995, 4.1, 4.2, 4.4, 4.6, 4.8).

A *family* is a stem and all clones that split off it. A family is grown at a length; where the
envelope prunes, it is probed over and over at nine tenths of the length until it fits. What is
handed many arrays is compiled as a `driver`, since counting references to them took most of the
time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from forest._jit import driver, njit
from forest.parametric.frames import copy, declination, load_frame, turn_about, turn_x, turn_z
from forest.parametric.ratios import flared, shape_ratio, tapered
from forest.random import STREAM_PARAMETRIC, philox, uniforms

_DEGREE = np.pi / 180.0
_WORD = np.uint64(32)

# What a stem draws for: its joints are numbered from 0, and so are its children.
OF_SPLIT = 1_000
OF_CLONE = 2_000  # and 1000 more for each clone of a joint
OF_CHILD = 10_000_000
OF_LEAF = 20_000_000
OF_SELF = 30_000_000
OF_SWAY = 40_000_000

_SHRINK = 0.9  # of a family that punctures the envelope, before it is probed again
_LEAST = 1e-3  # of the tree's scale: a shorter stem is none


class Origins(NamedTuple):
    """Where the stems of a level spring from, n rows; what they have before they grow."""

    position: Any  # float64 (n, 3), m
    heading: Any  # float64 (n, 3)
    side: Any  # float64 (n, 3)
    length: Any  # float64, before pruning, m
    longest: Any  # float64, of such a stem anywhere on the parent, m
    parent_length: Any  # float64, m
    parent_radius: Any  # float64, m
    limit: Any  # float64, radius of the parent there, m
    offset: Any  # float64, along the parent, m
    parent: Any  # int32, stem
    node: Any  # int32, the last node of the parent below
    key: Any  # uint64, which random numbers are its own


class Shoots(NamedTuple):
    """Stems of one level, with what their children need."""

    parent: Any  # int32
    clone: Any  # bool
    length: Any  # float64, of the whole course from the family's base, m
    radius: Any  # float64, m
    first: Any  # int32, node of this level
    nodes: Any  # int32
    offset: Any  # float64, m
    node: Any  # int32, of the parent
    key: Any  # uint64
    start: Any  # int32, segment of the family's course with which it begins
    share: Any  # float64, length / longest
    reach: Any  # float64, the family's offset / length of its parent


class Sections(NamedTuple):
    """Cross sections; arrays of one entry per node."""

    position: Any  # float64 (n, 3), m
    heading: Any  # float64 (n, 3)
    side: Any  # float64 (n, 3)
    radius: Any  # float64, m
    stem: Any  # int32
    z: Any  # float64


class Pending(NamedTuple):
    """Clones that wait for their turn."""

    frame: Any  # float64 (n, 12): the frame and the helix's axis
    state: Any  # float64 (n, 6): place, compensation now, more of it later, propensity
    at: Any  # int32 (n, 3): segment, parent stem, parent node
    key: Any  # uint64 (n,)


class Hand(NamedTuple):
    """What a family is grown with: where it is written, and scratch of one thread."""

    probing: Any  # bool: only the positions are wanted
    shoots: Shoots
    sections: Sections
    pending: Pending
    frame: Any  # float64 (12,)
    state: Any  # float64 (6,)


class Whole(NamedTuple):
    """What holds for the whole tree."""

    seed: Any  # uint64
    scale: Any  # float64, m
    trunk_factor: Any  # float64, on the radius of the trunk's sections
    printed: Any  # bool: the paper's readings


@njit
def draw(seed: Any, key: Any, what: Any) -> Any:
    """Four numbers in (0, 1) that belong to one stem and use."""
    return uniforms(seed, STREAM_PARAMETRIC, key, np.uint64(key) >> _WORD, what)


@njit
def descend(seed: Any, key: Any, what: Any) -> Any:
    """Name a stem by the one it springs from and its number there."""
    a, b, _, _ = philox(key, np.uint64(key) >> _WORD, what, STREAM_PARAMETRIC, seed, seed >> _WORD)
    return (a << _WORD) | b


@njit
def either(u: Any) -> Any:
    """A number in (-1, 1)."""
    return 2.0 * u - 1.0


@njit
def inside(tree: Any, whole: Any, x: Any, y: Any, z: Any) -> Any:
    """Whether a point lies in the envelope (4.6)."""
    square = x * x + y * y
    if whole.printed:
        square += z * z
    ratio = (whole.scale - z) / (whole.scale * (1.0 - tree.base_size))
    width = shape_ratio(
        np.int64(8),
        ratio,
        tree.prune_width_peak,
        tree.prune_power_low,
        tree.prune_power_high,
        whole.printed,
    )
    return np.sqrt(square) / whole.scale < tree.prune_width * width


@njit
def turn_joint(f: Any, level: Any, tree: Any, number: Any, s: Any, whole: Any, key: Any) -> Any:
    """Turn a stem where its segment s begins: curve, helix, chance (4.1)."""
    res = level.segments
    if level.curve_variation < 0.0:
        turn_about(f, f[9], f[10], f[11], 2.0 * np.pi / res, np.int64(9))
        return
    a, b, _, _ = draw(whole.seed, key, s)
    if level.curve_back == 0.0:
        curve = level.curve / res
    elif 2 * s < res:
        curve = level.curve / (0.5 * res)
    else:
        curve = level.curve_back / (0.5 * res)
    chance = either(a) * level.curve_variation / res
    if whole.printed:
        turn_x(f, (curve + chance) * _DEGREE)
    else:
        turn_x(f, curve * _DEGREE)
        about = 2.0 * np.pi * b
        turn_z(f, about)
        turn_x(f, chance * _DEGREE)
        turn_z(f, -about)


@njit
def attract(f: Any, level: Any, tree: Any) -> None:
    """Bend a segment to the vertical (4.8)."""
    turn_x(f, -tree.attraction_up * declination(f) * f[5] / level.segments)


@njit
def lean(f: Any, level: Any, u: Any, down: Any) -> Any:
    """Lean a stem or clone after a split; gives the angle, radians (4.2)."""
    wanted = level.split_angle + either(u) * level.split_angle_variation
    angle = max(0.0, wanted * _DEGREE - down)
    turn_x(f, angle)
    turn_about(f[9:12], f[0], f[1], f[2], angle, np.int64(3))
    return angle


@njit
def spread(f: Any, u: Any, down: Any, factor: Any) -> None:
    """Turn a stem and its axis about the vertical (4.2)."""
    angle = 20.0 + 0.75 * (30.0 + abs(down / _DEGREE - 90.0)) * u * u
    turn_about(f, 0.0, 0.0, 1.0, factor * angle * _DEGREE, np.int64(12))


@driver
def place_clones(
    n: Any, f: Any, p: Any, level: Any, whole: Any, s: Any, here: Any, pending: Any, waiting: Any
) -> Any:
    """Split at the joint before segment s; gives the stem's own compensation per joint.

    `p` is the stem's state, `here` = (stem, node, key of the stem).
    """
    stem, node, key = here
    down = declination(f)
    left = max(level.segments - 1.0 - s, 1.0)
    a, b, c, _ = draw(whole.seed, key, OF_SPLIT + s)
    sign = 1.0 if c < 0.5 else -1.0
    for k in range(1, n + 1):
        row = waiting + k - 1
        own = descend(whole.seed, key, OF_CLONE + 1_000 * k + s)
        u, v, _, _ = draw(whole.seed, own, OF_SELF)
        clone = pending.frame[row]
        copy(clone, f)
        angle = lean(clone, level, u, down)
        if k > 1:
            spread(clone, v, down, sign * ((k + 1) // 2 if k % 2 else -(k // 2)))
        copy(pending.state[row], p)
        pending.state[row, 4] = p[4] + angle / left
        pending.at[row, 0] = s
        pending.at[row, 1] = stem
        pending.at[row, 2] = node
        pending.key[row] = own
    angle = lean(f, level, a, down)
    spread(f, b, down, sign)
    return angle / left


@njit
def sections_of(level: Any, tree: Any, number: Any) -> Any:
    """Cross sections per segment: more where the radius is not a cone's."""
    wanted = 1
    if level.taper > 2.0 or (number == 0 and tree.flare > 0.0):
        wanted = 32
    elif level.taper > 1.0:
        wanted = 8
    return np.int64(np.ceil(wanted / level.segments))


@driver
def section_radius(
    level: Any, tree: Any, whole: Any, number: Any, radius: Any, z: Any, le: Any
) -> Any:
    """Radius at z, m: tapered, and flared on the trunk."""
    r = tapered(radius, level.taper, z, le)
    return r * flared(tree.flare, z) * whole.trunk_factor if number == 0 else r


@driver
def base_radius(tree: Any, origins: Any, o: Any, length: Any) -> Any:
    """Radius at the base of a family's course, m (4.4)."""
    relative = length / origins.parent_length[o]
    return min(origins.parent_radius[o] * relative**tree.ratio_power, origins.limit[o])


@driver
def set_frame(sections: Any, m: Any, f: Any) -> None:
    """Write a section's frame, number by number: an assignment of slices would allocate."""
    for c in range(3):
        sections.heading[m, c] = f[6 + c]
        sections.side[m, c] = f[c]


@driver
def grow_family(
    number: Any,
    level: Any,
    tree: Any,
    whole: Any,
    origins: Any,
    o: Any,
    length: Any,
    error: Any,
    base: Any,
    hand: Any,
) -> Any:
    """Grow a stem and its clones at a length, or probe it.

    `base` = (stems, nodes before this level, stems, nodes of this level so far). Returns
    (error of the splits, stems, nodes); -1 stems: no room.
    """
    stems_before, nodes_before, n, m = base
    probing, shoots, sections, pending, f, p = hand
    res = np.int64(level.segments)
    per = sections_of(level, tree, number)
    step = length / (res * per)
    radius = 0.0 if probing else base_radius(tree, origins, o, length)
    pending.at[0, 0] = 0
    waiting: Any = 1
    while waiting > 0:
        waiting -= 1
        start = np.int64(pending.at[waiting, 0])
        if start == 0:
            load_frame(f, origins.side, origins.heading, o)
            copy(f[9:12], f[6:9])
            copy(p[:3], origins.position[o])
            p[3] = p[4] = 0.0
            p[5] = 1.0
            key = origins.key[o]
            parent, node, offset = origins.parent[o], origins.node[o], origins.offset[o]
            if level.curve_variation < 0.0:
                turn_x(f, -level.curve_variation * _DEGREE)
        else:
            copy(f, pending.frame[waiting])
            copy(p, pending.state[waiting])
            key = pending.key[waiting]
            parent, node = pending.at[waiting, 1], pending.at[waiting, 2]
            offset = length * start / res
        if not probing:
            longest = origins.longest[o]
            shoots.parent[n], shoots.node[n], shoots.offset[n] = parent, node, offset
            shoots.clone[n] = start > 0
            shoots.length[n], shoots.radius[n] = length, radius
            shoots.first[n], shoots.nodes[n] = m, (res - start) * per + 1
            shoots.key[n], shoots.start[n] = key, start
            shoots.share[n] = length / longest if longest > 0.0 else 1.0
            shoots.reach[n] = origins.offset[o] / origins.parent_length[o]
        before = waiting
        for s in range(start, res):
            more = 0.0
            if s > start:
                splits = level.splits * p[5]
                if number == 0 and s == 1 and tree.base_splits > 0.0:
                    clones = np.int64(tree.base_splits)
                else:
                    clones = np.int64(np.floor(splits + error + 0.5))
                    error += splits - clones
                room = min(len(pending.key), len(shoots.key) - n - 1)
                if waiting + clones > room:
                    return error, np.int64(-1), m
                if clones > 0:
                    p[5] = tree.clone_habit if whole.printed else p[5] * tree.clone_habit
                    here = (stems_before + n, nodes_before + m - 1, key)
                    more = place_clones(clones, f, p, level, whole, s, here, pending, waiting)
                    waiting += clones
            if s > 0:
                turn_joint(f, level, tree, number, s, whole, key)
                turn_x(f, -p[3])
                p[3] += p[4] + more
                p[4] = 0.0
                if number > 1:
                    attract(f, level, tree)
            if m + per + (1 if s == start else 0) > len(sections.z):
                return error, np.int64(-1), m
            for k in range(0 if s == start else 1, per + 1):
                if k > 0:
                    for c in range(3):
                        p[c] += step * f[6 + c]
                copy(sections.position[m], p)
                if not probing:
                    if s > start and k == 1:  # the section at the joint turns with what it bears
                        set_frame(sections, m - 1, f)
                    set_frame(sections, m, f)
                    z = (s * per + k) / (res * per)
                    le = length
                    sections.radius[m] = section_radius(level, tree, whole, number, radius, z, le)
                    sections.z[m], sections.stem[m] = z, stems_before + n
                m += 1
        n += 1
        _reverse(pending, before, waiting)
    return error, n, m


@driver
def _reverse(pending: Any, first: Any, end: Any) -> None:
    """Turn the order of the clones just made, so that the first comes off the stack first."""
    for k in range((end - first) // 2):
        i, j = first + k, end - 1 - k
        for c in range(12):
            pending.frame[i, c], pending.frame[j, c] = pending.frame[j, c], pending.frame[i, c]
        for c in range(6):
            pending.state[i, c], pending.state[j, c] = pending.state[j, c], pending.state[i, c]
        for c in range(3):
            pending.at[i, c], pending.at[j, c] = pending.at[j, c], pending.at[i, c]
        pending.key[i], pending.key[j] = pending.key[j], pending.key[i]


@driver
def fits(tree: Any, whole: Any, sections: Any, first: Any, end: Any, part: Any) -> Any:
    """Whether a family that was probed, shortened to a part of its length, is in the envelope."""
    at = sections.position
    x, y, z = at[first, 0], at[first, 1], at[first, 2]
    for k in range(end - 1, first, -1):  # the far end is the first to be outside
        u = x + part * (at[k, 0] - x)
        v = y + part * (at[k, 1] - y)
        w = z + part * (at[k, 2] - z)
        if not inside(tree, whole, u, v, w):
            return False
    return True


@driver
def pruned_length(
    number: Any, level: Any, tree: Any, whole: Any, origins: Any, o: Any, error: Any, base: Any,
    hand: Any,
) -> Any:  # fmt: skip
    """Length at which a family is grown, m (4.6); 0 if it is none, -1 if there was no room.

    No turn and no split depends on the length, so that one probe serves all lengths.
    """
    length = origins.length[o]
    least = _LEAST * whole.scale
    if tree.prune_ratio > 0.0 and number > 0 and length > least:
        at = origins.position
        short = 0.0
        if inside(tree, whole, at[o, 0], at[o, 1], at[o, 2]):
            short = length
            probe = Hand(True, hand.shoots, hand.sections, hand.pending, hand.frame, hand.state)
            _, n, m = grow_family(
                number, level, tree, whole, origins, o, length, error, base, probe
            )
            if n < 0:
                return -1.0
            while short > least and not fits(
                tree, whole, hand.sections, base[3], m, short / length
            ):
                short *= _SHRINK
            if short <= least:
                short = 0.0
        length = (1.0 - tree.prune_ratio) * length + tree.prune_ratio * short
    return length if length > least else 0.0


@driver
def grow_level(
    number: Any, tree: Any, levels: Any, whole: Any, origins: Any, before: Any, hand: Any
) -> Any:
    """Grow all stems of a level; `before` = (stems, nodes) of the levels below.

    Returns the number of stems and nodes made; -1 if the arrays are too short. One after the
    other, since the error of the splits is handed on.
    """
    level, whole_tree = levels[number], tree[0]
    error = 0.0
    n, m = np.int64(0), np.int64(0)
    for o in range(len(origins.key)):
        if n >= len(hand.shoots.key):
            return np.int64(-1), m
        base = (before[0], before[1], n, m)
        length = pruned_length(number, level, whole_tree, whole, origins, o, error, base, hand)
        if length < 0.0:
            return np.int64(-1), m
        if length > 0.0:
            error, n, m = grow_family(
                number, level, whole_tree, whole, origins, o, length, error, base, hand
            )
        if n < 0:
            return n, m
    return n, m
