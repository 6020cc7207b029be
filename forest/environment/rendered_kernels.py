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

from forest._jit import inline, njit
from forest.environment.rendered_shapes import (
    column_spots,
    leaf_spots,
    limb_ends,
    limb_spots,
    paint_column,
    paint_leaf,
    paint_limb,
)
from forest.environment.voxels import count_buds

#: Edge of a tile in pixels.
TILE = 128
#: Runs of whole blocks of metamers, of about equal length; fixed, so that nothing depends on the
#: threads. One more hand holds the obstacles.
HANDS = 16
#: Kinds of shapes.
LEAF = np.int64(0)
LIMB = np.int64(1)
COLUMN = np.int64(2)


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


@njit
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


@njit
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
                at_x, at_y, z = x + tip[k, 0], y + tip[k, 1], np.float64(tip[k, 2])
                spots, _ = leaf_spots(scene, at_x, at_y, z, buds * area)
                i0 = min(i0, spots[0])
                i1 = max(i1, spots[1])
                j0 = min(j0, spots[2])
                j1 = max(j1, spots[3])
        bounds[hand, 0] = i0
        bounds[hand, 1] = i1
        bounds[hand, 2] = j0
        bounds[hand, 3] = j1


@inline
def _tiles_along(low: Any, high: Any, n: Any, periodic: Any) -> Any:
    """Find the first tile along an axis that some pixels touch, and how many."""
    tiles = (n + TILE - 1) // TILE
    if high < low:
        return np.int64(0), np.int64(0)
    if not periodic:
        low = max(low, 0)
        high = min(high, n - 1)
        return low // TILE, max(high // TILE - low // TILE + 1, 0) if high >= low else np.int64(0)
    if high - low >= n - 1:
        return np.int64(0), tiles
    begin = low % n
    end = high % n
    count = end // TILE - begin // TILE + 1
    if end < begin:
        count += tiles
    return begin // TILE, min(count, tiles)


@inline
def _enter(
    spots: Any, scene: Any, cursor: Any, hand: Any, owner: Any, item: Any, tree: Any, name: Any
) -> None:
    """Name a shape for every tile that it touches; only count them while there is no room."""
    i, across = _tiles_along(spots[0], spots[1], scene.wide, scene.periodic)
    j, down = _tiles_along(spots[2], spots[3], scene.deep, scene.periodic)
    tiles_x = (scene.wide + TILE - 1) // TILE
    tiles_y = (scene.deep + TILE - 1) // TILE
    for b in range(j, j + down):
        row = b - tiles_y if b >= tiles_y else b
        for a in range(i, i + across):
            tile = row * tiles_x + (a - tiles_x if a >= tiles_x else a)
            at = cursor[hand, tile]
            if len(owner) > 0:
                owner[at] = tree
                item[at] = name
            cursor[hand, tile] = at + 1


@njit
def _enter_block(metamers, trees, walk, block, looks, scene, radius, entries, hand):  # type: ignore[no-untyped-def]
    """Name the leaves and internodes of a block."""
    # Arrays are taken out of their tuples before the loop: each access would count references.
    state = metamers.state
    tip = metamers.tip
    parents = metamers.parent
    cursor, owner, item = entries.cursor, entries.tree, entries.item
    tree = walk.tree[block]
    start = trees.start[tree]
    area = looks.leaf_area_m2[trees.species[tree]]
    x, y = trees.x[tree], trees.y[tree]
    for k in range(walk.first[block], walk.last[block]):
        buds = count_buds(state[k])
        if buds > 0:
            at_x, at_y, z = x + tip[k, 0], y + tip[k, 1], np.float64(tip[k, 2])
            spots, _ = leaf_spots(scene, at_x, at_y, z, buds * area)
            _enter(spots, scene, cursor, hand, owner, item, tree, k - start)
        parent = np.int64(parents[k])
        if parent >= 0:
            parent += start
        ends = limb_ends(scene, x, y, tip, parent, k)
        spots = limb_spots(scene, ends, np.float64(radius[k]))
        _enter(spots, scene, cursor, hand, owner, item, tree, -1 - (k - start))


@njit
def enter(first, step, metamers, trees, walk, looks, scene, radius, columns, entries):  # type: ignore[no-untyped-def]
    """Name all shapes for the tiles that they touch; only count them while there is no room."""
    for hand in range(first, HANDS + 1, step):
        if hand < HANDS:
            for block in range(walk.cut[hand], walk.cut[hand + 1]):
                _enter_block(metamers, trees, walk, block, looks, scene, radius, entries, hand)
            continue
        for c in range(len(columns.x)):
            _enter(
                column_spots(scene, columns, c),
                scene,
                entries.cursor,
                hand,
                entries.tree,
                entries.item,
                np.int64(-1),
                np.int64(c),
            )


@inline
def _shifts(low: Any, high: Any, begin: Any, end: Any, n: Any, periodic: Any) -> Any:
    """Find how many turns of a torus bring pixels low..high into begin..end - 1."""
    if not periodic or (low >= 0 and high < n):
        return np.int64(0), np.int64(0)
    return -((end - 1 - low) // n), (high - begin) // n


@njit
def _draw_entry(  # type: ignore[no-untyped-def]
    depth, who, tile, name, spots, scene, kind, ends, radius, columns, column
):
    """Draw one shape into a tile; a leaf stands at the height ends[5]."""
    i0, i1, j0, j1 = spots
    x0, x1, y0, y1 = tile
    low_i, high_i = _shifts(i0, i1, x0, x1, scene.wide, scene.periodic)
    low_j, high_j = _shifts(j0, j1, y0, y1, scene.deep, scene.periodic)
    for turn_j in range(low_j, high_j + 1):
        for turn_i in range(low_i, high_i + 1):
            over_i = turn_i * scene.wide
            over_j = turn_j * scene.deep
            part = (
                max(i0, x0 + over_i),
                min(i1, x1 - 1 + over_i),
                max(j0, y0 + over_j),
                min(j1, y1 - 1 + over_j),
            )
            corner = x0 + over_i, y0 + over_j
            if kind == LEAF:
                paint_leaf(depth, who, name, part, corner, ends[5])
            elif kind == LIMB:
                paint_limb(depth, who, name, part, corner, scene, ends, radius)
            else:
                paint_column(depth, who, name, part, corner, scene, columns, column)


@inline
def _leaf(metamers: Any, trees: Any, looks: Any, scene: Any, tree: Any, k: Any) -> Any:
    """Find a leaf's spots, how many pixels it covers, and its height."""
    area = count_buds(metamers.state[k]) * looks.leaf_area_m2[trees.species[tree]]
    at_x = trees.x[tree] + metamers.tip[k, 0]
    at_y = trees.y[tree] + metamers.tip[k, 1]
    z = np.float64(metamers.tip[k, 2])
    spots, covers = leaf_spots(scene, at_x, at_y, z, area)
    return spots, covers, z


@njit
def _draw_shapes(depth, who, tile, span, metamers, trees, looks, scene, radius, columns, entries):  # type: ignore[no-untyped-def]
    """Draw the shapes of one tile's entries; a name is the entry's place among them."""
    nowhere = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for e in range(span[0], span[1]):
        tree = np.int64(entries.tree[e])
        item = np.int64(entries.item[e])
        name = np.int32(e - span[0])
        if tree < 0:
            spots = column_spots(scene, columns, item)
            _draw_entry(depth, who, tile, name, spots, scene, COLUMN, nowhere, 0.0, columns, item)
        elif item >= 0:
            k = trees.start[tree] + item
            spots, covers, z = _leaf(metamers, trees, looks, scene, tree, k)
            if covers > 0:
                ends = (0.0, 0.0, z, 0.0, 0.0, z)
                _draw_entry(depth, who, tile, name, spots, scene, LEAF, ends, 0.0, columns, item)
        else:
            k = trees.start[tree] - 1 - item
            parent = np.int64(metamers.parent[k])
            if parent >= 0:
                parent += trees.start[tree]
            ends = limb_ends(scene, trees.x[tree], trees.y[tree], metamers.tip, parent, k)
            thick = np.float64(radius[k])
            spots = limb_spots(scene, ends, thick)
            _draw_entry(depth, who, tile, name, spots, scene, LIMB, ends, thick, columns, item)


@njit
def _count_seen(depth, who, tile, span, metamers, trees, looks, scene, entries):  # type: ignore[no-untyped-def]
    """Count the pixels of each entry; a leaf between all centres sees what its pixel holds."""
    seen = entries.seen
    for e in range(span[0], span[1]):
        seen[e] = 0
    for j in range(tile[3] - tile[2]):
        for i in range(tile[1] - tile[0]):
            if who[j, i] >= 0:
                seen[span[0] + who[j, i]] += 1
    for e in range(span[0], span[1]):
        tree = np.int64(entries.tree[e])
        item = np.int64(entries.item[e])
        if tree < 0 or item < 0:
            continue
        k = trees.start[tree] + item
        spots, covers, z = _leaf(metamers, trees, looks, scene, tree, k)
        if covers == 0:
            i, j = spots[0], spots[2]
            if scene.periodic:
                i %= scene.wide
                j %= scene.deep
            seen[e] = 1 if depth[j - tile[2], i - tile[0]] <= np.float32(z) else 0


@njit
def draw(first, step, metamers, trees, looks, scene, radius, columns, entries):  # type: ignore[no-untyped-def]
    """Draw every tile and count the pixels of every entry."""
    depth = np.empty((TILE, TILE), np.float32)
    who = np.empty((TILE, TILE), np.int32)
    tiles_x = (scene.wide + TILE - 1) // TILE
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
        _count_seen(depth, who, place, span, metamers, trees, looks, scene, entries)


@inline
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


@njit
def gather(  # type: ignore[no-untyped-def]
    first, step, metamers, trees, walk, looks, scene, entries, count, clearing, share
):
    """Add `share` times the part of each leaf that is seen to the node's light."""
    light = metamers.light
    tiles = entries.cursor.shape[1]
    for hand in range(first, HANDS, step):
        for tile in range(tiles):
            at = tile * (HANDS + 1) + hand
            for e in range(entries.begin[at], entries.begin[at + 1]):
                if entries.item[e] >= 0:
                    k = trees.start[entries.tree[e]] + entries.item[e]
                    count[k] += entries.seen[e]
        for block in range(walk.cut[hand], walk.cut[hand + 1]):
            tree = walk.tree[block]
            x, y = trees.x[tree], trees.y[tree]
            for k in range(walk.first[block], walk.last[block]):
                if count[k] == 0:
                    continue
                _, covers, z = _leaf(metamers, trees, looks, scene, tree, k)
                if _is_open(scene, clearing, x + metamers.tip[k, 0], y + metamers.tip[k, 1], z):
                    seen = np.float64(count[k]) / np.float64(max(covers, 1))
                    light[k] = np.float32(np.float64(light[k]) + share * seen)
                count[k] = 0


@njit
def respond(first, step, metamers, walk, full_light, saturation):  # type: ignore[no-untyped-def]
    """Let light at and above the share `saturation` count as full light."""
    light = metamers.light
    for hand in range(first, HANDS, step):
        for block in range(walk.cut[hand], walk.cut[hand + 1]):
            for k in range(walk.first[block], walk.last[block]):
                part = np.float64(light[k]) / (saturation * full_light)
                light[k] = np.float32(full_light * min(part, 1.0))
