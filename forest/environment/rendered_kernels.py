"""A picture of a stand, drawn tile by tile, and what of every leaf it shows.

Shapes are named once for every tile that they touch, sorted by tile with counts (never by
comparison), in the order of trees and metamers. Each tile is then drawn by one thread into a
buffer of its own of `TILE` x `TILE` pixels (8 bytes each: height and name). Nothing but whole
numbers is added up, so no bit depends on the threads.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest.environment.rendered_shapes import (
    column_spots,
    leaf_spots,
    limb_ends,
    limb_spots,
    paint_column,
    paint_leaf,
    paint_limb,
)
from forest.environment.voxels import count_buds, wrap

#: Edge of a tile in pixels, 2 to the power of SHIFT.
TILE = 128
SHIFT = 7
#: Runs of whole blocks of metamers, of about equal length; fixed, so that nothing depends on the
#: threads. One more hand, the last, holds the obstacles.
HANDS = 16
#: Kinds of shapes.
LEAF = 0
LIMB = 1
COLUMN = 2
#: Tiles that a shape touches, where it is not just one.
NONE = -1
SEVERAL = -2


class Walk(NamedTuple):
    """The metamers of all trees in order: blocks within trees, and the blocks of each hand.

    Hand h has the blocks cut[h] to cut[h + 1] - 1; `tree`, `first` and `last` are as in
    `forest.environment.voxels.Blocks`.
    """

    tree: NDArray[np.int64]
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    cut: NDArray[np.int64]


class Looks(NamedTuple):
    """What a species' sites look like; arrays of one entry per species.

    Attributes
    ----------
    leaf_area_m2 : float64
        Leaf area of a bud site, m^2.
    pipe_exponent : float64
        d = pipe^(1 / exponent).
    """

    leaf_area_m2: NDArray[np.float64]
    pipe_exponent: NDArray[np.float64]


class Entries(NamedTuple):
    """Shapes named for each tile that they touch, sorted by tile, then tree, then metamer.

    Attributes
    ----------
    tree, item : int32
        Row of the tree and metamer in its extent (leaf), or -1 - metamer (internode); -1 and
        the column (obstacle).
    seen : int32
        Pixels in which the shape is seen.
    begin : int64 (tiles * (HANDS + 1) + 1,)
        First entry of each tile and hand.
    cursor : int64 (HANDS + 1, tiles)
        Next entry of each hand and tile while entries are counted and filled in.
    """

    tree: NDArray[np.int32]
    item: NDArray[np.int32]
    seen: NDArray[np.int32]
    begin: NDArray[np.int64]
    cursor: NDArray[np.int64]


@driver
def prepare(first, step, metamers, trees, walk, looks, radius):  # type: ignore[no-untyped-def]
    """Darken every node and find the radius of every internode, m."""
    pipe = metamers.pipe
    light = metamers.light
    for hand in range(first, HANDS, step):
        for block in range(walk.cut[hand], walk.cut[hand + 1]):
            exponent = looks.pipe_exponent[trees.species[walk.tree[block]]]
            for k in range(walk.first[block], walk.last[block]):
                light[k] = np.float32(0.0)
                thick = np.float64(pipe[k])
                if exponent == 2.0:
                    thick = np.sqrt(thick)
                else:
                    thick = thick ** (1.0 / exponent)
                radius[k] = np.float32(0.5 * thick)


@driver
def bound_leaves(first, step, metamers, trees, walk, looks, scene, bounds):  # type: ignore[no-untyped-def]
    """Bound the spots of each hand's leaves: int64 (HANDS, 4), first above last without any."""
    state = metamers.state
    tip = metamers.tip
    for hand in range(first, HANDS, step):
        i0 = j0 = np.int64(2**62)
        i1 = j1 = np.int64(-(2**62))
        for block in range(walk.cut[hand], walk.cut[hand + 1]):
            tree = walk.tree[block]
            area = looks.leaf_area_m2[trees.species[tree]]
            x, y = trees.x[tree], trees.y[tree]
            for k in range(walk.first[block], walk.last[block]):
                buds = count_buds(state[k])
                if buds == 0:
                    continue
                spots, _, _ = _leaf(scene, x, y, tip, k, buds * area)
                i0 = min(i0, spots[0])
                i1 = max(i1, spots[1])
                j0 = min(j0, spots[2])
                j1 = max(j1, spots[3])
        bounds[hand, 0] = i0
        bounds[hand, 1] = i1
        bounds[hand, 2] = j0
        bounds[hand, 3] = j1


@njit
def _leaf(scene: Any, x: Any, y: Any, tip: Any, k: Any, area: Any) -> Any:
    """Find a leaf's spots, how many pixels it covers, and its height."""
    z = np.float64(tip[k, 2])
    spots, covers = leaf_spots(scene, x + tip[k, 0], y + tip[k, 1], z, 0.5 * np.sqrt(area))
    return spots, covers, z


@njit
def _tiles_along(low: Any, high: Any, n: Any, periodic: Any) -> Any:
    """Find the first tile along an axis that some pixels touch, and how many."""
    tiles = (n + TILE - 1) >> SHIFT
    if not periodic:
        low = max(low, 0)
        high = min(high, n - 1)
        return low >> SHIFT, max((high >> SHIFT) - (low >> SHIFT) + 1, 0) * (high >= low)
    if high - low >= n - 1:
        return np.int64(0), tiles
    begin = wrap(low, n)
    end = begin + high - low
    if end < n:
        return begin >> SHIFT, (end >> SHIFT) - (begin >> SHIFT) + 1
    return begin >> SHIFT, min(((end - n) >> SHIFT) - (begin >> SHIFT) + 1 + tiles, tiles)


@njit
def _only_tile(spots: Any, wide: Any, deep: Any, periodic: Any) -> Any:
    """Find the one tile that holds all spots, else NONE or SEVERAL (as far as is easily told)."""
    i, j = spots[0], spots[2]
    if spots[1] < i or spots[3] < j:
        return np.int64(NONE)
    if periodic:
        i = wrap(i, wide)
        j = wrap(j, deep)
    right, back = i + spots[1] - spots[0], j + spots[3] - spots[2]
    if i < 0 or j < 0 or right >= wide or back >= deep:
        return np.int64(SEVERAL)
    if i >> SHIFT != right >> SHIFT or j >> SHIFT != back >> SHIFT:
        return np.int64(SEVERAL)
    return (j >> SHIFT) * ((wide + TILE - 1) >> SHIFT) + (i >> SHIFT)


@njit
def _enter(
    spots: Any, scene: Any, cursor: Any, hand: Any, owner: Any, item: Any, tree: Any, name: Any
) -> None:
    """Name a shape for every tile that it touches; only count them while there is no room."""
    if spots[1] < spots[0] or spots[3] < spots[2]:
        return
    i, across = _tiles_along(spots[0], spots[1], scene.wide, scene.periodic)
    j, down = _tiles_along(spots[2], spots[3], scene.deep, scene.periodic)
    tiles_x = (scene.wide + TILE - 1) >> SHIFT
    tiles_y = (scene.deep + TILE - 1) >> SHIFT
    for b in range(j, j + down):
        row = b - tiles_y if b >= tiles_y else b
        for a in range(i, i + across):
            tile = row * tiles_x + (a - tiles_x if a >= tiles_x else a)
            at = cursor[hand, tile]
            if len(owner) > 0:
                owner[at] = tree
                item[at] = name
            cursor[hand, tile] = at + 1


@driver
def enter(first, step, metamers, trees, walk, looks, scene, radius, columns, entries):  # type: ignore[no-untyped-def]
    """Name all shapes for the tiles that they touch; only count them while there is no room."""
    # Arrays are taken out of their tuples before the loops: each access would count references.
    state, tip, parents = metamers.state, metamers.tip, metamers.parent
    cursor, owner, item = entries.cursor, entries.tree, entries.item
    wide, deep, periodic = scene.wide, scene.deep, scene.periodic
    filling = len(owner) > 0
    for hand in range(first, HANDS, step):
        for block in range(walk.cut[hand], walk.cut[hand + 1]):
            tree = walk.tree[block]
            start = trees.start[tree]
            area = looks.leaf_area_m2[trees.species[tree]]
            x, y = trees.x[tree], trees.y[tree]
            for shape in range(2 * walk.first[block], 2 * walk.last[block]):
                k = shape >> 1
                if shape & 1:
                    name = start - k - 1
                    parent = start + parents[k] if parents[k] >= 0 else np.int64(-1)
                    ends = limb_ends(scene, x, y, tip, parent, k)
                    spots = limb_spots(scene, ends, np.float64(radius[k]))
                elif count_buds(state[k]) > 0:
                    name = k - start
                    spots, _, _ = _leaf(scene, x, y, tip, k, count_buds(state[k]) * area)
                else:
                    continue
                tile = _only_tile(spots, wide, deep, periodic)
                if tile >= 0:
                    at = cursor[hand, tile]
                    cursor[hand, tile] = at + 1
                    if filling:
                        owner[at] = tree
                        item[at] = name
                elif tile == SEVERAL:
                    _enter(spots, scene, cursor, hand, owner, item, tree, name)
    if first == 0:
        for c in range(len(columns.x)):
            spots = column_spots(scene, columns, c)
            _enter(spots, scene, cursor, HANDS, owner, item, np.int64(-1), np.int64(c))


@njit
def _turns(spots: Any, tile: Any, scene: Any) -> Any:
    """Find how many turns of the torus bring spots into a tile: least and most along x, along y."""
    low_i = high_i = low_j = high_j = np.int64(0)
    if scene.periodic:
        if spots[0] < 0 or spots[1] >= scene.wide:
            low_i = -((tile[1] - 1 - spots[0]) // scene.wide)
            high_i = (spots[1] - tile[0]) // scene.wide
        if spots[2] < 0 or spots[3] >= scene.deep:
            low_j = -((tile[3] - 1 - spots[2]) // scene.deep)
            high_j = (spots[3] - tile[2]) // scene.deep
    return low_i, high_i, low_j, high_j


@njit
def _part(spots: Any, tile: Any, over_i: Any, over_j: Any) -> Any:
    """Cut spots to those that lie in a tile after some turns; give the tile's corner there, too."""
    i0, j0 = tile[0] + over_i, tile[2] + over_j
    part = (
        max(spots[0], i0),
        min(spots[1], tile[1] - 1 + over_i),
        max(spots[2], j0),
        min(spots[3], tile[3] - 1 + over_j),
    )
    return part, (i0, j0)


@njit
def _draw_shapes(depth, who, tile, span, metamers, trees, looks, scene, radius, columns, entries):  # type: ignore[no-untyped-def]
    """Draw the shapes of one tile's entries; a name is the entry's place among them.

    A leaf between all pixels' centres is not drawn; its count is set to -1.
    """
    state, tip, parents = metamers.state, metamers.tip, metamers.parent
    owner, items, seen = entries.tree, entries.item, entries.seen
    tree_x, tree_y, starts, species = trees.x, trees.y, trees.start, trees.species
    leaf_area = looks.leaf_area_m2
    for e in range(span[0], span[1]):
        tree, item, name = np.int64(owner[e]), np.int64(items[e]), np.int32(e - span[0])
        seen[e] = 0
        kind = COLUMN if tree < 0 else LEAF if item >= 0 else LIMB
        z = thick = 0.0
        ends = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if kind == LEAF:
            k = starts[tree] + item
            area = count_buds(state[k]) * leaf_area[species[tree]]
            spots, covers, z = _leaf(scene, tree_x[tree], tree_y[tree], tip, k, area)
            if covers == 0:
                seen[e] = -1
                continue
        elif kind == LIMB:
            k = starts[tree] - 1 - item
            parent = starts[tree] + parents[k] if parents[k] >= 0 else np.int64(-1)
            ends = limb_ends(scene, tree_x[tree], tree_y[tree], tip, parent, k)
            thick = np.float64(radius[k])
            spots = limb_spots(scene, ends, thick)
        else:
            spots = column_spots(scene, columns, item)
        low_i, high_i, low_j, high_j = _turns(spots, tile, scene)
        for turn_j in range(low_j, high_j + 1):
            for turn_i in range(low_i, high_i + 1):
                part, corner = _part(spots, tile, turn_i * scene.wide, turn_j * scene.deep)
                if kind == LEAF:
                    paint_leaf(depth, who, name, part, corner, z)
                elif kind == LIMB:
                    paint_limb(depth, who, name, part, corner, scene, ends, thick)
                else:
                    paint_column(depth, who, name, part, corner, scene, columns, item)


@njit
def _count_seen(depth, who, tile, span, metamers, trees, scene, entries):  # type: ignore[no-untyped-def]
    """Count the pixels of each entry; a leaf between all centres sees what its pixel holds."""
    owner, items, seen = entries.tree, entries.item, entries.seen
    for j in range(tile[3] - tile[2]):
        for i in range(tile[1] - tile[0]):
            if who[j, i] >= 0:
                seen[span[0] + who[j, i]] += 1
    for e in range(span[0], span[1]):
        if seen[e] >= 0:
            continue
        tree = owner[e]
        k = trees.start[tree] + items[e]
        spots, _, z = _leaf(scene, trees.x[tree], trees.y[tree], metamers.tip, k, 0.0)
        i, j = spots[0], spots[2]
        if scene.periodic:
            i = wrap(i, scene.wide)
            j = wrap(j, scene.deep)
        seen[e] = 1 if depth[j - tile[2], i - tile[0]] <= np.float32(z) else 0


@njit
def _draw_tiles(first, step, metamers, trees, looks, scene, radius, columns, entries, names):  # type: ignore[no-untyped-def]
    depth = np.empty((TILE, TILE), np.float32)
    who = np.empty((TILE, TILE), np.int32)
    tiles_x = (scene.wide + TILE - 1) >> SHIFT
    for tile in range(first, entries.cursor.shape[1], step):
        span = entries.begin[tile * (HANDS + 1)], entries.begin[(tile + 1) * (HANDS + 1)]
        if span[0] == span[1]:
            continue
        depth[:] = np.float32(-np.inf)
        who[:] = np.int32(-1)
        x, y = tile % tiles_x * TILE, tile // tiles_x * TILE
        place = x, min(x + TILE, scene.wide), y, min(y + TILE, scene.deep)
        _draw_shapes(
            depth, who, place, span, metamers, trees, looks, scene, radius, columns, entries
        )
        _count_seen(depth, who, place, span, metamers, trees, scene, entries)
        if len(names) > 0:
            for j in range(place[2], place[3]):
                for i in range(place[0], place[1]):
                    name = who[j - y, i - x]
                    names[j, i] = np.int32(span[0] + name) if name >= 0 else np.int32(-1)


@driver
def draw(first, step, metamers, trees, looks, scene, radius, columns, entries, names):  # type: ignore[no-untyped-def]
    """Draw every tile and count the pixels of every entry.

    `names`, int32 (deep, wide) or (0, 0) if it is not wanted, gets the entry seen in each pixel of
    tiles that hold any; -1 where none is.
    """
    _draw_tiles(first, step, metamers, trees, looks, scene, radius, columns, entries, names)


@njit
def _is_open(scene: Any, clearing: Any, x: Any, y: Any, z: Any) -> Any:
    """Tell whether the light comes over the wall of a clearing to a point.

    `clearing` is (x, y) of its centre, its radius and the wall's height, m; radius 0 is no wall.
    """
    wall = clearing[3]
    if clearing[2] == 0.0 or z >= wall:
        return True
    off_x, off_y = x - clearing[0], y - clearing[1]
    room = clearing[2] * clearing[2] - off_x * off_x - off_y * off_y
    if room <= 0.0:
        return False
    # The wall is passed at the height z + t, where the ray has gone t slopes sideways.
    square = scene.slope_x * scene.slope_x + scene.slope_y * scene.slope_y
    out = off_x * scene.slope_x + off_y * scene.slope_y
    t = wall - z
    return square * t * t + 2.0 * out * t <= room


@driver
def gather(  # type: ignore[no-untyped-def]
    first, step, metamers, trees, walk, looks, scene, entries, count, clearing, share
):
    """Add `share` times the part of each leaf that is seen to the node's light."""
    light, state, tip = metamers.light, metamers.state, metamers.tip
    begin, owner, items, seen = entries.begin, entries.tree, entries.item, entries.seen
    starts = trees.start
    for hand in range(first, HANDS, step):
        for at in range(hand, len(begin) - 1, HANDS + 1):
            for e in range(begin[at], begin[at + 1]):
                if items[e] >= 0:
                    count[starts[owner[e]] + items[e]] += seen[e]
        for block in range(walk.cut[hand], walk.cut[hand + 1]):
            tree = walk.tree[block]
            x, y = trees.x[tree], trees.y[tree]
            area = looks.leaf_area_m2[trees.species[tree]]
            for k in range(walk.first[block], walk.last[block]):
                if count[k] == 0:
                    continue
                _, covers, z = _leaf(scene, x, y, tip, k, count_buds(state[k]) * area)
                if _is_open(scene, clearing, x + tip[k, 0], y + tip[k, 1], z):
                    part = np.float64(count[k]) / np.float64(max(covers, 1))
                    light[k] = np.float32(np.float64(light[k]) + share * part)
                count[k] = 0


@driver
def respond(first, step, metamers, walk, full_light, saturation):  # type: ignore[no-untyped-def]
    """Let light at and above the share `saturation` count as full light."""
    light = metamers.light
    for hand in range(first, HANDS, step):
        for block in range(walk.cut[hand], walk.cut[hand + 1]):
            for k in range(walk.first[block], walk.last[block]):
                part = np.float64(light[k]) / (saturation * full_light)
                light[k] = np.float32(full_light * min(part, 1.0))
