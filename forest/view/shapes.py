"""Geometry of pictures: stems as tubes, twigs as lines, leaves as small cards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.trees.skeleton import Skeleton
from forest.view.looks import look_of

_GOLDEN = 0.6180339887498949

# Sizes of cards, for an internode of length 1.
_LEAF_LENGTH, _LEAF_AREA = 1.1, 0.495
_BRUSH_LENGTH, _BRUSH_AREA = 2.2, 0.8  # length of a site's only blade; area of all of them
_BLADES = (2, 14)  # least and most that stand for the needles of a site
_TWIG = np.array([0.38, 0.29, 0.22])  # colour of the thinnest wood, whatever its species
_OLD_M = 0.02  # radius from which wood has its species' bark
_SHOOT = 0.8  # brightness of a shoot among its needles, of theirs
_SLANT = np.radians(32.0)  # between shoot and needle


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
        look = look_of(tree.species)
        old = np.clip(tree.radius[by_axis, None] / _OLD_M, 0.0, 1.0)
        bark = old * np.array(look.bark) + (1.0 - old) * _TWIG
        if look.needles:  # which hide the shoot that bears them
            bark = np.where(tree.leafy[by_axis, None], _SHOOT * np.array(look.leaf), bark)
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
        Whether the foliage stands along the shoot, as needles do.
    blades : int
        Cards that stand for the needles of a site; the more, the finer they are.
    """

    place: NDArray[np.float64]
    along: NDArray[np.float64]
    colour: NDArray[np.float64]
    needles: NDArray[np.bool_]
    blades: int

    @property
    def area(self) -> NDArray[np.float64]:
        """Area of all cards of a site, m2."""
        return np.asarray(np.where(self.needles, _BRUSH_AREA, _LEAF_AREA) * self._shoot() ** 2)

    def _shoot(self) -> NDArray[np.float64]:
        return np.asarray(np.maximum(np.linalg.norm(self.along, axis=1), 1e-3))

    def cards(self, scale: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Give rhombic cards enlarged by `scale`: their corners (m, 4, 3), and the site of each.

        A broad-leaved site has one card of any direction at the internode's end. One with needles
        has `blades` narrow ones, around the internode and slanting forwards like a bottle brush.
        """
        count = np.where(self.needles, self.blades, 1)
        site = np.repeat(np.arange(len(count)), count)
        nth = np.arange(len(site)) - np.repeat(np.cumsum(count) - count, count)
        seed = (site + 1.0)[:, None] * _GOLDEN * np.array([1.0, 5.0, 13.0])
        chance = np.modf(seed + nth[:, None] * _GOLDEN * np.array([1.0, 1.0, 0.0]))[0]
        turn = 2.0 * np.pi * chance[:, 0]
        needle, shoot = self.needles[site], self._shoot()[site]
        heading = self.along[site] / shoot[:, None]
        axis = np.where(
            needle[:, None], _slanting(heading, turn), _any_way(turn, 1.2 * chance[:, 1] - 0.5)
        )
        spin = np.column_stack((np.cos(3.0 * turn), np.sin(3.0 * turn), 0.6 * chance[:, 2]))
        side = np.cross(axis, spin)
        side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
        brush = _BRUSH_LENGTH / np.sqrt(self.blades)
        length = scale * shoot * np.where(needle, brush, _LEAF_LENGTH)
        width = (
            scale
            * shoot
            * np.where(
                needle, 2.0 * _BRUSH_AREA / (self.blades * brush), 2.0 * _LEAF_AREA / _LEAF_LENGTH
            )
        )
        back = np.where(needle, 1.0 - (nth + 0.5) / self.blades, 0.0)
        base = self.place[site] - back[:, None] * self.along[site]
        tip = base + length[:, None] * axis
        middle, half = 0.5 * (base + tip), 0.5 * width[:, None] * side
        return np.stack((base, middle - half, tip, middle + half), axis=1), site


def _any_way(turn: NDArray[np.float64], rise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give unit vectors of these azimuths and rises."""
    level = np.cos(rise)
    return np.column_stack((np.cos(turn) * level, np.sin(turn) * level, np.sin(rise)))


def _slanting(heading: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give unit vectors that slant away from unit vectors, turned so far around them."""
    other = np.where(np.abs(heading[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    right = np.cross(heading, other)
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-9)
    up = np.cross(right, heading)
    around = np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up
    return np.asarray(np.cos(_SLANT) * heading + np.sin(_SLANT) * around)


def gather_leaves(skeletons: Sequence[Skeleton], most: int) -> tuple[Leaves, float]:
    """Put all leafy sites into one list, or an even part if they need more than `most` cards.

    Returns
    -------
    leaves : Leaves
    scale : float
        Factor on the cards' size that makes up for the sites left out.
    """
    sites_of = [int(tree.leafy.sum()) for tree in skeletons]
    total = sum(sites_of)
    needles = sum(
        n for n, tree in zip(sites_of, skeletons, strict=True) if look_of(tree.species).needles
    )
    blades = int(np.clip((most - total + needles) // max(needles, 1), *_BLADES))
    share = min(1.0, most / max(total + (blades - 1) * needles, 1))
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
        none = np.empty((0, 3))
        return Leaves(none, none, none, np.empty(0, bool), blades), 1.0
    place, along, colour, needle = (np.concatenate(column) for column in zip(*columns, strict=True))
    leaves = Leaves(place, along, colour, needle.astype(np.bool_), blades)
    return leaves, float(np.sqrt(total / max(len(place), 1)))
