"""Levels whose stems do not split: each stem is a family alone, so that threads can share them."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import driver, njit
from forest.parametric.stems import Hand, grow_family, pruned_length

#: Parts that the stems of a level are cut into.
CHUNKS = 64


def scratch() -> Any:
    """Room for a stem's frame and state, or a leaf's frames, in each chunk."""
    return np.empty((CHUNKS, 24))


@njit
def part(chunk: Any, count: Any) -> Any:
    """First and end of a chunk of `count` rows."""
    return chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS


@driver
def probe_alone(
    first: Any,
    step: Any,
    number: Any,
    tree: Any,
    levels: Any,
    whole: Any,
    origins: Any,
    before: Any,
    out: Any,
    length: Any,
) -> None:
    """Set the length of each stem, 0 where it is none; `out` = (shoots, sections, pending,
    scratch)."""
    for chunk in range(first, CHUNKS, step):
        _probe(chunk, number, levels[number], tree[0], whole, origins, before, out, length)


@driver
def _probe(
    chunk: Any, number: Any, level: Any, tree: Any, whole: Any, origins: Any, before: Any,
    out: Any, length: Any,
) -> None:  # fmt: skip
    # No clone ever waits, so that threads may share `pending`.
    hand = Hand(False, out[0], out[1], out[2], out[3][chunk, :12], out[3][chunk, 12:18])
    nodes = len(out[1].z) // len(length)
    start, end = part(chunk, len(length))
    for o in range(start, end):
        base = (before[0], before[1], o, o * nodes)
        length[o] = pruned_length(number, level, tree, whole, origins, o, 0.0, base, hand)


@driver
def grow_alone(
    first: Any,
    step: Any,
    number: Any,
    tree: Any,
    levels: Any,
    whole: Any,
    origins: Any,
    before: Any,
    out: Any,
    length: Any,
    row: Any,
) -> None:
    """Grow the stems that have a length, each in its row."""
    for chunk in range(first, CHUNKS, step):
        _grow(chunk, number, levels[number], tree[0], whole, origins, before, out, length, row)


@driver
def _grow(
    chunk: Any, number: Any, level: Any, tree: Any, whole: Any, origins: Any, before: Any,
    out: Any, length: Any, row: Any,
) -> None:  # fmt: skip
    hand = Hand(False, out[0], out[1], out[2], out[3][chunk, :12], out[3][chunk, 12:18])
    nodes = len(out[1].z) // len(length)
    start, end = part(chunk, len(length))
    for o in range(start, end):
        if length[o] > 0.0:
            base = (before[0], before[1], row[o], row[o] * nodes)
            grow_family(number, level, tree, whole, origins, o, length[o], 0.0, base, hand)
