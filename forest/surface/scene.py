"""A whole stand as meshes: one mesh for each shape, and the places where trees of it stand.

What of a tree becomes a mesh follows from the range from which the scene is to be seen (Weber and
Penn 1995, section 5; `forest.surface.detail`). A file is made once and holds no lines or points,
so what the paper would draw as lines becomes thin tubes, and what it would draw as points goes
into the leaves that are left, which are enlarged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.surface.description import Description
from forest.surface.detail import LAST_LEVEL, LEAF_POINT_MASS, Fractions, Sight, drawn, fractions
from forest.surface.instances import Colour, Instances, Model
from forest.surface.mesh import Mesh
from forest.surface.terrain import HeightField
from forest.surface.tubes import tubes
from forest.trees.leaves import Leaves, no_leaves
from forest.trees.skeleton import Skeleton

#: Ranges that have names, m: a tree before one, a stand as one sees it from its edge, a forest.
DETAILS = {"tree": 20.0, "stand": 100.0, "far": 400.0}

#: Ranges from which a scene may be seen, m.
NEAREST_M, FARTHEST_M = 0.1, 100_000.0

_TOLERANCE = 1e-4  # of the surface of wood, over the range; about a tenth of a pixel
_MOST_SIDES = 24
_SHAPES_A_LINE = 50  # of progress
_MOST_GROUND_CELLS = 200  # along each edge

_Say = Callable[[str], object]


class Census(NamedTuple):
    """Who the trees of a scene are; one entry for each.

    Attributes
    ----------
    tree_id : int64 (n,)
        Number; below 0 of residual trees, 0 where trees have none.
    species : str (n,)
        Name of the species.
    dbh_cm : float64 (n,)
        Diameter at 1.3 m over bark, cm; NaN where there is none.
    """

    tree_id: NDArray[np.int64]
    species: NDArray[np.str_]
    dbh_cm: NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """What is drawn of a model; its foot is the origin.

    Attributes
    ----------
    species : str
        After which its materials are named.
    wood : Mesh
        Closed tubes.
    leaves : Leaves
        Those that are drawn, as large as they are drawn.
    bark, foliage : tuple of float
        Colours as on a screen (sRGB), 0 to 1.
    """

    species: str
    wood: Mesh
    leaves: Leaves
    bark: Colour
    foliage: Colour


@dataclass(frozen=True)
class Ground:
    """The ground that trees stand on.

    Attributes
    ----------
    mesh : Mesh
        Seen from above.
    colour : tuple of float
        As on a screen (sRGB), 0 to 1.
    """

    mesh: Mesh
    colour: Colour


@dataclass(frozen=True)
class Scene:
    """A stand as meshes.

    Attributes
    ----------
    shapes : tuple of Shape
        Each once.
    instances : Instances
        Where trees stand, and which shape each has.
    census : Census
        Who they are.
    range_m : float
        From where the scene is meant to be seen, m.
    ground : Ground, optional
        Unless it was left out.
    origin_m : tuple of float
        What was taken off all x and y, m, since files have single precision.
    """

    shapes: tuple[Shape, ...]
    instances: Instances
    census: Census
    range_m: float
    ground: Ground | None = None
    origin_m: tuple[float, float] = (0.0, 0.0)

    @property
    def triangles(self) -> tuple[int, int]:
        """Triangles of wood and of leaf cards, counted once for each shape."""
        return self._sum(1)

    @property
    def standing_triangles(self) -> tuple[int, int]:
        """Triangles of wood and of leaf cards of all trees, as a viewer draws them."""
        return self._sum(np.bincount(self.instances.model, minlength=len(self.shapes)))

    def _sum(self, times: NDArray[np.int64] | int) -> tuple[int, int]:
        wood = np.array([len(shape.wood.triangles) for shape in self.shapes], np.int64)
        cards = np.array([2 * len(shape.leaves.shape) for shape in self.shapes], np.int64)
        return int(np.sum(wood * times)), int(np.sum(cards * times))


def scene_range(detail: str | float) -> float:
    """Give the range, m, that a name of `DETAILS` stands for, or a number itself.

    Raises
    ------
    InputError
        If the name is unknown, or the number not within `NEAREST_M` to `FARTHEST_M`.
    """
    if isinstance(detail, str) and detail in DETAILS:
        return DETAILS[detail]
    try:
        range_m = float(detail)
    except ValueError:
        hint = f"{nearest(str(detail), tuple(DETAILS))}, or a range in m"
        raise InputError(f"unknown detail {detail!r}, {hint}") from None
    if not NEAREST_M <= range_m <= FARTHEST_M:
        raise InputError(
            f"detail is {range_m:g}", expected=f"a range of {NEAREST_M:g} to {FARTHEST_M:,.0f} m"
        )
    return range_m


def build_scene(
    models: Sequence[Model],
    instances: Instances,
    *,
    detail: str | float = "stand",
    sight: Sight | None = None,
    leaves: bool = True,
    census: Census | None = None,
    ground: Ground | None = None,
    say: _Say = lambda line: None,
) -> Scene:
    """Make the meshes of a stand, those of each model once.

    Parameters
    ----------
    models : sequence of Model
        Geometry that trees share.
    instances : Instances
        Where trees stand.
    detail : str or float
        A name of `DETAILS`, or the range in m from which the scene is to be seen.
    sight : Sight, optional
        Season, quality and picture, as for `fractions`.
    leaves : bool
        Whether trees have leaves at all.
    census : Census, optional
        Who the trees are; else known by the species of their model alone.
    ground : Ground, optional
        What they stand on, from `ground_of`.
    say : callable
        Is told, in a line, how far it is.

    Raises
    ------
    InputError
        If the detail is unknown, or there is no tree.
    """
    sight, range_m = sight or Sight(), scene_range(detail)
    if not len(instances.model):
        raise InputError("no tree to put into the scene", expected="a stand with trees")
    shapes = []
    for number, model in enumerate(models, start=1):
        shares = fractions(range_m, sight, evergreen=model.evergreen)
        tree = model.description
        shapes.append(
            Shape(
                tree.skeleton.species or "tree",
                _wood(tree, shares, range_m),
                _foliage(tree.leaves, shares) if leaves else no_leaves(),
                model.bark,
                model.foliage[sight.season],
            )
        )
        if number % _SHAPES_A_LINE == 0 or number == len(models):
            say(f"{number} of {len(models)} shapes")
    if census is None:
        names = np.array([shape.species for shape in shapes])[instances.model]
        n = len(names)
        census = Census(np.zeros(n, np.int64), names, np.full(n, np.nan))
    return Scene(tuple(shapes), instances, census, range_m, ground)


def ground_of(
    terrain: HeightField, extent: tuple[float, float, float, float], colour: Colour
) -> Ground:
    """Make the ground of a rectangle (x0, y0, x1, y1) in m: flat in one piece, else in cells."""
    x0, y0, x1, y1 = extent
    if not (x1 > x0 and y1 > y0):
        raise InputError(f"the ground goes from {x0}, {y0} to {x1}, {y1}", expected="a rectangle")
    flat = bool(np.all(terrain.heights == terrain.heights[0, 0]))
    cells = [
        1 if flat else int(np.clip(round(size / terrain.cell_m), 1, _MOST_GROUND_CELLS))
        for size in (x1 - x0, y1 - y0)
    ]
    x, y = np.linspace(x0, x1, cells[0] + 1), np.linspace(y0, y1, cells[1] + 1)
    across, along = np.meshgrid(x, y)
    points = np.column_stack((across.ravel(), along.ravel(), terrain.at(across, along).ravel()))
    corner = (np.arange(cells[1])[:, None] * len(x) + np.arange(cells[0])).ravel()
    fan = np.array([(0, 1, len(x) + 1), (0, len(x) + 1, len(x))])
    triangles = (corner[:, None, None] + fan).reshape(-1, 3).astype(np.int32)
    return Ground(Mesh(points, triangles, points[triangles][:, :, :2]), colour)


def _wood(tree: Description, shares: Fractions, range_m: float) -> Mesh:
    """Lay tubes along the axes that are drawn as tubes or as lines."""
    share = np.maximum(shares.stem_polygons, shares.stem_lines)
    return tubes(
        drawn_axes(tree.skeleton, share),
        tolerance_m=_TOLERANCE * range_m,
        most_sides=_MOST_SIDES,
        lobes=tree.lobes,
        lobed_orders=tree.lobed_levels,
    )


def drawn_axes(skeleton: Skeleton, shares: NDArray[np.float64]) -> Skeleton:
    """Leave out axes, the thinnest first.

    Parameters
    ----------
    skeleton : Skeleton
        A tree.
    shares : float64 (3,)
        Share of the internodes of each level to keep: trunk, main branches, other branches.

    Returns
    -------
    Skeleton
        Whole axes, so that none is cut, each with the axes that bear it, so that none floats. Of
        each level as many of the thickest as do not pass its share of internodes.
    """
    first, axis = np.unique(skeleton.axis, return_index=True, return_inverse=True)[1:]
    size = np.bincount(axis, minlength=len(first))
    level = np.minimum(skeleton.order[first], LAST_LEVEL)
    order = np.lexsort((-skeleton.radius[first], level))
    keep = np.zeros(len(first), np.bool_)
    for which in range(LAST_LEVEL + 1):
        here = order[level[order] == which]
        keep[here] = np.cumsum(size[here]) <= shares[which] * size[here].sum() + 0.5
    bearer = np.where(skeleton.parent[first] >= 0, axis[skeleton.parent[first]], -1)
    while True:
        borne = keep & ((bearer < 0) | keep[bearer])
        if np.array_equal(borne, keep):
            break
        keep = borne
    kept = np.flatnonzero(keep[axis])
    number = np.full(len(skeleton) + 1, -1, np.int32)  # its last entry is that of no parent
    number[kept] = np.arange(len(kept), dtype=np.int32)
    columns = ("start", "end", "radius", "axis", "order", "birth_year", "leafy", "serial")
    parts = {name: getattr(skeleton, name)[kept] for name in columns}
    return replace(skeleton, parent=number[skeleton.parent[kept]], **parts)


def _foliage(leaves: Leaves, shares: Fractions) -> Leaves:
    """Take the leaves that are drawn, spread over the tree, and give them the area of all."""
    share = float(shares.leaf_polygons)
    if shares.leaf_points > 0.0:
        share = max(share, 1.0 / LEAF_POINT_MASS)
    chosen = drawn(len(leaves.shape), share, LEAF_POINT_MASS)
    few = Leaves._make(column[chosen] for column in leaves)
    if not len(chosen):
        return few
    larger = np.sqrt(leaves.area.sum() / few.area.sum())
    return few._replace(length=few.length * larger, width=few.width * larger)
