"""Which cells hold the blended surface, by recursion: a twin of `blend.cells`.

A cell is its low corner, in half cells, and its level.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from forest.surface.blend.cells import _BLENDED, Lattice
from forest.surface.blend.field import Blend, joint
from tests.reference.blend import cone

Cell = tuple[tuple[int, int, int], int]


def width(level: int) -> int:
    return 2 << level


def is_near(blend: Blend, lattice: Lattice, cell: Cell, slope: float) -> bool:
    """Whether the surface may pass a cell: the function at its centre against its half diagonal."""
    return abs(float(blend.value(centre(lattice, cell))[0])) <= slope * reach(lattice, cell)


def centre(lattice: Lattice, cell: Cell) -> np.ndarray:
    return lattice.origin + lattice.unit * (np.array(cell[0]) + width(cell[1]) / 2)


def reach(lattice: Lattice, cell: Cell) -> float:
    return math.sqrt(3.0) * lattice.unit * width(cell[1]) / 2


def thinnest(blend: Blend, lattice: Lattice, cell: Cell) -> float:
    """Radius of the thinnest limb whose surface may pass a cell, or whose blend bears on it."""
    x, found = centre(lattice, cell), [math.inf]
    for i in range(len(blend.kernel.cones.low)):
        away, radius, _ = cone(blend.kernel.cones, i, x)
        if abs(away) <= 1.2 * reach(lattice, cell):
            found.append(radius)
    for j, thin in enumerate(blend.kernel.joints.thin):
        value, plain, _ = joint(blend.kernel, j, *x)
        if math.isfinite(plain) and plain - value > _BLENDED * thin:
            found.append(float(thin))
    return min(found)


def eight(cell: Cell) -> list[Cell]:
    (x, y, z), level = cell
    half = width(level - 1)
    return [
        ((x + i * half, y + j * half, z + k * half), level - 1)
        for i, j, k in itertools.product((0, 1), repeat=3)
    ]


def leaves(
    blend: Blend, lattice: Lattice, cell: Cell, in_radius: float, slope: float
) -> list[Cell]:
    """Cut a cell until it is small beside the limbs in it; drop what is far from the surface."""
    if not is_near(blend, lattice, cell, slope):
        return []
    level = cell[1]
    metres = lattice.unit * width(level)
    fits = level < lattice.levels and (
        level == 0 or metres * in_radius <= thinnest(blend, lattice, cell) * (1.0 + 1e-9)
    )
    if fits:
        return [cell]
    return [leaf for part in eight(cell) for leaf in leaves(blend, lattice, part, in_radius, slope)]


def touch(one: Cell, other: Cell) -> bool:
    """Whether two cells have a point in common."""
    return all(
        a <= b + width(other[1]) and b <= a + width(one[1])
        for a, b in zip(one[0], other[0], strict=True)
    )


def parents(lattice: Lattice, cell: Cell) -> set[Cell]:
    """All larger cells that hold a cell, up to the largest that are leaves."""
    corner, level = cell
    found = set()
    for above in range(level + 1, lattice.levels):
        x, y, z = (c // width(above) * width(above) for c in corner)
        found.add(((x, y, z), above))
    return found


def balanced(blend: Blend, lattice: Lattice, found: set[Cell], slope: float) -> set[Cell]:
    """Cut cells until none touches a smaller one that is the parent of a leaf."""
    held = set().union(*(parents(lattice, cell) for cell in found))
    while True:
        large = {cell for cell in found if any(cell[1] > p[1] and touch(cell, p) for p in held)}
        if not large:
            return found
        parts = {
            part for cell in large for part in eight(cell) if is_near(blend, lattice, part, slope)
        }
        held |= set().union(*(parents(lattice, part) for part in parts))
        found = (found - large) | parts
