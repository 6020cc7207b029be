"""Parametric trees as pictures, and as tubes and leaves for VTK's programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.parametric import ParametricTree
from forest.record.export import whole_file
from forest.trees.leaves import OUTLINES, Leaves
from forest.view import shapes
from forest.view.scene import Scene, import_pyvista, look_at, open_plotter, save
from forest.view.shading import LightVolume
from forest.view.shapes import gather_wood, polylines

#: Colour of the leaves in each season.
SEASONS = {
    "spring": (0.42, 0.58, 0.22),
    "summer": (0.22, 0.42, 0.14),
    "fall": (0.72, 0.48, 0.12),
    "winter": (0.20, 0.36, 0.16),
}

_MOST_LEAVES = 800_000
_SIDES = 6
_LEAST_WIDTH = 0.0004  # of the picture's height


@dataclass(frozen=True)
class Blades(shapes.Leaves):
    """Leaves as they stand, each a rhombus of its own length and width.

    Attributes
    ----------
    normal : float64 (n, 3)
        Out of the upper face; `along` reaches from the foot to the tip.
    width : float64 (n,)
        Width, m.
    """

    normal: NDArray[np.float64]
    width: NDArray[np.float64]

    @property
    def area(self) -> NDArray[np.float64]:
        """Area of each rhombus, m2."""
        return np.asarray(0.5 * np.linalg.norm(self.along, axis=1) * self.width)

    def cards(self, scale: float) -> NDArray[np.float64]:
        """Give the corners (n, 4, 3), enlarged by `scale`."""
        side = np.cross(self.along, self.normal)
        side *= (0.5 * scale * self.width / np.linalg.norm(side, axis=1))[:, None]
        tip, middle = self.place + scale * self.along, self.place + 0.5 * scale * self.along
        return np.stack((self.place, middle - side, tip, middle + side), axis=1)


def has_leaves(tree: ParametricTree, season: str) -> bool:
    """Whether the species bears leaves in a season of `SEASONS`."""
    return season != "winter" or tree.parameters.evergreen


def draw_parametric(
    tree: ParametricTree,
    to: str | Path,
    *,
    leaves: bool = True,
    season: str = "summer",
    window: tuple[int, int] = (900, 1100),
) -> None:
    """Draw a parametric tree on white and save the picture.

    Parameters
    ----------
    tree : ParametricTree
        The tree.
    to : path
        PNG file to write.
    leaves : bool
        Whether to draw leaves, where the season has any.
    season : str
        One of `SEASONS`.
    window : tuple of int
        Width and height of the picture, pixels.
    """
    skeleton = tree.skeleton()
    points = tree.nodes.position
    reach, top = np.abs(points[:, :2]).max() + 0.1, points[:, 2].max()
    scene = Scene([skeleton], leaves=False, least_radius_m=_LEAST_WIDTH * max(2.0 * reach, top))
    if leaves and has_leaves(tree, season) and len(tree.leaves.stem):
        blades, scene.card_scale = _blades(tree, season)
        scene.leaves = blades
        bounds = (scene.lower, scene.upper)
        scene.light = LightVolume(blades.place, blades.area * scene.card_scale**2, bounds)
    plotter = open_plotter(window)
    plotter.set_background("white")
    scene.add_to(plotter)
    sides = [(a, b) for a in (-reach, reach) for b in (-reach, reach)]
    corners = np.array([(*side, z) for side in sides for z in (min(0.0, points[:, 2].min()), top)])
    look_at(plotter, corners, bearing_deg=-75.0, above_deg=4.0, aspect=window[0] / window[1])
    save(plotter, to)


def write_vtp(
    tree: ParametricTree, to: str | Path, *, leaves: bool = True, overwrite: bool = False
) -> None:
    """Write tubes and leaves as a VTK PolyData file.

    Parameters
    ----------
    tree : ParametricTree
        The tree.
    to : path
        File to write.
    leaves : bool
        Whether to write the leaves too.
    overwrite : bool
        Whether to replace a file.

    Notes
    -----
    Cells carry `leaf`, 1 on leaves and 0 on wood.
    """
    pv = import_pyvista()
    lines = polylines(gather_wood([tree.skeleton()]))
    mesh = pv.PolyData()
    mesh.points, mesh.lines = lines.points, lines.cells
    mesh["radius"] = np.maximum(lines.radius, 1e-5)
    mesh.set_active_scalars("radius")
    tubes = mesh.tube(scalars="radius", absolute=True, n_sides=_SIDES).triangulate()
    tubes.clear_data()
    tubes.cell_data["leaf"] = np.zeros(tubes.n_cells, np.uint8)
    if leaves and len(tree.leaves.stem):
        corners = _outlines(tree.leaves, tree.parameters.leaf_shape)
        n, k = corners.shape[:2]
        faces = np.column_stack((np.full(n, k), np.arange(k * n).reshape(n, k))).ravel()
        cards = pv.PolyData(corners.reshape(-1, 3), faces)
        cards.cell_data["leaf"] = np.ones(n, np.uint8)
        tubes = tubes.append_polydata(cards)
    with whole_file(to, overwrite=overwrite) as draft:
        tubes.save(draft)


def _outlines(leaves: Leaves, shape: int) -> NDArray[np.float64]:
    """Give the corners (n, k, 3) of all leaves' outlines."""
    along = leaves.direction * leaves.length[:, None]
    across = np.cross(leaves.normal, leaves.direction) * leaves.width[:, None]
    x, y = OUTLINES[shape].T
    bent = along[:, None] * x[None, :, None] + across[:, None] * y[None, :, None]
    return np.asarray(leaves.position[:, None] + bent, np.float64)


def _blades(tree: ParametricTree, season: str) -> tuple[Blades, float]:
    """Take an even part of the leaves, and the factor on their size that makes up for the rest."""
    total = len(tree.leaves.stem)
    chosen = np.arange(0, total, max(1, -(-total // _MOST_LEAVES)))
    columns: list[Any] = [column[chosen] for column in tree.leaves]
    some = Leaves(*columns)
    grain = 0.85 + 0.3 * np.modf(np.arange(len(chosen)) * 0.6180339887498949)[0]
    blades = Blades(
        place=some.position,
        along=some.direction * some.length[:, None],
        colour=grain[:, None] * np.asarray(SEASONS[season]),
        needles=np.zeros(len(chosen), np.bool_),
        normal=some.normal,
        width=some.width,
    )
    return blades, float(np.sqrt(total / len(chosen)))
