"""Parametric trees as pictures, and as tubes and leaves for VTK's programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.parametric import Parameters, ParametricTree
from forest.parametric.ratios import lobed
from forest.record.export import whole_file
from forest.surface.export import Material, Part, leaf_parts, linear
from forest.surface.tubes import tubes
from forest.trees.leaves import Leaves
from forest.view import shapes
from forest.view.scene import Scene, import_pyvista, look_at, open_plotter, pixels
from forest.view.shading import LightVolume

#: The seasons, and how young the leaves are in each, 0 to 1.
SEASONS = {"spring": 0.5, "summer": 0.0, "fall": 0.0, "winter": 0.0}

_YOUNG = np.array([0.60, 0.72, 0.30])  # colour of leaves that have just unfolded
#: What the leaves of evergreens, simulated or not, are mixed with in winter, and how much of it.
WINTER_DULL, WINTER_SHARE = (0.30, 0.33, 0.22), 0.25

_MOST_LEAVES = 800_000
_SIDES = 6
_PER_LOBE = 12  # sides of a lobed trunk for each lobe
_FROM_THE_SIDES = 0.4  # of the light of the sky
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

    def cards(self, scale: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Give the corners (n, 4, 3), enlarged by `scale`, and the number of each."""
        side = np.cross(self.along, self.normal)
        side *= (0.5 * scale * self.width / np.linalg.norm(side, axis=1))[:, None]
        tip, middle = self.place + scale * self.along, self.place + 0.5 * scale * self.along
        corners = np.stack((self.place, middle - side, tip, middle + side), axis=1)
        return corners, np.arange(len(corners))


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
    if parameters.evergreen:
        dull = WINTER_SHARE if season == "winter" else 0.0
        return np.asarray((1.0 - dull) * colour + dull * np.array(WINTER_DULL))
    young = SEASONS[season]
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
    size : float, optional
        Height of the picture, m, after which the thinnest twigs are drawn; the tree's unless given.
    """

    def __init__(
        self,
        tree: ParametricTree,
        *,
        leaves: bool = True,
        season: str = "summer",
        size: float | None = None,
    ) -> None:
        box = box_of(tree)
        least = _LEAST_WIDTH * (size or max(2.0 * box[1, 0], box[1, 2]))
        super().__init__([tree.skeleton()], leaves=False, least_radius_m=least)
        self.tree = tree
        self.bark = colour_of(tree.parameters.bark_colour)
        wood = replace(self.wood, bark=np.broadcast_to(self.bark, self.wood.bark.shape))
        self.wood = wood.part(_round(tree)) if is_lobed(tree) else wood
        if leaves and has_leaves(tree, season) and len(tree.leaves.stem):
            self.leaves, self.card_scale = _blades(tree, season)
            area = self.leaves.area * self.card_scale**2
            self.light = LightVolume(self.leaves.place, area, (self.lower, self.upper))
            # The sky's light comes from above there; a lone tree has it from the sides too.
            self.light.sky = _FROM_THE_SIDES + (1.0 - _FROM_THE_SIDES) * self.light.sky

    def add_to(self, plotter: Any) -> None:
        """Put wood and leaves into a plotter."""
        super().add_to(plotter)
        if not is_lobed(self.tree):
            return
        mesh = _polygons(*lobed_trunk(self.tree)).compute_normals(
            cell_normals=False, consistent_normals=False, auto_orient_normals=False
        )
        normals = np.asarray(mesh.point_data["Normals"], np.float64)
        bark = np.broadcast_to(self.bark, normals.shape)
        mesh["rgb"] = self.lit_bark(np.asarray(mesh.points, np.float64), normals, bark)
        plotter.add_mesh(mesh, scalars="rgb", rgb=True, lighting=False)


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
    from PIL import Image

    picture = _render(tree, leaves and has_leaves(tree, season), season, window, box_of(tree))
    with whole_file(to, overwrite=True) as draft:
        Image.fromarray(picture).save(draft)


def draw_sway(
    frames: Sequence[ParametricTree],
    to: str | Path,
    *,
    seconds: float,
    leaves: bool = True,
    season: str = "summer",
    window: tuple[int, int] = (450, 550),
    overwrite: bool = False,
) -> None:
    """Draw moments of a wind and save them as a GIF that runs for ever.

    Parameters
    ----------
    frames : sequence of ParametricTree
        The moments, of one tree, as from `ParametricTree.frames`.
    to : path
        GIF file to write.
    seconds : float
        How long one round lasts; each frame is shown for a whole number of hundredths.
    leaves, season, window
        As of `draw_parametric`.
    overwrite : bool
        Whether to replace a file.
    """
    from PIL import Image

    boxes = np.array([box_of(frame) for frame in frames])
    box = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    leafy = leaves and has_leaves(frames[0], season)
    images = [Image.fromarray(_render(frame, leafy, season, window, box)) for frame in frames]
    with whole_file(to, overwrite=overwrite) as draft:
        images[0].save(
            draft,
            save_all=True,
            append_images=images[1:],
            duration=max(20, round(100.0 * seconds / len(images)) * 10),
            loop=0,
        )


def box_of(tree: ParametricTree) -> NDArray[np.float64]:
    """Corners (2, 3) of the space that a picture shows, the trunk's base in its middle, m."""
    points = tree.nodes.position
    reach = np.abs(points[:, :2]).max() + 0.1
    low, high = min(0.0, points[:, 2].min()), points[:, 2].max()
    return np.array([(-reach, -reach, low), (reach, reach, high)])


def _render(
    tree: ParametricTree,
    leafy: bool,
    season: str,
    window: tuple[int, int],
    box: NDArray[np.float64],
) -> NDArray[np.uint8]:
    size = max(2.0 * box[1, 0], box[1, 2])
    plotter = open_plotter(window)
    plotter.set_background("white")
    TreeScene(tree, leaves=leafy, season=season, size=size).add_to(plotter)
    corners = np.array([(x, y, z) for x in box[:, 0] for y in box[:, 1] for z in box[:, 2]])
    look_at(plotter, corners, bearing_deg=-75.0, above_deg=4.0, aspect=window[0] / window[1])
    return pixels(plotter)


def is_lobed(tree: ParametricTree) -> bool:
    """Whether the trunk's cross section is anything but round."""
    return tree.parameters.lobes > 0 and tree.parameters.lobe_depth > 0.0


def lobed_trunk(tree: ParametricTree) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give the surface of the trunk and its clones, their radius lobed (section 4.4).

    A plant without leaves, a cactus, has lobes on all stems.

    Returns
    -------
    points : float64 (n, 3)
        Rings of `12 * lobes` points, m, a ring for each cross section.
    quads : int64 (m, 4)
        Their corners.
    """
    stems, nodes = tree.stems, tree.nodes
    count = int(stems.nodes[stems.level < _lobed_levels(tree)].sum())
    sides = _PER_LOBE * tree.parameters.lobes
    angle = 2.0 * np.pi * np.arange(sides) / sides
    radius = nodes.radius[:count, None] * lobed(
        tree.parameters.lobes, tree.parameters.lobe_depth, angle
    )
    side, across = nodes.side[:count], np.cross(nodes.heading[:count], nodes.side[:count])
    points = (
        nodes.position[:count, None]
        + (radius * np.cos(angle))[:, :, None] * side[:, None]
        + (radius * np.sin(angle))[:, :, None] * across[:, None]
    )
    lower = np.flatnonzero(np.diff(nodes.stem[:count]) == 0)[:, None] * sides
    here = np.arange(sides)
    then = np.roll(here, -1)
    quads = np.stack((lower + here, lower + then, lower + sides + then, lower + sides + here), 2)
    return points.reshape(-1, 3), quads.reshape(-1, 4)


def _lobed_levels(tree: ParametricTree) -> int:
    """Levels of stems with lobes: the trunk's alone; of a plant without leaves, a cactus, all."""
    return 1 if tree.parameters.leaves else tree.parameters.depth


def _round(tree: ParametricTree) -> NDArray[np.bool_]:
    """Which internodes of `gather_wood` have no lobes; it leaves out the shortest."""
    skeleton = tree.skeleton()
    return np.asarray(skeleton.order[skeleton.length > 1e-6] >= _lobed_levels(tree))


def _polygons(points: NDArray[np.float64], corners: NDArray[np.int64]) -> Any:
    n, k = corners.shape
    return import_pyvista().PolyData(points, np.column_stack((np.full(n, k), corners)).ravel())


def mesh_parts(tree: ParametricTree, *, leaves: bool, season: str = "summer") -> list[Part]:
    """Give tubes and leaf cards for files of meshes; a trunk with lobes has them.

    Parameters
    ----------
    tree : ParametricTree
        The tree.
    leaves : bool
        Whether to give the leaves too, where the season has any.
    season : str
        One of `SEASONS`.
    """
    lobes = (tree.parameters.lobes, tree.parameters.lobe_depth) if is_lobed(tree) else (0, 0.0)
    wood = tubes(tree.skeleton(), lobes=lobes, lobed_orders=_lobed_levels(tree))
    bark = colour_of(tree.parameters.bark_colour)
    parts = [Part(wood, Material("wood", colour=linear(bark.tolist())))]
    if leaves and has_leaves(tree, season):
        parts += leaf_parts(
            tree.leaves, colour=linear(leaf_colour(tree.parameters, season).tolist())
        )
    return parts


def _blades(tree: ParametricTree, season: str) -> tuple[Blades, float]:
    """Take an even part of the leaves, and the factor on their size that makes up for the rest."""
    total = len(tree.leaves.stem)
    chosen = np.arange(0, total, max(1, -(-total // _MOST_LEAVES)))
    columns: list[Any] = [column[chosen] for column in tree.leaves]
    some = Leaves(*columns)
    grain = 0.85 + 0.3 * np.modf(np.arange(len(chosen)) * 0.6180339887498949)[0]
    blades = Blades(
        place=some.position.astype(np.float64),
        along=some.direction * some.length[:, None],
        colour=grain[:, None] * leaf_colour(tree.parameters, season),
        needles=np.zeros(len(chosen), np.bool_),
        blades=1,
        normal=some.normal.astype(np.float64),
        width=some.width,
    )
    return blades, float(np.sqrt(total / len(chosen)))
