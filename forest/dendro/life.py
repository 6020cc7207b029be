"""A stem's yearly surfaces: the solid of Hart & Baker 2003, section 6, that can be cut anywhere.

The wood of each internode moves with it when the tree bends: all its rings lie about the axis
that it has now.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from forest.dendro.disc import Disc, centres, rays
from forest.dendro.knots import Branches, Knot, Plane, knots_in
from forest.dendro.stems import StemRings
from forest.dendro.turns import UP, shortest_turn, unit
from forest.errors import InputError


@dataclass(frozen=True)
class StemLife:
    """The stem of a sample tree: m internodes from the base up, and their Y years on record.

    Attributes
    ----------
    tree_id : int
    species : str
    years : int64 (Y,)
        Calendar years on record, up to the one in which the stem is looked at.
    start, end : float64 (m, 3)
        Ends of the internodes in the last of these years, m, in the plot's coordinates.
    birth_year : int64 (m,)
        Calendar year in which each was made.
    radius : float64 (Y, m)
        Under bark at the end of each year, m; 0 before an internode was made.
    eccentricity, thick_side_deg : float64 (Y, m)
        Of each year's ring; the azimuth once the internode is upright, 0 for a round ring.
    branches : Branches
        What has branched off.
    bark_factor : float
        Double bark thickness per diameter over bark.
    """

    tree_id: int
    species: str
    years: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    birth_year: NDArray[np.int64]
    radius: NDArray[np.float64]
    eccentricity: NDArray[np.float64]
    thick_side_deg: NDArray[np.float64]
    branches: Branches
    bark_factor: float

    @cached_property
    def length(self) -> NDArray[np.float64]:
        """Length of each internode, m, (m,)."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1), np.float64)

    @cached_property
    def direction(self) -> NDArray[np.float64]:
        """Unit vector along each internode, (m, 3)."""
        return unit(self.end - self.start)

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """Matrix that leans each internode from the vertical to where it points, (m, 3, 3)."""
        return shortest_turn(UP, self.direction)

    @cached_property
    def dated(self) -> NDArray[np.bool_]:
        """Which radii end a ring whose own width is known, (Y, m).

        The wood that an internode had when it came on record has no rings, unless it was made in
        that very year.
        """
        there = self.radius > 0.0
        before = np.zeros_like(there)
        before[1:] = there[:-1]
        return np.asarray(there & (before | (self.birth_year == self.years[:, None])))

    @cached_property
    def widths(self) -> NDArray[np.float64]:
        """Mean width of each year's ring, m, (Y, m); 0 for wood without rings."""
        return np.where(self.dated, np.diff(self.radius, axis=0, prepend=0.0), 0.0)

    @cached_property
    def centres(self) -> NDArray[np.float64]:
        """Centre of each year's outline in its internode's plane, m from the pith, (Y, m, 2)."""
        return centres(self.widths, self.eccentricity, self.thick_side_deg)

    @property
    def height_m(self) -> float:
        """Greatest height that the stem reaches above its base."""
        return float((self.end[:, 2] - self.start[0, 2]).max())

    def internode_at(self, height_m: float) -> int:
        """Find the internode in which the stem first reaches a height above its base.

        Raises
        ------
        InputError
            If the stem is not so high, or the height is below the ground or no number.
        """
        if not 0.0 <= height_m <= self.height_m:
            raise InputError(
                f"tree {self.tree_id} has no stem at {height_m:g} m in {self.years[-1]}",
                where="height",
                expected=f"0 to {self.height_m:.2f} m",
            )
        reach = np.maximum.accumulate(self.end[:, 2] - self.start[0, 2])
        return int(np.searchsorted(reach, height_m))

    def rings(self, height_m: float) -> StemRings:
        """Give the rings at a height; as `/rings` has them, if the tree was always on record."""
        i = self.internode_at(height_m)
        dated = self.dated[:, i]
        if not dated.any():
            raise InputError(
                f"tree {self.tree_id} is on record from {self.years[0]} to {self.years[-1]} only, "
                f"and has no whole ring of its own at {height_m:g} m",
                where="height",
                expected="a height whose rings the table rings has",
            )
        years = self.years[dated]
        return StemRings(
            tree_id=self.tree_id,
            species=self.species,
            stem_height_m=height_m,
            year=years,
            cambial_age=years - self.birth_year[i] + 1,
            width_mm=1000.0 * self.widths[dated, i],
            eccentricity=self.eccentricity[dated, i],
            thick_side_deg=self.thick_side_deg[dated, i],
            undated_mm=1000.0 * float(self.radius[-1, i] - self.widths[:, i].sum()),
        )

    def disc(self, height_m: float, rings: StemRings | None = None) -> Disc:
        """Cut a disc square to the stem.

        Parameters
        ----------
        height_m : float
            Height of its pith above the stem's base.
        rings : StemRings, optional
            Its rings, if they are known from elsewhere.
        """
        stem = self.rings(height_m) if rings is None else rings
        bare = Disc.of(stem, self.bark_factor)
        return Disc.of(stem, self.bark_factor, self._knots(bare, height_m))

    def _knots(self, disc: Disc, height_m: float) -> tuple[Knot, ...]:
        """Give the knots in a disc's plane, ending where its wood does."""
        i = self.internode_at(height_m)
        across, up, _ = self.turn[i].T
        share = (height_m - (self.start[i, 2] - self.start[0, 2])) / (
            self.end[i, 2] - self.start[i, 2]
        )
        plane = Plane(self.start[i] + share * (self.end[i] - self.start[i]), across, up)
        kept = []
        for knot in self.knots_in(plane):
            x, y = knot.outline.T
            wood = rays(disc.radii[-1:], disc.centres[-1:], np.arctan2(y, x))[0]
            reach = np.hypot(x, y)
            inward = np.minimum(1.0, wood / np.maximum(reach, 1e-12))[:, None]
            kept.append(
                Knot(
                    knot.serial,
                    knot.birth_year,
                    knot.last_year,
                    knot.alive,
                    knot.outline * inward,
                )
            )
        return tuple(kept)

    def knots_in(self, plane: Plane) -> tuple[Knot, ...]:
        """Give the knots that a plane shows."""
        return knots_in(plane, self.branches, self.years, self.end, self.direction, self.radius)

    def ring_volumes(self) -> NDArray[np.float64]:
        """Integrate each year's ring over the stem, m3, (Y,): sleeves of its internodes."""
        inner = self.radius - self.widths
        sleeves = np.where(self.dated, self.radius**2 - inner**2, 0.0)
        return np.asarray(np.pi * (sleeves @ self.length), np.float64)

    def undated_volume(self) -> float:
        """Integrate the wood without rings of its own over the stem, m3."""
        core = self.radius[-1] - self.widths.sum(axis=0)
        return float(np.pi * (core**2 @ self.length))
