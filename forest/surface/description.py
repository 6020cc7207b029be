"""A tree's geometric description, and what of it is drawn as polygons, lines and points.

Weber and Penn 1995, section 5: one description serves all distances, and any number of instances.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.surface.detail import (
    LAST_LEVEL,
    LEAF_POINT_MASS,
    LEAF_POLYGON_MASS,
    STEM_MASS,
    Fractions,
    drawn,
)
from forest.surface.frames import carry_frames
from forest.trees.leaves import OUTLINES, Leaves
from forest.trees.skeleton import Skeleton

#: Number of the leaves among the items; the levels of stems are items 0, 1 and 2.
LEAF_ITEM = LAST_LEVEL + 1

#: Sides of the tubes of each level of stems; small branches are triangular (Oppenheimer 1986).
SIDES = (12, 6, 3)

_PER_LOBE = 4  # sides of a lobed stem for each lobe: peak, hollow and the two flanks

_Array = NDArray[np.float64]


class Segments(NamedTuple):
    """Pieces of stems of one level, between consecutive cross sections; one entry each.

    Attributes
    ----------
    centre : float64 (n, 2, 3)
        Centres of the lower and the upper cross section, m.
    side, across : float64 (n, 2, 3)
        Two directions that span each cross section, each as long as its radius, m.
    internode : int32 (n,)
        Index in the skeleton.
    """

    centre: _Array
    side: _Array
    across: _Array
    internode: NDArray[np.int32]


class Primitives(NamedTuple):
    """Triangles, lines or points.

    Attributes
    ----------
    vertices : float64 (n, k, 3)
        Corners, m; k is 3, 2 or 1.
    item : int8 (n,)
        Level of the stem, or `LEAF_ITEM`.
    element : int32 (n,)
        Index of the internode in the skeleton, or of the leaf in the leaves.
    """

    vertices: _Array
    item: NDArray[np.int8]
    element: NDArray[np.int32]


class Drawing(NamedTuple):
    """What is drawn of a tree at some distance."""

    triangles: Primitives
    lines: Primitives
    points: Primitives


@dataclass(frozen=True)
class Description:
    """One tree, ready to be drawn at any distance.

    Attributes
    ----------
    stems : tuple of Segments
        Trunk, main branches and all other branches, in order of creation.
    leaves : Leaves
        In order of creation.
    skeleton : Skeleton
        The tree that it was made of.
    lobes : (int, float)
        Number of peaks around the trunk, and their height as a share of its radius.
    lobed_levels : int
        Levels of stems that have them; the trunk's alone, but of a cactus all.
    """

    stems: tuple[Segments, ...]
    leaves: Leaves
    skeleton: Skeleton
    lobes: tuple[int, float] = (0, 0.0)
    lobed_levels: int = 1

    def sides(self, level: int) -> int:
        """Count the sides of the tubes of a level of stems; lobes need some for each."""
        count, depth = self._lobes_of(level)
        return max(SIDES[level], _PER_LOBE * count) if depth else SIDES[level]

    def _lobes_of(self, level: int) -> tuple[int, float]:
        return self.lobes if level < self.lobed_levels else (0, 0.0)

    def drawn(self, shares: Fractions) -> Drawing:
        """Give what the paper's loop draws.

        Parameters
        ----------
        shares : Fractions
            For one range, from `forest.surface.fractions`.
        """
        triangles, lines = [], []
        for level, stems in enumerate(self.stems):
            total = len(stems.internode)
            tubes = drawn(total, float(shares.stem_polygons[level]), STEM_MASS)
            sides = self.sides(level)
            corners = _tubes(stems, tubes, sides, self._lobes_of(level))
            triangles.append(_primitives(corners, level, stems.internode[tubes].repeat(2 * sides)))
            threads = drawn(total, float(shares.stem_lines[level]), STEM_MASS)
            lines.append(_primitives(stems.centre[threads], level, stems.internode[threads]))
        total = len(self.leaves.shape)
        triangles += _blades(
            self.leaves, drawn(total, float(shares.leaf_polygons), LEAF_POLYGON_MASS)
        )
        dots = drawn(total, float(shares.leaf_points), LEAF_POINT_MASS)
        middle = self.leaves.position[dots]
        middle = middle + 0.5 * self.leaves.length[dots, None] * self.leaves.direction[dots]
        return Drawing(
            _together(triangles),
            _together(lines),
            _primitives(middle[:, None].astype(np.float64), LEAF_ITEM, dots),
        )


def describe(
    skeleton: Skeleton,
    leaves: Leaves,
    *,
    lobes: tuple[int, float] = (0, 0.0),
    lobed_levels: int = 1,
) -> Description:
    """Sort a tree into the paper's four lists.

    Parameters
    ----------
    skeleton : Skeleton
        Any tree: simulated, parametric or measured. Consecutive internodes of an axis share their
        cross section, so that tubes are closed; branches of order 2 and more are one list.
    leaves : Leaves
        `forest.trees.leaves.leaves_of` makes those of a simulated tree.
    lobes : (int, float)
        Lobes and LobeDepth of a parametric tree's trunk (section 4.4).
    lobed_levels : int
        Levels of stems that have them.
    """
    heading, side = carry_frames(skeleton)
    across = np.cross(heading, side)
    parent = np.maximum(skeleton.parent, 0)
    goes_on = (skeleton.parent >= 0) & (skeleton.axis[parent] == skeleton.axis)
    lower = np.where(goes_on, parent, np.arange(len(skeleton)))
    ends = np.column_stack((lower, np.arange(len(skeleton))))
    radius = skeleton.radius[ends][:, :, None]
    whole = Segments(
        centre=np.stack((skeleton.start, skeleton.end), axis=1),
        side=radius * side[ends],
        across=radius * across[ends],
        internode=np.arange(len(skeleton), dtype=np.int32),
    )
    by_axis = np.argsort(skeleton.axis, kind="stable")
    level = np.minimum(skeleton.order, LAST_LEVEL)[by_axis]
    stems = tuple(
        Segments(*(field[by_axis[level == k]] for field in whole)) for k in range(LAST_LEVEL + 1)
    )
    return Description(stems, leaves, skeleton, lobes, lobed_levels)


def _tubes(
    stems: Segments, chosen: NDArray[np.int64], sides: int, lobes: tuple[int, float]
) -> _Array:
    """Give the corners (2 sides n, 3, 3) of tubes' triangles, seen from outside anticlockwise."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    count, depth = lobes
    factor = 1.0 + depth * np.sin(count * angle)
    ring = (
        stems.centre[chosen][:, :, None]
        + (factor * np.cos(angle))[:, None] * stems.side[chosen][:, :, None]
        + (factor * np.sin(angle))[:, None] * stems.across[chosen][:, :, None]
    )
    low, high = ring[:, 0], ring[:, 1]
    next_low, next_high = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    first = np.stack((low, next_low, next_high), axis=2)
    second = np.stack((low, next_high, high), axis=2)
    return np.stack((first, second), axis=2).reshape(-1, 3, 3)


def _blades(leaves: Leaves, chosen: NDArray[np.int64]) -> list[Primitives]:
    """Cut the blades into fans of triangles from their petioles, one list for each outline."""
    across = np.cross(leaves.normal[chosen], leaves.direction[chosen])
    across *= leaves.width[chosen, None]
    along = leaves.direction[chosen] * leaves.length[chosen, None]
    found = []
    for code, outline in enumerate(OUTLINES):
        here = leaves.shape[chosen] == code
        corner = (
            leaves.position[chosen][here, None]
            + outline[:, :1] * along[here, None]
            + outline[:, 1:] * across[here, None]
        )
        fan = np.array([(0, k, k + 1) for k in range(1, len(outline) - 1)])
        found.append(
            _primitives(corner[:, fan].reshape(-1, 3, 3), LEAF_ITEM, chosen[here].repeat(len(fan)))
        )
    return found


def _primitives(
    vertices: _Array, item: int, element: NDArray[np.int32] | NDArray[np.int64]
) -> Primitives:
    return Primitives(vertices, np.full(len(vertices), item, np.int8), element.astype(np.int32))


def _together(parts: list[Primitives]) -> Primitives:
    return Primitives(*(np.concatenate(column) for column in zip(*parts, strict=True)))
