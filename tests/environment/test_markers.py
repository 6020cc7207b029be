"""The marker space against its slow twin, and what must hold of it on any stand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.environment.marker_buds import apply_space, bud_index
from forest.environment.markers import Envelope, MarkerSpace, MarkerSpecies
from forest.trees.metamers import LATERAL, NO_ROOM_LATERAL, NO_ROOM_TERMINAL, TERMINAL
from tests.builders import random_arena
from tests.reference import markers as twin

SIZE = (1.3, 1.1)
SPACING = 0.2


def make_species(rng: np.random.Generator, n: int) -> MarkerSpecies:
    return MarkerSpecies(
        rng.uniform(0.05, 0.3, n).astype(np.float32),
        rng.uniform(0.2, 0.7, n).astype(np.float32),
        np.cos(np.radians(rng.uniform(20.0, 170.0, n))).astype(np.float32),
    )


def as_rows(species: MarkerSpecies) -> list[tuple[float, ...]]:
    return [tuple(float(v) for v in row) for row in zip(*species, strict=True)]


def all_cells(space: MarkerSpace, buds, reach: float, periodic: bool) -> list:
    """Every cell that could matter: those of the plot, or those around all buds."""
    places = np.array([b["place"] for b in buds]).reshape(-1, 3)
    low = np.floor((places.min(axis=0) - reach) / space.cell_m).astype(int)
    high = np.floor((places.max(axis=0) + reach) / space.cell_m).astype(int)
    low[2] = 0
    if periodic:
        low[:2] = 0
        high[:2] = np.rint(np.array(SIZE) / space.cell_m[:2]).astype(int) - 1
    ranges = [range(a, b + 1) for a, b in zip(low, high, strict=True)]
    return list(itertools.product(*ranges))


def expect(buds, space: MarkerSpace, seed: int, species, periodic: bool, keep=None, extra=()):
    """The twin's answer, and the markers that it says are taken."""
    if not buds:
        return set(), [], np.zeros((0, 3))
    reach = max(max(row[:2]) for row in as_rows(species))
    cell = space.cell_m
    markers = [
        twin.marker_of_cell(seed, *ijk, cell) for ijk in all_cells(space, buds, reach, periodic)
    ]
    markers = [m for m in markers if keep is None or keep(m)] + [tuple(p) for p in extra]
    taken, won, direction = twin.claim(buds, markers, as_rows(species), SIZE if periodic else None)
    return {markers[m] for m in taken}, [len(w) for w in won], np.array(direction).reshape(-1, 3)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**63 - 1), periodic=st.booleans())
def test_claims_equal_the_twin(seed: int, periodic: bool) -> None:
    rng = np.random.default_rng(seed)
    metamers, trees = random_arena(rng, 2, 5, size_m=SIZE, n_species=2)
    species = make_species(rng, 2)
    extra = rng.uniform((0, 0, -0.3), (*SIZE, 0.8), (6, 3))
    envelopes = [
        Envelope(shape, tuple(rng.uniform(0, SIZE[0], 3)), tuple(rng.uniform(0.3, 1.5, 3)))
        for shape in rng.choice(["ellipsoid", "cylinder", "box"], rng.integers(0, 3))
    ]

    def keep(point) -> bool:
        turns = (-1, 0, 1) if periodic else (0,)
        return not envelopes or any(
            twin.inside((point[0] + a * SIZE[0], point[1] + b * SIZE[1], point[2]), *envelope)
            for envelope in envelopes
            for a in turns
            for b in turns
        )

    space = MarkerSpace(seed, SPACING, SIZE, periodic, True, envelopes, extra)
    found = space.claim(metamers, trees, species)
    buds = twin.living_buds(metamers, trees)
    _, count, direction = expect(buds, space, seed, species, periodic, keep, extra)
    assert found.tree_row.tolist() == [b["row"] for b in buds]
    assert found.metamer.tolist() == [b["metamer"] for b in buds]
    assert found.kind.tolist() == [b["kind"] for b in buds]
    assert found.found.tolist() == count
    np.testing.assert_allclose(found.direction, direction, rtol=1e-5, atol=1e-5)


def same(a, b) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32), periodic=st.booleans())
def test_the_paper_deletes_markers_for_good(seed: int, periodic: bool) -> None:
    """Two years with different stands: what the first took is gone in the second."""
    rng = np.random.default_rng(seed)
    species = make_species(rng, 1)
    first = random_arena(rng, 2, 4, size_m=SIZE)
    second = random_arena(rng, 2, 4, size_m=SIZE)
    extra = rng.uniform((0, 0, 0), (*SIZE, 0.8), (6, 3))
    space = MarkerSpace(seed, SPACING, SIZE, periodic, False, (), extra)
    buds = twin.living_buds(*first)
    gone, _, _ = expect(buds, space, seed, species, periodic, None, extra)
    space.claim(*first, species)
    resumed = MarkerSpace(seed, SPACING, SIZE, periodic, False, (), extra)
    resumed.restore(space.state())
    found = space.claim(*second, species)
    buds = twin.living_buds(*second)
    left = [tuple(p) for p in extra if tuple(p) not in gone]
    _, count, _ = expect(
        buds, space, seed, species, periodic, lambda point: point not in gone, left
    )
    assert found.found.tolist() == count
    assert same(found, resumed.claim(*second, species))


def test_markers_come_back_when_released() -> None:
    rng = np.random.default_rng(3)
    species = MarkerSpecies(np.float32([0.4]), np.float32([1.0]), np.float32([0.7]))
    crowded = random_arena(rng, 6, 40, size_m=SIZE)
    alone = random_arena(rng, 1, 10, size_m=SIZE)
    found = {}
    for release in (True, False):
        space = MarkerSpace(5, SPACING, SIZE, True, release)
        before = space.claim(*alone, species)
        space.claim(*crowded, species)
        found[release] = before.found.sum(), space.claim(*alone, species).found.sum()
    assert found[True][1] == found[True][0]
    assert found[False][1] < found[False][0]


def stand(rng: np.random.Generator):
    return random_arena(rng, 40, 60, size_m=(8.0, 6.0), n_species=2)


def test_threads_do_not_change_bits() -> None:
    rng = np.random.default_rng(11)
    metamers, trees = stand(rng)
    species = make_species(rng, 2)
    answers = []
    for n in (1, 2):
        with using_threads(n):
            space = MarkerSpace(1, SPACING, (8.0, 6.0), True, False)
            space.claim(metamers, trees, species)
            answers.append(space.claim(metamers, trees, species))
    assert answers[0].found.sum() > 100
    assert same(*answers)


def test_where_a_tree_stands_on_a_torus_does_not_matter() -> None:
    """The same stand named one plot further has the same neighbours and markers."""
    rng = np.random.default_rng(12)
    metamers, trees = stand(rng)
    species = make_species(rng, 2)
    space = MarkerSpace(1, SPACING, (8.0, 6.0), True, True)
    here = space.claim(metamers, trees, species)
    there = space.claim(metamers, trees._replace(x=trees.x + 8.0, y=trees.y - 6.0), species)
    assert here.found.tolist() == there.found.tolist()
    np.testing.assert_allclose(here.direction, there.direction, atol=1e-6)


def test_buds_without_room_are_marked_and_found() -> None:
    rng = np.random.default_rng(13)
    metamers, trees = stand(rng)
    unused = np.ones(len(metamers.state), bool)
    for start, size in zip(trees.start, trees.size, strict=True):
        unused[start : start + size] = False
    species = MarkerSpecies(*(np.float32([a, a]) for a in (0.3, 0.5, 0.7)))
    space = MarkerSpace(1, SPACING, (8.0, 6.0), True, True).claim(metamers, trees, species)
    metamers.state[~unused] |= NO_ROOM_LATERAL  # last year's marks
    before = metamers.state.copy()
    apply_space(metamers, trees, space)
    assert 0 < np.count_nonzero(space.found) < len(space.found)
    assert np.array_equal(metamers.state[unused], before[unused])
    for row, start in enumerate(trees.start):
        for index in range(trees.size[row]):
            state = metamers.state[start + index]
            for kind, living, full in (
                (0, TERMINAL, NO_ROOM_TERMINAL),
                (1, LATERAL, NO_ROOM_LATERAL),
            ):
                b = bud_index(space, row, index, kind)
                assert (b >= 0) == bool(state & living)
                if b >= 0:
                    assert (space.tree_row[b], space.metamer[b], space.kind[b]) == (
                        row,
                        index,
                        kind,
                    )
                assert bool(state & full) == (b >= 0 and space.found[b] == 0)


def test_a_cell_that_does_not_divide_the_plot_is_adjusted() -> None:
    assert MarkerSpace(1, 0.3, (8.0, 6.0), True, True).cell_m == pytest.approx([8 / 27, 0.3, 0.3])
    assert MarkerSpace(1, 0.3, (8.0, 6.0), False, True).cell_m == pytest.approx([0.3, 0.3, 0.3])


def test_no_buds_no_claims() -> None:
    rng = np.random.default_rng(1)
    species = make_species(rng, 1)
    for n_trees in (0, 2):
        metamers, trees = random_arena(rng, n_trees, 0)
        space = MarkerSpace(1, SPACING, SIZE, False, False).claim(metamers, trees, species)
        assert len(space.found) == 0
        assert space.first_of_tree.tolist() == [0] * (n_trees + 1)
