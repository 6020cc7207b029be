"""Where a branch's bark meets its parent's: a collar in which one gives way to the other.

The two were torn and dressed apart. At the foot of the branch its map is therefore the parent's,
carried on over the crease: a point s m out on the branch shows the parent's bark s m inside the
foot, as if the parent's bark had been folded up. Over about one radius of the branch its own bark
comes in, in height and colour; normals and occlusion follow from the height.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from forest.errors import InputError
from forest.surface.bark.axes import AxisPath
from forest.surface.bark.dressing import Dress
from forest.surface.bark.light import normals, occlusion
from forest.surface.bark.maps import BarkMaps, bark_maps, quantised
from forest.surface.bark.tree_bark import TreeBark

_Floats = NDArray[np.float64]

_FOLDED = 0.8  # how far in the parent's bark is folded up over a collar, radii of the branch
_LONGEST = 4.0  # radii along the branch; a steep one runs long beside its parent
_MARGIN = 8  # strips of the parent beyond what is looked up
_LEAST_PIXELS = 16


class Collar(NamedTuple):
    """How much of the parent's bark is seen at some places of a branch, and which.

    Attributes
    ----------
    share : float64 (...)
        1 at the crease, 0 beyond the collar.
    v, turn : float64 (...)
        Where on the parent, m along it and turns from its seam.
    """

    share: _Floats
    v: _Floats
    turn: _Floats


def foot_of(path: AxisPath, parent: AxisPath, v: _Floats, columns: int) -> tuple[Collar, _Floats]:
    """Give the collar of a round branch on a round parent.

    Parameters
    ----------
    path, parent : AxisPath
        The branch, and what bears it.
    v : float64 (rows,)
        Rings along the branch, m.
    columns : int
        Points around each.

    Returns
    -------
    (Collar, float64 (rows, columns))
        Its arrays are (rows, columns). Beside it, how deep in the parent each point is, m.
    """
    turn = (np.arange(columns) + 0.5) / columns
    rings = np.repeat(v, columns)
    radius = path.radius_at(rings)
    turns = np.tile(turn, len(v))
    along, _, away = parent.locate(path.points(rings, turns, radius))
    beyond = away - parent.radius_at(along)  # m out of the parent's surface
    foot = float(path.radius_at(np.array([path.low]))[0])
    way = np.maximum(beyond / foot, (rings - path.low) / (_LONGEST * foot) - 0.5)
    found = _folded(path, parent, rings, turns, radius, np.clip(way, 0.0, 1.0))
    shape = len(v), columns
    collar = Collar(*(column.reshape(shape) for column in found))
    return collar, np.maximum(-beyond, 0.0).reshape(shape)


def seam_of(
    path: AxisPath,
    parent: AxisPath,
    points: _Floats,
    seam: NDArray[np.bool_],
    shape: tuple[int, int],
    low: float,
    high: float,
) -> Collar | None:
    """Give the collar of a branch's part of one surface, pixel by pixel of its map.

    Parameters
    ----------
    path, parent : AxisPath
    points : float64 (n, 3)
        Points of the branch's part.
    seam : bool (n,)
        Those that the parent's part has as well.
    shape : (rows, columns)
        Of the map.
    low, high : float
        What of the axis it shows, m.

    Returns
    -------
    Collar or None
        None where the two do not touch.
    """
    if seam.sum() < 3:
        return None
    foot = float(path.radius_at(np.array([path.low]))[0])
    way, _ = cKDTree(points[seam]).query(points)
    way = way / foot
    near = way < 1.5
    v, turn, _ = path.locate(points[near])
    where = np.column_stack((turn, v / (2.0 * np.pi * foot)))
    place, *_ = path.frame(v)
    inward = 1.0 - _FOLDED * np.clip(way[near], 0.0, 1.0)
    along, around, _ = parent.locate(place + (points[near] - place) * inward[:, None])
    centre = parent.locate(path.frame(np.array([path.low]))[0])[1][0]
    values = np.column_stack((way[near], along, (around - centre + 0.5) % 1.0 - 0.5))
    where = np.vstack([where + np.array((shift, 0.0)) for shift in (-1.0, 0.0, 1.0)])
    values = np.tile(values, (3, 1))
    rows, columns = shape
    rings = low + (rows - np.arange(rows) - 0.5) * ((high - low) / rows)
    rows_in = rings <= v.max()
    asked = np.stack(
        np.meshgrid(
            (np.arange(columns) + 0.5) / columns, rings[rows_in] / (2.0 * np.pi * foot)
        ), axis=-1,
    )  # fmt: skip
    found = LinearNDInterpolator(where, values)(asked)
    outside = np.isnan(found[..., 0])
    found[outside] = NearestNDInterpolator(where, values)(asked[outside])
    share = np.zeros(shape)
    share[rows_in] = _share(found[..., 0])
    along, around = np.zeros(shape), np.zeros(shape)
    along[rows_in], around[rows_in] = found[..., 1], (found[..., 2] + centre) % 1.0
    return Collar(share, along, around)


def blended_maps(
    bark: TreeBark, maps: BarkMaps, path: AxisPath, collar: Collar, dress: Dress
) -> BarkMaps:
    """Let a branch's maps begin with its parent's bark.

    Where the parent has no bark there, the maps stay as they are.
    """
    used = collar.share > 0.0
    if not used.any():
        return maps
    parent = bark.tree.path(path.parent)
    pixel = maps.length_m / len(maps.height), maps.width_m / maps.height.shape[1]
    patch = _patch(bark, parent, collar.v[used], pixel, dress)
    if patch is None:
        return maps
    seen, low = patch
    rows, columns = seen.height.shape
    row = rows - (collar.v[used] - low) / seen.length_m * rows - 0.5
    column = collar.turn[used] * columns - 0.5
    share = collar.share[used]

    def mixed(own: NDArray[np.generic], other: NDArray[np.generic]) -> NDArray[np.float64]:
        padded = np.concatenate((other[:, -1:], other, other[:, :1]), axis=1).astype(np.float64)
        shown = map_coordinates(padded, (row, column + 1.0), order=1, mode="nearest")
        out = own.astype(np.float64)
        out[used] += share * (shown - out[used])
        return out

    def byte(own: NDArray[np.uint8], other: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return np.asarray(np.rint(mixed(own, other)), np.uint8)

    height = mixed(maps.height_m, seen.height_m).astype(np.float32)
    colour = [byte(maps.colour[..., k], seen.colour[..., k]) for k in range(3)]
    across = np.full(len(height), pixel[1])
    lowest, highest, raised = quantised(height)
    return replace(
        maps,
        colour=np.stack(colour, axis=-1),
        normal=normals(height, across, pixel[0], wraps_along=False),
        height=raised,
        roughness=byte(maps.roughness, seen.roughness),
        occlusion=occlusion(height, across, pixel[0], wraps_along=False),
        lowest_m=lowest,
        highest_m=highest,
    )


def _folded(
    path: AxisPath, parent: AxisPath, v: _Floats, turn: _Floats, radius: _Floats, way: _Floats
) -> Collar:
    """Look up the parent's bark below points of the branch, drawn in towards its axis."""
    along, around, _ = parent.locate(path.points(v, turn, radius * (1.0 - _FOLDED * way)))
    return Collar(_share(way), along, around)


def _share(way: _Floats) -> _Floats:
    """Fade from 1 to 0 over a collar."""
    way = np.clip(way, 0.0, 1.0)
    return np.asarray(1.0 - way * way * (3.0 - 2.0 * way), np.float64)


def _patch(
    bark: TreeBark, parent: AxisPath, v: _Floats, pixel: tuple[float, float], dress: Dress
) -> tuple[BarkMaps, float] | None:
    """Paint the parent's bark around a joint, in pixels of the branch's size."""
    strips = bark.tree.strips_of(parent.axis)
    margin = _MARGIN * float(bark.tree.geometry.width[strips[0]])
    try:
        piece = bark.piece(parent.axis, float(v.min()) - margin, float(v.max()) + margin)
    except InputError:  # it bears no bark there, or not yet
        return None
    low = float(piece.strips.along[0] - 0.5 * piece.strips.width[0])
    high = float(piece.strips.along[-1] + 0.5 * piece.strips.width[-1])
    size = round(float(piece.strips.girth.mean()) / pixel[1]), round((high - low) / pixel[0])
    columns, rows = (max(pixels, _LEAST_PIXELS) for pixels in size)
    folds = bark.folds(parent.axis)
    return bark_maps(
        piece, dress, (columns, rows), axis=parent.axis, folds=folds, seed=bark.seed
    ), low
