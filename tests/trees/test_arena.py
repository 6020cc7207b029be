"""The arena: whatever extents are asked for, no metamer is lost."""

from __future__ import annotations

import copy

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from forest.trees.metamers import BYTES_PER_METAMER, Arena
from forest.trees.table import append, empty, keep


def test_a_metamer_takes_at_most_80_bytes() -> None:
    assert BYTES_PER_METAMER <= 80


class Model:
    """An arena and, beside it, what each tree's serials should be."""

    def __init__(self) -> None:
        self.arena = Arena(16)
        self.trees = empty(0)
        self.expected: list[np.ndarray] = []
        self.next = 0

    def grow(self, more: list[int]) -> None:
        """Let each tree gain some metamers."""
        gain = np.resize(np.array(more, np.int64), len(self.expected))
        t = self.trees
        self.arena.make_room(t.start, t.size, t.room, t.size + gain)
        for row, n in enumerate(gain):
            first = int(t.start[row] + t.size[row])
            new = np.arange(self.next, self.next + n)
            self.next += int(n)
            for field in self.arena.metamers:
                shape = (-1,) + (1,) * (field.ndim - 1)
                field[first : first + n] = new.reshape(shape).astype(field.dtype)
            self.expected[row] = np.concatenate((self.expected[row], new))
            t.size[row] += n

    def plant(self, n: int) -> None:
        """Add trees without metamers."""
        self.trees = append(self.trees, empty(n))
        self.expected += [np.zeros(0, int)] * n

    def fell(self, row: int) -> None:
        """Take a tree away: its extent becomes a hole."""
        stays = np.arange(len(self.expected)) != row % max(1, len(self.expected))
        self.trees = keep(self.trees, stays)
        self.expected = [e for e, s in zip(self.expected, stays, strict=True) if s]

    def shrink(self, row: int) -> None:
        """Drop half of a tree's metamers."""
        if self.expected:
            row %= len(self.expected)
            self.trees.size[row] //= 2
            self.expected[row] = self.expected[row][: self.trees.size[row]]

    def check(self) -> None:
        """Compare all fields of all trees; extents lie in the arena and do not overlap."""
        t = self.trees
        held = np.zeros(self.arena.capacity, int)
        for row, numbers in enumerate(self.expected):
            first = int(t.start[row])
            held[first : first + int(t.room[row])] += 1
            assert len(numbers) == t.size[row] <= t.room[row]
            assert first + t.room[row] <= self.arena.used <= self.arena.capacity
            for field in self.arena.metamers:
                got = field[first : first + len(numbers)]
                shape = (-1,) + (1,) * (field.ndim - 1)
                wanted = numbers.reshape(shape).astype(field.dtype)
                assert (got == wanted).all()
        assert held.max() <= 1


act = st.one_of(
    st.tuples(st.just("grow"), st.lists(st.integers(0, 60), min_size=1, max_size=4)),
    st.tuples(st.just("plant"), st.integers(1, 4)),
    st.tuples(st.just("fell"), st.integers(0, 20)),
    st.tuples(st.just("shrink"), st.integers(0, 20)),
)


@given(st.lists(act, max_size=15))
def test_no_metamer_is_lost(acts: list[tuple[str, object]]) -> None:
    model = Model()
    model.plant(2)
    for name, argument in acts:
        getattr(model, name)(argument)
        model.check()


def test_nothing_moves_while_there_is_room() -> None:
    model = Model()
    model.plant(3)
    model.grow([100])
    before = copy.deepcopy(model.trees)
    arrays = model.arena.metamers
    model.grow([int((model.trees.room - model.trees.size).min())])
    assert model.arena.metamers is arrays
    assert (model.trees.start == before.start).all()
    assert (model.trees.room == before.room).all()
