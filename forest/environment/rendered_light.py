"""Light as in a picture of the stand, taken from the sun or the sky (Hart & Baker 2003, 4.1).

Leaves are drawn as horizontal squares, internodes and obstacles as opaque background, in an index
buffer seen along one stochastic direction per picture. A leaf's light is the part of it that is
seen. A limb's photosynthesis p_i, its lit projected leaf area, is the sum of light times leaf area
over its own metamers, times the common cosine of incidence; its share of the picture's pixels
(the paper's p_i, for a single tree) is the same sum over that of all limbs and the background.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._threads import in_threads
from forest.environment.obstacles import Solid, solid_voxels
from forest.environment.rendered_kernels import (
    HANDS,
    TILE,
    Entries,
    Looks,
    Walk,
    bound_leaves,
    draw,
    enter,
    gather,
    prepare,
    respond,
)
from forest.environment.rendered_shapes import Columns, Scene
from forest.environment.sun import LightPath
from forest.environment.voxels import deal_blocks
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

#: Share of full sun above which photosynthesis does not rise (Horn 1971, Fig. 5.1).
_SATURATION = 0.2


class IndexPicture(NamedTuple):
    """What the light sees from one place: the index buffer that it is counted from.

    Attributes
    ----------
    tree : int32 (deep, wide)
        Row of the tree that is seen in each pixel, -1 where none is. Lines go along y, pixels of a
        line along x.
    item : int32 (deep, wide)
        Its leaf, by its metamer's number in the tree, or -1 - metamer of an internode.
    obstacle : bool (deep, wide)
        Where an obstacle is seen.
    toward : float64 (3,)
        Unit vector towards the light.
    share : float32 (arena,)
        Part of each node's leaf that is seen, 0 to 1 and, by the pixels' places, at times above.
    """

    tree: NDArray[np.int32]
    item: NDArray[np.int32]
    obstacle: NDArray[np.bool_]
    toward: NDArray[np.float64]
    share: NDArray[np.float32]


@dataclass(frozen=True)
class RenderedSpec:
    """Parameters of rendered light, named as in a scenario's `[environment.rendered]`."""

    pixel_m: float = 0.05
    directions: int = 1
    sun_share: float = 0.8
    lowest_deg: float = 10.0
    response: Literal["linear", "flat_above_20"] = "linear"
    clearing_radius_m: float | None = None
    clearing_height_m: float | None = None


class RenderedLight:
    """Light as in pictures of the stand.

    Parameters
    ----------
    spec : RenderedSpec
    size_m : (float, float)
        Plot, m; its corner stands at (0, 0).
    periodic : bool
        Whether the plot is a torus; pixels are then fitted to it.
    latitude_deg : float
        Latitude for the sun's places, degrees.
    seed : int
        Seed of the scenario.
    looks : Looks
        Leaf area and pipe exponent of each species.
    solid, voxel_m : Solid, float
        Voxels that obstacles fill, and their edge, m.
    full_light : float
        Light of a leaf that is seen whole.

    Notes
    -----
    Memory, kept from year to year: 8 bytes per metamer, and 12 per shape and tile that it touches
    (0.9 to 1.4 of them per metamer). Pixels take 8 bytes each, but only those of one tile of
    `TILE` x `TILE` pixels per thread are held at a time.
    """

    def __init__(
        self,
        spec: RenderedSpec,
        *,
        size_m: tuple[float, float],
        periodic: bool,
        latitude_deg: float,
        seed: int,
        looks: Looks,
        solid: Solid,
        voxel_m: float,
        full_light: float = 1.0,
    ) -> None:
        self._spec = spec
        self._seed = seed
        self._looks = looks
        self._full_light = full_light
        self._path = LightPath(latitude_deg, spec.sun_share, spec.lowest_deg)
        self._columns = solid_columns(solid, voxel_m)
        self._periodic = periodic
        across, down = (max(round(edge / spec.pixel_m), 1) for edge in size_m)
        self._window = (across, down)
        self._per = (across / size_m[0], down / size_m[1])
        if not periodic:
            self._per = (1.0 / spec.pixel_m, 1.0 / spec.pixel_m)
        radius, height = spec.clearing_radius_m or 0.0, spec.clearing_height_m or 0.0
        self._clearing = (0.5 * size_m[0], 0.5 * size_m[1], float(radius), float(height))
        self._radius = np.empty(0, np.float32)
        self._count = np.zeros(0, np.int32)
        self._names = np.empty((3, 0), np.int32)

    def expose(self, metamers: Metamers, trees: Trees, step: int) -> None:
        """Take the year's pictures and set `metamers.light` of every node; 0 without a bud."""
        walk = _walk(trees)
        self._prepare(metamers, trees, walk)
        for picture in range(self._spec.directions):
            toward, shift_x, shift_y = self._path.draw(self._seed, step, picture)
            self.add_picture(metamers, trees, walk, toward, (shift_x, shift_y))
        if self._spec.response == "flat_above_20":
            in_threads(respond, metamers, walk, self._full_light, _SATURATION)

    def picture(self, metamers: Metamers, trees: Trees, step: int, number: int = 0) -> IndexPicture:
        """Take one of a year's pictures and give what it shows; the stand stays as it is."""
        walk = _walk(trees)
        share = np.zeros_like(metamers.light)
        lit = metamers._replace(light=share)
        self._prepare(lit, trees, walk)
        toward, *shift = self._path.draw(self._seed, step, number)
        scene = self._scene(lit, trees, walk, toward, (shift[0], shift[1]))
        seen = np.full((max(scene.deep, 0), max(scene.wide, 0)), -1, np.int32)
        if not seen.size:
            return IndexPicture(seen, seen, seen >= 0, toward, share)
        entries = self._draw(lit, trees, walk, scene, seen)
        self._gather(lit, trees, walk, scene, entries, 1.0)
        here = seen >= 0
        tree, item = np.full_like(seen, -1), np.full_like(seen, -1)
        tree[here], item[here] = entries.tree[seen[here]], entries.item[seen[here]]
        return IndexPicture(tree, item, here & (tree < 0), toward, share)

    def _prepare(self, metamers: Metamers, trees: Trees, walk: Walk) -> None:
        if len(self._radius) < len(metamers.parent):
            self._radius = np.empty(len(metamers.parent), np.float32)
            self._count = np.zeros(len(metamers.parent), np.int32)
        in_threads(prepare, metamers, trees, walk, self._looks, self._radius)

    def add_picture(
        self,
        metamers: Metamers,
        trees: Trees,
        walk: Walk,
        toward: NDArray[np.float64],
        shift: tuple[float, float],
    ) -> None:
        """Add what one picture shows of each leaf, as a share of the year's light."""
        scene = self._scene(metamers, trees, walk, toward, shift)
        if scene.wide <= 0:
            return
        entries = self._draw(metamers, trees, walk, scene, np.empty((0, 0), np.int32))
        share = self._full_light / self._spec.directions
        self._gather(metamers, trees, walk, scene, entries, share)

    def _draw(
        self,
        metamers: Metamers,
        trees: Trees,
        walk: Walk,
        scene: Scene,
        names: NDArray[np.int32],
    ) -> Entries:
        entries = self._enter(metamers, trees, walk, scene)
        looks, columns = self._looks, self._columns
        in_threads(draw, metamers, trees, looks, scene, self._radius, columns, entries, names)
        return entries

    def _gather(
        self,
        metamers: Metamers,
        trees: Trees,
        walk: Walk,
        scene: Scene,
        entries: Entries,
        share: float,
    ) -> None:
        common = (self._looks, scene, entries, self._count, self._clearing, share)
        in_threads(gather, metamers, trees, walk, *common)

    def _scene(
        self,
        metamers: Metamers,
        trees: Trees,
        walk: Walk,
        toward: NDArray[np.float64],
        shift: tuple[float, float],
    ) -> Scene:
        """Lay the picture: over the torus, or around all leaves of an open plot."""
        dx, dy, dz = (float(part) for part in toward)
        scene = Scene(
            dx / dz,
            dy / dz,
            dx,
            dy,
            float(np.hypot(1.0, dx / dz)),
            float(np.hypot(1.0, dy / dz)),
            *self._per,
            *shift,
            *self._window,
            int(self._periodic),
        )
        if self._periodic:
            return scene
        bounds = np.empty((HANDS, 4), np.int64)
        in_threads(bound_leaves, metamers, trees, walk, self._looks, scene, bounds)
        i0, j0 = (int(bounds[:, axis].min()) for axis in (0, 2))
        i1, j1 = (int(bounds[:, axis].max()) for axis in (1, 3))
        return scene._replace(
            shift_x=shift[0] + i0, shift_y=shift[1] + j0, wide=i1 - i0 + 1, deep=j1 - j0 + 1
        )

    def _enter(self, metamers: Metamers, trees: Trees, walk: Walk, scene: Scene) -> Entries:
        """Count the shapes of each tile, then name them in their order."""
        tiles = -(-scene.wide // TILE) * -(-scene.deep // TILE)
        cursor = np.zeros((HANDS + 1, tiles), np.int64)
        nothing = np.empty(0, np.int32)
        entries = Entries(nothing, nothing, nothing, np.empty(0, np.int64), cursor)
        shapes = (metamers, trees, walk, self._looks, scene, self._radius, self._columns)
        in_threads(enter, *shapes, entries)
        begin = np.zeros(cursor.size + 1, np.int64)
        np.cumsum(cursor.T.ravel(), out=begin[1:])
        cursor[:] = begin[:-1].reshape(tiles, HANDS + 1).T
        if self._names.shape[1] < begin[-1]:
            self._names = np.empty((3, int(begin[-1]) * 5 // 4 + 64), np.int32)
        tree, item, seen = self._names
        entries = Entries(tree, item, seen, begin, cursor)
        in_threads(enter, *shapes, entries)
        return entries


def _walk(trees: Trees) -> Walk:
    """Deal the trees' blocks to the hands in their order, about as many metamers to each."""
    tree, first, last = deal_blocks(trees)
    running = np.concatenate(([0], np.cumsum(last - first)))
    cut = np.searchsorted(running, running[-1] * np.arange(HANDS + 1) / HANDS).astype(np.int64)
    cut[-1] = len(tree)
    return Walk(tree, first, last, cut)


def solid_columns(solid: Solid, voxel_m: float) -> Columns:
    """Join the solid voxels that light can reach to upright columns."""
    none = np.empty(0)
    voxels = solid_voxels(solid)
    if len(voxels) == 0:
        return Columns(none, none, none, none, float(voxel_m))
    around = np.pad(solid.mask > 0, 1)
    if solid.periodic:
        around[1:-1] = np.pad(solid.mask > 0, ((0, 0), (1, 1), (1, 1)), mode="wrap")
    buried = around[2:, 1:-1, 1:-1] & around[1:-1, 2:, 1:-1] & around[1:-1, :-2, 1:-1]
    buried &= around[1:-1, 1:-1, 2:] & around[1:-1, 1:-1, :-2]
    open_to_light = (solid.mask > 0) & ~buried
    # Sorted by x, y, z, a run ends where the next voxel is not the one above.
    x, y, z = np.argwhere(open_to_light.T).T + solid.origin[:, None].astype(np.int64)
    ends = np.ones(len(x) + 1, bool)
    ends[1:-1] = (np.diff(x) != 0) | (np.diff(y) != 0) | (np.diff(z) != 1)
    foot, top = np.flatnonzero(ends[:-1]), np.flatnonzero(ends[1:])
    return Columns(
        x[foot] * voxel_m,
        y[foot] * voxel_m,
        z[foot] * voxel_m,
        (z[top] + 1) * voxel_m,
        float(voxel_m),
    )
