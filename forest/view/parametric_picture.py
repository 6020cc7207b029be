"""Parametric trees as pictures, and as tubes and leaves for VTK's programs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.parametric import Parameters, ParametricTree
from forest.record.export import whole_file
from forest.trees.leaves import OUTLINES, Leaves
from forest.view import shapes
from forest.view.scene import Scene, import_pyvista, look_at, open_plotter, save
from forest.view.shading import LightVolume
from forest.view.shapes import gather_wood, polylines

#: The seasons, and how young the leaves are in each, 0 to 1.
SEASONS = {"spring": 0.5, "summer": 0.0, "fall": 0.0, "winter": 0.0}

_YOUNG = np.array([0.60, 0.72, 0.30])  # colour of leaves that have just unfolded

_MOST_LEAVES = 800_000
_SIDES = 6
_FROM_THE_SIDES = 0.4
_POINTS_PER_LOBE = 8
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


def colour_of(text: str) -> NDArray[np.float64]:
    """Read `#rrggbb` as shares of red, green and blue."""
    return np.array([int(text[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0


def leaf_colour(parameters: Parameters, season: str) -> NDArray[np.float64]:
    """Colour of the leaves in a season of `SEASONS`, as shares of red, green and blue."""
    falls = season == "fall" and not parameters.evergreen
    colour = colour_of(parameters.fall_colour if falls else parameters.leaf_colour)
    young = 0.0 if parameters.evergreen else SEASONS[season]
    return np.asarray((1.0 - young) * colour + young * _YOUNG)


class TreeScene(Scene):
    """One parametric tree in its species' colours, with its lobes.

    Parameters
    ----------
    tree : ParametricTree
        The tree.
    leaves : bool
        Whether to show leaves, where the season has any.
    season : str
        One of `SEASONS`.
    """

    def __init__(
        self, tree: ParametricTree, *, leaves: bool = True, season: str = "summer"
    ) -> None:
        points, skeleton = tree.nodes.position, tree.skeleton()
        size = max(2.0 * np.abs(points[:, :2]).max(), points[:, 2].max())
        super().__init__([skeleton], leaves=False, least_radius_m=_LEAST_WIDTH * size)
        self.bark = colour_of(tree.parameters.bark_colour)
        wood = replace(self.wood, bark=np.broadcast_to(self.bark, self.wood.bark.shape))
        self.tree, self.lobed = tree, lobed_stems(tree)
        drawn = skeleton.axis[skeleton.length > 1e-6]  # as `gather_wood` has them
        self.wood = wood.part(~np.isin(drawn, self.lobed))
        if leaves and has_leaves(tree, season) and len(tree.leaves.stem):
            self.leaves, self.card_scale = _blades(tree, season)
            area = self.leaves.area * self.card_scale**2
            self.light = LightVolume(self.leaves.place, area, (self.lower, self.upper))
            # The sky's light comes from above there; a lone tree has it from the sides too.
            self.light.sky = _FROM_THE_SIDES + (1.0 - _FROM_THE_SIDES) * self.light.sky

    def add_to(self, plotter: Any) -> None:
        """Put wood and leaves into a plotter."""
        super().add_to(plotter)
        pv = import_pyvista()
        for stem in self.lobed:
            points, faces = lobed_tube(self.tree, int(stem))
            mesh = pv.PolyData(points, faces).compute_normals(split_vertices=False)
            normals = np.asarray(mesh.point_data["Normals"], np.float64)
            bark = np.broadcast_to(self.bark, points.shape)
            mesh["rgb"] = self.lit_bark(np.asarray(mesh.points, np.float64), normals, bark)
            plotter.add_mesh(mesh, scalars="rgb", rgb=True, lighting=False)


def lobed_stems(tree: ParametricTree) -> NDArray[np.int64]:
    """Stems with lobes: the trunk and its clones; of a plant without leaves, a cactus, all."""
    parameters = tree.parameters
    if parameters.lobes == 0 or parameters.lobe_depth == 0.0:
        return np.empty(0, np.int64)
    return np.flatnonzero((tree.stems.level == 0) | (parameters.leaves == 0))


def lobed_tube(tree: ParametricTree, stem: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give the surface of a stem with lobes, closed at its end (Weber & Penn 1995, 4.4).

    Returns
    -------
    points : float64 (n, 3)
        Corners, ring by ring, m.
    faces : int64
        Quadrangles in VTK's way, [4, corner, corner, corner, corner, 4 ...].
    """
    lobes, depth = tree.parameters.lobes, tree.parameters.lobe_depth
    first = tree.stems.first[stem]
    rows = np.arange(first, first + tree.stems.nodes[stem])
    place, side = tree.nodes.position[rows], tree.nodes.side[rows]
    across = np.cross(tree.nodes.heading[rows], side)
    n = _POINTS_PER_LOBE * lobes
    angle = 2.0 * np.pi * np.arange(n) / n
    out = (
        np.cos(angle)[:, None] * side[:, None, :] + np.sin(angle)[:, None] * across[:, None, :]
    ) * (1.0 + depth * np.sin(lobes * angle))[:, None]
    rings = place[:, None, :] + tree.nodes.radius[rows][:, None, None] * out
    rings = np.concatenate((rings, np.broadcast_to(place[-1], (1, n, 3))))
    low = np.arange((len(rings) - 1) * n).reshape(-1, n)
    beside = np.roll(low, -1, axis=1)
    corners = np.stack((low, beside, beside + n, low + n), axis=2).reshape(-1, 4)
    faces = np.column_stack((np.full(len(corners), 4), corners)).ravel()
    return rings.reshape(-1, 3), faces


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
    points = tree.nodes.position
    reach, top = np.abs(points[:, :2]).max() + 0.1, points[:, 2].max()
    scene = TreeScene(tree, leaves=leaves, season=season)
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
        colour=grain[:, None] * leaf_colour(tree.parameters, season),
        needles=np.zeros(len(chosen), np.bool_),
        normal=some.normal,
        width=some.width,
    )
    return blades, float(np.sqrt(total / len(chosen)))
