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

from forest.trees.skeleton import Skeleton
from forest.view.looks import look_of
from forest.view.scene import Scene, import_pyvista, look_at
from forest.view.shading import SUN
from forest.view.tree_bodies import Bodies, tree_bodies
from forest.viewer.picking import Hit, Ray, first_triangle, nearest_segment

if TYPE_CHECKING:
    import pandas as pd

_WINDOW = (1100, 720)
_SKY = (0.96, 0.97, 0.97), (0.80, 0.87, 0.92)
_GROUND = (0.80, 0.78, 0.70)
_GRID = (0.70, 0.68, 0.60)
_CHOSEN = (0.98, 0.62, 0.10)
_AMBIENT = 0.56  # share of a colour that is seen on the side away from the sun
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
        self._conifers = frozenset(conifers)
        self.plotter = pv.Plotter(off_screen=True, window_size=_WINDOW, lighting="none")
        self.plotter.set_background(_SKY[0], top=_SKY[1])
        self.plotter.enable_terrain_style(mouse_wheel_zooms=False)
        for towards, strength in ((SUN, 0.85), (SUN * (-1.0, -1.0, 0.6), 0.4)):
            lamp = pv.Light(position=tuple(towards), intensity=strength, light_type="scene light")
            self.plotter.add_light(lamp)  # for what has no light baked into it
        self._bodies = Bodies(
            np.zeros((0, 3), np.float32),
            np.zeros((0, 3), np.int32),
            np.zeros(0, np.int32),
            np.zeros(0, np.bool_),
        )
        self._ids = np.zeros(0, np.int64)
        self._species: list[str] = []
        self._colours = np.zeros((0, 3))
        self._light = np.zeros(0)
        self._mesh: Any = None
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
        self._lay_ground()

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
        sides = next(sides for most, sides in _DETAIL if len(trees) <= most)
        self._bodies = tree_bodies(
            trees,
            stem_sides=sides[0],
            crown_sides=sides[1],
            crown_rings=sides[2],
            conifers=self._conifers,
        )
        self._ids = trees["tree_id"].to_numpy(np.int64)
        self._species = list(trees["species"].astype(str))
        self._top = float(np.nanmax(trees["height_m"].to_numpy(np.float64), initial=1.0))
        self._light = _baked_light(self._bodies)
        self._skeletons = {
            shape.tree_id: shape for shape in skeletons if alone in (None, shape.tree_id)
        }
        shown = ~np.isin(self._ids, list(self._skeletons))
        if alone is not None:
            shown &= self._ids == alone
        if not (shown.all() and self.crowns):
            corner = self._bodies.triangles[:, 0]
            kept = shown[self._bodies.tree[corner]]
            kept &= self.crowns | ~self._bodies.crown[corner]
            self._bodies = self._bodies._replace(triangles=self._bodies.triangles[kept])
        self.put("branches", self._add_branches if self._skeletons else None)
        self._place_bodies()
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

    def _place_bodies(self) -> None:
        pv = import_pyvista()
        bodies = self._bodies
        self._mesh = pv.PolyData()
        if len(bodies.triangles):
            self._mesh = pv.PolyData.from_regular_faces(bodies.points, bodies.triangles)
            self._mesh.point_data["rgb"] = np.zeros((self._mesh.n_points, 3), np.uint8)
        self.plotter.remove_actor("bodies", render=False)
        if len(bodies.triangles):
            self._add(self._mesh, "bodies", scalars="rgb", rgb=True, culling="back")

    def _paint(self) -> None:
        bodies = self._bodies
        if self._mesh is None or not self._mesh.n_points:
            return
        barks = {name: look_of(name).bark for name in set(self._species)}
        bark = np.array([barks[name] for name in self._species]).reshape(-1, 3)
        crown = self._colours.copy()
        for tree_id, tint in self.tints.items():
            crown[self._ids == tree_id] = tint
        if self._chosen is not None:
            here = self._ids == self._chosen
            crown[here] = _CHOSEN
            bark[here] = 0.5 * (bark[here] + _CHOSEN)
        base = np.where(bodies.crown[:, None], crown[bodies.tree], 0.85 * bark[bodies.tree])
        lit = base * self._light[:, None]
        self._mesh.point_data["rgb"][:] = np.asarray(255.0 * lit.clip(0.0, 1.0), np.uint8)
        self._mesh.GetPointData().GetArray("rgb").Modified()
        self._mesh.Modified()

    def _mark(self) -> None:
        """Lay a ring around the foot of the chosen tree."""
        pv = import_pyvista()
        self.plotter.remove_actor("chosen", render=False)
        rows = np.flatnonzero(self._ids == self._chosen)
        if not len(rows):
            return
        points = self._bodies.points[self._bodies.tree == rows[0]]
        foot = points[np.argmin(points[:, 2])]
        reach = np.linalg.norm(points[:, :2] - foot[:2], axis=1).max() * 1.08 + 0.15
        ring = pv.Disc(center=(*foot[:2], 0.04), inner=0.93 * reach, outer=reach, c_res=48)
        self._add(ring, "chosen", color=_CHOSEN)

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
        points = self._bodies.points[np.isin(self._bodies.tree, row)].astype(np.float64)
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

    def _lay_ground(self) -> None:
        pv = import_pyvista()
        width, depth = self.size_m
        ground = pv.Plane(
            center=(width / 2, depth / 2, -0.02),
            i_size=width,
            j_size=depth,
            i_resolution=1,
            j_resolution=1,
        )
        self._add(ground, "ground", color=_GROUND)
        ends = [((x, 0.0), (x, depth)) for x in (*np.arange(0.0, width, GRID_M), width)] + [
            ((0.0, y), (width, y)) for y in (*np.arange(0.0, depth, GRID_M), depth)
        ]
        points = np.array([(*point, 0.0) for line in ends for point in line], np.float32)
        self._add(pv.line_segments_from_points(points), "grid", color=_GRID, line_width=1)

    def _add(self, mesh: Any, name: str, **keys: Any) -> None:
        self.plotter.add_mesh(
            mesh,
            name=name,
            lighting=False,
            show_scalar_bar=False,
            reset_camera=False,
            render=False,
            copy_mesh=False,
            **keys,
        )

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
        met = first_triangle(self._bodies.points, self._bodies.triangles, ray)
        if met is not None:
            row = self._bodies.tree[self._bodies.triangles[met[0], 0]]
            best = (met[1], int(self._ids[row]), None)
        for tree_id, shape in self._skeletons.items():
            wood = nearest_segment(shape.start, shape.end, shape.radius, ray, _POINTER_RAD)
            if wood is not None and (best is None or wood[1] < best[0]):
                best = (wood[1], tree_id, int(shape.serial[wood[0]]))
        if best is not None:
            return Hit(best[1], best[2], ray.at(best[0]), ray, pressure)
        ground = ray.on_plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
        return Hit(None, None, ground, ray, pressure)


def _baked_light(bodies: Bodies) -> NDArray[np.float64]:
    """Give how bright each point is: sun by the surface's slope, shade low in the crown."""
    points, triangles = bodies.points, bodies.triangles
    corner = points[triangles[:, 0]]
    normal = np.cross(points[triangles[:, 1]] - corner, points[triangles[:, 2]] - corner)
    total = np.empty((len(points), 3))
    for axis in range(3):
        total[:, axis] = sum(
            np.bincount(triangles[:, k], normal[:, axis], len(points)) for k in range(3)
        )
    length = np.linalg.norm(total, axis=1)
    facing = np.divide(total @ SUN, length, out=np.zeros(len(points)), where=length > 0.0)
    light: NDArray[np.float64] = _AMBIENT + (1.06 - _AMBIENT) * (0.5 + 0.5 * facing)
    return light
