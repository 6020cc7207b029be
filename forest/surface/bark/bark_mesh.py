"""Barked trees as meshes: maps on the surface of the wood, or bark as geometry."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.bark.axes import AxisPath
from forest.surface.bark.collar import Collar, blended_maps, foot_of, seam_of
from forest.surface.bark.dressing import Dress, grow_preset
from forest.surface.bark.maps import BarkMaps, bark_maps
from forest.surface.bark.tree_bark import TreeBark
from forest.surface.export import Material, Part
from forest.surface.mesh import POINT_DATA, Mesh
from forest.surface.tubes import tubes
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]

_TILE_PIXELS = 512
_MOST_PIXELS = 16384
_LEAST_PIXELS = 16
_SUNK = 0.6  # radii by which a branch reaches into its parent below its bark
_ON_AXIS = 0.01  # radii: nearer to the axis a point has no side


def material_of(maps: BarkMaps, name: str, *, bumpy: bool = True) -> Material:
    """Make a material of maps, for uv that are shares of them; `bumpy` with their normals."""
    tile = (maps.width_m, maps.length_m) if maps.tileable else (1.0, 1.0)
    return Material(
        name,
        roughness=1.0,
        colour_image=maps.colour,
        normal_image=maps.normal if bumpy else None,
        rough_image=maps.occlusion_roughness_metal,
        tile_m=tile,
    )


def dressed_parts(bark: TreeBark, wood: Mesh, size: int = 1024) -> list[Part]:
    """Put bark's maps on a surface of the wood: tubes or the blended one.

    Parameters
    ----------
    bark : TreeBark
    wood : Mesh
        The same tree's surface.
    size : int
        Pixels of the trunk's map around; see `TreeBark.maps`.

    Returns
    -------
    list of Part
        A part for each barked axis, whose uv are shares of its map (around from the seam, and
        along), and one for all thinner wood with a tile of young bark. Together they have all
        triangles of `wood`, in another order.
    """
    dress = Dress.of(bark.preset, seed=bark.seed)
    axis = np.median(wood.data["axis"][wood.triangles].astype(np.int64), axis=1)
    middle = wood.points[wood.triangles].mean(axis=1)
    taken = np.zeros(len(axis), np.bool_)
    parts = []
    axis = _borne(bark, axis, middle)
    for number, maps in bark.maps(size, dress=dress).items():
        path = bark.tree.path(number)
        low, high = _covered(bark, number)
        of = np.flatnonzero(axis == number)
        along, _, _ = path.locate(middle[of])
        of = of[(along >= low) & (along <= high)]
        taken[of] = True
        corners = wood.triangles[of]
        used, place = np.unique(corners, return_inverse=True)
        v, turn, away = path.locate(wood.points[used])
        turn[away < _ON_AXIS * path.radius_at(v)] = np.nan
        place = place.reshape(-1, 3)
        uv = _corners(turn[place], (v[place] - low) / (high - low))
        name = f"bark_{number}"
        if path.parent >= 0:
            seam = np.isin(used, wood.triangles[axis == path.parent])
            parent, shape = bark.tree.path(path.parent), maps.height.shape
            collar = seam_of(path, parent, wood.points[used], seam, shape, low, high)
            maps = maps if collar is None else blended_maps(bark, maps, path, collar, dress)
        mesh = Mesh(
            wood.points[used],
            place.astype(np.int32),
            uv,
            {key: column[used] for key, column in wood.data.items()},
        )
        parts.append(Part(mesh, material_of(maps, name), name))
    if not taken.all():
        parts.append(_young(bark, _kept(wood, ~taken), dress))
    return parts


def _borne(bark: TreeBark, axis: NDArray[np.int64], middle: _Floats) -> NDArray[np.int64]:
    """Give triangles at a branch's foot, before its strips begin, to what bears it."""
    axis = axis.copy()
    for path in reversed(bark.tree.paths):
        if path.parent >= 0:
            of = np.flatnonzero(axis == path.axis)
            of = of[path.locate(middle[of])[0] < _covered(bark, path.axis)[0]]
            parent = bark.tree.path(path.parent)
            along, _, away = parent.locate(middle[of])
            # What lies deep in it, the foot of a tube, has no place on its surface.
            axis[of[away > 0.8 * parent.radius_at(along)]] = path.parent
    return axis


def displaced_parts(
    bark: TreeBark,
    cell_m: float = 0.005,
    *,
    axes: tuple[int, ...] | None = None,
    low_m: float | None = None,
    high_m: float | None = None,
    whole: bool = True,
) -> list[Part]:
    """Make bark as geometry: the barked axes as tubes with all their relief.

    Parameters
    ----------
    bark : TreeBark
    cell_m : float
        Distance of points around and along, m, at the thick end.
    axes, low_m, high_m
        As for `TreeBark.maps`.
    whole : bool
        Add all thinner wood as plain tubes, where no axes or heights are chosen.

    Returns
    -------
    list of Part
        Closed meshes, one for each axis, with colours of the same cells; uv are shares of them.

    Raises
    ------
    InputError
        A cell of no size, or more of them around an axis or along it than maps may have.
    """
    if not cell_m > 0.0:
        raise InputError(f"cells of {cell_m:g} m", where="bark", expected="metres, above 0")
    dress = Dress.of(bark.preset, seed=bark.seed)
    parts = []
    for number in bark.axes if axes is None else axes:
        piece = bark.piece(number, low_m, high_m)
        low = float(piece.strips.along[0] - 0.5 * piece.strips.width[0])
        high = float(piece.strips.along[-1] + 0.5 * piece.strips.width[-1])
        columns = round(float(piece.strips.girth.max()) / cell_m)
        rows = round((high - low) / cell_m)
        if max(columns, rows) > _MOST_PIXELS:
            least = max(float(piece.strips.girth.max()), high - low) / _MOST_PIXELS
            raise InputError(
                f"{columns:,} x {rows:,} cells on axis {number}",
                where="bark",
                expected=f"cells of {least:.3g} m or more",
            )
        maps = bark_maps(
            piece, dress, (max(columns, _LEAST_PIXELS), max(rows, _LEAST_PIXELS)),
            axis=number, folds=bark.folds(number), seed=bark.seed,
        )  # fmt: skip
        path = bark.tree.path(number)
        v = _rows(maps, low)
        deep = np.zeros((len(v), maps.height.shape[1]))
        if path.parent >= 0 and low - path.low < float(piece.strips.width[0]):
            v = np.concatenate((_sunk(path, low, cell_m), v))
            collar, deep = foot_of(path, bark.tree.path(path.parent), v, deep.shape[1])
            shown = slice(-2, -2 - len(maps.height), -1)  # rows of the map, from the top
            collar = Collar(*(column[shown] for column in collar))
            maps = blended_maps(bark, maps, path, collar, dress)
        radius = np.interp(v, piece.strips.along, piece.strips.girth)[:, None] / (2.0 * np.pi)
        # It shrinks from its parent's surface inward, so that it does not show in cracks.
        radius = np.maximum(radius - deep, 0.3 * radius)
        mesh = _tube(path, v, radius, maps, bark.tree.skeleton)
        name = f"bark_{number}"
        parts.append(Part(mesh, material_of(maps, name, bumpy=False), name))
    if whole and axes is None and low_m is None and high_m is None:
        rest = _thinner(bark)
        if len(rest):
            parts.append(_young(bark, tubes(rest), dress))
    return parts


def _covered(bark: TreeBark, axis: int) -> tuple[float, float]:
    """Give what of an axis its map shows, m along it."""
    strips = bark.tree.strips_of(axis)
    strips = strips[~np.isnan(bark.history.girth[-1, strips])]
    along, width = bark.tree.geometry.along[strips], bark.tree.geometry.width[strips]
    return float(along[0] - 0.5 * width[0]), float(along[-1] + 0.5 * width[-1])


def _corners(turn: _Floats, share: _Floats) -> _Floats:
    """Give the uv of triangles: turns of a triangle go the short way around.

    A corner on the axis itself (NaN), the middle of a cap, lies between the other two.
    """
    known = np.argmax(~np.isnan(turn), axis=1)
    turn = turn - np.round(turn - turn[np.arange(len(turn)), known][:, None])
    none = np.isnan(turn)
    between = np.where(none, 0.0, turn).sum(axis=1) / np.maximum((~none).sum(axis=1), 1)
    turn = np.where(none, between[:, None], turn)
    return np.stack((turn, share), axis=-1)


def _kept(mesh: Mesh, chosen: NDArray[np.bool_]) -> Mesh:
    """Give some triangles of a mesh, with their points alone."""
    used, place = np.unique(mesh.triangles[chosen], return_inverse=True)
    return Mesh(
        mesh.points[used],
        place.reshape(-1, 3).astype(np.int32),
        mesh.uv[chosen],
        {key: column[used] for key, column in mesh.data.items()},
    )


def _young(bark: TreeBark, mesh: Mesh, dress: Dress) -> Part:
    """Put a tile of young bark on wood that is too thin for strips."""
    girth = 2.0 * np.pi * float(np.max(mesh.data["radius_m"]))
    tile = grow_preset(bark.preset, girth, seed=bark.seed)
    maps = bark_maps(tile, dress, _TILE_PIXELS, girth_m=girth, seed=bark.seed)
    return Part(mesh, material_of(maps, "bark_young"), "bark_young")


def _thinner(bark: TreeBark) -> Skeleton:
    """Give what has no strips as a skeleton of its own; its pieces start where strips end."""
    skeleton = bark.tree.skeleton
    keep = np.ones(len(skeleton), np.bool_)
    for path in bark.tree.paths:
        _, high = _covered(bark, path.axis)
        keep[path.rows[path.v[1:] <= high + 1e-9]] = False
    number = np.cumsum(keep) - 1
    parent = skeleton.parent[keep]
    parent = np.where((parent >= 0) & keep[parent], number[parent], -1)
    columns: dict[str, Any] = {
        name: getattr(skeleton, name)[keep]
        for name in ("start", "end", "radius", "order", "birth_year", "leafy", "serial", "axis")
    }
    return replace(skeleton, parent=parent.astype(np.int32), **columns)


def _rows(maps: BarkMaps, low: float) -> _Floats:
    """Where a map's rows lie along the axis, m, from the base: their middles and both ends."""
    rows = len(maps.height)
    middles = (np.arange(rows) + 0.5) / rows
    return low + maps.length_m * np.concatenate(([0.0], middles, [1.0]))


def _sunk(path: AxisPath, low: float, cell_m: float) -> _Floats:
    """Where a branch has rings below its map, so that it stands in its parent's cracks, m."""
    deepest = max(low - _SUNK * float(path.radius_at(np.array([low]))[0]), 0.0)
    return np.linspace(deepest, low, int(np.ceil((low - deepest) / cell_m)), endpoint=False)


def _tube(path: AxisPath, v: _Floats, radius: _Floats, maps: BarkMaps, skeleton: Skeleton) -> Mesh:
    """Lay a closed tube with a point for each pixel of a map, raised by its height.

    `v` are its rings, m: any below the map, its lower end, the middles of its rows, its upper end.
    """
    height = maps.height_m[::-1]
    below = len(v) - 1 - len(height)
    height = np.vstack((np.repeat(height[:1], below, axis=0), height, height[-1:]))
    rings, columns = height.shape
    low = v[below - 1]
    place, side, across = _smooth(path, v)
    angle = 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
    out = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * across[:, None]
    reach = np.maximum(radius + height, 0.05 * radius)
    ring = (place[:, None] + reach[..., None] * out).reshape(-1, 3)
    points = np.vstack((ring, place[:1], place[-1:]))
    k, j = np.meshgrid(np.arange(rings - 1), np.arange(columns), indexing="ij")
    ahead = (j + 1) % columns
    a, b = k * columns + j, k * columns + ahead
    bands = np.stack(((a, b, b + columns), (a, b + columns, a + columns)), axis=0)
    one = np.arange(columns)
    two = (one + 1) % columns
    foot, head = rings * columns, rings * columns + 1
    top = (rings - 1) * columns
    triangles = np.concatenate(
        (
            bands.transpose(2, 3, 0, 1).reshape(-1, 3),
            np.column_stack((np.full(columns, foot), two, one)),
            np.column_stack((np.full(columns, head), top + one, top + two)),
        )
    )
    turn = np.concatenate((np.tile((one + 0.5) / columns, rings), [np.nan, np.nan]))
    share = np.maximum((v - low) / maps.length_m, 0.0)
    share = np.concatenate((np.repeat(share, columns), [0.0, 1.0]))
    row = path.rows[path.internode(np.concatenate((np.repeat(v, columns), v[[0, -1]])))]
    known: dict[str, Any] = {
        "radius_m": np.concatenate((radius.ravel(), radius[[0, -1], 0])),
        "order": skeleton.order[row],
        "birth_year": skeleton.birth_year[row],
        "tree_id": np.full(len(points), skeleton.tree_id),
        "axis": np.full(len(points), path.axis),
    }
    data = {name: known[name].astype(kind) for name, kind in POINT_DATA.items()}
    return Mesh(
        points, triangles.astype(np.int32), _corners(turn[triangles], share[triangles]), data
    )


def _smooth(path: AxisPath, v: _Floats) -> tuple[_Floats, _Floats, _Floats]:
    """Give places on an axis and two directions across it that turn evenly through its bends."""
    place = np.column_stack([np.interp(v, path.v, path.place[:, k]) for k in range(3)])
    heading = np.column_stack([np.interp(v, path.middle, path.heading[:, k]) for k in range(3)])
    side = np.column_stack([np.interp(v, path.middle, path.side[:, k]) for k in range(3)])
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    side -= np.sum(side * heading, axis=1)[:, None] * heading
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return place, side, np.cross(heading, side)
