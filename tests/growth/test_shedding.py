"""Shedding against its slow twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.growth.dealing import Workbench, deal
from forest.growth.shedding import shed
from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, TERMINAL
from tests.builders import random_arena
from tests.growth.growing import arena_of, copied, extent, make_species, make_traits
from tests.growth.invariants import assert_valid
from tests.reference import shedding as slow
from tests.reference.plant import read_plant

KAPPA = 0.35


def _shed(m, trees, threshold: float, drop_bare: bool) -> None:  # type: ignore[no-untyped-def]
    species = make_species(
        shedding={"light_per_internode": threshold}, carbon={"branch_pipe_ratio": KAPPA}
    )
    shared = deal(trees.size)
    shed(
        arena_of(m, trees),
        trees,
        shared,
        Workbench().scratch(shared),
        make_traits(species),
        drop_bare,
    )


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.25, 0.5]), st.booleans(), st.booleans())
def test_shedding(seed: int, threshold: float, drop_bare: bool, bare: bool) -> None:
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 3, 30)
    for row in range(3):
        here = extent(trees, row)
        m.light[here] = rng.integers(0, 9, int(trees.size[row])) / 8
        if bare:
            living = rng.random(int(trees.size[row])) < 0.3
            m.state[here] &= np.where(living, 255, 255 - TERMINAL - LATERAL).astype(np.uint8)
    before, old = copied(m), copied(trees)
    expected = [
        slow.shed(read_plant(m, trees, row)[0], threshold, drop_bare, KAPPA) for row in range(3)
    ]
    _shed(m, trees, threshold, drop_bare)
    assert_valid(m, trees)
    for row, left in enumerate(expected):
        here, was = extent(trees, row), extent(old, row)
        index = [node.index for node in left.kept]
        assert m.serial[here].tolist() == [node.serial for node in left.kept]
        for name in before._fields:
            if name not in ("parent", "state", "sapwood"):
                rows = getattr(before, name)[was][index]
                np.testing.assert_array_equal(getattr(m, name)[here], rows)
        for k, node in enumerate(left.kept):
            lost = CONTINUED if node.serial in left.lost_main else 0
            lost |= BRANCHED if node.serial in left.lost_branch else 0
            assert m.state[here][k] == before.state[was][node.index] & ~np.uint8(lost)
            if node.below:
                assert m.serial[here][m.parent[here][k]] == node.below.serial
            sapwood = left.sapwood[node.serial]
            np.testing.assert_allclose(m.sapwood[here][k], sapwood, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("drop_bare", [False, True])
def test_nothing_is_shed_without_a_reason(drop_bare: bool) -> None:
    m, trees = random_arena(np.random.default_rng(3), 2, 30)
    for row in range(2):
        m.state[extent(trees, row)] |= LATERAL
    before, size = copied(m), trees.size.copy()
    _shed(m, trees, 0.0, drop_bare)
    assert (trees.size == size).all()
    for name in m._fields:
        np.testing.assert_array_equal(getattr(m, name), getattr(before, name))
