"""A picture of a stand on its plot, seen from slightly above."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from forest.trees.skeleton import Skeleton
from forest.view.scene import Scene, import_pyvista, look_at, open_plotter, save
from forest.view.shading import shade

_LITTER = np.array([0.50, 0.42, 0.30])
_MOSS = np.array([0.45, 0.52, 0.28])
_GROUND_CELL_M = 0.25
_SLAB_M = 0.6


def _add_ground(plotter: Any, scene: Scene, size_m: tuple[float, float]) -> None:
    """Lay the plot as a slab of ground, lit through the crowns, with its outline."""
    pv = import_pyvista()
    width, depth = size_m
    cells = [int(np.clip(side / _GROUND_CELL_M, 20, 400)) for side in size_m]
    ground = pv.Plane(
        center=(width / 2, depth / 2, 0.0),
        i_size=width,
        j_size=depth,
        i_resolution=cells[0],
        j_resolution=cells[1],
    )
    points = np.asarray(ground.points, np.float64)
    sun, sky = scene.light.at(points)
    x, y = points[:, 0], points[:, 1]
    patches = 0.5 + 0.25 * (np.sin(1.3 * x + 2.0 * np.sin(0.4 * y)) + np.sin(1.1 * y + np.sin(x)))
    moss = np.clip(patches * (0.3 + sky), 0.0, 1.0)[:, None]
    ground["rgb"] = shade((1.0 - moss) * _LITTER + moss * _MOSS, 0.75 * sun, sky)
    plotter.add_mesh(ground, scalars="rgb", rgb=True, lighting=False)
    slab = pv.Box((0.0, width, 0.0, depth, -_SLAB_M, -0.01))
    plotter.add_mesh(slab, color=(0.36, 0.28, 0.21), ambient=0.5, diffuse=0.5, specular=0.0)
    corners = np.array([(0, 0), (width, 0), (width, depth), (0, depth), (0, 0)], float)
    outline = pv.lines_from_points(np.column_stack((corners, np.full(5, 0.03))))
    plotter.add_mesh(outline, color=(0.15, 0.12, 0.1), line_width=3, lighting=False)


def draw_stand(
    skeletons: Sequence[Skeleton],
    size_m: tuple[float, float],
    to: str | Path,
    *,
    leaves: bool = True,
    window: tuple[int, int] = (1600, 1000),
) -> None:
    """Draw the trees of a plot and save the picture.

    Parameters
    ----------
    skeletons : sequence of Skeleton
        The trees, in the plot's coordinates. Colours follow their species (`forest.view.looks`).
    size_m : tuple of float
        Size of the plot, m.
    to : path
        PNG file to write.
    leaves : bool
        Whether to draw foliage.
    window : tuple of int
        Width and height of the picture, pixels.
    """
    scene = Scene(skeletons, leaves=leaves)
    plotter = open_plotter(window)
    plotter.set_background((0.93, 0.95, 0.96), top=(0.62, 0.76, 0.90))
    scene.add_to(plotter)
    _add_ground(plotter, scene, size_m)
    corners = [
        (x, y, z) for x in (0.0, size_m[0]) for y in (0.0, size_m[1]) for z in (-_SLAB_M, 0.0)
    ]
    look_at(
        plotter,
        np.concatenate((np.array(corners), scene.wood.end)),
        bearing_deg=-58.0,
        above_deg=17.0,
        aspect=window[0] / window[1],
    )
    save(plotter, to)
