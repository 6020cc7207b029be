"""Pictures of a stand as stem cones and crown shapes, one after another from one stage."""

from __future__ import annotations

from collections.abc import Collection
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.view.looks import look_of
from forest.view.scene import import_pyvista, look_at, open_plotter, shoot
from forest.view.shading import SUN
from forest.view.tree_bodies import Bodies, tree_bodies
from forest.view.tree_colours import TreeColours

if TYPE_CHECKING:
    import pandas as pd

#: From where a stand is seen; `turning` goes around it once.
VIEWS = ("side", "above", "turning")

#: Colour around the plot.
AROUND = (0.93, 0.94, 0.91)
_PLOT, _SHADE = (0.83, 0.81, 0.71), (0.66, 0.65, 0.57)
_BEARING_DEG, _ABOVE_DEG = -58.0, 20.0
_LEAST_HEIGHT_M = 2.0  # of the space that is in view
_MARGIN = 1.12
_SUN, _SKY, _FLOOR = 0.62, 0.30, 0.24  # what of its colour a surface shows by each light
_WITHIN = 0.7  # brightness low in a crown, of that at its top

# Corners of stems, of crowns, rings of crowns: for so many trees at most.
_DETAIL = ((1200, (8, 12, 5)), (10**9, (3, 9, 4)))
_SHADOW_DETAIL = (3, 7, 2)


class Stage:
    """A plot on which trees are put and seen; one plotter for all pictures of it.

    Parameters
    ----------
    size_m : (float, float)
        Sides of the plot, m.
    height_m : float
        Height of what must be in view, m.
    window : (int, int)
        Width and height of the pictures, pixels.
    view : str
        One of `VIEWS`.
    conifers : collection of str
        Species that are conifers.

    Raises
    ------
    InputError
        If there is no such view.
    """

    def __init__(
        self,
        size_m: tuple[float, float],
        height_m: float,
        *,
        window: tuple[int, int] = (960, 600),
        view: str = "side",
        conifers: Collection[str] = (),
    ) -> None:
        if view not in VIEWS:
            raise InputError(f"no view '{view}', {nearest(view, VIEWS)}")
        self.size_m, self.window, self.view, self.conifers = size_m, window, view, conifers
        self.height_m = max(height_m, _LEAST_HEIGHT_M)
        self._shown = False
        self._plotter = open_plotter(window)
        self._plotter.render_window.SetMultiSamples(0)  # its pixels are averaged as it is
        self._plotter.set_background(AROUND)
        self._add_ground()

    def picture(
        self, trees: pd.DataFrame, colours: TreeColours, turn: float = 0.0
    ) -> NDArray[np.uint8]:
        """Show trees, those of the last picture no more.

        Parameters
        ----------
        trees : DataFrame
            Rows of `forest.view.stand_years.StandYears`.
        colours : TreeColours
            Of the crowns; stems have their bark's.
        turn : float
            Share of the way around the stand, 0 to 1, if the view is turning.

        Returns
        -------
        uint8 (height, width, 3)
        """
        detail = next(sides for most, sides in _DETAIL if len(trees) <= most)
        self._add_bodies(self._bodies(trees, detail), trees, colours)
        if self.view != "above":
            self._add_shadows(self._bodies(trees, _SHADOW_DETAIL))
        self._look(turn)
        shown, self._shown = self._shown, True
        return shoot(self._plotter, again=shown)

    def close(self) -> None:
        """Give back what the plotter holds."""
        self._plotter.close()

    def __enter__(self) -> Self:
        """Give the stage."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close it."""
        self.close()

    def _add_ground(self) -> None:
        pv = import_pyvista()
        width, depth = self.size_m
        plane = pv.Plane(center=(0.5 * width, 0.5 * depth, -0.02), i_size=width, j_size=depth)
        self._plotter.add_mesh(plane, color=_PLOT, lighting=False)
        corners = np.array([(0, 0), (width, 0), (width, depth), (0, depth), (0, 0)], float)
        outline = pv.lines_from_points(np.column_stack((corners, np.full(5, 0.03))))
        self._plotter.add_mesh(outline, color=(0.25, 0.22, 0.18), line_width=2, lighting=False)

    def _bodies(self, trees: pd.DataFrame, detail: tuple[int, int, int]) -> Bodies:
        stem, crown, rings = detail
        return tree_bodies(
            trees,
            stem_sides=stem,
            crown_sides=crown,
            crown_rings=rings,
            conifers=self.conifers,
        )

    def _add_bodies(self, bodies: Bodies, trees: pd.DataFrame, colours: TreeColours) -> None:
        self._plotter.remove_actor("bodies", render=False)
        if not len(bodies.points):
            return
        crown_rgb = colours.of(trees)
        bark = np.array([look_of(str(name)).bark for name in trees["species"]]).reshape(-1, 3)
        if "fate" in trees:
            gone = (trees["fate"] != "").to_numpy()
            bark[gone] = crown_rgb[gone]
        rgb = np.where(bodies.crown[:, None], crown_rgb[bodies.tree], 0.8 * bark[bodies.tree])
        top = np.fmax(trees["height_m"].to_numpy(np.float64), 1e-3)[bodies.tree]
        up = np.clip(bodies.points[:, 2] / top, 0.0, 1.0)
        rgb = rgb * np.where(bodies.crown, _WITHIN + (1.0 - _WITHIN) * up, 1.0)[:, None]
        mesh = import_pyvista().PolyData.from_regular_faces(bodies.points, bodies.triangles)
        mesh = mesh.compute_normals(
            cell_normals=False, split_vertices=False, consistent_normals=False
        )
        lit = _lit(np.asarray(mesh.point_data["Normals"], np.float64))
        mesh.point_data["rgb"] = np.asarray(255.0 * np.clip(rgb * lit[:, None], 0.0, 1.0), np.uint8)
        self._put("bodies", mesh, scalars="rgb", rgb=True)

    def _add_shadows(self, bodies: Bodies) -> None:
        """Lay every body flat on the ground, away from the sun."""
        self._plotter.remove_actor("shadows", render=False)
        if not len(bodies.points):
            return
        flat = bodies.points - bodies.points[:, 2:] * (SUN / SUN[2]).astype(np.float32)
        mesh = import_pyvista().PolyData.from_regular_faces(flat, bodies.triangles)
        self._put("shadows", mesh, color=_SHADE)

    def _put(self, name: str, mesh: Any, **look: Any) -> None:
        """Add closed bodies in colours that are lit already: one pass, and only front sides."""
        self._plotter.add_mesh(
            mesh,
            name=name,
            lighting=False,
            culling="back",
            reset_camera=False,
            render=False,
            **look,
        )

    def _look(self, turn: float) -> None:
        width, depth = self.size_m
        aspect = self.window[0] / self.window[1]
        if self.view == "above":
            camera = self._plotter.camera
            camera.position = (0.5 * width, 0.5 * depth, self.height_m + 2.0 * max(self.size_m))
            camera.focal_point = (0.5 * width, 0.5 * depth, 0.0)
            camera.up = (0.0, 1.0, 0.0)
            camera.parallel_projection = True
            camera.parallel_scale = 0.5 * _MARGIN * max(depth, width / aspect)
            self._plotter.renderer.ResetCameraClippingRange()
            return
        angle = 2.0 * np.pi * np.arange(48) / 48
        if self.view == "turning":  # the same distance all the way round
            reach = 0.5 * float(np.hypot(width, depth))
            rim = np.column_stack((np.cos(angle), np.sin(angle))) * reach
            rim += (0.5 * width, 0.5 * depth)
        else:
            rim = np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)])
        space = [np.column_stack((rim, np.full(len(rim), z))) for z in (0.0, self.height_m)]
        look_at(
            self._plotter,
            np.concatenate(space),
            bearing_deg=_BEARING_DEG + 360.0 * turn * (self.view == "turning"),
            above_deg=_ABOVE_DEG,
            aspect=aspect,
        )


def _lit(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light of sun and sky on surfaces of these normals (n, 3)."""
    sun = np.maximum(normals @ (SUN / np.linalg.norm(SUN)), 0.0)
    sky = 0.5 + 0.5 * normals[:, 2]
    return np.asarray(_SUN * sun + _SKY * sky + _FLOOR)
