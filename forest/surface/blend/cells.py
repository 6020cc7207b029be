"""Sparse cells around a surface: small at thin limbs, large on the trunk.

Cells are the leaves of octrees of which only those near the surface are kept. A cell of level l is
`cell_m * 2^l` wide; its corners have integer coordinates in units of `cell_m / 2`, multiples of
2^(l+1), so that its centre has integer coordinates too. Neighbours differ by one level at most.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.errors import InputError
from forest.surface.blend.cones import Cones
from forest.surface.blend.field import Blend, cone, joint, value
from forest.surface.blend.tree_of_boxes import visit

_Keys = NDArray[np.int64]

#: A cell is at most this part of the radius of a limb whose surface may pass it.
CELLS_IN_RADIUS = 4.0
#: The greatest slope of the field that cells reckon with; raised where the mesh is not closed.
SLOPE = 1.3
#: Where a blend moves the surface by this part of the thinner limb's radius, cells suit that one.
_BLENDED = 0.05
#: Bytes that a cell takes while its surface is made.
BYTES_PER_CELL = 700
_CHUNKS = 64
_BITS = 21
_MASK = (1 << _BITS) - 1
_LARGEST_LEVEL = 6
_PERCENT = 0.9  # of the free memory that may be used
_MOST_CELLS = 40e6  # some ten minutes


def pack(grid: NDArray[np.int64]) -> _Keys:
    """Name lattice points (n, 3) by one number each."""
    return np.asarray((grid[:, 0] << (2 * _BITS)) | (grid[:, 1] << _BITS) | grid[:, 2], np.int64)


def unpack(keys: _Keys) -> NDArray[np.int64]:
    """Give back the coordinates (n, 3) of lattice points."""
    parts = (keys >> (2 * _BITS), (keys >> _BITS) & _MASK, keys & _MASK)
    return np.column_stack(parts)


@dataclass(frozen=True)
class Lattice:
    """Where lattice points lie.

    Attributes
    ----------
    origin : float64 (3,)
        Place of the point (0, 0, 0), m.
    unit : float
        Half the width of the smallest cell, m.
    levels : int
        Number of sizes of cells.
    """

    origin: NDArray[np.float64]
    unit: float
    levels: int

    def places(self, grid: NDArray[np.int64]) -> NDArray[np.float64]:
        """Give places (n, 3) of lattice points, m."""
        return np.asarray(self.origin + self.unit * grid, np.float64)


def lattice_of(cones: Cones, cell_m: float, in_radius: float = CELLS_IN_RADIUS) -> Lattice:
    """Lay a lattice around all cones; the lowest ground lies within a layer of cells.

    Raises
    ------
    InputError
        If the tree is more cells across than can be numbered.
    """
    thick = np.maximum(cones.low, cones.high)
    wide = (thick + cones.widened[cones.axis] + cones.flare[cones.axis, 1])[:, None]
    low = np.min(np.minimum(cones.start, cones.end) - wide, axis=0)
    high = np.max(np.maximum(cones.start, cones.end) + wide, axis=0)
    level = int(np.floor(np.log2(max(thick.max() / (in_radius * cell_m), 1.0))))
    level = min(level, _LARGEST_LEVEL)
    across = cell_m * 2 ** (level + 1)
    unit = 0.5 * cell_m
    if np.max(high - low + 8 * across) / unit >= 2**_BITS - 2:
        raise InputError(
            f"a cell of {cell_m:g} m is too small for a tree {np.max(high - low):.3g} m across",
            where="cell_m",
            expected=f"at least {np.max(high - low) / 2**19:.2g} m",
        )
    return Lattice(low - 2.37 * across, unit, level + 1)


def bytes_needed(cones: Cones, cell_m: float, in_radius: float = CELLS_IN_RADIUS) -> float:
    """Estimate the memory in bytes that the surface takes while it is made."""
    radius = 0.5 * (cones.low + cones.high)
    size = cell_m * 2 ** np.floor(np.log2(np.maximum(radius / (in_radius * cell_m), 1.0)))
    length = np.linalg.norm(cones.end - cones.start, axis=1)
    area = 2.0 * np.pi * radius * (length + radius)
    return float(BYTES_PER_CELL * np.sum(1.7 * area / size**2))


def free_memory() -> float:
    """Memory that may still be taken, bytes."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * float(line.split()[1])
    except OSError:
        pass
    return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))


def check_memory(cones: Cones, cell_m: float, in_radius: float = CELLS_IN_RADIUS) -> None:
    """Refuse cells so small that the surface would take hours, or more than the free memory."""
    need, free = bytes_needed(cones, cell_m, in_radius), _PERCENT * free_memory()
    cells = need / BYTES_PER_CELL
    if cells > _MOST_CELLS:
        raise InputError(
            f"the surface would take {cells / 1e6:.0f} million cells of {cell_m:g} m",
            where="cell_m",
            expected=f"cells of about {cell_m * np.sqrt(cells / _MOST_CELLS):.2g} m or more",
        )
    if need > free:
        enough = cell_m * np.sqrt(need / free)
        raise InputError(
            f"cells of {cell_m:g} m would take {need / 2**30:.3g} GiB of memory, "
            f"{free / 2**30:.3g} GiB are free",
            where="cell_m",
            expected=f"cells of about {enough:.2g} m or more",
        )


@njit
def _thinnest(field: Any, x: Any, y: Any, z: Any, reach: Any) -> Any:
    """Radius of the thinnest limb whose own surface may pass within `reach`; inf for none."""
    best = np.inf
    node = np.int64(1)
    while node > 0:
        first, last, node = visit(field.boxes, node, x, y, z, reach)
        for k in range(first, last):
            away, radius, _, _, _, _ = cone(field.cones, field.boxes.item[k], x, y, z)
            if abs(away) <= reach:
                best = min(best, radius)
    return best


@njit
def _thinnest_blended(field: Any, x: Any, y: Any, z: Any) -> Any:
    """Radius of the thinnest limb whose blend bears on a point; inf for none."""
    joints = field.joints
    best = np.inf
    node = np.int64(1)
    while node > 0:
        first, last, node = visit(field.places, node, x, y, z, 0.0)
        for k in range(first, last):
            place = field.places.item[k]
            for j in range(joints.place[place], joints.place[place + 1]):
                if joints.thin[j] < best:
                    blended, plain, _ = joint(field, j, x, y, z)
                    if plain - blended > _BLENDED * joints.thin[j]:
                        best = joints.thin[j]
    return best


@driver
def _judge(
    first: Any, step: Any, field: Any, centre: Any, reach: Any, slope: Any, near: Any, thin: Any
) -> None:
    """Tell which cells the surface may pass, and, if asked, how thin the thinnest limb there is."""
    for c in range(first, _CHUNKS, step):
        hint = np.int64(0)
        for i in range(len(centre) * c // _CHUNKS, len(centre) * (c + 1) // _CHUNKS):
            p = centre[i]
            f, hint = value(field, p[0], p[1], p[2], hint)
            near[i] = abs(f) <= slope * reach
            if near[i] and len(thin):
                thin[i] = _thinnest(field, p[0], p[1], p[2], 1.2 * reach)
                thin[i] = min(thin[i], _thinnest_blended(field, p[0], p[1], p[2]))


_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.int64)


class _Octree:
    """Keeps the leaves of each level while they are found; keys are those of their low corners."""

    def __init__(self, blend: Blend, lattice: Lattice, in_radius: float, slope: float) -> None:
        self.blend, self.lattice, self.in_radius, self.slope = blend, lattice, in_radius, slope
        self.leaves: list[_Keys] = [np.zeros(0, np.int64) for _ in range(lattice.levels)]

    def judge(self, keys: _Keys, level: int) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Tell which cells matter, and the thinnest limb in each but the smallest."""
        centre = self.lattice.places(unpack(keys) + (1 << level))
        near = np.zeros(len(keys), np.bool_)
        thin = np.full(len(keys) if level else 0, np.inf)  # the smallest cells are not cut
        reach = np.sqrt(3.0) * self.lattice.unit * (1 << level)
        in_threads(_judge, self.blend.kernel, centre, reach, self.slope, near, thin)
        return near, thin

    def split(self, keys: _Keys, level: int) -> _Keys:
        """Give the eight children of each cell."""
        grid = unpack(keys)[:, None, :] + _CORNERS[None] * (1 << level)
        return pack(grid.reshape(-1, 3))

    def refine(self, keys: _Keys, level: int) -> None:
        """Sort cells of a level into leaves and those that are cut further."""
        cell = 2.0 * self.lattice.unit
        while len(keys):
            near, thin = self.judge(keys, level)
            keys = keys[near]
            if level >= self.lattice.levels:
                cut = np.ones(len(keys), np.bool_)
            elif level == 0:
                self.leaves[0] = np.union1d(self.leaves[0], keys)
                break
            else:
                cut = cell * (1 << level) * self.in_radius > thin[near] * (1.0 + 1e-9)
                self.leaves[level] = np.union1d(self.leaves[level], keys[~cut])
            keys = self.split(keys[cut], level)
            level -= 1

    def touched(self, grid: NDArray[np.int64], size: int, level: int) -> NDArray[np.bool_]:
        """Tell which leaves of a level hold one of, or touch, smaller cells of width `size`."""
        wide = 1 << (level + 1)
        low, high = (grid - size) // wide * wide, (grid + size) // wide * wide
        leaves = self.leaves[level]
        hit = np.zeros(len(leaves), np.bool_)
        for upward in _CORNERS if len(leaves) else ():
            keys = pack(np.where(upward, high, low))
            at = np.minimum(np.searchsorted(leaves, keys), len(leaves) - 1)
            hit[at[leaves[at] == keys]] = True
        return hit

    def balance(self) -> None:
        """Cut cells until none touches one that is less than half as wide."""
        held = np.zeros(0, np.int64)  # cells of the level, with those that were cut
        for level in range(self.lattice.levels - 2):
            held = np.union1d(held, self.leaves[level])
            size = 1 << (level + 2)  # of a parent, in units
            parents = np.unique(pack(unpack(held) // size * size))
            grid = unpack(parents)
            for upper in range(self.lattice.levels - 1, level + 1, -1):
                hit = self.touched(grid, size, upper)
                children = self.split(self.leaves[upper][hit], upper)
                self.leaves[upper] = self.leaves[upper][~hit]
                near, _ = self.judge(children, upper - 1)
                self.leaves[upper - 1] = np.union1d(self.leaves[upper - 1], children[near])
            held = parents


def _coarse(cones: Cones, lattice: Lattice) -> _Keys:
    """Name the coarse cells, one level above the leaves, that cones come near."""
    size = lattice.unit * 2 ** (lattice.levels + 1)
    found = []
    length = np.linalg.norm(cones.end - cones.start, axis=1)
    thick = np.maximum(cones.low, cones.high)
    wide = 1.5 * thick + cones.widened[cones.axis] + cones.flare[cones.axis, 1]
    for i in range(len(length)):
        pieces = max(int(np.ceil(length[i] / size)), 1)
        t = np.linspace(0.0, 1.0, pieces + 1)[:, None]
        point = cones.start[i] + t * (cones.end[i] - cones.start[i])
        margin = wide[i] + 0.5 * size
        low = np.floor((np.minimum(point[:-1], point[1:]) - margin - lattice.origin) / size)
        high = np.floor((np.maximum(point[:-1], point[1:]) + margin - lattice.origin) / size)
        for a, b in zip(low.astype(np.int64), high.astype(np.int64), strict=True):
            box = np.stack(np.meshgrid(*(np.arange(a[k], b[k] + 1) for k in range(3))), -1)
            found.append(box.reshape(-1, 3))
    cells = np.maximum(np.concatenate(found), 0)
    return np.unique(pack(cells << (lattice.levels + 1)))


def cells_near(
    blend: Blend, lattice: Lattice, in_radius: float = CELLS_IN_RADIUS, slope: float = SLOPE
) -> list[_Keys]:
    """Find the cells that the surface passes, by level, as sorted keys of their low corners."""
    octree = _Octree(blend, lattice, in_radius, slope)
    octree.refine(_coarse(blend.limbs.cones, lattice), lattice.levels)
    octree.balance()
    return octree.leaves
