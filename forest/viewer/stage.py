"""The scene in 3D, rendered off screen: ground, bodies of trees, branches, what else is put in.

Light is baked into the colours of points, so that software renders a hectare at interactive rates;
turning the view changes nothing but the camera.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import product
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from forest.scenario.model import Obstacle
from forest.trees.skeleton import Skeleton
from forest.view.bodies_scene import BodiesScene, add_lit, add_obstacles, barks, lay_ground
from forest.view.scene import Scene, import_pyvista, look_at
from forest.view.shading import SUN
from forest.viewer.picking import Hit, Ray, first_triangle, nearest_segment

if TYPE_CHECKING:
    import pandas as pd

_WINDOW = (1100, 720)
_SKY = (0.96, 0.97, 0.97), (0.80, 0.87, 0.92)
_GROUND = (0.80, 0.78, 0.70)
_GRID = (0.70, 0.68, 0.60)
_CHOSEN = (0.98, 0.62, 0.10)
_POINTER_RAD = 0.004
_NOTCH = 1.15  # by how much a notch of the wheel brings the view nearer
GRID_M = 10.0

# Corners of stems, of crowns, rings of crowns: for so many trees at most.
_DETAIL = ((400, (10, 18, 8)), (1200, (6, 12, 5)), (10**9, (3, 7, 3)))

#: Cameras: bearing from the x axis and height above the horizon, degrees.
LOOKS = {"stand": (-62.0, 24.0), "side": (-90.0, 3.0), "above": (-90.0, 89.9)}


class Stage:
    """What is seen.

    Parameters
    ----------
    size_m : (float, float)
        Size of the plot, m.
    conifers : collection of str
        Species that are drawn as cones.

    Attributes
    ----------
    crowns : bool
        Whether crowns are shown.
    tints : mapping of int to (red, green, blue)
        Trees that have another colour than theirs, 0 to 1, when they are next shown.
    """

    crowns = True
    tints: Mapping[int, tuple[float, float, float]] = MappingProxyType({})

    def __init__(self, size_m: tuple[float, float], conifers: Collection[str]) -> None:
        pv = import_pyvista()
        self.size_m = size_m
        self.plotter = pv.Plotter(off_screen=True, window_size=_WINDOW, lighting="none")
        self.plotter.set_background(_SKY[0], top=_SKY[1])
        self.plotter.enable_terrain_style(mouse_wheel_zooms=False)
        for towards, strength in ((SUN, 0.85), (SUN * (-1.0, -1.0, 0.6), 0.4)):
            lamp = pv.Light(position=tuple(towards), intensity=strength, light_type="scene light")
            self.plotter.add_light(lamp)  # for what has no light baked into it
        self._bodies = BodiesScene(self.plotter, conifers, _DETAIL)
        self._others = BodiesScene(self.plotter, conifers, _DETAIL, "others")
        self._ids = np.zeros(0, np.int64)
        self._species: list[str] = []
        self._colours = np.zeros((0, 3))
        self._chosen: int | None = None
        self._skeletons: dict[int, Skeleton] = {}
        self._dressed: int | None = None
        self._extras: dict[str, list[str]] = {}
        self._top = 1.0
        self._looked: tuple[str, tuple[float, ...]] | None = None
        self.window.AddObserver("WindowResizeEvent", lambda *_: self._look_again())
        for way, sign in (("Forward", 1.0), ("Backward", -1.0)):
            self.plotter.iren.interactor.AddObserver(
                f"MouseWheel{way}Event", lambda *_, sign=sign: self._zoom(sign)
            )
        lay_ground(self.plotter, size_m, _GROUND, _GRID, grid_m=GRID_M)

    @property
    def window(self) -> Any:
        """The render window."""
        return self.plotter.render_window

    @property
    def skeletons(self) -> tuple[int, ...]:
        """The trees that are shown with their branches."""
        return tuple(self._skeletons)

    # ------------------------------------------------------------------ trees

    def show_trees(
        self,
        trees: pd.DataFrame,
        colours: NDArray[np.float64],
        skeletons: Sequence[Skeleton] = (),
        *,
        alone: int | None = None,
    ) -> None:
        """Put the trees of a year in place of those before.

        Parameters
        ----------
        trees : DataFrame
            As `tree_bodies` takes them, with `status`.
        colours : float64 (n, 3)
            Of each tree, 0 to 1.
        skeletons : sequence of Skeleton
            Trees that are shown with branches in place of a body.
        alone : int, optional
            The only tree that is shown.
        """
        self._ids = trees["tree_id"].to_numpy(np.int64)
        self._species = list(trees["species"].astype(str))
        self._top = float(np.nanmax(trees["height_m"].to_numpy(np.float64), initial=1.0))
        self._skeletons = {
            shape.tree_id: shape for shape in skeletons if alone in (None, shape.tree_id)
        }
        shown = ~np.isin(self._ids, list(self._skeletons))
        if alone is not None:
            shown &= self._ids == alone
        self._bodies.show(trees, shown, crowns=self.crowns)
        self.put("branches", self._add_branches if self._skeletons else None)
        self.recolour(colours)

    def recolour(self, colours: NDArray[np.float64]) -> None:
        """Change the trees' colours (n, 3) and nothing else."""
        self._colours = colours
        self._paint()
        self._mark()

    def choose(self, tree_id: int | None) -> None:
        """Make one tree stand out."""
        self._chosen = tree_id
        self._paint()
        self._mark()

    def dress(self, tree_id: int | None) -> None:
        """Leave the drawing of a tree's branches to a surface that was put in; None does not.

        The pointer still finds its metamers.
        """
        if tree_id != self._dressed:
            self._dressed = tree_id
            self.put("branches", self._add_branches if self._skeletons else None)

    def show_others(
        self,
        others: pd.DataFrame,
        colours: NDArray[np.float64],
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        """Put up what stands among the trees and cannot be chosen, in place of that before.

        Parameters
        ----------
        others : DataFrame
            As `tree_bodies` takes them.
        colours : float64 (n, 3)
            Of each of them, crown and stem, 0 to 1.
        obstacles : sequence of Obstacle
        """
        height = others["height_m"].to_numpy(np.float64)
        self._top = float(np.nanmax(height, initial=self._top))
        self._others.show(others, crowns=self.crowns)
        self._others.paint(colours, colours)
        add_obstacles(self.plotter, obstacles)

    def _paint(self) -> None:
        bark = barks(self._species)
        crown = self._colours.copy()
        for tree_id, tint in self.tints.items():
            crown[self._ids == tree_id] = tint
        if self._chosen is not None:
            here = self._ids == self._chosen
            crown[here] = _CHOSEN
            bark[here] = 0.5 * (bark[here] + _CHOSEN)
        self._bodies.paint(crown, bark)

    def _mark(self) -> None:
        """Lay a ring around the foot of the chosen tree."""
        pv = import_pyvista()
        self.plotter.remove_actor("chosen", render=False)
        rows = np.flatnonzero(self._ids == self._chosen)
        if not len(rows):
            return
        points = self._bodies.bodies.points[self._bodies.bodies.tree == rows[0]]
        foot = points[np.argmin(points[:, 2])]
        reach = np.linalg.norm(points[:, :2] - foot[:2], axis=1).max() * 1.08 + 0.15
        ring = pv.Disc(center=(*foot[:2], 0.04), inner=0.93 * reach, outer=reach, c_res=48)
        add_lit(self.plotter, ring, "chosen", color=_CHOSEN)

    def _add_branches(self, plotter: Any) -> None:
        drawn = [shape for tree_id, shape in self._skeletons.items() if tree_id != self._dressed]
        if drawn:
            Scene(drawn, leaves=True, least_radius_m=0.004).add_to(plotter)

    # ------------------------------------------------------------------ the rest of the scene

    def put(self, name: str, add: Callable[[Any], None] | None) -> None:
        """Put something into the scene under a name, in place of what had it; None takes it away.

        Parameters
        ----------
        name : str
        add : callable, optional
            Is given the plotter, and adds what it likes to it.
        """
        for actor in self._extras.pop(name, []):
            self.plotter.remove_actor(actor, render=False)
        if add is not None:
            before = set(self.plotter.actors)
            add(self.plotter)
            self._extras[name] = [key for key in self.plotter.actors if key not in before]

    def filled_by(
        self, places: NDArray[np.float64], height_m: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Give the share of the picture's height that trees of these middles (n, 3) fill."""
        camera = self.plotter.camera
        away = np.linalg.norm(places - np.asarray(camera.position), axis=1)
        before = (places - np.asarray(camera.position)) @ self.looks > -0.5 * height_m
        seen = 2.0 * np.maximum(away, 0.1) * np.tan(np.radians(0.5 * camera.view_angle))
        return np.asarray(np.where(before, height_m / seen, 0.0), np.float64)

    def when_moved(self, tell: Callable[[], None]) -> None:
        """Call something whenever the user has turned the view or come nearer."""
        released = [f"{button}ButtonReleaseEvent" for button in ("Left", "Middle", "Right")]
        for event in (*released, "MouseWheelForwardEvent", "MouseWheelBackwardEvent"):
            self.plotter.iren.interactor.AddObserver(event, lambda *_: tell())

    def _zoom(self, notches: float) -> None:
        """Come nearer to what is under the pointer, which stays there; or go away from it.

        The style's factor says how far the wheel was turned: a touchpad sends parts of a notch.
        """
        interactor, camera = self.plotter.iren.interactor, self.plotter.camera
        (x, y), (width, height) = interactor.GetEventPosition(), self.window.GetSize()
        position, focus = np.array(camera.position), np.array(camera.focal_point)
        towards = self.ray(x / width, 1.0 - y / height).direction
        depth = (focus - position) @ self.looks
        under = position + towards * depth / (towards @ self.looks)
        turned = notches * interactor.GetInteractorStyle().GetMouseWheelMotionFactor()
        left = _NOTCH**-turned
        camera.position = tuple(under + left * (position - under))
        camera.focal_point = tuple(under + left * (focus - under))
        self.plotter.renderer.ResetCameraClippingRange()

    def look(self, way: str) -> None:
        """Point the camera at the whole stand from one of `LOOKS`."""
        bearing, above = LOOKS[way]
        width, depth = self.size_m
        corners = [(x, y, z) for x in (0.0, width) for y in (0.0, depth) for z in (0.0, self._top)]
        self._look(np.array(corners), bearing, above)
        self._looked = way, tuple(self.plotter.camera.position)

    def _look_again(self) -> None:
        """Fit the whole stand into a picture of another size, if nobody has turned it since."""
        if self._looked is not None and self._looked[1] == tuple(self.plotter.camera.position):
            self.look(self._looked[0])

    def look_at_tree(self, tree_id: int) -> None:
        """Point the camera at one tree."""
        row = np.flatnonzero(self._ids == tree_id)
        bodies = self._bodies.bodies
        points = bodies.points[np.isin(bodies.tree, row)].astype(np.float64)
        if tree_id in self._skeletons:
            points = self._skeletons[tree_id].end
        if len(points):
            low, high = points.min(axis=0), points.max(axis=0)
            corners = np.array(list(product(*zip(low, high, strict=True))))
            self._look(corners, *LOOKS["stand"])

    def _look(self, corners: NDArray[np.float64], bearing: float, above: float) -> None:
        width, height = self.plotter.window_size
        look_at(
            self.plotter,
            corners,
            bearing_deg=bearing,
            above_deg=above,
            aspect=width / max(height, 1),
        )
        if above > 80.0:
            self.plotter.camera.up = (0.0, 1.0, 0.0)

    # ------------------------------------------------------------------ the pointer

    @property
    def looks(self) -> NDArray[np.float64]:
        """The direction in which the camera looks, a unit vector."""
        return np.array(self.plotter.camera.direction, np.float64)

    def ray(self, across: float, down: float) -> Ray:
        """Give the line of sight at a place of the picture: shares of its width and height."""
        width, height = self.window.GetSize()
        renderer = self.plotter.renderer
        ends = []
        for depth in (0.0, 1.0):
            renderer.SetDisplayPoint(across * width, (1.0 - down) * height, depth)
            renderer.DisplayToWorld()
            x, y, z, w = renderer.GetWorldPoint()
            ends.append(np.array([x, y, z]) / w)
        direction = ends[1] - ends[0]
        return Ray(ends[0], direction / np.linalg.norm(direction))

    def hit(self, across: float, down: float, pressure: float = 0.5) -> Hit:
        """Say what lies at a place of the picture."""
        ray = self.ray(across, down)
        best: tuple[float, int, int | None] | None = None
        bodies = self._bodies.bodies
        met = first_triangle(bodies.points, bodies.triangles, ray)
        if met is not None:
            row = bodies.tree[bodies.triangles[met[0], 0]]
            best = (met[1], int(self._ids[row]), None)
        for tree_id, shape in self._skeletons.items():
            wood = nearest_segment(shape.start, shape.end, shape.radius, ray, _POINTER_RAD)
            if wood is not None and (best is None or wood[1] < best[0]):
                best = (wood[1], tree_id, int(shape.serial[wood[0]]))
        if best is not None:
            return Hit(best[1], best[2], ray.at(best[0]), ray, pressure)
        ground = ray.on_plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
        return Hit(None, None, ground, ray, pressure)
