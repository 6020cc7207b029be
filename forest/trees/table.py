"""The tree table: one row per living tree, one array per column, in order of tree id."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.trees.metamers import Metamers

#: Ids that a message lists before it breaks off.
_LISTED = 8

#: Heights at which rings can be told.
DISCS = 8

#: Columns of the table: name -> (dtype, items, meaning).
COLUMNS: dict[str, tuple[type, int, str]] = {
    "tree_id": (np.int32, 1, "number of the tree, from 1, never used twice"),
    "species": (np.int16, 1, "index into the scenario's list of species"),
    "x": (np.float64, 1, "place of the stem base, m"),
    "y": (np.float64, 1, "place of the stem base, m"),
    "base_voxel": (np.int32, 3, "near-field voxel of the base (ix, iy, iz)"),
    "base_offset": (np.float32, 3, "place of the base inside that voxel, m"),
    "birth": (np.int32, 1, "step in which it was planted or, if it came older, germinated"),
    "mother_id": (np.int32, 1, "tree that seeded it; 0 if planted"),
    "start": (np.int64, 1, "first metamer of its extent in the arena"),
    "size": (np.int32, 1, "metamers in use"),
    "room": (np.int32, 1, "metamers that its extent can hold"),
    "next_serial": (np.int32, 1, "serial number of its next metamer"),
    "vigour": (np.float32, 1, "lasting factor on its production"),
    "reserve": (np.float64, 1, "stored dry mass, kg"),
    "wind_stress": (np.float32, 1, "stress at the stem's foot in last year's wind per its limit"),
    "bad_years": (np.int32, 1, "years in a row of a net income below the limit"),
    "breast_serial": (np.int32, 1, "serial of the metamer at 1.3 m; -1 while there is none"),
    "disc_serial": (np.int32, DISCS, "serials of the metamers whose rings are told; -1 for none"),
}


class Trees(NamedTuple):
    """The table's columns, as kernels take them. See `COLUMNS`."""

    tree_id: NDArray[np.int32]
    species: NDArray[np.int16]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    base_voxel: NDArray[np.int32]
    base_offset: NDArray[np.float32]
    birth: NDArray[np.int32]
    mother_id: NDArray[np.int32]
    start: NDArray[np.int64]
    size: NDArray[np.int32]
    room: NDArray[np.int32]
    next_serial: NDArray[np.int32]
    vigour: NDArray[np.float32]
    reserve: NDArray[np.float64]
    wind_stress: NDArray[np.float32]
    bad_years: NDArray[np.int32]
    breast_serial: NDArray[np.int32]
    disc_serial: NDArray[np.int32]


def empty(n: int = 0) -> Trees:
    """Make a table of `n` rows of zeros."""
    arrays: dict[str, NDArray[Any]] = {
        name: np.zeros(n if k == 1 else (n, k), dtype) for name, (dtype, k, _) in COLUMNS.items()
    }
    return Trees(**arrays)


def append(trees: Trees, more: Trees) -> Trees:
    """Give a table with the rows of `more` behind those of `trees`."""
    columns: dict[str, Any] = {
        name: np.concatenate((column, getattr(more, name)))
        for name, column in trees._asdict().items()
    }
    return Trees(**columns)


def keep(trees: Trees, rows: NDArray[np.bool_]) -> Trees:
    """Give a table of the rows for which `rows` is true."""
    columns: dict[str, Any] = {
        name: np.ascontiguousarray(column[rows]) for name, column in trees._asdict().items()
    }
    return Trees(**columns)


def have_grown(trees: Trees, metamers: Metamers, steps: int) -> NDArray[np.bool_]:
    """Tell which trees have grown for a year here; newcomers have neither wood nor rods yet.

    Their age does not tell it: a recruit has lived as a seedling before it comes.

    Parameters
    ----------
    trees : Trees
        n rows.
    metamers : Metamers
        Of the arena.
    steps : int
        Years grown so far.

    Returns
    -------
    bool (n,)
    """
    has = np.flatnonzero(trees.size > 0)
    grown = np.zeros(len(trees.size), np.bool_)
    grown[has] = metamers.birth[trees.start[has]] < steps
    return grown


def distances(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    x_m: float,
    y_m: float,
    size_m: tuple[float, float],
    periodic: bool,
) -> NDArray[np.float64]:
    """Give distances of places on a plot to one of them, m; they wrap on a periodic plot."""
    dx, dy = np.abs(x - x_m), np.abs(y - y_m)
    if periodic:
        dx, dy = np.minimum(dx, size_m[0] - dx), np.minimum(dy, size_m[1] - dy)
    return np.asarray(np.hypot(dx, dy))


def row_of(trees: Trees, tree_id: int, *, where: str) -> int:
    """Find the row of a living tree; `where` names the act that asks for it in messages.

    Raises
    ------
    InputError
        If no living tree has that id.
    """
    row = int(np.searchsorted(trees.tree_id, tree_id))
    if row == len(trees.tree_id) or trees.tree_id[row] != tree_id:
        living = ", ".join(str(i) for i in trees.tree_id[:_LISTED])
        more = f", ... ({len(trees.tree_id)} trees)" if len(trees.tree_id) > _LISTED else ""
        raise InputError(
            f"no living tree has the id {tree_id}",
            where=where,
            expected=f"one of {living}{more}" if living else "a living tree, but there is none",
        )
    return row
