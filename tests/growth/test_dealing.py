"""The deal of trees to bins."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from forest.growth.dealing import BINS, FLOATS, INTEGERS, Workbench, deal


@given(st.lists(st.integers(0, 5000), max_size=60))
def test_every_tree_is_dealt_once_and_has_room(sizes: list[int]) -> None:
    size = np.array(sizes, np.int32)
    shared = deal(size)
    assert sorted(shared.rows.tolist()) == list(range(len(size)))
    assert shared.first[0] == 0
    assert shared.first[-1] == len(size)
    scratch = Workbench().scratch(shared)
    assert len(scratch.floats) >= FLOATS * shared.place[-1]
    assert len(scratch.integers) >= INTEGERS * shared.place[-1]
    loads = []
    for b in range(BINS):
        mine = size[shared.rows[shared.first[b] : shared.first[b + 1]]]
        assert (mine <= shared.place[b + 1] - shared.place[b]).all()
        loads.append(int((mine + 64).sum()))
    # dealt largest first, no bin exceeds the emptiest by more than one tree
    assert max(loads) - min(loads) <= (size.max(initial=0) + 64)
