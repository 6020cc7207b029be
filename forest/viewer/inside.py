"""What buds know of their stand: its light, its markers, and what the light itself sees."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from forest.environment.marker_places import free_markers
from forest.errors import InputError
from forest.stand import Stand
from forest.trees.metamers import LATERAL, TERMINAL
from forest.view.looks import look_of

_Number = TypeVar("_Number", bound=np.generic)

_MOST_MARKERS = 60_000
_AROUND_M = 3.0  # markers are shown so far around a tree
_MOST_PIXELS = 900
_FEWEST_PIXELS = 500
_WOOD = np.array([74, 58, 44], np.uint8)
_STONE = np.array([120, 122, 128], np.uint8)
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
    """The stand as the light sees it: lines from north to south, as a map has them.

    Attributes
    ----------
    image : uint8 (ny, nx, 3)
    tree_id : int32 (ny, nx)
        The tree that is seen in each pixel, 0 where none is.
    toward : float64 (3,)
        Direction of the light, a unit vector.
    lit : dict of int to int
        Pixels in which each tree's leaves are seen, of the picture that light is counted from;
        `image` may have fewer or more.
    share : float
        Share of the leaf area that is seen: mean light of the leaves in this picture.
    """

    image: NDArray[np.uint8]
    tree_id: NDArray[np.int32]
    toward: NDArray[np.float64]
    lit: dict[int, int]
    share: float


#: What leaves can be coloured by as the light sees them: name, label.
LIGHT_COLOURS = {"leaf": "Leaf", "tree": "Tree", "species": "Species", "light": "Light it got"}


def view_from_light(stand: Stand, number: int = 0, by: str = "leaf") -> LightView:
    """Show one of the year's pictures that rendered light is counted from.

    It is the index buffer of Hart & Baker (2003, section 4.1), drawn by
    `forest.environment.rendered_light`: each leaf a horizontal square in a colour of its own,
    internodes and obstacles opaque background. Without rendered light in the scenario, it is the
    picture that its defaults give.

    Parameters
    ----------
    stand : Stand
        An exposed one.
    number : int
        Which of the year's places of sun and sky.
    by : str
        One of `LIGHT_COLOURS`.

    Raises
    ------
    InputError
        If there is no leaf.
    """
    metamers, trees = stand.arena.metamers, stand.rows
    seen = stand.surroundings.picture(metamers, trees, stand.steps, number)
    area = np.array([kind.leaves.area_m2 for kind in stand.species])
    nodes = [np.arange(a, a + n) for a, n in zip(trees.start, trees.size, strict=True)]
    sites = [_sites(metamers.state[k]) * area[s] for k, s in zip(nodes, trees.species, strict=True)]
    whole = sum(float(site.sum()) for site in sites)
    if not seen.tree.size or whole == 0.0:
        raise InputError("no leaf is there that the light could see")
    lit = sum(float(site @ seen.share[k]) for site, k in zip(sites, nodes, strict=True))
    is_leaf = (seen.tree >= 0) & (seen.item >= 0)
    count = np.bincount(seen.tree[is_leaf], minlength=len(trees.tree_id))
    step = max(1, -(-max(seen.tree.shape) // _MOST_PIXELS))
    every = np.s_[::step, ::step]
    tree, item, obstacle = seen.tree[every], seen.item[every], seen.obstacle[every]
    tree_id = np.where(tree >= 0, trees.tree_id[tree], 0).astype(np.int32)
    times = max(1, _FEWEST_PIXELS // max(tree.shape))
    image = _enlarged(_coloured(stand, tree, item, obstacle, by), times)
    tree_id = _enlarged(tree_id, times)
    known = dict(zip(trees.tree_id.tolist(), count.tolist(), strict=True))
    return LightView(image, tree_id, seen.toward, known, lit / whole)


def _enlarged(part: NDArray[_Number], times: int) -> NDArray[_Number]:
    """Let each pixel be a square of so many along its edge, and the last line come first."""
    return part[::-1].repeat(times, axis=0).repeat(times, axis=1)


def _sites(state: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Count the leaf-bearing sites of each node."""
    return ((state & TERMINAL) > 0).astype(np.int64) + ((state & LATERAL) > 0)


def _coloured(
    stand: Stand,
    tree: NDArray[np.int32],
    item: NDArray[np.int32],
    obstacle: NDArray[np.bool_],
    by: str,
) -> NDArray[np.uint8]:
    """Colour what is seen in each pixel."""
    from matplotlib import colormaps
    from matplotlib.colors import hsv_to_rgb

    rows = stand.rows
    image = np.empty((*tree.shape, 3), np.uint8)
    image[:] = _FLOOR
    image[obstacle] = _STONE
    image[(tree >= 0) & (item < 0)] = _WOOD
    leaf = (tree >= 0) & (item >= 0)
    row = tree[leaf]
    node = rows.start[row] + item[leaf]
    grain = np.modf((item[leaf] + 1) * _GOLDEN)[0]
    if by == "light":
        light = stand.arena.metamers.light
        top = max(float(stand.surroundings.full_light), 1e-9)
        colour = colormaps["inferno"](0.05 + 0.95 * np.clip(light[node] / top, 0.0, 1.0))[:, :3]
    elif by == "species":
        looks = np.array([look_of(kind.name).line for kind in stand.species])
        colour = looks[rows.species[row]] * (0.75 + 0.35 * grain)[:, None]
    else:
        leaves = grain if by == "leaf" else np.zeros(len(row))
        hue = np.modf(rows.tree_id[row] * _GOLDEN + leaves)[0]
        value = 0.9 - 0.35 * np.modf(7.0 * leaves)[0]
        colour = hsv_to_rgb(np.column_stack((hue, np.full(len(hue), 0.6), value)).reshape(-1, 3))
    image[leaf] = np.asarray(255.0 * np.clip(colour, 0.0, 1.0), np.uint8)
    return image
