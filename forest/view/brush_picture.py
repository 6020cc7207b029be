"""Pictures of brushed trees: wood, markers as gray spheres, obstacles, and one part in purple."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.trees.skeleton import Skeleton
from forest.view.scene import Scene, import_pyvista, look_at, open_plotter, save

_PURPLE = (0.45, 0.16, 0.55)
_GRAY = (0.62, 0.62, 0.62)
_PLANKS = (0.66, 0.55, 0.42)
_MOST_SPHERES = 20_000
#: Least radius of wood and radius of a marker, as shares of the height of what is seen.
_LEAST_WIDTH = 0.0006
_MARKER_WIDTH = 0.0045
#: Room above what is seen for a title, as a share of its height.
_TITLE = 0.1


class Panel(NamedTuple):
    """One view.

    Attributes
    ----------
    title : str
    trees : sequence of Skeleton
    markers : float64 (n, 3)
        Places of markers, m.
    purple_from : int or None
        Metamers of the first tree from this serial number on are purple.
    boxes : sequence of (lower corner, upper corner)
        Obstacles, m.
    leaves : bool
    """

    title: str
    trees: Sequence[Skeleton]
    markers: NDArray[np.float64] = np.empty((0, 3))
    purple_from: int | None = None
    boxes: Sequence[tuple[Sequence[float], Sequence[float]]] = ()
    leaves: bool = False


def _part(tree: Skeleton, chosen: NDArray[np.bool_]) -> Skeleton:
    """Keep some internodes; those whose parent is left out begin anew."""
    place = np.cumsum(chosen) - 1
    parent = np.where((tree.parent >= 0) & chosen[tree.parent], place[tree.parent], -1)
    columns: dict[str, Any] = {
        name: value[chosen]
        for name, value in vars(tree).items()
        if isinstance(value, np.ndarray) and name != "parent"
    }
    return replace(tree, parent=parent[chosen].astype(np.int32), **columns)


def _wood(panel: Panel, thin: float) -> Scene:
    if panel.purple_from is None:
        return Scene(panel.trees, leaves=panel.leaves, least_radius_m=thin)
    first, *others = panel.trees
    new = first.serial >= panel.purple_from
    trees = [*others, _part(first, ~new), _part(first, new)]
    scene = Scene(trees, leaves=panel.leaves, least_radius_m=thin)
    n = int((trees[-1].length > 1e-6).sum())
    scene.wood.bark[len(scene.wood.bark) - n :] = _PURPLE
    return scene


def _add_markers(plotter: Any, markers: NDArray[np.float64], radius_m: float) -> None:
    if not len(markers):
        return
    pv = import_pyvista()
    shown = markers[:: max(1, -(-len(markers) // _MOST_SPHERES))]
    ball = pv.Sphere(radius=radius_m, theta_resolution=10, phi_resolution=8)
    balls = pv.PolyData(shown).glyph(geom=ball, scale=False, orient=False)
    plotter.add_mesh(balls, color=_GRAY, ambient=0.35, diffuse=0.7, specular=0.0)


def draw_brushed(
    panels: Sequence[Panel],
    to: str | Path,
    *,
    bearing_deg: float = -90.0,
    above_deg: float = 4.0,
    columns: int = 0,
    panel: tuple[int, int] = (360, 460),
    box_m: NDArray[np.float64] | None = None,
) -> None:
    """Draw panels side by side on white, all from one camera, and save the picture.

    Parameters
    ----------
    panels : sequence of Panel
    to : path
        PNG file to write.
    bearing_deg, above_deg : float
        From where they are seen, counted from the x axis, and above the horizon.
    columns : int
        Panels in a row; 0 for all in one row.
    panel : tuple of int
        Width and height of one, pixels.
    box_m : float64 (2, 3), optional
        Lower and upper corner of what must be seen, m; default: all that is drawn.
    """
    if box_m is None:
        seen = [part for one in panels for part in (*(t.end for t in one.trees), one.markers)]
        boxes = [corner for one in panels for box in one.boxes for corner in box]
        whole = np.concatenate((*seen, np.array(boxes, np.float64).reshape(-1, 3)))
        box_m = np.array([whole.min(axis=0), whole.max(axis=0)])
        box_m[0, 2] = min(box_m[0, 2], 0.0)
    (x0, y0, z0), (x1, y1, z1) = box_m
    if any(one.title for one in panels):
        z1 += _TITLE * (z1 - z0)
    corners = np.array([(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (z0, z1)])
    columns = columns or len(panels)
    rows = -(-len(panels) // columns)
    plotter = open_plotter((panel[0] * columns, panel[1] * rows), (rows, columns))
    height = max(z1 - z0, (x1 - x0) * panel[1] / panel[0])
    for i, one in enumerate(panels):
        plotter.subplot(*divmod(i, columns))
        plotter.set_background("white", all_renderers=False)
        _wood(one, _LEAST_WIDTH * height).add_to(plotter)
        _add_markers(plotter, one.markers, _MARKER_WIDTH * height)
        for low, high in one.boxes:
            bounds = [side for pair in zip(low, high, strict=True) for side in pair]
            cube = import_pyvista().Box(bounds)
            plotter.add_mesh(cube, color=_PLANKS, ambient=0.4, diffuse=0.6, specular=0.0)
        if one.title:
            plotter.add_text(one.title, position="upper_edge", font_size=16, color="black")
        look_at(
            plotter,
            corners,
            bearing_deg=bearing_deg,
            above_deg=above_deg,
            aspect=panel[0] / panel[1],
        )
    save(plotter, to)
