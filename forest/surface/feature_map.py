"""Which trees and which grass stand where: a map of bits, and trees spread over it.

Weber and Penn 1995, section 6: of each cell's 16 bits, 14 tell whether trees of 14 kinds may stand
there, and 2 which of three kinds of grass does. Trees exclude neither each other nor grass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest._jit import njit
from forest.dynamics.draws import uniforms_of
from forest.errors import InputError
from forest.random import STREAM_SCENERY
from forest.scenario.placing import MOST_TREES
from forest.species.text import input_error
from forest.surface.terrain import read_array, read_grey

#: Files that feature maps are read from.
MAP_SUFFIXES = (".png", ".tif", ".tiff", ".npy")

#: Kinds of trees; the two bits above them are the grass.
TREE_BITS = 14

_TRIES = 60  # places tried for a tree before it is left out for want of room


@dataclass(frozen=True)
class FeatureMap:
    """Bits of the vegetation on square cells.

    Attributes
    ----------
    bits : uint16 (rows, columns)
        Bits 0 to 13: trees of that kind may stand in the cell. Bits 14 and 15: the grass, 0 none,
        1, 2 or 3. Row 0 is the north edge, column 0 the west edge.
    cell_m : float
        Side of a cell, m.
    origin : tuple of float
        x and y of the south-west corner of the map, m.
    """

    bits: NDArray[np.uint16]
    cell_m: float = 1.0
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the shape."""
        if self.bits.ndim != 2 or 0 in self.bits.shape or self.bits.dtype != np.uint16:
            raise InputError(
                f"bits of shape {self.bits.shape} and type {self.bits.dtype}",
                expected="rows and columns of uint16",
            )
        if not 0.0 < self.cell_m < np.inf:
            raise InputError(f"cell_m is {self.cell_m}", expected="metres above 0")

    @property
    def size_m(self) -> tuple[float, float]:
        """Width along x and along y, m."""
        rows, columns = self.bits.shape
        return columns * self.cell_m, rows * self.cell_m

    @property
    def grass(self) -> NDArray[np.uint8]:
        """Code of the grass of each cell, 0 to 3."""
        return (self.bits >> TREE_BITS).astype(np.uint8)

    def bears(self, bit: int) -> NDArray[np.bool_]:
        """Tell the cells (rows, columns) where trees of a kind may stand."""
        return np.asarray((self.bits >> bit) & 1, np.bool_)

    def at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.uint16]:
        """Give the bits at places; beyond the map none is set."""
        rows, columns = self.bits.shape
        column = np.floor((np.asarray(x, np.float64) - self.origin[0]) / self.cell_m)
        row = rows - 1.0 - np.floor((np.asarray(y, np.float64) - self.origin[1]) / self.cell_m)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        found = self.bits[
            np.where(inside, row, 0).astype(np.int64), np.where(inside, column, 0).astype(np.int64)
        ]
        return np.where(inside, found, 0).astype(np.uint16)

    def grass_at(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.uint8]:
        """Give the code of the grass at places; beyond the map there is none."""
        return (self.at(x, y) >> TREE_BITS).astype(np.uint8)


def read_feature_map(
    path: str | Path, *, cell_m: float = 1.0, origin: tuple[float, float] = (0.0, 0.0)
) -> FeatureMap:
    """Read a feature map from a grey picture of 16 bits (.png, .tif) or a NumPy array (.npy).

    Raises
    ------
    InputError
        If the file cannot be read or holds no bits.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MAP_SUFFIXES:
        raise input_error(
            f"unknown format '{path.suffix}'", where=path.name, expected=", ".join(MAP_SUFFIXES)
        )
    values = read_array(path) if suffix == ".npy" else read_grey(path)
    if (
        values.dtype.kind not in "iu"
        or values.size == 0
        or values.min() < 0
        or values.max() > 65535
    ):
        raise input_error("holds no bits", where=path.name, expected="whole numbers, 0 to 65535")
    try:
        return FeatureMap(values.astype(np.uint16), cell_m, origin)
    except InputError as error:
        raise input_error(str(error), where=path.name) from None


@dataclass(frozen=True)
class Spreading:
    """How trees of one kind are spread over the cells of their bit.

    Attributes
    ----------
    bit : int
        0 to 13.
    per_ha : float
        Trees per hectare of the cells whose bit is set.
    variants : int
        Trees of the same parameters and different seeds that are mixed.
    scale : tuple of float
        Least and greatest factor on a tree's size.
    least_distance_m : float
        No two trees of this kind stand nearer.
    """

    bit: int
    per_ha: float
    variants: int = 1
    scale: tuple[float, float] = (1.0, 1.0)
    least_distance_m: float = 0.0


class Spread(NamedTuple):
    """Trees on a map, one entry each.

    Attributes
    ----------
    kind : int32 (n,)
        Index of the `Spreading`.
    variant : int32 (n,)
        Which of its variants.
    x, y : float64 (n,)
        Places, m.
    scale : float64 (n,)
        Factor on the size.
    """

    kind: NDArray[np.int32]
    variant: NDArray[np.int32]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    scale: NDArray[np.float64]


def spread(features: FeatureMap, kinds: Sequence[Spreading], seed: int) -> Spread:
    """Spread trees at random over the cells where the bit of their kind is set.

    Parameters
    ----------
    features : FeatureMap
    kinds : sequence of Spreading
        Each draws random numbers of its own, so that a change of one leaves the others in place.
    seed : int

    Returns
    -------
    Spread
        Where the least distance leaves no room, fewer trees than `asked_for`.

    Raises
    ------
    InputError
        If there are more than a million trees.

    Notes
    -----
    Trees are not turned: shadow marks of one description hold for all its instances only if all
    have the same orientation (section 6).
    """
    parts = [_spread_one(features, kind, number, seed) for number, kind in enumerate(kinds)]
    none: Spread = Spread(
        np.empty(0, np.int32), np.empty(0, np.int32), np.empty(0), np.empty(0), np.empty(0)
    )
    return Spread(*(np.concatenate(column) for column in zip(none, *parts, strict=True)))


def asked_for(features: FeatureMap, kind: Spreading) -> int:
    """Count the trees that `per_ha` asks for, whether there is room for them or not."""
    cells = np.count_nonzero(features.bears(kind.bit))
    return round(kind.per_ha * int(cells) * features.cell_m**2 / 1e4)


def _spread_one(features: FeatureMap, kind: Spreading, number: int, seed: int) -> Spread:
    row, column = np.nonzero(features.bears(kind.bit))
    count = asked_for(features, kind)
    if count > MOST_TREES:
        raise InputError(f"{count} trees of bit {kind.bit}", expected=f"at most {MOST_TREES}")
    ids = np.arange(count, dtype=np.int32)
    look = uniforms_of(seed, STREAM_SCENERY, ids, kind.bit, number * (_TRIES + 1))
    x, y = np.full(count, np.nan), np.full(count, np.nan)
    if count:
        _place(features, kind, number, seed, (row, column), (x, y))
    stands = np.isfinite(x)
    low, high = kind.scale
    return Spread(
        np.full(int(stands.sum()), number, np.int32),
        (look[stands, 0] * kind.variants).astype(np.int32),
        x[stands],
        y[stands],
        low + (high - low) * look[stands, 1],
    )


def _place(
    features: FeatureMap,
    kind: Spreading,
    number: int,
    seed: int,
    cells: tuple[NDArray[np.int64], NDArray[np.int64]],
    places: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Fill in the places; those of trees that find no room stay NaN."""
    row, column = cells
    x, y = places
    rows = features.bits.shape[0]
    room = _Room.of(features.size_m, kind.least_distance_m, len(x))
    waiting = np.arange(len(x), dtype=np.int32)
    for attempt in range(_TRIES if kind.least_distance_m > 0.0 else 1):
        draws = uniforms_of(
            seed, STREAM_SCENERY, waiting, kind.bit, number * (_TRIES + 1) + 1 + attempt
        )
        cell = np.minimum((draws[:, 0] * len(row)).astype(np.int64), len(row) - 1)
        east = (column[cell] + draws[:, 1]) * features.cell_m
        north = (rows - 1 - row[cell] + draws[:, 2]) * features.cell_m
        settled = np.ones(len(waiting), np.bool_)
        if kind.least_distance_m > 0.0:
            _settle(room, waiting, east, north, settled)
        x[waiting[settled]] = features.origin[0] + east[settled]
        y[waiting[settled]] = features.origin[1] + north[settled]
        waiting = waiting[~settled]


class _Room(NamedTuple):
    """The spots taken so far, in lists of the cells of a grid, none narrower than the distance."""

    distance: float
    size: NDArray[np.float64]  # width and depth of the whole
    first: NDArray[np.int32]  # (nx, ny) tree of each cell's list, -1 for none
    then: NDArray[np.int32]  # (n,) the next in the list of a tree's cell
    spot: NDArray[np.float64]  # (n, 2)

    @classmethod
    def of(cls, size_m: tuple[float, float], distance_m: float, trees: int) -> _Room:
        """Make a grid of no more than about four cells a tree."""
        side = max(distance_m, float(np.sqrt(size_m[0] * size_m[1] / (4.0 * trees + 4.0))))
        cells = [max(int(edge / side), 1) for edge in size_m]
        return cls(
            distance_m,
            np.array(size_m),
            np.full(cells, -1, np.int32),
            np.full(trees, -1, np.int32),
            np.empty((trees, 2)),
        )


@njit
def _settle(room: Any, trees: Any, x: Any, y: Any, free: Any) -> None:
    """Take the spots that are free, one tree after the other; tell which were."""
    nx, ny = room.first.shape
    for k in range(len(trees)):
        cx = min(int(x[k] / room.size[0] * nx), nx - 1)
        cy = min(int(y[k] / room.size[1] * ny), ny - 1)
        free[k] = True
        for i in range(max(cx - 1, 0), min(cx + 2, nx)):
            for j in range(max(cy - 1, 0), min(cy + 2, ny)):
                other = room.first[i, j]
                while other >= 0 and free[k]:
                    dx, dy = x[k] - room.spot[other, 0], y[k] - room.spot[other, 1]
                    free[k] = np.sqrt(dx * dx + dy * dy) >= room.distance
                    other = room.then[other]
        if free[k]:
            tree = trees[k]
            room.spot[tree, 0], room.spot[tree, 1] = x[k], y[k]
            room.then[tree] = room.first[cx, cy]
            room.first[cx, cy] = tree
