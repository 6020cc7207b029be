"""Trees and their metamers as plain arrays without slack, and back: what a checkpoint holds."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.trees.metamers import Arena
from forest.trees.table import Trees

Arrays = dict[str, NDArray[Any]]


def pack(arena: Arena, trees: Trees) -> Arrays:
    """Give the table's columns, and the fields of its trees' metamers in its order."""
    arrays = {f"tree_{name}": column for name, column in trees._asdict().items()}
    spans = [(int(s), int(s) + int(n)) for s, n in zip(trees.start, trees.size, strict=True)]
    for name, field in _fields(arena):
        parts = [field[a:b] for a, b in spans]
        arrays[name] = np.concatenate(parts) if parts else field[:0]
    return arrays


def unpack(arrays: Arrays, arena: Arena) -> Trees:
    """Put packed trees into an empty arena and give their table."""
    trees = Trees(**{name: np.array(arrays[f"tree_{name}"]) for name in Trees._fields})
    size = trees.size.copy()
    trees.size[:] = 0
    trees.room[:] = 0
    arena.make_room(trees.start, trees.size, trees.room, size.astype(np.int64))
    at = 0
    for row, n in enumerate(size):
        s = int(trees.start[row])
        for name, field in _fields(arena):
            field[s : s + n] = arrays[name][at : at + n]
        at += int(n)
    trees.size[:] = size
    return trees


def _fields(arena: Arena) -> list[tuple[str, NDArray[Any]]]:
    """Name the arrays of the arena."""
    groups = {"metamer": arena.metamers, "companion": arena.companions}
    return [
        (f"{group}_{name}", field)
        for group, fields in groups.items()
        for name, field in zip(getattr(fields, "_fields", ()), fields, strict=True)
    ]
