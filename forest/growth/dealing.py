"""How trees are dealt to threads, and the scratch memory each of them works in.

Scans run per tree. Trees are dealt to a fixed number of bins, the largest first to the emptiest
bin, so that a few giants do not serialise a step; the deal never depends on the thread count.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit

BINS = 16
#: Scratch arrays of one number per metamer that a scan may use.
FLOATS = 12
INTEGERS = 4


class Deal(NamedTuple):
    """Which rows each bin works on, and where its scratch lies.

    `rows[first[b] : first[b + 1]]` are the trees of bin b; `place[b]` is the start of its scratch,
    in metamers.
    """

    rows: NDArray[np.int64]
    first: NDArray[np.int64]
    place: NDArray[np.int64]


class Scratch(NamedTuple):
    """Flat scratch memory shared by all bins; a tree of n metamers uses rows of length n."""

    floats: NDArray[np.float64]
    integers: NDArray[np.int32]


@njit
def _deal(size, by_size, bins):  # type: ignore[no-untyped-def]
    n = len(size)
    load = np.zeros(bins, np.int64)
    count = np.zeros(bins, np.int64)
    largest = np.zeros(bins, np.int64)
    bin_of = np.empty(n, np.int64)
    for k in range(n):
        row = by_size[k]
        best = 0
        for b in range(1, bins):
            if load[b] < load[best]:
                best = b
        bin_of[row] = best
        load[best] += size[row] + 64
        count[best] += 1
        largest[best] = max(largest[best], size[row])
    first = np.zeros(bins + 1, np.int64)
    place = np.zeros(bins + 1, np.int64)
    for b in range(bins):
        first[b + 1] = first[b] + count[b]
        place[b + 1] = place[b] + largest[b]
    fill = first[:-1].copy()
    rows = np.empty(n, np.int64)
    for row in range(n):
        rows[fill[bin_of[row]]] = row
        fill[bin_of[row]] += 1
    return rows, first, place


def deal(size: NDArray[np.int32]) -> Deal:
    """Deal trees of the given sizes (metamers) to the bins."""
    by_size = np.argsort(-size.astype(np.int64), kind="stable")
    return Deal(*_deal(size.astype(np.int64), by_size, BINS))


def leave_out(shared: Deal, rows: NDArray[np.int64]) -> Deal:
    """Take some rows out of a deal; the others stay in their bins."""
    kept = ~np.isin(shared.rows, rows)
    before = np.concatenate((np.zeros(1, np.int64), np.cumsum(kept, dtype=np.int64)))
    return Deal(shared.rows[kept], before[shared.first], shared.place)


class Workbench:
    """Scratch memory that is kept from year to year and grows in place when trees do."""

    def __init__(self) -> None:
        self._scratch = Scratch(np.empty(0), np.empty(0, np.int32))

    def scratch(self, shared: Deal) -> Scratch:
        """Give scratch for this deal."""
        need = int(shared.place[-1])
        if len(self._scratch.integers) < need * INTEGERS:
            roomy = need + need // 4 + 64
            self._scratch = Scratch(np.empty(roomy * FLOATS), np.empty(roomy * INTEGERS, np.int32))
        return self._scratch
