"""What buds know of their stand: its light, its markers, and what the light itself sees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.environment.marker_places import free_markers
from forest.environment.sun import LightPath
from forest.errors import InputError
from forest.stand import Stand

_MOST_MARKERS = 60_000
_AROUND_M = 3.0  # markers are shown so far around a tree
_MOST_PIXELS = 900
_FINEST_M = 0.02
_WOOD = np.array([74, 58, 44], np.uint8)
_FLOOR = np.array([236, 232, 220], np.uint8)
_GOLDEN = 0.6180339887498949


class Slice(NamedTuple):
    """Relative light on a level.

    Attributes
    ----------
    light : float32 (ny, nx)
        Mean of sun and sky, 0 to 1, at the middle of each coarse voxel.
    corner_m : (float, float)
        Its corner with the least x and y, m.
    voxel_m, height_m : float
        Edge of a voxel; height of the voxels' middle.
    """

    light: NDArray[np.float32]
    corner_m: tuple[float, float]
    voxel_m: float
    height_m: float


def exposed(stand: Stand) -> Stand:
    """Give a copy of a stand whose buds have seen this year's light; the stand stays as it is."""
    arrays, meta = stand.state()
    copy = Stand.restore(stand.scenario, arrays, meta)
    copy.surroundings.expose(copy.arena.metamers, copy.rows, copy.steps)
    return copy


def light_slice(stand: Stand, height_m: float) -> Slice:
    """Cut the far field of an exposed stand at a height.

    Raises
    ------
    InputError
        If its scenario has no far field.
    """
    canopy = stand.surroundings.canopy
    if canopy is None:
        raise InputError("the scenario has no far field ([environment.canopy]) to slice")
    voxel = canopy.ratio * stand.surroundings.voxel_m
    layer = int(np.floor(height_m / voxel))
    if layer < len(canopy.transmission):
        light = canopy.transmission[max(layer, 0)]
    else:
        light = np.ones_like(canopy.transmission[0])  # above all leaves
    corner = (float(canopy.origin[0]) * voxel, float(canopy.origin[1]) * voxel)
    return Slice(light, corner, voxel, (max(layer, 0) + 0.5) * voxel)


def markers_around(stand: Stand, tree_id: int | None) -> tuple[NDArray[np.float64], int]:
    """List free markers around a tree, or over the plot: points (n, 3), m, and one of how many.

    Raises
    ------
    InputError
        If its scenario has no markers.
    """
    space = stand.surroundings.markers
    if space is None:
        raise InputError("the scenario has no markers ([environment.markers])")
    if tree_id is not None:
        ends = stand.skeleton(tree_id).end
        low, high = ends.min(axis=0) - _AROUND_M, ends.max(axis=0) + _AROUND_M
    else:
        width, depth = stand.scenario.plot.size_m
        top = max((stand.skeleton(int(k)).end[:, 2].max() for k in stand.rows.tree_id), default=1.0)
        low, high = np.zeros(3), np.array((width, depth, top + _AROUND_M))
    return free_markers(space, low, high, _MOST_MARKERS)


class LightView(NamedTuple):
    """The stand as the light sees it.

    Attributes
    ----------
    image : uint8 (ny, nx, 3)
        y upwards in the plot is upwards in the picture.
    toward : float64 (3,)
        Direction of the light, a unit vector.
    seen : float
        Share of the leaf pixels that is seen: mean light of the leaves.
    """

    image: NDArray[np.uint8]
    toward: NDArray[np.float64]
    seen: float


def view_from_light(stand: Stand, picture: int = 0) -> LightView:
    """Draw the stand from one stochastic place of sun or sky, each tree's leaves in one colour.

    Leaves are horizontal squares and the first along the light is seen, as in Hart & Baker (2003,
    section 4.1) and `forest.environment.rendered_light`; pixels are laid on the ground along the
    light. Places are those of the scenario's seed in the stand's year.
    """
    from forest.environment.rendered_light import RenderedSpec

    given = stand.scenario.environment.rendered
    spec = RenderedSpec(**given.model_dump()) if given is not None else RenderedSpec()
    path = LightPath(stand.scenario.site.latitude_deg, spec.sun_share, spec.lowest_deg)
    toward, _, _ = path.draw(stand.scenario.seed, stand.steps, picture)
    slope = toward[:2] / toward[2]
    area = np.array([kind.leaves.area_m2 for kind in stand.species])
    places, heights, colours, edges = [], [], [], []
    for row, tree_id in enumerate(stand.rows.tree_id):
        shape = stand.skeleton(int(tree_id))
        wood = 0.5 * (shape.start + shape.end)
        leaf = shape.end[shape.leafy]
        colour = _leaf_colours(int(tree_id), shape.axis[shape.leafy])
        edge = np.sqrt(area[stand.rows.species[row]])
        for points, tone, size in (
            (wood, np.broadcast_to(_WOOD, wood.shape), np.zeros(len(wood))),
            (leaf, colour, np.full(len(leaf), edge)),
        ):
            places.append(points[:, :2] - points[:, 2:] * slope)
            heights.append(points[:, 2])
            colours.append(tone)
            edges.append(size)
    if not places:
        raise InputError("no tree stands that the light could see")
    where, height = np.concatenate(places), np.concatenate(heights)
    return _painted(where, height, np.concatenate(colours), np.concatenate(edges), toward)


def _leaf_colours(tree_id: int, axis: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Give each limb's leaves a shade of their tree's colour."""
    from matplotlib.colors import hsv_to_rgb

    hue = np.full(len(axis), (tree_id * _GOLDEN) % 1.0)
    value = 0.55 + 0.4 * np.modf(axis * _GOLDEN)[0]
    hsv = np.column_stack((hue, np.full(len(axis), 0.55), value)).reshape(-1, 3)
    return np.asarray(255.0 * hsv_to_rgb(hsv), np.uint8)


def _painted(
    where: NDArray[np.float64],
    height: NDArray[np.float64],
    colour: NDArray[np.uint8],
    edge: NDArray[np.float64],
    toward: NDArray[np.float64],
) -> LightView:
    """Paint squares (their middle, edge in m) from the lowest to the highest."""
    low, high = where.min(axis=0) - 0.5, where.max(axis=0) + 0.5
    pixel = max(float((high - low).max()) / _MOST_PIXELS, _FINEST_M)
    nx, ny = (int(n) for n in np.ceil((high - low) / pixel).astype(int))
    half = np.minimum(np.ceil(0.5 * edge / pixel - 0.5).astype(int), 12)
    item, column, line = [], [], []
    for size in np.unique(half):
        here = np.flatnonzero(half == size)
        at = ((where[here] - low) / pixel).astype(int)
        for dx in range(-size, size + 1):
            for dy in range(-size, size + 1):
                item.append(here)
                column.append(at[:, 0] + dx)
                line.append(at[:, 1] + dy)
    items, x, y = (np.concatenate(part) for part in (item, column, line))
    drawn = (x >= 0) & (x < nx) & (y >= 0) & (y < ny)
    items, flat = items[drawn], y[drawn] * nx + x[drawn]
    order = np.argsort(height[items], kind="stable")
    owner = np.full(nx * ny, -1, np.int64)
    np.maximum.at(owner, flat[order], np.arange(len(order)))
    shown = owner >= 0
    image = np.empty((nx * ny, 3), np.uint8)
    image[:] = _FLOOR
    image[shown] = colour[items[order][owner[shown]]]
    is_leaf = edge[items] > 0.0
    seen = int((edge[items[order][owner[shown]]] > 0.0).sum()) / max(int(is_leaf.sum()), 1)
    return LightView(image.reshape(ny, nx, 3)[::-1], toward, seen)
