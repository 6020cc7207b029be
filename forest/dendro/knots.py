"""Knots: the wood that branches left in a stem, and what a plane shows of it.

A branch begins at the pith. As the stem thickens it takes in what stood at its surface, so that a
knot is a round body about the branch's first direction: where it crosses the stem's outline of a
year it is as thick as the branch was in that year. It ends at the outline of the last
year in which the branch was on the tree; one that still is goes on past the bark.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.dendro.turns import unit

#: A branch that leaves at less than this sine of its angle to the stem is taken to leave at it.
_LEAST_SINE = 0.2

#: How much farther than the bark a branch that is on the tree is followed, per stem radius.
_OUTSIDE = 0.5

#: Points along each side of a knot's outline.
_POINTS = 24

_FLAT = 1e-6  # a plane counts as square to a branch within this sine


@dataclass(frozen=True)
class Knot:
    """What a plane shows of a branch.

    Attributes
    ----------
    serial : int
        Serial of the branch's first metamer.
    birth_year : int
        Calendar year in which the branch was made.
    last_year : int
        The last year in which it was on the tree, as far as the wood goes.
    alive : bool
        Whether it was on the tree in the year of the wood's last ring.
    outline : float64 (k, 2)
        Closed outline in the plane's coordinates, m.
    """

    serial: int
    birth_year: int
    last_year: int
    alive: bool
    outline: NDArray[np.float64]


class Branches(NamedTuple):
    """The branches that a stem has or had, b of them, over Y years."""

    serial: NDArray[np.int32]  # (b,) of the first metamer
    node: NDArray[np.int64]  # (b,) internode of the stem at whose upper end it stands
    direction: NDArray[np.float64]  # (b, 3) of its first metamer, where the stem stands now
    birth_year: NDArray[np.int64]  # (b,)
    radius: NDArray[np.float64]  # (Y, b) of its first metamer, m; 0 while not on the tree


class Plane(NamedTuple):
    """A plane with coordinates: a point on it, and two unit vectors square to each other."""

    origin: NDArray[np.float64]
    across: NDArray[np.float64]
    up: NDArray[np.float64]

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit vector square to the plane."""
        return np.asarray(np.cross(self.across, self.up))

    def flat(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give points (..., 3) of the plane in its coordinates, (..., 2)."""
        away = points - self.origin
        return np.stack((away @ self.across, away @ self.up), axis=-1)


def knots_in(
    plane: Plane,
    branches: Branches,
    years: NDArray[np.int64],
    nodes: NDArray[np.float64],
    directions: NDArray[np.float64],
    radius: NDArray[np.float64],
) -> tuple[Knot, ...]:
    """Give the knots that a plane shows.

    Parameters
    ----------
    plane : Plane
    branches : Branches
    years : int64 (Y,)
        Calendar years on record.
    nodes, directions : float64 (m, 3)
        Upper ends of the stem's internodes, and their directions.
    radius : float64 (Y, m)
        Radii of the stem's internodes, m.
    """
    node, towards = nodes[branches.node], branches.direction
    sine = np.linalg.norm(np.cross(towards, directions[branches.node]), axis=1)
    # how far along the branch the outline of each year lies; 0 while it is not on the tree
    there = branches.radius > 0.0
    along = np.where(there, radius[:, branches.node], 0.0) / np.maximum(sine, _LEAST_SINE)
    away = (node - plane.origin) @ plane.normal
    slope = towards @ plane.normal
    last = (1.0 + _OUTSIDE) * along.max(axis=0, initial=0.0)
    thick = branches.radius.max(axis=0, initial=0.0)
    below = np.minimum(away, away + slope * last) - thick
    above = np.maximum(away, away + slope * last) + thick
    found = []
    for b in np.flatnonzero(there.any(axis=0) & (below <= 0.0) & (above >= 0.0)):
        of = there[:, b]
        s = np.concatenate(([0.0], along[of, b]))
        r = np.concatenate(([0.0], branches.radius[of, b]))
        if of[-1]:
            s, r = np.append(s, (1.0 + _OUTSIDE) * s[-1]), np.append(r, r[-1])
        for outline in cone_outlines(plane, node[b], towards[b], s, r):
            found.append(
                Knot(
                    int(branches.serial[b]),
                    int(branches.birth_year[b]),
                    int(years[of][-1]),
                    bool(of[-1]),
                    outline,
                )
            )
    return tuple(found)


def cone_outlines(
    plane: Plane,
    apex: NDArray[np.float64],
    direction: NDArray[np.float64],
    along: NDArray[np.float64],
    radius: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    """Cut a row of cones about one axis by a plane.

    The circle at s along the axis meets the plane in two points, at the sides of its chord.

    Parameters
    ----------
    plane : Plane
    apex : float64 (3,)
        Where the axis begins.
    direction : float64 (3,)
        Unit vector along it.
    along, radius : float64 (k,)
        Distances from the apex, not falling, and the radii there; straight between them.

    Returns
    -------
    list of float64 (k, 2)
        Closed outlines in the plane's coordinates; none if the plane misses the cones.
    """
    normal = plane.normal
    side = np.cross(direction, normal)
    sine = float(np.linalg.norm(side))
    if sine < _FLAT:
        sine, side = _FLAT, np.cross(direction, plane.across)
    side = unit(side)
    rise = np.cross(side, direction)
    rise *= 1.0 if rise @ normal >= 0.0 else -1.0
    away, slope = float((apex - plane.origin) @ normal), float(direction @ normal)

    def room(s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Half the chord's depth below the circle's rim; negative where the plane misses it."""
        return np.interp(s, along, radius) * sine - np.abs(away + slope * s)

    ends = along
    if slope != 0.0 and along[0] < -away / slope < along[-1]:
        ends = np.sort(np.append(along, -away / slope))
    ends = np.unique(ends)
    g = room(ends)
    change = np.flatnonzero((g[:-1] < 0.0) != (g[1:] < 0.0))
    roots = ends[change] + np.diff(ends)[change] * g[change] / (g[change] - g[change + 1])
    stops = np.unique(np.concatenate((ends[g >= 0.0], roots)))
    found = []
    for piece in np.split(stops, _gaps(stops, room)):
        if len(piece) < 2:
            continue
        even = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _POINTS))
        s = np.unique(np.concatenate((piece, piece[0] + (piece[-1] - piece[0]) * even)))
        r = np.interp(s, along, radius)
        lift = -(away + slope * s) / sine
        half = np.sqrt(np.maximum(r**2 - lift**2, 0.0))
        middle = apex + s[:, None] * direction + lift[:, None] * rise
        right, left = (middle + sign * half[:, None] * side for sign in (1.0, -1.0))
        end = np.linspace(right[-1], left[-1], _POINTS)[1:-1]
        found.append(plane.flat(np.concatenate((right, end, left[::-1]))))
    return found


def _gaps(stops: NDArray[np.float64], room: object) -> NDArray[np.int64]:
    """Find where, between two stops, the plane leaves the cones and comes back."""
    assert callable(room)
    middle = 0.5 * (stops[1:] + stops[:-1])
    return np.flatnonzero(room(middle) < -1e-12) + 1
