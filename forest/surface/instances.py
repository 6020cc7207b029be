"""One tree's geometry, and the many places where it stands.

Weber and Penn 1995, sections 5 and 6: any number of instances share a description. They differ in
place and scale, never in the direction that they face, so that shadows within a tree are worked
out once for all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError
from forest.surface.description import LEAF_ITEM, Description, Primitives, describe
from forest.surface.detail import (
    LAST_LEVEL,
    LEAF_POINT_MASS,
    LEAF_POLYGON_MASS,
    SEASONS,
    STEM_MASS,
    Fractions,
)
from forest.trees.leaves import Leaves
from forest.trees.skeleton import Skeleton

Colour = tuple[float, float, float]

#: Colours of a model that are not told otherwise: bark, and leaves by season.
BARK: Colour = (0.42, 0.36, 0.30)
FOLIAGE: Mapping[str, Colour] = {
    "spring": (0.50, 0.63, 0.24),
    "summer": (0.34, 0.50, 0.20),
    "fall": (0.75, 0.52, 0.15),
    "winter": (0.33, 0.45, 0.21),
}


class Elements(NamedTuple):
    """One of a tree's lists as one kind of primitive, as the kernels read it.

    Attributes
    ----------
    item : int
        Level of the stems, or `LEAF_ITEM`.
    mass : int
        Elements in a mass.
    vertices : float32 (p, 3 k)
        Corners of each primitive, m from the tree's foot; k is 3, 2 or 1.
    facing : float32 (p, 3)
        Unit normal of a triangle or of a point's leaf; direction of a line.
    along : float32 (e, 3)
        Unit vector along each internode; 0 of leaves.
    first : int32 (e + 1,)
        First primitive of each element.
    middle : float32 (e, 3)
        Middle of each element, m.
    width_m : float32 (e,)
        Diameter of an internode; side of the square that is as large as a leaf.
    """

    item: int
    mass: int
    vertices: NDArray[np.float32]
    facing: NDArray[np.float32]
    along: NDArray[np.float32]
    first: NDArray[np.int32]
    middle: NDArray[np.float32]
    width_m: NDArray[np.float32]

    @property
    def corners(self) -> int:
        """Three of triangles, two of lines, one of points."""
        return int(self.vertices.shape[1]) // 3

    def share(self, shares: Fractions) -> NDArray[np.float64]:
        """Give what is drawn of this list, from what is drawn of all."""
        if self.item == LEAF_ITEM:
            return shares.leaf_polygons if self.corners == 3 else shares.leaf_points
        levels = shares.stem_polygons if self.corners == 3 else shares.stem_lines
        return levels[..., self.item]


@dataclass(frozen=True)
class Model:
    """One tree's geometry, which many instances share.

    Attributes
    ----------
    description : Description
        The tree, its foot at the origin.
    evergreen : bool
        Whether it keeps its leaves in winter.
    bark : tuple of float
        Colour of the stems: red, green and blue, 0 to 1.
    foliage : mapping of str to tuple of float
        Colour of the leaves in each of `forest.surface.detail.SEASONS`.

    Raises
    ------
    InputError
        If a season or a part of a colour is missing or out of range.
    """

    description: Description
    evergreen: bool
    bark: Colour
    foliage: Mapping[str, Colour]

    def __post_init__(self) -> None:
        """Check the colours."""
        missing = [season for season in SEASONS if season not in self.foliage]
        if missing:
            raise InputError(f"foliage has no colour for {missing[0]}", expected=f"{SEASONS}")
        colours = {"bark": self.bark, **{f"foliage in {k}": v for k, v in self.foliage.items()}}
        for name, colour in colours.items():
            if len(colour) != 3 or not all(0.0 <= part <= 1.0 for part in colour):
                raise InputError(f"{name} is {colour}", expected="red, green and blue from 0 to 1")

    @classmethod
    def of(
        cls,
        skeleton: Skeleton,
        leaves: Leaves,
        *,
        evergreen: bool,
        bark: Colour = BARK,
        foliage: Mapping[str, Colour] = FOLIAGE,
        lobes: tuple[int, float] = (0, 0.0),
        lobed_levels: int = 1,
    ) -> Model:
        """Make the model of a tree, wherever it stands: its foot becomes the origin.

        Parameters
        ----------
        skeleton, leaves
            The tree.
        evergreen, bark, foliage
            As of the class; brown bark and green leaves unless given.
        lobes, lobed_levels
            Of the stems' cross sections, as of `forest.surface.describe`.
        """
        if len(skeleton):
            foot = skeleton.start[0]
            skeleton = replace(skeleton, start=skeleton.start - foot, end=skeleton.end - foot)
            leaves = leaves._replace(position=leaves.position - foot)
        whole = describe(skeleton, leaves, lobes=lobes, lobed_levels=lobed_levels)
        return cls(whole, evergreen, bark, foliage)

    @cached_property
    def lists(self) -> tuple[Elements, ...]:
        """The lists for the kernels, made when they are first asked for.

        Triangles of the three levels of stems and of the leaves, lines of the stems, points of
        the leaves.
        """
        share, levels = np.ones(()), np.ones(LAST_LEVEL + 1)
        whole = self.description.drawn(Fractions(levels, levels, share, share))
        stems = range(LAST_LEVEL + 1)
        return (
            *(self._stems(whole.triangles, level) for level in stems),
            self._leaves(whole.triangles, LEAF_POLYGON_MASS),
            *(self._stems(whole.lines, level) for level in stems),
            self._leaves(whole.points, LEAF_POINT_MASS),
        )

    def _stems(self, primitives: Primitives, level: int) -> Elements:
        corners = primitives.vertices[primitives.item == level]
        stems = self.description.stems[level]
        total = len(stems.internode)
        if corners.shape[1] == 3:
            facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        else:
            facing = corners[:, 1] - corners[:, 0]
        return Elements(
            level,
            STEM_MASS,
            _flat(corners),
            _units(facing),
            _units(stems.centre[:, 1] - stems.centre[:, 0]),
            (np.arange(total + 1) * (len(corners) // max(total, 1))).astype(np.int32),
            stems.centre.mean(axis=1).astype(np.float32),
            np.linalg.norm(stems.side, axis=2).sum(axis=1).astype(np.float32),
        )

    def _leaves(self, primitives: Primitives, mass: int) -> Elements:
        leaves = self.description.leaves
        here = np.flatnonzero(primitives.item == LEAF_ITEM)
        # Blades come outline by outline.
        here = here[np.argsort(primitives.element[here], kind="stable")]
        element = primitives.element[here]
        middle = leaves.position + 0.5 * leaves.length[:, None] * leaves.direction
        return Elements(
            LEAF_ITEM,
            mass,
            _flat(primitives.vertices[here]),
            leaves.normal[element].astype(np.float32),
            np.zeros((len(leaves.shape), 3), np.float32),
            np.searchsorted(element, np.arange(len(leaves.shape) + 1)).astype(np.int32),
            middle.astype(np.float32),
            np.sqrt(leaves.area).astype(np.float32),
        )

    @cached_property
    def sphere(self) -> tuple[NDArray[np.float64], float]:
        """Centre (3,) and radius of a sphere that holds the whole tree, m."""
        parts = [part.vertices.reshape(-1, 3) for part in self.lists]
        corners = np.concatenate(parts).astype(np.float64)
        if not len(corners):
            return np.zeros(3), 0.0
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        return centre, float(np.sqrt(np.max(np.sum((corners - centre) ** 2, axis=1))))


class Instances(NamedTuple):
    """Where trees stand; one entry for each tree.

    Attributes
    ----------
    model : int32 (n,)
        Which of the models.
    place : float64 (n, 3)
        Foot, m.
    scale : float64 (n,)
        Size over the model's.
    """

    model: NDArray[np.int32]
    place: NDArray[np.float64]
    scale: NDArray[np.float64]

    @classmethod
    def of(cls, model: ArrayLike, place: ArrayLike, scale: ArrayLike) -> Instances:
        """Make instances from anything that numpy reads as arrays of these shapes."""
        return cls(
            np.asarray(model, np.int32).reshape(-1),
            np.asarray(place, np.float64).reshape(-1, 3),
            np.asarray(scale, np.float64).reshape(-1),
        )


def _flat(corners: NDArray[np.float64]) -> NDArray[np.float32]:
    return corners.reshape(len(corners), 3 * corners.shape[1]).astype(np.float32)


def _units(vectors: NDArray[np.float64]) -> NDArray[np.float32]:
    """Scale vectors to length 1; those without length stay 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0), np.float32)
