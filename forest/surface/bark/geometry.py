"""Bark as geometry: outlines and lines of equal depth, triangulated and pushed into a surface.

The outlines, and lines inside fractures on which the depth is a set share of its whole, are
constraints of a Delaunay triangulation (Lefebvre and Neyret 3.3, figure 12); VTK makes it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from forest.errors import InputError
from forest.surface.bark.dressing import relief_of
from forest.surface.bark.outlines import Relief, fields_at
from forest.surface.bark.presets import Preset
from forest.surface.bark.silhouettes import Silhouettes, silhouettes
from forest.surface.bark.viewed import BarkView
from forest.surface.mesh import Mesh

_Floats = NDArray[np.float64]
_Edges = NDArray[np.int64]
#: A surface: (turns, heights along the axis in m) -> points and outward normals, (n, 3) each.
Surface = Callable[[_Floats, _Floats], tuple[_Floats, _Floats]]

MATERIALS = ("epidermis", "inside")
_GRAIN = 1e-7  # m: points nearer than that are one
_NARROW = 2e-4  # m: a line with a point nearer to it is left out
_TRIALS = 8  # of a triangulation
_GUARDS = 24
_CLEAR = 1e-3  # m: no line comes nearer to the piece's border


@dataclass(frozen=True)
class BarkGeometry:
    """A piece of bark as triangles.

    Attributes
    ----------
    mesh : Mesh
        Its `uv` are metres around the girth and along the axis.
    material : int8 (triangles)
        Index into `MATERIALS`.
    epidermis_m : float64 (triangles, 3)
        Where each corner lies on the original epidermis, m around from its seam: with v, the
        texture coordinate of the epidermis.
    """

    mesh: Mesh
    material: NDArray[np.int8]
    epidermis_m: _Floats

    def part(self, material: str) -> Mesh:
        """Give the triangles of one material, with all points."""
        chosen = self.material == MATERIALS.index(material)
        mesh = self.mesh
        return Mesh(mesh.points, mesh.triangles[chosen], mesh.uv[chosen], mesh.data)


def cylinder(radius_m: float | Callable[[_Floats], _Floats]) -> Surface:
    """Give an upright stem as a surface: a radius, or a radius at heights."""

    def surface(turn: _Floats, v: _Floats) -> tuple[_Floats, _Floats]:
        radius = radius_m(v) if callable(radius_m) else np.full(len(v), float(radius_m))
        angle = 2.0 * np.pi * turn
        normal = np.column_stack((np.cos(angle), np.sin(angle), np.zeros(len(v))))
        return normal * radius[:, None] + np.column_stack((0.0 * v, 0.0 * v, v)), normal

    return surface


def flat(width_m: float) -> Surface:
    """Give an upright sheet that faces -y, so wide that it is one turn."""

    def surface(turn: _Floats, v: _Floats) -> tuple[_Floats, _Floats]:
        normal = np.tile([0.0, -1.0, 0.0], (len(v), 1))
        return np.column_stack((turn * width_m, np.zeros(len(v)), v)), normal

    return surface


def bark_geometry(
    bark: BarkView,
    preset: Preset,
    surface: Surface,
    *,
    axis: int = 0,
    turns: tuple[float, float] = (0.0, 1.0),
    v_m: tuple[float, float] | None = None,
    spacing_m: float = 0.02,
    samples: int = 2,
    isolines: Sequence[float] = (0.35, 0.7),
    girth_m: float | None = None,
) -> BarkGeometry:
    """Push the bark of a preset into a surface.

    Parameters
    ----------
    bark : BarkView
    preset : Preset
        Its depth profile and shoulders.
    surface : callable
        The uncracked surface (`cylinder`, `flat`, or your own).
    axis : int
        Which axis of the bark.
    turns, v_m : pair of float
        The piece: from where to where around and along. A whole turn is closed at its seam where
        the surface is.
    spacing_m : float
        Largest distance of points on plain epidermis.
    samples : int
        Steps of an outline from strip to strip.
    isolines : sequence of float
        Where between border and middle lines are laid, 0 to 1. The middle always has one.
    girth_m : float, optional
        Girth that sets the bark's age; that of the strips unless given.

    Returns
    -------
    BarkGeometry

    Raises
    ------
    InputError
        An empty piece.
    """
    outlines = silhouettes(bark, axis)
    low, high = v_m or (outlines.low, outlines.low + outlines.length)
    if not (0.0 < turns[1] - turns[0] <= 1.0 and outlines.low <= low < high):
        raise InputError(
            f"a piece of turns {turns} and {low:g} to {high:g} m",
            where="bark geometry",
            expected="at most one turn, and heights that rise",
        )
    girth = float(np.mean(outlines.girth))
    flat_points, edges = _lines(outlines, turns, (low, high), samples, isolines, girth)
    frame = _frame(turns, (low, high), spacing_m, girth)
    points = np.concatenate((frame, flat_points))
    points, edges = _welded(points, edges + len(frame))
    edges = _uncrossed(points, edges)
    corner = np.array([[turns[0] * girth, low], [turns[1] * girth, high]])
    triangles = _sound_triangles(points, edges, corner)
    return _raised(
        bark, preset, surface, outlines, points / [girth, 1.0], triangles, girth_m, turns
    )


def _lines(
    outlines: Silhouettes,
    turns: tuple[float, float],
    span: tuple[float, float],
    samples: int,
    isolines: Sequence[float],
    girth: float,
) -> tuple[_Floats, _Edges]:
    """Borders and isolines of all fractures in a piece: points (m, m) and edges between them."""
    s = np.linspace(0.0, 1.0, samples + 1)
    basis = np.stack(
        (
            1.0 - 3.0 * s**2 + 2.0 * s**3,
            3.0 * s**2 - 2.0 * s**3,
            s - 2.0 * s**2 + s**3,
            s**3 - s**2,
        )
    )
    interval = np.repeat(np.arange(len(outlines.offsets) - 1), np.diff(outlines.offsets))
    centre, half = outlines.centre @ basis, np.maximum(outlines.half @ basis, 0.0)
    knots = outlines.knots
    v = knots[interval, None] + s * (knots[interval + 1] - knots[interval])[:, None]
    across = np.unique([-1.0, 1.0, 0.0, *(1.0 - x for x in isolines), *(x - 1.0 for x in isolines)])
    hidden = _hidden(interval, centre, half)
    kept = []
    for around in (-1.0, 0.0, 1.0):  # pieces over the seam are in it twice
        turn = (centre + around)[:, None, :] + across[None, :, None] * half[:, None, :]
        height = np.broadcast_to(v[:, None, :], turn.shape)
        inside = (turn > turns[0] + _CLEAR / girth) & (turn < turns[1] - _CLEAR / girth)
        inside &= (height > span[0] + _CLEAR) & (height < span[1] - _CLEAR)
        inside &= ~hidden[:, None, :]
        place = np.stack((turn * girth, height), axis=-1)
        pair = inside[..., :-1] & inside[..., 1:]
        kept.append(np.stack((place[..., :-1, :][pair], place[..., 1:, :][pair]), axis=1))
    segments = np.concatenate(kept)
    points = segments.reshape(-1, 2)
    return points, np.arange(len(points)).reshape(-1, 2)


def _hidden(interval: _Edges, centre: _Floats, half: _Floats) -> NDArray[np.bool_]:
    """Which samples of a piece lie in the opening of another, wider one in the same interval."""
    hidden = np.zeros(centre.shape, np.bool_)
    for k in np.unique(interval):
        rows = np.flatnonzero(interval == k)
        apart = centre[rows, None] - centre[None, rows]
        apart = np.abs(apart - np.round(apart))
        wider = (half[None, rows] > half[rows, None]) | (
            (half[None, rows] == half[rows, None])
            & (np.arange(len(rows))[None, :, None] < np.arange(len(rows))[:, None, None])
        )
        over = wider & (apart < half[rows, None] + half[None, rows])
        hidden[rows] = over.any(axis=1)
    return hidden


def _frame(
    turns: tuple[float, float], span: tuple[float, float], spacing: float, girth: float
) -> _Floats:
    """Points on the piece's border and, staggered, over all of it."""
    across = max(2, int(np.ceil((turns[1] - turns[0]) * girth / spacing - 1e-6)))
    along = max(2, int(np.ceil((span[1] - span[0]) / spacing - 1e-6)))
    turn = np.linspace(turns[0], turns[1], across + 1)
    v = np.linspace(span[0], span[1], along + 1)
    inner_t, inner_v = np.meshgrid(turn[1:-1], v[1:-1])
    shift = 0.25 * (turn[1] - turn[0]) * np.where(np.arange(along - 1) % 2, 1.0, -1.0)
    inner = np.column_stack(((inner_t + shift[:, None]).ravel(), inner_v.ravel()))
    # Off their rows: VTK's constraints fail where they run through points in line.
    k = np.arange(len(inner))
    inner[:, 0] += 0.2 * (turn[1] - turn[0]) * ((0.6180339887 * k) % 1.0 - 0.5)
    inner[:, 1] += 0.2 * (v[1] - v[0]) * ((0.7548776662 * k) % 1.0 - 0.5)
    parts = [inner]
    parts += [np.column_stack((turn, np.full(across + 1, end))) for end in span]
    parts += [np.column_stack((np.full(along - 1, end), v[1:-1])) for end in turns]
    return np.concatenate(parts) * [girth, 1.0]


def _welded(points: _Floats, edges: _Edges) -> tuple[_Floats, _Edges]:
    """Make points at one place one point; drop edges that then are none, or double."""
    _, first, to = np.unique(
        np.round(points / _GRAIN).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    edges = np.sort(np.asarray(to).reshape(-1)[edges], axis=1)
    edges = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0)
    return points[first], edges


def _uncrossed(points: _Floats, edges: _Edges) -> _Edges:
    """Drop lines that cross another one or run through a point: with them VTK may never end."""
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    middle, half = 0.5 * (a + b), 0.5 * np.linalg.norm(b - a, axis=1)
    if not len(edges):
        return edges
    one, other = cKDTree(middle).query_pairs(2.0 * half.max(), output_type="ndarray").T
    near = np.linalg.norm(middle[one] - middle[other], axis=1) <= half[one] + half[other]
    one, other = one[near], other[near]
    cross = (_side(a[one], b[one], a[other]) * _side(a[one], b[one], b[other]) < 0.0) & (
        _side(a[other], b[other], a[one]) * _side(a[other], b[other], b[one]) < 0.0
    )
    sound = np.ones(len(edges), np.bool_)
    sound[np.maximum(one, other)[cross]] = False
    close = cKDTree(points).query_ball_point(middle, half)
    edge = np.repeat(np.arange(len(edges)), [len(found) for found in close])
    point = np.concatenate([np.asarray(found, np.int64) for found in close])
    own = (point == edges[edge, 0]) | (point == edges[edge, 1])
    off = np.abs(_side(a[edge], b[edge], points[point])) / (2.0 * half[edge])
    sound[edge[~own & (off < _NARROW)]] = False
    return edges[sound]


def _side(a: _Floats, b: _Floats, p: _Floats) -> _Floats:
    """Give twice the area of triangles, positive where they turn left."""
    ab, ap = b - a, p - a
    area: _Floats = ab[:, 0] * ap[:, 1] - ab[:, 1] * ap[:, 0]
    return area


def _sound_triangles(points: _Floats, edges: _Edges, corner: _Floats) -> NDArray[np.int64]:
    """Triangulate; where lines that cross make triangles overlap, leave these lines out."""
    sides = np.concatenate([np.abs(points - end) < 1e-9 for end in corner], axis=1)
    border = np.concatenate(
        [
            np.column_stack((row[:-1], row[1:]))
            for k in range(4)
            for row in [np.flatnonzero(sides[:, k])[np.argsort(points[sides[:, k], 1 - k % 2])]]
        ]
    )
    # VTK leaves notches between points in line on the hull: points outside keep them off it.
    middle, reach = corner.mean(axis=0), np.ptp(corner, axis=0)
    around = np.linspace(0.0, 2.0 * np.pi, _GUARDS, endpoint=False)
    guards = middle + reach * np.column_stack((np.cos(around), np.sin(around)))
    guarded = np.concatenate((points, guards))
    for trial in range(_TRIALS):
        triangles = _triangulate(guarded, np.concatenate((border, edges)))
        triangles = triangles[(triangles < len(points)).all(axis=1)]
        ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edge, count = np.unique(ends, axis=0, return_counts=True)
        outer = (sides[edge[:, 0]] & sides[edge[:, 1]]).any(axis=1)
        bad = np.zeros(len(points), np.bool_)
        bad[edge[count != np.where(outer, 1, 2)]] = True
        if not bad.any():
            break
        loose = bad[edges].any(axis=1)
        edges = edges[~loose] if loose.any() and trial < _TRIALS - 2 else edges[:0]
    return triangles


def _triangulate(points: _Floats, edges: _Edges) -> NDArray[np.int64]:
    """Constrained Delaunay triangulation by VTK: triangles (m, 3), anticlockwise."""
    from vtkmodules.util.numpy_support import (
        numpy_to_vtk,
        numpy_to_vtkIdTypeArray,
        vtk_to_numpy,
    )
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkFiltersCore import vtkDelaunay2D

    place = vtkPoints()
    place.SetData(numpy_to_vtk(np.column_stack((points, np.zeros(len(points)))), deep=1))
    data = vtkPolyData()
    data.SetPoints(place)
    lines = vtkCellArray()
    starts = 2 * np.arange(len(edges) + 1, dtype=np.int64)
    lines.SetData(
        numpy_to_vtkIdTypeArray(starts, deep=1),
        numpy_to_vtkIdTypeArray(np.ascontiguousarray(edges, np.int64).ravel(), deep=1),
    )
    constraints = vtkPolyData()
    constraints.SetPoints(place)
    constraints.SetLines(lines)
    maker: Any = vtkDelaunay2D()
    maker.SetInputData(data)
    maker.SetSourceData(constraints)
    maker.SetTolerance(0.0)
    maker.Update()
    found = vtk_to_numpy(maker.GetOutput().GetPolys().GetConnectivityArray())
    triangles = np.array(found, np.int64).reshape(-1, 3)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[area < 0.0] = triangles[area < 0.0][:, ::-1]
    return np.asarray(triangles[area != 0.0], np.int64)


def _raised(
    bark: BarkView,
    preset: Preset,
    surface: Surface,
    outlines: Silhouettes,
    place: _Floats,
    triangles: NDArray[np.int64],
    girth_m: float | None,
    turns: tuple[float, float],
) -> BarkGeometry:
    """Sink points by their depth below the surface; tell epidermis from inside."""

    def relief(v: _Floats) -> Relief:
        girth = outlines.at(outlines.girth, v)
        aged = girth if girth_m is None else np.full(len(v), float(girth_m))
        plain = relief_of(preset, aged, generation=bark.generation, seed=0)
        return plain._replace(fray=np.zeros(len(v)))  # borders are the smooth outlines

    turn, v = place.T.copy()
    found = fields_at(outlines, relief(v), turn, v)
    points, normals = surface(turn, v)
    points = points - found.depth.astype(np.float64) * normals
    middle = place[triangles].mean(axis=1)
    seen = fields_at(outlines, relief(middle[:, 1]), *middle.T.copy())
    girth = outlines.at(outlines.girth, v)
    uv = np.column_stack((turn * girth, v))[triangles]
    rest = outlines.at(outlines.rest, v)
    # Whole turns apart is one place: corners follow the middle of their triangle.
    own = found.epidermis[triangles, 0].astype(np.float64)
    own -= np.round(own - seen.epidermis.astype(np.float64))
    epidermis = own * rest[triangles]
    kept = triangles
    if turns[1] - turns[0] == 1.0:
        last = np.flatnonzero(turn == turns[1])
        first = np.flatnonzero(turn == turns[0])
        twin = np.arange(len(turn))
        pair = first[np.argsort(v[first])][np.argsort(np.argsort(v[last]))]
        same = np.linalg.norm(points[pair] - points[last], axis=1) < 1e-6
        twin[last[same]] = pair[same]
        kept = twin[triangles]
    used, kept = np.unique(kept, return_inverse=True)
    return BarkGeometry(
        Mesh(points[used], kept.reshape(-1, 3).astype(np.int32), uv),
        (seen.fracture[:, 0] >= 0).astype(np.int8),
        epidermis,
    )
