"""Shadow maps: which parts of trees, and which ground, the sun does not reach.

Weber and Penn 1995, section 6: "a standard shadow map ... can be used to mark which geometric
components will be shadowed before rendering takes place". A map is a picture of the trees as the
sun sees them, which holds the depth of what is nearest to it. What lies behind is in the shade.

Each model has a fine map of itself, in which its own elements are marked once for all instances.
The map of a scene is made of these, moved and scaled to every instance: a cell takes what the
model's map shows at its middle. So the gaps of a crown let light through in the right share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.errors import InputError, nearest
from forest.surface.description import LEAF_ITEM
from forest.surface.detail import LAST_LEVEL, SEASONS
from forest.surface.directions import unit
from forest.surface.instances import Elements, Instances, Model

_OWN_CELLS = 512  # along the longer side of a model's own map
_OWN_BIAS = 3.0  # cells by which an element must lie behind another
_BANDS = 32  # of rows; fixed, so that nothing depends on the number of threads
_MOST_CELLS = 60_000_000
_SCENE_CELLS = 4_000_000  # of a scene's map whose cell is not given
_LEAST_CELL_M = 0.001
_STEM_REACH_M = 1.0  # marks of stems are averaged so far along them
_LEAST_SINE = 0.1  # of the angle between a stem and the sun
_OTHERS_BIAS = 1.0  # cells by which an element must lie behind another tree


class ShadowMap(NamedTuple):
    """What the sun sees; a plain tuple that kernels read.

    Attributes
    ----------
    axes : float64 (3, 3)
        Unit vectors to the map's right, up the map, and towards the sun.
    corner : float64 (2,)
        Lower left corner of the map along the first two, m.
    cell_m : float
        Size of a cell, m.
    depth : float32 (rows, cols)
        Place along the third of what is nearest to the sun, m; -inf where there is nothing.
    owner : int32 (rows, cols)
        Its instance, -1 for none.
    """

    axes: NDArray[np.float64]
    corner: NDArray[np.float64]
    cell_m: float
    depth: NDArray[np.float32]
    owner: NDArray[np.int32]


#: A map in which nothing stands.
NO_MAP = ShadowMap(
    np.zeros((3, 3)), np.zeros(2), 1.0, np.empty((0, 0), np.float32), np.empty((0, 0), np.int32)
)


class ModelShadow(NamedTuple):
    """A model's shadow on itself.

    Attributes
    ----------
    map : ShadowMap
        What the sun sees of it, from the model's foot.
    shaded : tuple of float32 (e,)
        For each item, what others take of its elements' sun: 0 or 1 of leaves and small branches;
        of trunk and main branches the mean over a metre both ways along them.
    """

    map: ShadowMap
    shaded: tuple[NDArray[np.float32], ...]


@dataclass(frozen=True)
class SceneShadow:
    """The shade of all trees of a scene.

    Attributes
    ----------
    sun : float64 (3,)
        Unit vector towards the sun.
    season : str
        Whose leaves cast it.
    own : tuple of ModelShadow
        Each model's shadow on itself.
    map : ShadowMap
        What the sun sees of all trees.
    """

    sun: NDArray[np.float64]
    season: str
    own: tuple[ModelShadow, ...]
    map: ShadowMap

    def shaded(self, points: ArrayLike) -> NDArray[np.float64]:
        """Give how much of the sun trees take from points of the ground.

        Parameters
        ----------
        points : array_like (n, 3)
            Points on the ground or a little above, m.

        Returns
        -------
        float64 (n,)
            0 in the sun, 1 in the shade; between them at the edges of shadows, over one cell.
        """
        points = np.ascontiguousarray(np.asarray(points, np.float64).reshape(-1, 3))
        found = np.empty(len(points))
        in_threads(_shade_points, self.map, points, found)
        return found


def own_shadows(
    models: Sequence[Model], sun: ArrayLike, *, season: str = "summer"
) -> tuple[ModelShadow, ...]:
    """Work out each model's shadow on itself; it serves as long as sun and season do.

    Raises
    ------
    InputError
        If the sun is not above the horizon or the season unknown.
    """
    axes = _axes(_checked(sun, season))
    found: list[ModelShadow | None] = [None] * len(models)

    def work(first: int, step: int) -> None:
        for k in range(first, len(models), step):
            found[k] = _own_shadow(models[k], axes, leafy=_leafy(models[k], season))

    in_threads(work)
    return tuple(one for one in found if one is not None)


def scene_shadow(
    models: Sequence[Model],
    instances: Instances,
    sun: ArrayLike,
    cell_m: float | None = None,
    *,
    season: str = "summer",
    own: tuple[ModelShadow, ...] | None = None,
    finest_m: float = _LEAST_CELL_M,
) -> SceneShadow:
    """Cast the shade of all trees of a scene.

    Parameters
    ----------
    models, instances
        The trees.
    sun : array_like (3,)
        Direction towards the sun; above the horizon.
    cell_m : float, optional
        Size of a cell of the scene's map, m. Unless given the map has 4 million cells.
    season : str
        One of `forest.surface.detail.SEASONS`; bare trees cast the shade of their branches.
    own : tuple of ModelShadow, optional
        From `own_shadows` for the same models, sun and season; worked out unless given.
    finest_m : float
        Without `cell_m`, no cell is smaller, m.

    Raises
    ------
    InputError
        If the sun is not above the horizon, the season unknown, or the map too large.
    """
    direction = _checked(sun, season)
    axes = _axes(direction)
    if own is None:
        own = own_shadows(models, direction, season=season)
    place = _project(instances.place, axes)
    lower, upper = _bounds(own, instances, place)
    scene = _empty_map(
        axes, lower, upper, _cell_of(upper - lower, finest_m) if cell_m is None else cell_m
    )
    for k, shadow in enumerate(own):
        rows = np.flatnonzero(instances.model == k)
        if len(rows):
            in_threads(_cast, shadow.map, rows, place, instances.scale, scene)
    return SceneShadow(direction, season, own, scene)


def _checked(sun: ArrayLike, season: str) -> NDArray[np.float64]:
    """Give the unit vector towards the sun."""
    if season not in SEASONS:
        raise InputError(f"unknown season {season!r}, {nearest(season, SEASONS)}")
    direction = unit(sun, "sun")
    if direction[2] <= 0.0:
        raise InputError("the sun is not above the horizon", expected="sun[2] above 0")
    return direction


def _leafy(model: Model, season: str) -> bool:
    return model.evergreen or season != "winter"


def _axes(sun: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the map's axes: level, up, and towards the sun."""
    right = np.array([-sun[1], sun[0], 0.0])
    length = np.hypot(sun[0], sun[1])
    right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.stack((right, np.cross(sun, right), sun))


def _project(points: NDArray[Any], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give points (..., 3) along the axes; written out, since BLAS may sum in any order."""
    x, y, z = np.moveaxis(np.asarray(points, np.float64), -1, 0)
    return np.stack([a[0] * x + a[1] * y + a[2] * z for a in axes], axis=-1)


def _own_shadow(model: Model, axes: NDArray[np.float64], *, leafy: bool) -> ModelShadow:
    """Take the sun's picture of a model and mark what lies behind."""
    lists = model.lists
    solid = [part for part in lists if part.corners == 3 and (leafy or part.item != LEAF_ITEM)]
    corners = [_project(part.vertices.reshape(-1, 3, 3), axes) for part in solid]
    flat = np.concatenate(corners).reshape(-1, 3)
    if len(flat):
        lower, upper = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    else:
        lower = upper = np.zeros(2)
    cell = max(float((upper - lower).max()) / _OWN_CELLS, _LEAST_CELL_M)
    picture = _empty_map(axes, lower, upper, cell)
    for triangles in corners:
        _rasterise(triangles, picture.corner, picture.cell_m, picture.depth)
    shaded: list[NDArray[np.float32]] = []
    for part in lists:
        if part.corners < 3:  # lines of the stems, then points of the leaves: one of each element
            middle = _project(part.middle, axes)
            middle[:, 2] += _lift(part, axes[2]) + _OWN_BIAS * cell
            marks = np.zeros(len(middle), np.float32)
            _mark(middle, picture.corner, picture.cell_m, picture.depth, marks)
            shaded.append(_along_stems(marks, part.vertices) if part.item < LAST_LEVEL else marks)
    return ModelShadow(picture, tuple(shaded))


def _along_stems(marks: NDArray[np.float32], lines: NDArray[np.float32]) -> NDArray[np.float32]:
    """Average the marks of internodes, lines (e, 6), over a metre both ways along their axis."""
    if not len(marks):
        return marks
    lower, upper = lines[:, :3].astype(np.float64), lines[:, 3:].astype(np.float64)
    length = np.linalg.norm(upper - lower, axis=1)
    end = np.cumsum(length)
    axis = np.cumsum(np.append(0, np.any(lower[1:] != upper[:-1], axis=1)))
    first = np.flatnonzero(np.diff(axis, prepend=-1))
    begins = (end - length)[first][axis]
    ends = np.append(end[first[1:] - 1], end[-1])[axis]
    middle = end - 0.5 * length
    low, high = np.maximum(middle - _STEM_REACH_M, begins), np.minimum(middle + _STEM_REACH_M, ends)
    ways = np.append(0.0, end)
    dark = np.append(0.0, np.cumsum(marks * length))
    share = np.interp(high, ways, dark) - np.interp(low, ways, dark)
    mean = np.where(high > low, share / np.where(high > low, high - low, 1.0), marks)
    return np.asarray(np.clip(mean, 0.0, 1.0), np.float32)


def _lift(part: Elements, sun: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the way from an element's middle to its own surface, towards the sun, m."""
    if part.item == LEAF_ITEM:
        return np.zeros(len(part.width_m))
    along = _project(part.facing, sun[None])[:, 0]
    across = np.sqrt(np.maximum(1.0 - along**2, _LEAST_SINE**2))
    return np.asarray(0.5 * part.width_m / across, np.float64)


def _bounds(
    own: Sequence[ModelShadow], instances: Instances, place: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the part of the map's plane that the instances' own maps cover."""
    if not len(instances.model):
        return np.zeros(2), np.zeros(2)
    low = np.array([one.map.corner for one in own])
    size = np.array([one.map.depth.shape[::-1] for one in own])
    high = low + np.array([one.map.cell_m for one in own])[:, None] * size
    scale = instances.scale[:, None]
    lower = place[:, :2] + scale * low[instances.model]
    upper = place[:, :2] + scale * high[instances.model]
    return lower.min(axis=0), upper.max(axis=0)


def _cell_of(extent: NDArray[np.float64], finest_m: float) -> float:
    """Give the cell with which a map of this extent, and three cells more, has `_SCENE_CELLS`."""
    width, height = extent.tolist()
    free, half = _SCENE_CELLS - 9.0, 1.5 * (width + height)
    return max(float(half + np.sqrt(half**2 + free * width * height)) / free, finest_m)


def _empty_map(
    axes: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    cell_m: float,
) -> ShadowMap:
    """Make a map in which nothing stands, one cell wider than asked on each side."""
    extent = upper - lower
    if not cell_m > 0.0:
        raise InputError(f"cell_m is {cell_m}", expected="metres above 0")
    cols, rows = np.ceil(extent / cell_m) + 2
    if rows * cols > _MOST_CELLS:
        raise InputError(
            f"a shadow map of {cols:.0f} x {rows:.0f} cells of {cell_m:g} m",
            expected=f"at most {_MOST_CELLS:,} cells: a larger cell_m",
        )
    shape = int(rows), int(cols)
    depth = np.full(shape, -np.inf, np.float32)
    return ShadowMap(axes, lower - cell_m, cell_m, depth, np.full(shape, -1, np.int32))


@njit
def _rasterise(corners: Any, corner: Any, cell: Any, depth: Any) -> None:
    """Draw triangles (t, 3, 3), in the map's axes: a cell shows what its middle meets."""
    rows, cols = depth.shape
    for t in range(len(corners)):
        a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        left = (min(a[0], b[0], c[0]) - corner[0]) / cell - 0.5
        right = (max(a[0], b[0], c[0]) - corner[0]) / cell - 0.5
        low = (min(a[1], b[1], c[1]) - corner[1]) / cell - 0.5
        high = (max(a[1], b[1], c[1]) - corner[1]) / cell - 0.5
        for row in range(max(0, int(np.ceil(low))), min(rows - 1, int(np.floor(high))) + 1):
            y = corner[1] + (row + 0.5) * cell
            for col in range(max(0, int(np.ceil(left))), min(cols - 1, int(np.floor(right))) + 1):
                x = corner[0] + (col + 0.5) * cell
                share_b = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
                share_c = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
                if share_b >= 0.0 and share_c >= 0.0 and share_b + share_c <= 1.0:
                    there = a[2] + share_b * (b[2] - a[2]) + share_c * (c[2] - a[2])
                    if there > depth[row, col]:
                        depth[row, col] = there


@njit
def _mark(points: Any, corner: Any, cell: Any, depth: Any, marks: Any) -> None:
    """Mark points, in the map's axes, that lie behind what the map shows."""
    for i in range(len(points)):
        row = int(np.floor((points[i, 1] - corner[1]) / cell))
        col = int(np.floor((points[i, 0] - corner[0]) / cell))
        if 0 <= row < depth.shape[0] and 0 <= col < depth.shape[1]:
            marks[i] = 1.0 if depth[row, col] > points[i, 2] else 0.0


@driver
def _cast(first: Any, step: Any, own: Any, which: Any, place: Any, scale: Any, scene: Any) -> None:
    """Lay one model's map over the scene's at each of its instances, band by band of rows."""
    rows, cols = scene.depth.shape
    own_rows, own_cols = own.depth.shape
    cell = scene.cell_m
    for band in range(first, _BANDS, step):
        lowest, highest = rows * band // _BANDS, rows * (band + 1) // _BANDS
        for i in which:
            fine = scale[i] * own.cell_m
            left = place[i, 0] + scale[i] * own.corner[0]
            low = place[i, 1] + scale[i] * own.corner[1]
            row_0 = max(lowest, int((low - scene.corner[1]) / cell))
            row_1 = min(highest, int((low + own_rows * fine - scene.corner[1]) / cell) + 1)
            col_0 = max(0, int((left - scene.corner[0]) / cell))
            col_1 = min(cols, int((left + own_cols * fine - scene.corner[0]) / cell) + 1)
            for row in range(row_0, row_1):
                y = int(np.floor((scene.corner[1] + (row + 0.5) * cell - low) / fine))
                if not 0 <= y < own_rows:
                    continue
                for col in range(col_0, col_1):
                    x = int(np.floor((scene.corner[0] + (col + 0.5) * cell - left) / fine))
                    if not 0 <= x < own_cols or own.depth[y, x] == -np.inf:
                        continue
                    there = np.float32(place[i, 2] + scale[i] * own.depth[y, x])
                    other = scene.depth[row, col]
                    if there > other or (there == other and i < scene.owner[row, col]):
                        scene.depth[row, col] = there
                        scene.owner[row, col] = i


@driver
def _shade_points(first: Any, step: Any, scene: Any, points: Any, found: Any) -> None:
    """Weigh the four cells around each point by their nearness."""
    rows, cols = scene.depth.shape
    axes, cell = scene.axes, scene.cell_m
    for band in range(first, _BANDS, step):
        for i in range(len(points) * band // _BANDS, len(points) * (band + 1) // _BANDS):
            p = points[i]
            x = axes[0, 0] * p[0] + axes[0, 1] * p[1] + axes[0, 2] * p[2]
            y = axes[1, 0] * p[0] + axes[1, 1] * p[1] + axes[1, 2] * p[2]
            z = axes[2, 0] * p[0] + axes[2, 1] * p[1] + axes[2, 2] * p[2]
            x = (x - scene.corner[0]) / cell - 0.5
            y = (y - scene.corner[1]) / cell - 0.5
            col, row = int(np.floor(x)), int(np.floor(y))
            shade = 0.0
            for k in range(4):
                c, r = col + k % 2, row + k // 2
                if 0 <= r < rows and 0 <= c < cols and scene.depth[r, c] > z:
                    shade += (1.0 - abs(x - c)) * (1.0 - abs(y - r))
            found[i] = shade


@driver
def shaded_by_others(scene: Any, i: Any, x: Any, y: Any, z: Any) -> Any:
    """Tell whether another tree stands between the sun and a point of instance `i`.

    Where a tree's own crown is what the sun sees, its own marks say what is in the shade.
    """
    axes, cell = scene.axes, scene.cell_m
    u = axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z
    v = axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z
    col = int(np.floor((u - scene.corner[0]) / cell))
    row = int(np.floor((v - scene.corner[1]) / cell))
    if not (0 <= row < scene.depth.shape[0] and 0 <= col < scene.depth.shape[1]):
        return False
    if scene.owner[row, col] == i:
        return False
    w = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    return scene.depth[row, col] > w + _OTHERS_BIAS * cell
