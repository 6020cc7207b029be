"""Pruning leaves a valid tree."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.errors import InputError
from forest.trees.pruning import cut_branch
from tests.builders import random_arena
from tests.growth.growing import arena_of, copied, extent
from tests.growth.invariants import assert_valid
from tests.reference.plant import read_plant

#: Thickness of a pipe along branches relative to the stem.
KAPPA = 0.35


@given(st.integers(0, 2**32 - 1))
def test_what_stands_on_the_cut_goes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 2, 30)
    before, old = copied(m), copied(trees)
    nodes = read_plant(m, trees, 1)
    if len(nodes) < 2:
        return
    cut = nodes[int(rng.integers(1, len(nodes)))]
    gone = {node.serial for node in cut.above()}
    assert cut_branch(arena_of(m, trees), trees, 1, cut.serial, KAPPA) == len(gone)
    assert_valid(m, trees)
    here, was = extent(trees, 1), extent(old, 1)
    stays = ~np.isin(before.serial[was], list(gone))
    for name in set(m._fields) - {"parent", "state", "sapwood"}:
        np.testing.assert_array_equal(getattr(m, name)[here], getattr(before, name)[was][stays])
    # below the cut the pipes of what is gone no longer serve; elsewhere nothing changes
    path = {node.serial for node in nodes if cut in node.above() and node is not cut}
    on_stem = float(before.sapwood[was][cut.index]) / (KAPPA if cut.order > 0 else 1.0)
    for serial, order, left, had in zip(
        m.serial[here],
        m.order[here],
        m.sapwood[here],
        before.sapwood[was][stays],
        strict=True,
    ):
        lost = on_stem * (KAPPA if order > 0 else 1.0) if serial in path else 0.0
        assert left == pytest.approx(max(0.0, float(had) - lost), rel=1e-5, abs=1e-12)
    other = extent(old, 0)
    for name in m._fields:
        np.testing.assert_array_equal(getattr(m, name)[other], getattr(before, name)[other])


@pytest.mark.parametrize("serial", [0, 999])
def test_refused(serial: int) -> None:
    m, trees = random_arena(np.random.default_rng(1), 1, 10)
    m.serial[extent(trees, 0)] = np.arange(int(trees.size[0]))
    with pytest.raises(InputError, match=str(serial)):
        cut_branch(arena_of(m, trees), trees, 0, serial, KAPPA)
