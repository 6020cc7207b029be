"""Pictures of a stand as stem cones and crown shapes, one after another from one stage."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.scenario.model import Obstacle
from forest.view.bodies_scene import BodiesScene, add_lit, add_obstacles, barks, lay_ground
from forest.view.scene import import_pyvista, look_at, open_plotter, shoot
from forest.view.shading import SUN
from forest.view.tree_colours import TreeColours

if TYPE_CHECKING:
    import pandas as pd

#: From where a stand is seen; `turning` goes around it once.
VIEWS = ("side", "above", "turning")

#: Colour around the plot.
AROUND = (0.93, 0.94, 0.91)
_PLOT, _SHADE, _OUTLINE = (0.83, 0.81, 0.71), (0.66, 0.65, 0.57), (0.25, 0.22, 0.18)
_BEARING_DEG, _ABOVE_DEG = -58.0, 20.0
_LEAST_HEIGHT_M = 2.0  # of the space that is in view
_MARGIN = 1.12

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
        self.size_m, self.window, self.view = size_m, window, view
        self.height_m = max(height_m, _LEAST_HEIGHT_M)
        self._shown = False
        self._plotter = open_plotter(window)
        self._plotter.render_window.SetMultiSamples(0)  # its pixels are averaged as it is
        self._plotter.set_background(AROUND)
        self._bodies = BodiesScene(self._plotter, conifers, _DETAIL)
        self._obstacles: tuple[Obstacle, ...] = ()
        self._solid: Any = None
        lay_ground(self._plotter, size_m, _PLOT, _OUTLINE)

    def picture(
        self,
        trees: pd.DataFrame,
        colours: TreeColours,
        turn: float = 0.0,
        obstacles: Sequence[Obstacle] = (),
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
        obstacles : sequence of Obstacle
            What else stands there.

        Returns
        -------
        uint8 (height, width, 3)
        """
        self._bodies.show(trees)
        crown, bark = colours.of(trees), barks(trees["species"])
        if "fate" in trees:
            gone = (trees["fate"] != "").to_numpy()
            bark[gone] = crown[gone]
        self._bodies.paint(crown, bark)
        if tuple(obstacles) != self._obstacles:
            self._obstacles = tuple(obstacles)
            self._solid = add_obstacles(self._plotter, obstacles)
        if self.view != "above":
            self._add_shadows(trees)
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

    def _add_shadows(self, trees: pd.DataFrame) -> None:
        """Lay all that stands flat on the ground, away from the sun."""
        bodies = self._bodies.formed(trees, _SHADOW_DETAIL)
        casters = [(bodies.points, bodies.triangles)]
        if self._solid is not None:
            faces = self._solid.faces.reshape(-1, 4)[:, 1:]
            casters.append((np.asarray(self._solid.points, np.float32), faces))
        for k, (points, triangles) in enumerate(casters):
            self._plotter.remove_actor(f"shadows {k}", render=False)
            if len(points):
                flat = points - points[:, 2:].clip(0.0) * (SUN / SUN[2]).astype(np.float32)
                flat[:, 2] = 0.0
                mesh = import_pyvista().PolyData.from_regular_faces(flat, triangles)
                add_lit(self._plotter, mesh, f"shadows {k}", color=_SHADE)

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
