"""Trees as bodies in a plotter, on their plot and among its obstacles, their light baked in.

Colours of corners hold all the light there is: sun and sky by the slope of a surface, and the shade
of the canopy above it. What turns the view moves the camera and nothing else.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, maximum_filter

from forest.scenario.model import Box, Obstacle
from forest.view.looks import look_of
from forest.view.scene import import_pyvista
from forest.view.shading import SUN
from forest.view.tree_bodies import Bodies, no_bodies, tree_bodies

if TYPE_CHECKING:
    import pandas as pd

Colours = NDArray[np.float64]

OBSTACLE = (0.56, 0.58, 0.61)
_SUN, _SKY, _FLOOR = 0.55, 0.27, 0.34  # what of its colour a surface shows by each light
_DEEP = 0.66  # brightness far below the canopy's top, of that at the top
_DEEP_SHARE = 0.35  # of the canopy's height: so far down the shade is 1 - 1/e of the deepest
_CELL_M = 1.0
_MOST_CELLS = 250_000
_BARK = 0.82  # brightness of stems, which stand in the crowns' shade


class BodiesScene:
    """Bodies of trees in a plotter; those shown last are there until others are.

    Parameters
    ----------
    plotter : pyvista.Plotter
    conifers : collection of str
        Species that are conifers.
    detail : sequence of (int, (int, int, int))
        For so many trees at most, in rising order: corners of stems, of crowns, rings of crowns.
    name : str
        Of what is put into the plotter.

    Attributes
    ----------
    bodies : Bodies
    """

    def __init__(
        self,
        plotter: Any,
        conifers: Collection[str],
        detail: Sequence[tuple[int, tuple[int, int, int]]],
        name: str = "bodies",
    ) -> None:
        self.bodies = no_bodies()
        self._plotter, self._conifers, self._detail = plotter, frozenset(conifers), detail
        self._name = name
        self._light = np.zeros(0)
        self._mesh: Any = None

    def show(
        self, trees: pd.DataFrame, shown: NDArray[np.bool_] | None = None, *, crowns: bool = True
    ) -> None:
        """Put trees in place of those before, black until they are painted.

        Parameters
        ----------
        trees : DataFrame
            As `tree_bodies` takes them.
        shown : bool (n,), optional
            Which of them are seen; the others still cast their shade.
        crowns : bool
            Whether crowns are seen.
        """
        sides = next(sides for most, sides in self._detail if len(trees) <= most)
        bodies = self.formed(trees, sides)
        self._light = _baked_light(bodies)
        if shown is not None or not crowns:
            corner = bodies.triangles[:, 0]
            kept = crowns | ~bodies.crown[corner]
            if shown is not None:
                kept &= shown[bodies.tree[corner]]
            bodies = bodies._replace(triangles=bodies.triangles[kept])
        self.bodies = bodies
        self._plotter.remove_actor(self._name, render=False)
        self._mesh = None
        if len(bodies.triangles):
            self._mesh = import_pyvista().PolyData.from_regular_faces(
                bodies.points, bodies.triangles
            )
            self._mesh.point_data["rgb"] = np.zeros((self._mesh.n_points, 3), np.uint8)
            add_lit(self._plotter, self._mesh, self._name, scalars="rgb", rgb=True, culling="back")

    def paint(self, crown: Colours, bark: Colours) -> None:
        """Colour each tree's crown and stem; both (n, 3), 0 to 1."""
        if self._mesh is None:
            return
        bodies = self.bodies
        base = np.where(bodies.crown[:, None], crown[bodies.tree], _BARK * bark[bodies.tree])
        lit = base * self._light[:, None]
        self._mesh.point_data["rgb"][:] = np.asarray(255.0 * lit.clip(0.0, 1.0), np.uint8)
        self._mesh.GetPointData().GetArray("rgb").Modified()
        self._mesh.Modified()

    def formed(self, trees: pd.DataFrame, sides: tuple[int, int, int]) -> Bodies:
        """Give the bodies of trees with so many corners, without putting them up."""
        stem, crown, rings = sides
        return tree_bodies(
            trees,
            stem_sides=stem,
            crown_sides=crown,
            crown_rings=rings,
            conifers=self._conifers,
        )


def barks(species: Iterable[str]) -> Colours:
    """Give the colour of each tree's bark, (n, 3), 0 to 1."""
    return np.array([look_of(str(name)).bark for name in species], np.float64).reshape(-1, 3)


def add_lit(plotter: Any, mesh: Any, name: str, **look: Any) -> None:
    """Add a mesh whose colours need no lamp, in place of what had its name."""
    plotter.add_mesh(
        mesh,
        name=name,
        lighting=False,
        show_scalar_bar=False,
        reset_camera=False,
        render=False,
        copy_mesh=False,
        **look,
    )


def lay_ground(
    plotter: Any,
    size_m: tuple[float, float],
    colour: tuple[float, float, float],
    lines: tuple[float, float, float],
    *,
    grid_m: float | None = None,
) -> None:
    """Lay the plot with its outline, and with a grid if one is asked for."""
    pv = import_pyvista()
    width, depth = size_m
    plane = pv.Plane(
        center=(width / 2, depth / 2, -0.02),
        i_size=width,
        j_size=depth,
        i_resolution=1,
        j_resolution=1,
    )
    add_lit(plotter, plane, "ground", color=colour)
    along = [np.append(np.arange(0.0, side, grid_m or side), side) for side in size_m]
    ends = [((x, 0.0), (x, depth)) for x in along[0]] + [((0.0, y), (width, y)) for y in along[1]]
    points = np.array([(*point, 0.01) for line in ends for point in line], np.float32)
    grid = pv.line_segments_from_points(points)
    add_lit(plotter, grid, "grid", color=lines, line_width=1 if grid_m else 2)


def surface_of(obstacle: Obstacle) -> Any:
    """Give the surface of an obstacle, a pyvista mesh."""
    pv = import_pyvista()
    if isinstance(obstacle, Box):
        low, high = obstacle.min_m, obstacle.max_m
        return pv.Box([x for pair in zip(low, high, strict=True) for x in pair])
    return pv.read(obstacle.file).translate(obstacle.at_m)


def solid_surfaces(obstacles: Iterable[Obstacle]) -> Any:
    """Give the surfaces of obstacles as one mesh of triangles, or None if there is none.

    A mesh whose file is not there any more is left out.
    """
    parts = [
        surface_of(each).extract_surface(algorithm=None).triangulate()
        for each in obstacles
        if isinstance(each, Box) or Path(each.file).is_file()
    ]
    return import_pyvista().merge(parts) if parts else None


def add_obstacles(plotter: Any, obstacles: Iterable[Obstacle]) -> Any:
    """Put obstacles in place of those before; gives their surfaces, None if there are none."""
    plotter.remove_actor("standing obstacles", render=False)
    surfaces = solid_surfaces(obstacles)
    if surfaces is not None:
        faced = surfaces.compute_normals(
            cell_normals=True, point_normals=False, auto_orient_normals=True
        )
        light = _by_slope(np.asarray(faced.cell_data["Normals"], np.float64))
        rgb = 255.0 * np.clip(light[:, None] * OBSTACLE, 0.0, 1.0)
        faced.cell_data["rgb"] = np.asarray(rgb, np.uint8)
        add_lit(plotter, faced, "standing obstacles", scalars="rgb", rgb=True)
    return surfaces


def _by_slope(normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light of sun and sky on surfaces of these unit normals (n, 3)."""
    sun = np.maximum(normals @ (SUN / np.linalg.norm(SUN)), 0.0)
    return np.asarray(_SUN * sun + _SKY * (0.5 + 0.5 * normals[:, 2]) + _FLOOR)


def _baked_light(bodies: Bodies) -> NDArray[np.float64]:
    """Give how bright each point is: by its surface's slope, and by the canopy above it."""
    points, triangles = bodies.points, bodies.triangles
    corner = points[triangles[:, 0]]
    normal = np.cross(points[triangles[:, 1]] - corner, points[triangles[:, 2]] - corner)
    total = np.empty((len(points), 3))
    for axis in range(3):
        total[:, axis] = sum(
            np.bincount(triangles[:, k], normal[:, axis], len(points)) for k in range(3)
        )
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
    return _by_slope(total) * np.where(bodies.crown, _below_canopy(bodies), 1.0)


def _below_canopy(bodies: Bodies) -> NDArray[np.float64]:
    """Give the brightness that the crowns above leave, 1 at their tops.

    A crown that stands under another, or grows through its flank, is darker than it: one sees which
    is the larger where bodies overlap.
    """
    crown = bodies.points[bodies.crown].astype(np.float64)
    if not len(crown):
        return np.ones(len(bodies.points))
    low, high = crown.min(axis=0), crown.max(axis=0)
    cell = max(_CELL_M, float(np.sqrt(np.prod(np.maximum(high - low, 0.1)[:2]) / _MOST_CELLS)))
    at = (bodies.points[:, :2] - low[:2]) / cell
    shape = tuple((np.ceil((high - low)[:2] / cell) + 2).astype(int))
    top = np.zeros(shape)
    i, j = np.rint(at[bodies.crown]).astype(int).T
    np.maximum.at(top, (i, j), crown[:, 2])
    top = maximum_filter(top, 3)
    above = map_coordinates(top, at.T, order=1, mode="nearest") - bodies.points[:, 2]
    deep = np.maximum(above, 0.0) / max(_DEEP_SHARE * float(high[2]), 1e-6)
    return np.asarray(_DEEP + (1.0 - _DEEP) * np.exp(-deep))
