"""The neutral shape of a tree's leaves, beside its `Skeleton`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.species import Species
from forest.trees.skeleton import Skeleton

#: The outlines that a code of `Leaves.shape` stands for. A spray is a shoot's flat row of needles.
LEAF_SHAPES = (
    "oval",
    "triangle",
    "oak_3_lobes",
    "maple_3_lobes",
    "maple_5_lobes",
    "three_leaflets",
    "spray",
)
OVAL, SPRAY = LEAF_SHAPES.index("oval"), LEAF_SHAPES.index("spray")


def _blade(*edge: tuple[float, float]) -> NDArray[np.float64]:
    """Make an outline of one edge: petiole, edge, tip, the edge's mirror image."""
    right = np.array(edge)
    left = right[::-1] * np.array([1.0, -1.0])
    return np.concatenate(([[0.0, 0.0]], right, [[1.0, 0.0]], left))


#: Corners (n, 2) of each outline from the petiole around: shares of the length along the midrib and
#: of the width across it. The petiole sees every corner, so that a fan of triangles fills it.
OUTLINES: tuple[NDArray[np.float64], ...] = (
    _blade((0.3, -0.5), (0.7, -0.4)),
    _blade((0.0, -0.5)),
    _blade((0.35, -0.5), (0.55, -0.22), (0.85, -0.28)),
    _blade((0.15, -0.25), (0.6, -0.5), (0.5, -0.15)),
    _blade((0.15, -0.4), (0.25, -0.25), (0.65, -0.5), (0.55, -0.15)),
    _blade((0.1, -0.3), (0.5, -0.5), (0.35, -0.15), (0.15, -0.05), (0.6, -0.18)),
    _blade((0.5, -0.5)),
)

_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_BLADE_SLENDERNESS = 1.5  # length of a blade over its width
_BLADE_ANGLE = np.radians(55.0)  # between shoot and blade
_SPRAY_ANGLE = np.radians(15.0)
_UP = np.array([0.0, 0.0, 1.0])


class Leaves(NamedTuple):
    """Leaves of one tree, in order of creation.

    Those of parametric trees, which may have millions, are single precision; what all of them share
    (`length`, `width`, `shape`) is held once and cannot be written to.

    Attributes
    ----------
    position : float (m, 3)
        Where the blade begins, m, in the coordinates of the tree's skeleton.
    direction, normal : float (m, 3)
        Unit vectors from the petiole to the tip, and away from the upper face.
    length, width : float64 (m,)
        Size of the blade, m.
    shape : int8 (m,)
        Its outline, an index into `LEAF_SHAPES` and `OUTLINES`.
    stem : int32 (m,)
        Number of the stem that bears it; for a `Skeleton`, of its axis.
    """

    position: NDArray[np.floating]
    direction: NDArray[np.floating]
    normal: NDArray[np.floating]
    length: NDArray[np.float64]
    width: NDArray[np.float64]
    shape: NDArray[np.int8]
    stem: NDArray[np.int32]

    @property
    def area(self) -> NDArray[np.float64]:
        """Area of one face of each leaf, m2."""
        share = np.array([outline_area(outline) for outline in OUTLINES])
        return np.asarray(share[self.shape] * self.length * self.width, dtype=np.float64)


def outline_area(outline: NDArray[np.float64]) -> float:
    """Area within an outline of length and width 1 (the shoelace formula)."""
    x, y = outline.T
    return float(0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))


def no_leaves() -> Leaves:
    """Make the leaves of a bare tree."""
    none = np.empty((0, 3))
    return Leaves(
        none, none, none, np.empty(0), np.empty(0), np.empty(0, np.int8), np.empty(0, np.int32)
    )


def living_sites(skeleton: Skeleton) -> NDArray[np.int64]:
    """Count the leaf-bearing sites of each internode: 0, 1 or 2.

    A skeleton says only whether there is one. A leafy internode that bears nothing has both, its
    terminal and its lateral bud; one that goes on or has branched has the other. A tip may have
    lost one of the two, or a branch: lone trees of 20 years have 0 to 0.7 % fewer sites than
    this, those of the generic species 7 %.
    """
    bears = np.zeros(len(skeleton), np.bool_)
    bears[skeleton.parent[skeleton.parent >= 0]] = True
    return np.where(skeleton.leafy, np.where(bears, 1, 2), 0).astype(np.int64)


def leaves_of(skeleton: Skeleton, species: Species, *, per_site: int = 1) -> Leaves:
    """Give the leaves of a simulated tree: some on each leafy internode.

    A simulated tree knows which of its internodes are leafy, and what area of leaves a site has
    (`leaves.area_m2` of its species). Broadleaves bear oval blades at the upper end of the
    internode, one and a half times as long as wide, a golden angle from one to the next; conifers
    bear sprays of needles along the internode, as long as it, but never wider than long. The upper
    face is turned to the sky as far as the direction allows. What would reach from
    above the ground, the height at which the tree starts, to below it is lifted so far.

    Parameters
    ----------
    skeleton : Skeleton
    species : Species
        Its species; `group` decides between blades and needles.
    per_site : int
        Leaves that share a site's area, 1 or more.

    Returns
    -------
    Leaves
        `per_site` leaves of each site (see `living_sites`), in the skeleton's order; the areas of
        a site's leaves add up to `leaves.area_m2`.

    Raises
    ------
    InputError
        If `per_site` is less than 1.
    """
    if per_site < 1:
        raise InputError(f"per_site is {per_site}", expected="1 or more")
    count = per_site * living_sites(skeleton)
    sites = np.repeat(np.arange(len(skeleton)), count)
    which = np.arange(len(sites)) - np.repeat(np.cumsum(count) - count, count)
    needles = species.group == "conifer"
    shape = SPRAY if needles else OVAL
    lengthwise = skeleton.end[sites] - skeleton.start[sites]
    shoot_length = np.linalg.norm(lengthwise, axis=1)
    heading = np.where(
        shoot_length[:, None] > 1e-9, lengthwise / np.maximum(shoot_length, 1e-9)[:, None], _UP
    )
    turn = (2.0 * per_site * skeleton.serial[sites] + which) * _GOLDEN_ANGLE
    direction = _turned_off(heading, _SPRAY_ANGLE if needles else _BLADE_ANGLE, turn)
    product = species.leaves.area_m2 / (per_site * outline_area(OUTLINES[shape]))
    if needles:
        length = np.maximum(shoot_length, np.sqrt(product))
    else:
        length = np.full(len(sites), np.sqrt(product * _BLADE_SLENDERNESS))
    position = skeleton.start[sites] if needles else skeleton.end[sites]
    direction = _off_the_ground(direction, position[:, 2] - skeleton.start[:1, 2], length)
    return Leaves(
        position=position,
        direction=direction,
        normal=_towards_sky(direction),
        length=length,
        width=product / length,
        shape=np.full(len(sites), shape, np.int8),
        stem=skeleton.axis[sites],
    )


def _turned_off(
    heading: NDArray[np.float64], angle: float, turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Give directions at `angle` from the headings, turned by `turn` around them."""
    side = _unit_or(np.cross(heading, _UP), np.array([1.0, 0.0, 0.0]))
    across = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * np.cross(heading, side)
    return np.asarray(np.cos(angle) * heading + np.sin(angle) * across, dtype=np.float64)


def _off_the_ground(
    direction: NDArray[np.float64], height: NDArray[np.float64], length: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Lift directions in which a leaf that is above the ground would end below it, just so far."""
    least = np.maximum(-height / length, -1.0)
    low = np.flatnonzero((height >= 0.0) & (direction[:, 2] < least))
    lifted = direction.copy()
    level = _unit_or(direction[low] * (1.0, 1.0, 0.0), np.array([1.0, 0.0, 0.0]))
    lifted[low] = np.sqrt(1.0 - least[low] ** 2)[:, None] * level
    lifted[low, 2] = least[low]
    return lifted


def _towards_sky(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give unit vectors across the directions, as near to the vertical as can be."""
    rise = direction[:, 2:]
    level = np.cross(np.array([0.0, 1.0, 0.0]), direction)  # for those that point straight up
    return _unit_or(_UP - rise * direction, _unit_or(level, _UP))


def _unit_or(vector: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale vectors to length 1; those that have none become `other`."""
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    return np.asarray(
        np.where(length > 1e-9, vector / np.maximum(length, 1e-9), other), dtype=np.float64
    )
