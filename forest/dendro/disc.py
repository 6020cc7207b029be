"""A disc cut out of a stem: its rings as closed outlines, bark, and the knots that it shows.

The plane of a disc stands square to the stem. Its coordinates are metres from the pith, laid flat
by the shortest turn, so that x and y point where they do on the plot. The outlines are those that
increment cores are taken from (`forest.dendro.cores`): circles of the mean radius whose centres
move towards the thick sides. A ring is w (1 + e) wide on its thick side, w (1 - e) opposite, and
has the area that its mean width w gives it, so that basal area and volume agree with the rings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.dendro.knots import Knot
from forest.dendro.stems import StemRings

#: Corners of an outline; the first lies in the direction of x, the others follow towards y.
CORNERS = 360


@dataclass(frozen=True)
class Disc:
    """A disc of a stem at the end of its last ring's year. All lengths are in m.

    Attributes
    ----------
    tree_id : int
    species : str
    height_m : float
        Height above the ground at which the disc's pith lies.
    years : int64 (n,)
        Calendar years of the rings, innermost first, none left out.
    cambial_ages : int64 (n,)
        Rings from the pith, each included.
    ring_widths : float64 (n,)
        Mean widths; 0 for a missing ring.
    eccentricity : float64 (n,)
        0 to 1; the width goes as 1 + eccentricity * cos(azimuth - thick side).
    thick_side_deg : float64 (n,)
        Azimuth of the thick side, degrees from x towards y; 0 for a round ring.
    bark_factor : float
        Double bark thickness per diameter over bark.
    undated_radius : float
        Radius of the wood inside the innermost ring, grown before the tree was on record.
    knots : tuple of Knot
        Branches that the disc passes; none where the tree's branches are not on record.
    """

    tree_id: int
    species: str
    height_m: float
    years: NDArray[np.int64]
    cambial_ages: NDArray[np.int64]
    ring_widths: NDArray[np.float64]
    eccentricity: NDArray[np.float64]
    thick_side_deg: NDArray[np.float64]
    bark_factor: float
    undated_radius: float = 0.0
    knots: tuple[Knot, ...] = ()

    @classmethod
    def of(cls, stem: StemRings, bark_factor: float, knots: tuple[Knot, ...] = ()) -> Disc:
        """Make a disc of the rings of a stem at a height."""
        return cls(
            tree_id=stem.tree_id,
            species=stem.species,
            height_m=stem.stem_height_m,
            years=stem.year,
            cambial_ages=stem.cambial_age,
            ring_widths=stem.width_mm / 1000.0,
            eccentricity=stem.eccentricity,
            thick_side_deg=stem.thick_side_deg,
            bark_factor=bark_factor,
            undated_radius=stem.undated_mm / 1000.0,
            knots=knots,
        )

    @property
    def pith(self) -> NDArray[np.float64]:
        """Place of the pith, (2,): the origin."""
        return np.zeros(2)

    @cached_property
    def radii(self) -> NDArray[np.float64]:
        """Mean radius at the end of each year, (n,)."""
        return np.asarray(self.undated_radius + np.cumsum(self.ring_widths), np.float64)

    @cached_property
    def centres(self) -> NDArray[np.float64]:
        """Centre of the outline of each year, (n, 2)."""
        return centres(self.ring_widths, self.eccentricity, self.thick_side_deg)

    @property
    def radius(self) -> float:
        """Mean radius under bark."""
        return float(self.radii[-1])

    @property
    def bark_thickness(self) -> float:
        """Thickness of the bark."""
        return self.radius * self.bark_factor / (1.0 - self.bark_factor)

    @property
    def ring_areas(self) -> NDArray[np.float64]:
        """Area of each ring, m2, (n,)."""
        inner = self.radii - self.ring_widths
        return np.asarray(np.pi * self.ring_widths * (self.radii + inner), np.float64)

    @property
    def area(self) -> float:
        """Area under bark, m2."""
        return float(np.pi * self.radius**2)

    @cached_property
    def outlines(self) -> tuple[NDArray[np.float64], ...]:
        """Outline of the wood at the end of each year, arrays of (`CORNERS`, 2).

        Corner j lies at the azimuth j * 360 / `CORNERS` degrees from the pith; the last is not the
        first again. `shapely.Polygon(outline)` takes them as they are.
        """
        return tuple(outlines(self.radii, self.centres))

    @property
    def undated_outline(self) -> NDArray[np.float64]:
        """Outline of the wood inside the innermost ring, (`CORNERS`, 2); all pith if none."""
        return next(iter(outlines(np.array([self.undated_radius]), np.zeros((1, 2)))))

    @property
    def bark_outline(self) -> NDArray[np.float64]:
        """Outline over bark, (`CORNERS`, 2)."""
        over_bark = np.array([self.radius + self.bark_thickness])
        return next(iter(outlines(over_bark, self.centres[-1:])))

    def widths_at(self, azimuth_deg: float) -> NDArray[np.float64]:
        """Measure the rings from the pith to the bark along an azimuth.

        Parameters
        ----------
        azimuth_deg : float
            Degrees from x towards y.

        Returns
        -------
        float64 (n,)
            Widths, m: what a core through the pith holds.
        """
        reach = np.concatenate(
            (
                [self.undated_radius],
                rays(self.radii, self.centres, np.radians([azimuth_deg]))[:, 0],
            )
        )
        return np.asarray(np.maximum(np.diff(reach), 0.0))


def centres(widths: ArrayLike, eccentricity: ArrayLike, side_deg: ArrayLike) -> NDArray[np.float64]:
    """Add up how far each ring moves the centre of the outline, (n, 2) or (n, ..., 2)."""
    shift = np.asarray(widths, np.float64) * np.asarray(eccentricity, np.float64)
    side = np.radians(np.asarray(side_deg, np.float64))
    towards = np.stack((np.cos(side), np.sin(side)), axis=-1)
    return np.asarray(np.cumsum(shift[..., None] * towards, axis=0))


def rays(
    radii: NDArray[np.float64], centre: NDArray[np.float64], azimuth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Give how far n circles that hold the pith reach from it along k azimuths (rad), (n, k)."""
    direction = np.stack((np.cos(azimuth), np.sin(azimuth)))
    along = centre @ direction
    across = centre @ np.stack((-direction[1], direction[0]))
    return np.asarray(along + np.sqrt(np.maximum(radii[:, None] ** 2 - across**2, 0.0)))


def outlines(
    radii: NDArray[np.float64], centre: NDArray[np.float64], corners: int = CORNERS
) -> NDArray[np.float64]:
    """Give n outlines polar about the pith, (n, corners, 2)."""
    azimuth = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    reach = rays(radii, centre, azimuth)
    direction = np.stack((np.cos(azimuth), np.sin(azimuth)), axis=1)
    return np.asarray(reach[:, :, None] * direction)
