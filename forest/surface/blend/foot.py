"""The foot of a tree: how roots widen it towards the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.blend.cones import FLARE
from forest.trees.skeleton import Skeleton

#: Thinner stems have no root flare unless told: radius at the ground, m.
THINNEST_FLARED_M = 0.05
_STEEP = 0.7  # cosine to the vertical; what lies down has no flare


@dataclass(frozen=True)
class Flare:
    """Root flare: the radius grows towards the ground, most along a few buttresses.

    At the height z the radius is greater by W (1 - z/H)^3 (1 - D (1 - cos(n a)) / 2), a the
    azimuth around the stem: it leaves the stem without an edge at H and slopes most at the ground.

    Attributes
    ----------
    height : float
        H, in radii of the stem at the ground.
    widening : float
        W, in radii.
    lobes : int
        n: the number of buttresses.
    depth : float
        D, 0 (round) to 1 (nothing is added between them).
    azimuth_deg : float
        Of the first buttress.
    """

    height: float = 3.0
    widening: float = 0.5
    lobes: int = 5
    depth: float = 0.6
    azimuth_deg: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what is no flare."""
        for name, low, high in (
            ("height", 0.1, 50.0),
            ("widening", 0.0, 5.0),
            ("lobes", 0, 24),
            ("depth", 0.0, 1.0),
        ):
            if not low <= getattr(self, name) <= high:
                raise InputError(
                    f"{getattr(self, name)!r} is out of range",
                    where=f"flare.{name}",
                    expected=f"{low:g} to {high:g}",
                )

    def columns(self, skeleton: Skeleton) -> NDArray[np.float64]:
        """Give the flare of each axis, float64 (axes, FLARE): of axes that rise from the ground."""
        found = np.zeros((int(skeleton.axis.max()) + 1, FLARE))
        way = skeleton.end - skeleton.start
        rises = way[:, 2] > _STEEP * np.linalg.norm(way, axis=1)
        for i in np.flatnonzero((skeleton.parent < 0) & rises):
            r = float(skeleton.radius[i])
            phase = -self.lobes * np.deg2rad(self.azimuth_deg)
            found[skeleton.axis[i]] = (
                self.height * r,
                self.widening * r,
                self.lobes,
                self.depth,
                phase,
            )
        return found


def usual_flare(skeleton: Skeleton) -> Flare | None:
    """Give the flare of a tree of this size: none for saplings."""
    base = skeleton.radius[skeleton.parent < 0].max(initial=0.0)
    return Flare() if base >= THINNEST_FLARED_M else None
