"""Whole years on random arenas: contract and books hold; layout and threads do not matter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.growth.budget import EXTENSION, INCOME, LEAVES, RESERVE_CHANGE, RING, UPKEEP
from forest.trees.metamers import Arena, Metamers
from forest.trees.table import Trees
from tests.builders import random_arena
from tests.growth.growing import (
    arena_of,
    copied,
    extent,
    grow_year,
    make_species,
    make_traits,
    make_year,
)
from tests.growth.invariants import assert_valid

#: First step of the tests; the random trees are older.
FIRST = 50
SPECIES = (
    make_species(shedding={"light_per_internode": 0.1}, bud_fate={"alpha": 3.0}),
    make_species(
        architecture={"axis": "sympodial", "shoots_by_order": [[0, 3.0], [3, 1.0]]},
        bud_fate={"apical_control_until_age_years": [8, 2]},
    ),
    make_species(architecture={"ramification": "sylleptic"}, bud_fate={"alpha": 2.5}),
)
MODES = {
    "balance": (make_year(), {"balance": True}),
    "priority": (make_year(), {"priority": True}),
    "paper": (make_year(paper=True), {}),
    "paper balance": (make_year(paper=True), {"balance": True}),
}


def _stand(seed: int) -> tuple[Metamers, Trees]:
    m, trees = random_arena(np.random.default_rng(seed), 6, 40, n_species=3)
    trees.reserve[:] = 0.05
    trees.birth[:] = FIRST - 6
    for row in range(6):
        m.resource[extent(trees, row)] *= 0.9
    return m, trees


def _grow(arena: Arena, trees: Trees, mode: str, years: int) -> list[np.ndarray]:
    traits = make_traits(*SPECIES, paper=MODES[mode][0].paper)
    year, models = MODES[mode]
    return [
        grow_year(arena, trees, traits, year._replace(step=step), **models)
        for step in range(FIRST, FIRST + years)
    ]


def _taken(arena: Arena, trees: Trees) -> list[Any]:
    """All that a tree is, wherever it stands in the arena."""
    fields = [field[extent(trees, row)] for row in range(6) for field in arena.metamers]
    return [*fields, trees.size, trees.next_serial, trees.reserve, trees.bad_years]


@pytest.mark.parametrize("mode", list(MODES))
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_the_contract_holds(mode: str, seed: int) -> None:
    m, trees = _stand(seed)
    arena = arena_of(m, trees)
    for step in range(FIRST, FIRST + 4):
        pipes = [
            dict(zip(arena.metamers.serial[e], arena.metamers.pipe[e], strict=True))
            for e in (extent(trees, row) for row in range(6))
        ]
        reserve = trees.reserve.copy()
        traits = make_traits(*SPECIES, paper=MODES[mode][0].paper)
        year, models = MODES[mode]
        accounts = grow_year(arena, trees, traits, year._replace(step=step), **models)
        assert_valid(arena.metamers, trees)
        for row in range(6):
            here = extent(trees, row)
            for serial, pipe in zip(
                arena.metamers.serial[here], arena.metamers.pipe[here], strict=True
            ):
                assert pipe >= pipes[row].get(serial, 0.0)
        if MODES[mode][0].paper:
            assert not accounts.any()
        else:
            spent = accounts[:, [LEAVES, UPKEEP, EXTENSION, RING, RESERVE_CHANGE]].sum(axis=1)
            np.testing.assert_allclose(spent, accounts[:, INCOME], rtol=1e-9, atol=1e-12)
            change = trees.reserve - reserve
            np.testing.assert_allclose(change, accounts[:, RESERVE_CHANGE], rtol=1e-9, atol=1e-12)
            assert (arena.metamers.resource[extent(trees, 0)] < 1.0).all()


@pytest.mark.parametrize("mode", list(MODES))
def test_threads_do_not_matter(mode: str) -> None:
    results = []
    for number in (1, 2):
        with using_threads(number):
            m, trees = _stand(11)
            arena = arena_of(m, trees)
            accounts = _grow(arena, trees, mode, 4)
            results.append(_taken(arena, trees) + accounts)
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def _scattered(m: Metamers, trees: Trees) -> tuple[Arena, Trees]:
    """The same trees in reverse order, far apart, in an arena full of other garbage."""
    arena = Arena(3 * int(trees.size.sum()) + 100)
    for field in arena.metamers:
        field[...] = 5
    trees = copied(trees)
    at = 7
    for row in range(5, -1, -1):
        old = extent(trees, row)
        trees.start[row] = at
        for new, field in zip(arena.metamers, m, strict=True):
            new[extent(trees, row)] = field[old]
        at += 2 * int(trees.size[row]) + 3
    trees.room[:] = trees.size
    arena.used = at
    return arena, trees


@pytest.mark.parametrize("mode", list(MODES))
def test_layout_does_not_matter(mode: str) -> None:
    """Trees grow alike in other extents, moved one by one or all packed anew in a full arena."""
    m, trees = _stand(12)
    other, other_trees = _scattered(m, trees)
    arena = arena_of(m, trees)
    packed = arena.capacity
    accounts = _grow(arena, trees, mode, 4)
    other_accounts = _grow(other, other_trees, mode, 4)
    assert arena.capacity > packed
    for one, two in zip(
        _taken(arena, trees) + accounts,
        _taken(other, other_trees) + other_accounts,
        strict=True,
    ):
        np.testing.assert_array_equal(one, two)
