"""Pictures of bark on trees: a piece of the trunk by years, or a whole tree."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.record.export import whole_file
from forest.surface.bark.bark_mesh import displaced_parts
from forest.surface.bark.tree_bark import TreeBark
from forest.surface.export import Part
from forest.view.scene import import_pyvista, open_plotter, pixels

_LIGHT = (-0.6, -0.8, 0.45)
_BEARING_DEG = -80.0
_AMBIENT = 0.32
_MARGIN = 1.06
_LEAST_CELL_M = 0.002
_CELLS = 500  # across a piece, where that is coarser


def draw_trunk(
    bark: TreeBark,
    to: str | Path,
    *,
    years: Sequence[float] = (),
    low_m: float = 0.0,
    high_m: float = 2.0,
    window: tuple[int, int] = (500, 1000),
    overwrite: bool = True,
) -> None:
    """Draw a piece of the trunk with its bark as geometry: once, or in some years side by side.

    Parameters
    ----------
    bark : TreeBark
    to : path
        PNG file to write.
    years : sequence of float
        When; the bark's own time if none. All pictures have the same scale and light.
    low_m, high_m : float
        Which piece of the trunk, m along it.
    window : (int, int)
        Pixels of each picture.

    Raises
    ------
    InputError
        There is no bark there in one of the years.
    """
    from PIL import Image

    path = bark.tree.paths[0]
    high_m = min(high_m, path.high)
    if not low_m < high_m:
        raise InputError(
            f"no trunk from {low_m:g} m up", where="bark", expected=f"0 to {path.high:.2f} m"
        )
    centre = path.frame(np.array([0.5 * (low_m + high_m)]))[0][0]
    moments = [bark.at(year) for year in years] or [bark]
    height = (high_m - low_m) * _MARGIN
    wide = 2.0 * float(path.radius_at(np.array([low_m]))[0]) * 1.3
    height = max(height, wide * window[1] / window[0])
    strips = [_view(_parts(one, low_m, high_m), centre, height, window) for one in moments]
    picture = Image.fromarray(np.concatenate(strips, axis=1))
    with whole_file(Path(to), overwrite=overwrite) as draft:
        picture.save(draft)


def _parts(bark: TreeBark, low_m: float, high_m: float) -> list[Part]:
    trunk = bark.tree.paths[0]
    girth = 2.0 * np.pi * float(trunk.radius_at(np.array([low_m]))[0])
    cell = max(_LEAST_CELL_M, girth / _CELLS)
    found = displaced_parts(bark, cell, axes=(trunk.axis,), low_m=low_m, high_m=high_m)
    for path in bark.tree.paths:
        if path.parent == trunk.axis and low_m <= _foot(bark, path.axis) <= high_m:
            reach = path.low + 6.0 * float(path.radius[0])
            try:
                found += displaced_parts(bark, cell, axes=(path.axis,), high_m=reach)
            except InputError:
                continue  # it is not there yet
    return found


def _foot(bark: TreeBark, axis: int) -> float:
    """Where on its parent a branch stands, m."""
    path = bark.tree.path(axis)
    along, _, _ = bark.tree.path(path.parent).locate(path.place[:1])
    return float(along[0])


def _view(
    parts: Sequence[Part], centre: NDArray[np.float64], height: float, window: tuple[int, int]
) -> NDArray[np.uint8]:
    pv = import_pyvista()
    plotter = open_plotter(window)
    plotter.set_background("white")
    plotter.remove_all_lights()
    plotter.add_light(pv.Light(position=_LIGHT, light_type="scene light"))
    for part in parts:
        _add(plotter, part)
    bearing = np.radians(_BEARING_DEG)
    towards = np.array((np.cos(bearing), np.sin(bearing), 0.0))
    plotter.camera_position = [centre + 50.0 * towards, centre, (0.0, 0.0, 1.0)]
    plotter.camera.parallel_projection = True
    plotter.camera.parallel_scale = 0.5 * height
    plotter.renderer.ResetCameraClippingRange()
    return pixels(plotter)


def _add(plotter: Any, part: Part) -> None:
    """Add a mesh coloured point by point, with the shading of its own relief."""
    pv = import_pyvista()
    mesh = part.mesh
    image = np.asarray(part.material.colour_image)
    rough = np.asarray(part.material.rough_image)
    own = np.zeros((len(mesh.points), 2))
    own[mesh.triangles.reshape(-1)] = mesh.uv.reshape(-1, 2)
    rows, columns = image.shape[:2]
    column = np.floor(np.mod(own[:, 0], 1.0) * columns).astype(np.int64) % columns
    row = np.clip(rows - 1 - np.floor(own[:, 1] * rows).astype(np.int64), 0, rows - 1)
    shade = rough[row, column, :1].astype(np.float64) / 255.0
    lit = image[row, column] * (0.45 + 0.8 * shade)
    colour = np.minimum(lit, 255.0).astype(np.uint8)
    n = len(mesh.triangles)
    made = pv.PolyData(mesh.points, np.column_stack((np.full(n, 3), mesh.triangles)).ravel())
    made.point_data["colour"] = colour
    made.point_data["Normals"] = mesh.normals()
    made.GetPointData().SetActiveNormals("Normals")
    plotter.add_mesh(
        made, scalars="colour", rgb=True, smooth_shading=True, ambient=_AMBIENT, diffuse=1.0,
        specular=0.05,
    )  # fmt: skip
