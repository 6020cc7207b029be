"""From skeletons to pixels: one pyvista scene, rendered off screen."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.record.export import whole_file
from forest.trees.skeleton import Skeleton
from forest.view.shading import SUN, LightVolume, shade
from forest.view.shapes import gather_leaves, gather_wood, polylines

_MOST_TUBES = 150_000  # internodes drawn as tubes, the thickest first
_MOST_TWIGS = 700_000  # internodes drawn as lines
_MOST_CARDS = 1_200_000
#: Pixels are rendered so many times as fine along each side, and averaged.
OVERSAMPLING = 2
_HALF_VIEW_DEG = 13.0
_MARGIN = 1.06


def import_pyvista() -> Any:
    """Import pyvista so that it renders off screen without a window system."""
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    import pyvista

    return pyvista


def _lambert(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.maximum(normals @ SUN, 0.0), np.float64)


class Scene:
    """Trees with their light, ready to be put into a plotter.

    Parameters
    ----------
    skeletons : sequence of Skeleton
        The trees.
    leaves : bool
        Whether to draw foliage.
    least_radius_m : float
        Thinner wood is drawn with this radius, so that twigs are seen.
    """

    def __init__(
        self, skeletons: Sequence[Skeleton], *, leaves: bool, least_radius_m: float = 0.0
    ) -> None:
        self.least_radius_m = least_radius_m
        self.wood = gather_wood(skeletons)
        self.leaves, self.card_scale = gather_leaves(skeletons if leaves else [], _MOST_CARDS)
        points = np.concatenate((self.wood.start, self.wood.end, np.zeros((1, 3))))
        if len(points) > 1:
            points = points[:-1]
        self.lower, self.upper = points.min(axis=0), points.max(axis=0)
        self.light = LightVolume(
            self.leaves.place, self.leaves.area * self.card_scale**2, (self.lower, self.upper)
        )

    def add_to(self, plotter: Any) -> None:
        """Put wood and leaves into a plotter."""
        radius = self.wood.radius
        thick = np.ones(len(radius), np.bool_)
        if len(radius) > _MOST_TUBES:
            thick = radius >= np.partition(radius, -_MOST_TUBES)[-_MOST_TUBES]
        self._add_tubes(plotter, thick)
        thin = np.flatnonzero(~thick)
        self._add_twigs(plotter, thin[:: max(1, -(-len(thin) // _MOST_TWIGS))])
        if len(self.leaves.place):
            self._add_cards(plotter)

    def _add_tubes(self, plotter: Any, chosen: NDArray[np.bool_]) -> None:
        if not chosen.any():
            return
        pv = import_pyvista()
        lines = polylines(self.wood.part(chosen))
        mesh = pv.PolyData()
        mesh.points = lines.points
        mesh.lines = lines.cells
        mesh["radius"] = np.maximum(lines.radius, self.least_radius_m)
        mesh["bark"] = lines.bark
        mesh.set_active_scalars("radius")
        tubes = mesh.tube(scalars="radius", absolute=True, n_sides=8)
        normals = np.asarray(tubes.point_data["TubeNormals"], np.float64)
        points = np.asarray(tubes.points, np.float64)
        tubes["rgb"] = self.lit_bark(points, normals, np.asarray(tubes["bark"]))
        plotter.add_mesh(tubes, scalars="rgb", rgb=True, lighting=False)

    def lit_bark(
        self, points: NDArray[np.float64], normals: NDArray[np.float64], bark: NDArray[np.float64]
    ) -> NDArray[np.uint8]:
        """Colours of bark at points (n, 3) of these normals, lit by sun and sky."""
        sun, sky = self.light.at(points)
        around = 0.75 + 0.25 * normals[:, 2]
        return shade(bark, sun * _lambert(normals), 1.3 * sky * around)

    def _add_twigs(self, plotter: Any, chosen: NDArray[np.int64]) -> None:
        if not len(chosen):
            return
        pv = import_pyvista()
        n = len(chosen)
        mesh = pv.PolyData()
        mesh.points = np.concatenate((self.wood.start[chosen], self.wood.end[chosen])).astype(
            np.float32
        )
        mesh.lines = np.column_stack((np.full(n, 2), np.arange(n), np.arange(n, 2 * n))).ravel()
        sun, sky = self.light.at(self.wood.end[chosen])
        mesh.cell_data["rgb"] = shade(self.wood.bark[chosen], 0.6 * sun, sky)
        plotter.add_mesh(mesh, scalars="rgb", rgb=True, lighting=False, line_width=1)

    def _add_cards(self, plotter: Any) -> None:
        pv = import_pyvista()
        corners, site = self.leaves.cards(self.card_scale)
        n = len(corners)
        faces = np.column_stack((np.full(n, 4), np.arange(4 * n).reshape(n, 4))).ravel()
        mesh = pv.PolyData(corners.reshape(-1, 3).astype(np.float32), faces)
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        facing = 0.55 + 0.45 * np.abs(normal @ SUN)  # leaves also let light through
        sun, sky = (light[site] for light in self.light.at(self.leaves.place))
        mesh.cell_data["rgb"] = shade(self.leaves.colour[site], sun * facing, sky)
        plotter.add_mesh(mesh, scalars="rgb", rgb=True, lighting=False)


def open_plotter(window: tuple[int, int], shape: tuple[int, int] = (1, 1)) -> Any:
    """Make an off-screen plotter whose pictures come out `window` pixels wide and high."""
    pv = import_pyvista()
    size = [side * OVERSAMPLING for side in window]
    return pv.Plotter(off_screen=True, window_size=size, shape=shape, border=False)


def look_at(
    plotter: Any,
    points: NDArray[np.float64],
    *,
    bearing_deg: float,
    above_deg: float,
    aspect: float,
) -> None:
    """Point the camera so that all points are just in view.

    Parameters
    ----------
    points : float64 (n, 3)
        What must be seen, m.
    bearing_deg : float
        Direction from which it is seen, counted from the x axis.
    above_deg : float
        Height of the camera above the horizon.
    aspect : float
        Width of the view over its height.
    """
    bearing, above = np.radians(bearing_deg), np.radians(above_deg)
    back = np.array(
        [np.cos(bearing) * np.cos(above), np.sin(bearing) * np.cos(above), np.sin(above)]
    )
    right = np.array([-np.sin(bearing), np.cos(bearing), 0.0])
    up = np.cross(back, right)
    tall = np.tan(np.radians(_HALF_VIEW_DEG))
    wide = tall * aspect
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    distance = 1.0
    for _ in range(20):  # centring changes the distance, and the distance the centre
        seen = points - centre
        nearer = seen @ back
        across, along = seen @ right, seen @ up
        distance = float(np.max(nearer + np.maximum(np.abs(across) / wide, np.abs(along) / tall)))
        depth = distance - nearer
        for axis, offset in ((right, across), (up, along)):
            angle = offset / depth
            centre = centre + 0.5 * (angle.max() + angle.min()) * distance * axis
    camera = plotter.camera
    camera.position = tuple(centre + _MARGIN * distance * back)
    camera.focal_point = tuple(centre)
    camera.up = (0.0, 0.0, 1.0)
    camera.view_angle = 2.0 * _HALF_VIEW_DEG
    plotter.renderer.ResetCameraClippingRange()


def save(plotter: Any, to: str | Path) -> None:
    """Render, average the fine pixels and write a PNG."""
    from PIL import Image

    with whole_file(to, overwrite=True) as draft:
        Image.fromarray(pixels(plotter)).save(draft)


def pixels(plotter: Any) -> NDArray[np.uint8]:
    """Render, close the plotter and average the fine pixels; gives (height, width, 3)."""
    picture = shoot(plotter)
    plotter.close()
    return picture


def shoot(plotter: Any, *, again: bool = False) -> NDArray[np.uint8]:
    """Render and average the fine pixels; gives (height, width, 3). The plotter stays open.

    A plotter renders of itself for its first picture; for the others it must be told `again`.
    """
    if again:
        plotter.render()
    fine = np.asarray(plotter.screenshot(return_img=True))
    k = OVERSAMPLING
    height, width = fine.shape[0] // k * k, fine.shape[1] // k * k
    total = np.full((height // k, width // k, 3), k * k // 2, np.uint16)  # so as to round
    for i, j in product(range(k), repeat=2):
        total += fine[i:height:k, j:width:k, :3]
    return np.asarray((total // (k * k)).astype(np.uint8))
