"""Geometry of pictures: stems as tubes, twigs as lines, leaves as small cards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.trees.skeleton import Skeleton
from forest.view.looks import look_of

_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Wood:
    """Internodes of many trees, each parent before its children.

    Attributes
    ----------
    start, end : float64 (n, 3)
        Ends, m.
    radius : float64 (n,)
        Radius, m.
    follows : bool (n,)
        Whether an internode stands on the one before it in these arrays, on the same axis.
    bark : float64 (n, 3)
        Colour of the bark.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    radius: NDArray[np.float64]
    follows: NDArray[np.bool_]
    bark: NDArray[np.float64]

    def part(self, chosen: NDArray[np.bool_]) -> Wood:
        """Keep the chosen internodes."""
        before = np.concatenate(([False], chosen[:-1]))
        return Wood(
            self.start[chosen],
            self.end[chosen],
            self.radius[chosen],
            (self.follows & before)[chosen],
            self.bark[chosen],
        )


def gather_wood(skeletons: Sequence[Skeleton]) -> Wood:
    """Put all internodes into one list, axis by axis."""
    parts = []
    for tree in skeletons:
        long = np.flatnonzero(tree.length > 1e-6)  # a tube cannot bear points that coincide
        by_axis = long[np.argsort(tree.axis[long], kind="stable")]
        follows = np.zeros(len(by_axis), np.bool_)
        follows[1:] = (tree.parent[by_axis[1:]] == by_axis[:-1]) & (
            tree.axis[by_axis[1:]] == tree.axis[by_axis[:-1]]
        )
        bark = np.broadcast_to(look_of(tree.species).bark, (len(by_axis), 3))
        parts.append((tree.start[by_axis], tree.end[by_axis], tree.radius[by_axis], follows, bark))
    if not parts:
        return Wood(
            np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty(0, bool), np.empty((0, 3))
        )
    return Wood(*(np.concatenate(column) for column in zip(*parts, strict=True)))


@dataclass(frozen=True)
class Polylines:
    """Wood as polylines in VTK's way: points, and cells as [count, index, index ...]."""

    points: NDArray[np.float64]
    cells: NDArray[np.int64]
    radius: NDArray[np.float64]
    bark: NDArray[np.float64]


def polylines(wood: Wood) -> Polylines:
    """String consecutive internodes together; a line tapers from one internode to the next."""
    first = ~wood.follows
    n_lines = int(first.sum())
    n = len(wood.radius)
    at_end = np.arange(n) + np.cumsum(first)
    at_start = at_end[first] - 1
    source = np.empty(n + n_lines, np.int64)
    source[at_end] = np.arange(n)
    source[at_start] = np.flatnonzero(first)
    points = wood.end[source]
    points[at_start] = wood.start[first]
    count = np.diff(np.append(at_start, n + n_lines))
    cells = np.insert(np.arange(n + n_lines), at_start, count)
    return Polylines(points, cells, wood.radius[source], wood.bark[source])


@dataclass(frozen=True)
class Leaves:
    """Leafy sites of many trees.

    Attributes
    ----------
    place, along : float64 (n, 3)
        Upper end of the internode; from its lower to its upper end, m.
    colour : float64 (n, 3)
        Colour in full light.
    needles : bool (n,)
        Whether the foliage lies along the shoot.
    """

    place: NDArray[np.float64]
    along: NDArray[np.float64]
    colour: NDArray[np.float64]
    needles: NDArray[np.bool_]

    @property
    def area(self) -> NDArray[np.float64]:
        """Area of each card, m2."""
        length, width = self._size()
        return 0.5 * length * width

    def _size(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        shoot = np.maximum(np.linalg.norm(self.along, axis=1), 1e-3)
        return shoot * np.where(self.needles, 1.7, 1.1), shoot * np.where(self.needles, 0.75, 0.9)

    def cards(self, scale: float) -> NDArray[np.float64]:
        """Give the corners (n, 4, 3) of one rhombic card per site, enlarged by `scale`."""
        n = len(self.place)
        chance = np.modf(np.arange(1, n + 1)[:, None] * _GOLDEN * np.array([1.0, 5.0, 13.0]))[0]
        turn = 2.0 * np.pi * chance[:, 0]
        rise = 1.2 * chance[:, 1] - 0.5
        outward = np.column_stack(
            (np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise))
        )
        shoot = self.along / np.maximum(np.linalg.norm(self.along, axis=1, keepdims=True), 1e-9)
        axis = np.where(self.needles[:, None], shoot + 0.35 * outward, outward)
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        spin = np.column_stack((np.cos(3.0 * turn), np.sin(3.0 * turn), 0.6 * chance[:, 2]))
        side = np.cross(axis, spin)
        side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
        length, width = (scale * size[:, None] for size in self._size())
        base = self.place - np.where(self.needles[:, None], 0.6 * axis * length, 0.0)
        middle = base + 0.5 * axis * length
        half = 0.5 * side * width
        return np.stack((base, middle - half, base + axis * length, middle + half), axis=1)


def gather_leaves(skeletons: Sequence[Skeleton], most: int) -> tuple[Leaves, float]:
    """Put all leafy sites into one list, or an even part of them if there are more than `most`.

    Returns
    -------
    leaves : Leaves
    scale : float
        Factor on the cards' size that makes up for the sites left out.
    """
    total = sum(int(tree.leafy.sum()) for tree in skeletons)
    share = min(1.0, most / max(total, 1))
    columns: list[tuple[NDArray[np.float64], ...]] = []
    for tree in skeletons:
        sites = np.flatnonzero(tree.leafy)
        count = np.arange(len(sites) + 1) * share + np.modf(tree.tree_id * _GOLDEN)[0]
        sites = sites[np.diff(np.floor(count)) > 0.0]
        look = look_of(tree.species)
        tint = 0.85 + 0.3 * np.modf(tree.tree_id * _GOLDEN)[0]  # trees differ a little
        hue = np.asarray(look.leaf) * tint
        grain = 0.9 + 0.2 * np.modf(np.arange(len(sites)) * _GOLDEN)[0]
        columns.append(
            (
                tree.end[sites],
                tree.end[sites] - tree.start[sites],
                grain[:, None] * hue,
                np.full(len(sites), look.needles),
            )
        )
    if not columns:
        return Leaves(np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3)), np.empty(0, bool)), 1.0
    leaves = Leaves(*(np.concatenate(column) for column in zip(*columns, strict=True)))
    return leaves, float(np.sqrt(total / max(len(leaves.place), 1)))
