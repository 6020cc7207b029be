"""The arena: the metamers of all trees, one NumPy array per field.

A metamer is an internode with the node at its upper end; the node bears a lateral bud, and the
last metamer of an axis also bears the terminal bud. Each tree owns one contiguous extent of the
arena with slack at its end. Inside an extent a parent always stands before its children, so a
basipetal pass is one backward scan and an acropetal pass one forward scan.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, move_bytes, njit
from forest._threads import in_threads

# Bits of Metamers.state
MAIN = np.uint8(1)  # continues its parent's axis (else it starts an axis of its own)
TERMINAL = np.uint8(2)  # bears a living terminal bud
LATERAL = np.uint8(4)  # bears a living lateral bud that has not grown out
BRANCHED = np.uint8(8)  # its lateral bud has grown out into a branch
CONTINUED = np.uint8(16)  # its axis goes on: another metamer follows on the same axis
NO_ROOM_TERMINAL = np.uint8(32)  # its terminal bud found no marker this year
NO_ROOM_LATERAL = np.uint8(64)  # its lateral bud found no marker this year

#: Fields of the arena: name -> (dtype, items per metamer, meaning).
FIELDS: dict[str, tuple[type, int, str]] = {
    "parent": (np.int32, 1, "index of the parent, relative to the tree's extent; -1 at the base"),
    "serial": (np.int32, 1, "number that never changes, counted per tree from 0"),
    "tip": (np.float32, 3, "upper end, relative to the tree's base, m"),
    "bud": (np.float32, 3, "unit direction of the lateral bud"),
    "length": (np.float32, 1, "internode length, m"),
    "pipe": (np.float32, 1, "diameter to the pipe exponent n, d^n, m^n (never decreases)"),
    "sapwood": (np.float32, 1, "the rings in it that still serve living branches, m^n"),
    "light": (np.float32, 1, "light Q of the buds at the node (4.1)"),
    "resource": (np.float32, 2, "resource v of the terminal and the lateral bud; their fraction"),
    "birth": (np.int16, 1, "step in which it was made, counted from the start of the run"),
    "order": (np.uint8, 1, "branching order, 0 on the trunk"),
    "state": (np.uint8, 1, "bits MAIN, TERMINAL, LATERAL, BRANCHED, CONTINUED, NO_ROOM_*"),
    "deficit": (np.uint8, 1, "years in a row in which its sites did not pay"),
    "shoot_height": (np.uint8, 1, "place in its year's shoot, 0 (base) to 255 (tip)"),
}


class Metamers(NamedTuple):
    """The arena's arrays, as kernels take them. See `FIELDS` for dtype, unit and meaning."""

    parent: NDArray[np.int32]
    serial: NDArray[np.int32]
    tip: NDArray[np.float32]
    bud: NDArray[np.float32]
    length: NDArray[np.float32]
    pipe: NDArray[np.float32]
    sapwood: NDArray[np.float32]
    light: NDArray[np.float32]
    resource: NDArray[np.float32]
    birth: NDArray[np.int16]
    order: NDArray[np.uint8]
    state: NDArray[np.uint8]
    deficit: NDArray[np.uint8]
    shoot_height: NDArray[np.uint8]


BYTES_PER_METAMER = sum(np.dtype(t).itemsize * k for t, k, _ in FIELDS.values())


def allocate(capacity: int) -> Metamers:
    """Make an arena of `capacity` metamers; memory is touched only when it is used."""
    arrays: dict[str, NDArray[Any]] = {
        name: np.empty(capacity if k == 1 else (capacity, k), dtype)
        for name, (dtype, k, _) in FIELDS.items()
    }
    return Metamers(**arrays)


class Fields(NamedTuple):
    """Where the arena's arrays lie, to move metamers whatever is known of them.

    Attributes
    ----------
    address : int64 (fields,)
        Address of each array.
    width : int64 (fields,)
        Its bytes per metamer.
    """

    address: NDArray[np.int64]
    width: NDArray[np.int64]


@driver
def _move_extents(first, step, fields, source, to, size):  # type: ignore[no-untyped-def]
    """Move extents, one after the other, in every field."""
    for field in range(first, len(fields.address), step):
        width = fields.width[field]
        for k in range(len(source)):
            move_bytes(
                fields.address[field] + to[k] * width,
                fields.address[field] + source[k] * width,
                np.int64(size[k]) * width,
            )


@njit
def close_ranks(parent, fields, start, n, gone, new_index):  # type: ignore[no-untyped-def]
    """Compact a tree inside its extent: move what stays to the front, in order.

    Parameters
    ----------
    parent : int32 (n,)
        The tree's part of `Metamers.parent`.
    fields : Fields
    start, n : int
        First metamer of the tree and metamers in use.
    gone : array (n,)
        Not 0 where a metamer goes; its children go as well.
    new_index : int32 (n,)
        Filled: where each metamer stands now, relative to the tree's extent; -1 if it is gone.

    Returns
    -------
    int
        Metamers that stay.
    """
    kept = 0
    for i in range(n):
        new_index[i] = -1 if gone[i] else kept
        if not gone[i]:
            kept += 1
            if parent[i] >= 0:
                parent[i] = new_index[parent[i]]
    to = 0
    i = 0
    while i < n:
        if gone[i]:
            i += 1
            continue
        end = i
        while end < n and not gone[end]:
            end += 1
        if to != i:
            for field in range(len(fields.address)):
                width = fields.width[field]
                move_bytes(
                    fields.address[field] + (start + to) * width,
                    fields.address[field] + (start + i) * width,
                    (end - i) * width,
                )
        to += end - i
        i = end
    return kept


class Arena:
    """The metamers of all trees and the room between them.

    `used` is the end of the last extent. Extents are handed out at the end; when the end is
    reached, `make_room` closes the holes and, only if that is not enough, grows the arrays.

    Parameters
    ----------
    capacity : int
        Metamers that the arrays hold at first.
    companions : callable, optional
        Makes a NamedTuple of further arrays, one entry per metamer, for a given capacity; they are
        kept in `companions` and move with the metamers. They exist where a scenario asks for them.
    """

    #: Slack left behind a tree when it is placed, as a share of its size.
    SLACK = 0.12
    #: Growth of the arrays when they are full.
    GROWTH = 1.15

    def __init__(
        self, capacity: int = 4096, companions: Callable[[int], Any] | None = None
    ) -> None:
        self.metamers = allocate(max(capacity, 16))
        self.companions: Any = companions(self.capacity) if companions else ()
        self.used = 0

    @property
    def fields(self) -> Fields:
        """Where all arrays lie now."""
        arrays = (*self.metamers, *self.companions)
        return Fields(
            np.array([array.ctypes.data for array in arrays], np.int64),
            np.array([array.nbytes // len(array) for array in arrays], np.int64),
        )

    @property
    def capacity(self) -> int:
        """Number of metamers that the arrays can hold."""
        return len(self.metamers.parent)

    def make_room(
        self,
        start: NDArray[np.int64],
        size: NDArray[np.int32],
        room: NDArray[np.int32],
        wanted: NDArray[np.int64],
    ) -> None:
        """Give each tree an extent of at least `wanted` metamers.

        Parameters
        ----------
        start, size, room : arrays of one entry per tree
            First metamer, metamers in use and length of each extent; `start` and `room` are
            changed in place.
        wanted : int64 array
            Metamers that each tree must be able to hold.
        """
        short = np.flatnonzero(wanted > room)
        if short.size == 0:
            return
        target = wanted[short] + (wanted[short] * self.SLACK).astype(np.int64) + 4
        if self.used + int(target.sum()) <= self.capacity:
            place = self.used + np.cumsum(target) - target
            self._move(start[short], place, size[short])
            start[short] = place
            room[short] = target
            self.used += int(target.sum())
            return
        self._repack(start, size, room, wanted)

    def _move(
        self, source: NDArray[np.int64], to: NDArray[np.int64], size: NDArray[np.int32]
    ) -> None:
        in_threads(_move_extents, self.fields, source, to, size)

    def _repack(
        self,
        start: NDArray[np.int64],
        size: NDArray[np.int32],
        room: NDArray[np.int32],
        wanted: NDArray[np.int64],
    ) -> None:
        """Lay all extents out anew, in the order they stand, with fresh slack; grow if needed.

        Each tree moves once: those that move down from the lowest on, then those that move up from
        the highest on. Order is kept, so nothing is written where another tree still stands.
        """
        by_place = np.argsort(start, kind="stable")
        need = np.maximum(wanted, size).astype(np.int64)
        length = need + (need * self.SLACK).astype(np.int64) + 4
        total = int(length.sum())
        if total > self.capacity:
            self._grow(int(total * self.GROWTH), self.used)
        place = np.empty(len(start), np.int64)
        place[by_place] = np.concatenate(([0], np.cumsum(length[by_place])[:-1]))
        down = by_place[place[by_place] < start[by_place]]
        up = by_place[place[by_place] > start[by_place]][::-1]
        moving = np.concatenate((down, up))
        self._move(start[moving], place[moving], size[moving])
        start[:] = place
        room[:] = length
        self.used = total

    def _grow(self, capacity: int, used: int) -> None:
        """Grow field by field, so that at most one field is held twice."""
        metamers: list[Any] = list(self.metamers)
        companions: list[Any] = list(self.companions)
        kind = type(self.companions)
        del self.metamers, self.companions
        for fields in (metamers, companions):
            for k in range(len(fields)):
                new = np.empty((capacity, *fields[k].shape[1:]), fields[k].dtype)
                new[:used] = fields[k][:used]
                fields[k] = new
        self.metamers = Metamers(*metamers)
        self.companions = kind(*companions)

    def alone(self, start: int, size: int) -> Arena:
        """Give an arena that holds a copy of one extent, companions and all, at its start."""
        copy = Arena.__new__(Arena)
        here = slice(start, start + size)
        metamers: list[Any] = [field[here].copy() for field in self.metamers]
        companions: list[Any] = [field[here].copy() for field in self.companions]
        copy.metamers = Metamers(*metamers)
        copy.companions = type(self.companions)(*companions) if companions else ()
        copy.used = size
        return copy
