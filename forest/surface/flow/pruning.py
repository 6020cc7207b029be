"""Pruning: a limb is cut, and leaves the face of a wound (see `healing`)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.blend.field import Blend
from forest.surface.blend.limbs import limbs_of
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

#: Where a limb is looked at for where it comes out of the stem, and halvings after that.
_OUTLOOKS = 200
_HALVINGS = 40


@dataclass(frozen=True)
class Wound:
    """The face that is left where a limb was cut.

    Attributes
    ----------
    middle : float64 (3,)
        Middle of the face, m.
    heading : float64 (3,)
        Unit vector out of the wood, at right angles to the face.
    radius_m : float
        Radius of the face.
    stub_m : float
        How long the limb's rest is, from the stem's axis to the face.
    protrusion_m : float
        How far the middle of the face stands off the stem's surface; 0 for a flush cut, whose
        face is the part of the stem's surface that lies within the limb.
    """

    middle: _Floats
    heading: _Floats
    radius_m: float
    stub_m: float
    protrusion_m: float

    @property
    def flush(self) -> bool:
        """Whether the limb is cut along the stem's surface."""
        return self.protrusion_m <= 0.0


def prune(skeleton: Skeleton, axis: int, *, stub_m: float) -> tuple[Skeleton, Wound]:
    """Cut a limb, and all that it bears, at a distance from the axis that it grows from.

    A cut within the stem is made flush, where the limb comes out of the stem.

    Returns
    -------
    tuple of Skeleton, Wound
        The tree without the limb, and the face that its rest has; the rest itself is part of the
        wound (`WoundedStem`).

    Raises
    ------
    InputError
        If there is no such limb, the cut lies beyond its tip, or the limb within the stem.
    """
    chain = np.flatnonzero(skeleton.axis == axis)
    if len(chain) == 0 or skeleton.parent[chain[0]] < 0:
        raise InputError(
            f"{axis} is no limb", where="axis", expected=f"1 to {int(skeleton.axis.max())}"
        )
    length = np.cumsum(skeleton.length[chain])
    if not 0.0 < stub_m < length[-1]:
        raise InputError(
            f"a stub of {stub_m:g} m", where="stub_m", expected=f"above 0, below {length[-1]:.3g} m"
        )
    rest = _without(skeleton, int(chain[0]))
    stem = Blend.of(limbs_of(rest))
    protrusion = float(stem.value(_along(skeleton, chain, stub_m)[0])[0])
    if protrusion <= 0.0:
        stub_m, protrusion = _comes_out(stem, skeleton, chain, stub_m), 0.0
    middle, heading, radius = _along(skeleton, chain, stub_m)
    return rest, Wound(middle, heading, radius, stub_m, protrusion)


def _along(skeleton: Skeleton, chain: _Ints, way: float) -> tuple[_Floats, _Floats, float]:
    """Give the place, heading and radius of an axis at a distance from its start, m."""
    length = np.cumsum(skeleton.length[chain])
    at = min(int(np.searchsorted(length, way)), len(chain) - 1)
    here = chain[at]
    heading = skeleton.end[here] - skeleton.start[here]
    heading = heading / np.linalg.norm(heading)
    middle = skeleton.end[here] - (length[at] - way) * heading
    return middle, heading, float(skeleton.radius[here])


def _comes_out(stem: Blend, skeleton: Skeleton, chain: _Ints, inside: float) -> float:
    """Find how far along it, from a place within the stem, a limb comes out of the stem, m."""
    length = float(skeleton.length[chain].sum())
    ways = np.linspace(inside, length, _OUTLOOKS)
    off = stem.value(np.array([_along(skeleton, chain, way)[0] for way in ways]))
    if not (off > 0.0).any():
        raise InputError("the limb does not come out of the stem", where="axis")
    first = int(np.argmax(off > 0.0))
    within, outside = float(ways[first - 1]), float(ways[first])
    for _ in range(_HALVINGS):
        middle = 0.5 * (within + outside)
        if stem.value(_along(skeleton, chain, middle)[0])[0] > 0.0:
            outside = middle
        else:
            within = middle
    return outside


def _without(skeleton: Skeleton, first: int) -> Skeleton:
    """Take an internode out of a tree, and all that it bears."""
    gone = np.zeros(len(skeleton), np.bool_)
    gone[first] = True
    for i in range(first + 1, len(skeleton)):
        gone[i] = skeleton.parent[i] >= 0 and gone[skeleton.parent[i]]
    number = np.cumsum(~gone) - 1
    parent = skeleton.parent[~gone]
    return replace(
        skeleton,
        **{
            name: getattr(skeleton, name)[~gone]
            for name in ("start", "end", "radius", "order", "birth_year", "leafy", "serial")
        },
        parent=np.where(parent >= 0, number[parent], -1).astype(np.int32),
        axis=np.unique(skeleton.axis[~gone], return_inverse=True)[1].astype(np.int32),
    )
