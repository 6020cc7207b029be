"""Fitting a nursery tree to a measured one: turned, stretched to its height, thickened to its dbh.

What is kept is what growth lives on: leaves, the sapwood that serves them, and where they are. What
is changed is what was measured: all lengths by one factor, the wood of all years by another.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.inventory.nursery import Donor

#: The wood of a whole tree is multiplied by this at most; the rest goes to the stem below 1.3 m.
MOST_WOOD = 4.0


def stretched(donor: Donor, ratio: float, azimuth: float) -> dict[str, NDArray[Any]]:
    """Give a donor's metamers, turned about the vertical and with all lengths multiplied.

    Parameters
    ----------
    donor : Donor
    ratio : float
        Height to height.
    azimuth : float
        Turn from x to y, rad.
    """
    metamers = {name: field.copy() for name, field in donor.metamers.items()}
    for name, scale in (("tip", ratio), ("bud", 1.0)):
        metamers[name] = (scale * turned(donor.metamers[name], azimuth)).astype(np.float32)
    metamers["length"] = (ratio * donor.metamers["length"].astype(np.float64)).astype(np.float32)
    return metamers


def turned(vectors: NDArray[np.float32], azimuth: float) -> NDArray[np.float64]:
    """Turn vectors (n, 3) about the vertical, from x to y."""
    c, s = np.cos(azimuth), np.sin(azimuth)
    x, y, z = vectors.astype(np.float64).T
    return np.stack((c * x - s * y, s * x + c * y, z), axis=1)


def thickened(
    pipe: NDArray[np.float32],
    parent: NDArray[np.int32],
    breast: int,
    wanted: float,
    primary: float,
) -> NDArray[np.float32]:
    """Give pipes that make the metamer at 1.3 m as thick as wanted.

    All wood beyond the primary wood is multiplied by one factor, so that a stem that outweighed
    what it bears still does. A factor above `MOST_WOOD`, as for a tree whose tip is near 1.3 m, is
    cut off; what is then missing is laid down as pipes from breast height to the ground.

    Parameters
    ----------
    pipe : float32 (n,)
        d^n of a tree's metamers, m^n.
    parent : int32 (n,)
    breast : int
        Metamer at 1.3 m.
    wanted : float
        d^n that it must have, not below `primary`.
    primary : float
        d^n of a metamer when it is made, where rings come on top of it; else 0.

    Returns
    -------
    float32 (n,)
    """
    old = pipe.astype(np.float64)
    rings = np.maximum(old - primary, 0.0)
    factor = 1.0
    if rings[breast] > 0.0:
        factor = min((wanted - primary) / rings[breast], MOST_WOOD)
    new = np.where(old > primary, primary + factor * rings, old)
    missing = wanted - new[breast]
    i = breast
    while i >= 0:
        new[i] += missing
        i = int(parent[i])
    return new.astype(np.float32)


def aged(birth: NDArray[np.int16], age: int, wanted_age: int, kept: int) -> NDArray[np.int16]:
    """Give metamers the births that a tree of another age would have.

    The last `kept` years stay as they are, since leaves are as old as their metamers; what is older
    is spread over the rest of the tree's life, so that its first metamer was made when it was.

    Parameters
    ----------
    birth : int16 (n,)
        Counted from now (0).
    age, wanted_age : int
        Years of the donor and of the tree.
    kept : int
    """
    years = -birth.astype(np.int64)
    recent = min(kept, age, wanted_age)
    if age > recent:
        spread = (years - recent) * (wanted_age - recent) / (age - recent)
        older = recent + np.rint(spread).astype(np.int64)
        years = np.where(years > recent, older, years)
    return (-np.minimum(years, wanted_age)).astype(np.int16)
