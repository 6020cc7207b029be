"""What tools draw into the view: lines, points, boxes, the brush."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.view.scene import import_pyvista
from forest.viewer.stage import Stage

Points = NDArray[np.float64]

_RING_M = 0.07  # least width of a ring

_PLAIN: dict[str, Any] = {
    "lighting": False,
    "reset_camera": False,
    "render": False,
    "show_scalar_bar": False,
}


def draw_segments(
    stage: Stage, name: str, start: Points, end: Points, colour: str, width: float
) -> None:
    """Draw straight lines between points (n, 3), m."""
    if not len(start):
        stage.put(name, None)
        return
    ends = np.stack((start, end), axis=1).reshape(-1, 3).astype(np.float32)
    mesh = import_pyvista().line_segments_from_points(ends)
    stage.put(
        name, lambda plotter: plotter.add_mesh(mesh, color=colour, line_width=width, **_PLAIN)
    )


def draw_points(stage: Stage, name: str, points: Points, colour: str, size: float) -> None:
    """Draw points (n, 3), m."""
    if not len(points):
        stage.put(name, None)
        return
    places = points.astype(np.float32)
    plain = {key: value for key, value in _PLAIN.items() if key != "show_scalar_bar"}
    stage.put(
        name, lambda plotter: plotter.add_points(places, color=colour, point_size=size, **plain)
    )


def draw_brush(stage: Stage, name: str, path: Points, radius: Points, colour: str) -> None:
    """Draw the path (n, 3) of a brush, m, as the spheres of its radius (n,) along it."""
    pv = import_pyvista()
    cloud = pv.PolyData(path.astype(np.float32))
    cloud["size"] = radius
    ball = pv.Sphere(radius=1.0, theta_resolution=14, phi_resolution=10)
    balls = cloud.glyph(orient=False, scale="size", factor=1.0, geom=ball)

    def add(plotter: Any) -> None:
        plotter.add_mesh(balls, color=colour, opacity=0.25, **_PLAIN)
        if len(path) > 1:
            line = pv.MultipleLines(path.astype(np.float32))
            plotter.add_mesh(line, color=colour, line_width=3, **_PLAIN)

    stage.put(name, add)


def draw_surfaces(stage: Stage, name: str, surfaces: list[Any], colour: str) -> None:
    """Draw pyvista meshes, half transparent, with their sharp edges."""

    def add(plotter: Any) -> None:
        for surface in surfaces:
            plotter.add_mesh(surface, color=colour, opacity=0.55, **_PLAIN)
            edges = surface.extract_feature_edges(30.0)
            if edges.n_points:
                plotter.add_mesh(edges, color=colour, line_width=2, **_PLAIN)

    stage.put(name, add if surfaces else None)


def draw_rings(stage: Stage, name: str, rings: list[tuple[float, float, float, str]]) -> None:
    """Draw rings on the ground: x, y, outer radius (0.1 or more), m, and the colour of each."""
    pv = import_pyvista()

    def add(plotter: Any) -> None:
        for colour in sorted({ring[3] for ring in rings}):
            parts = [
                pv.Disc(
                    center=(x, y, 0.03),
                    inner=size - max(_RING_M, 0.06 * size),
                    outer=size,
                    c_res=32,
                )
                for x, y, size, own in rings
                if own == colour
            ]
            plotter.add_mesh(pv.merge(parts), color=colour, **_PLAIN)

    stage.put(name, add if rings else None)
