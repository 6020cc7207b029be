"""Pruning leaves a valid tree."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.errors import InputError
from forest.scenario.acts import Branches
from forest.trees.metamers import BRANCHED, MAIN
from forest.trees.pruning import choose_branches, cut_branches
from tests.builders import random_arena
from tests.growth.growing import arena_of, copied, extent
from tests.growth.invariants import assert_valid
from tests.reference.plant import Node, read_plant

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
    assert set(cut_branches(arena_of(m, trees), trees, 1, [cut.serial], KAPPA)) == gone
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
        cut_branches(arena_of(m, trees), trees, 0, [serial], KAPPA)


@given(st.integers(0, 2**32 - 1))
def test_several_cuts_are_as_one_after_the_other(seed: int) -> None:
    """Each cut that stands on no other one, from the lowest place in the extent on."""
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 2, 40)
    one_by_one, their_trees = copied(m), copied(trees)
    nodes = read_plant(m, trees, 1)
    cuts = [node for node in nodes[1:] if rng.random() < 0.15]
    topmost = [cut for cut in cuts if not any(below in cuts for below in list(cut.down())[1:])]
    gone = cut_branches(arena_of(m, trees), trees, 1, [cut.serial for cut in cuts[::-1]], KAPPA)
    expected = [
        serial
        for cut in topmost
        for serial in cut_branches(
            arena_of(one_by_one, their_trees), their_trees, 1, [cut.serial], KAPPA
        )
    ]
    assert sorted(expected) == gone.tolist()
    assert_valid(m, trees)
    here = extent(trees, 1)
    assert here == extent(their_trees, 1)
    for name in m._fields:
        np.testing.assert_array_equal(getattr(m, name)[here], getattr(one_by_one, name)[here])


def _points_to(node: Node, side_deg: float, within_deg: float) -> bool:
    """Whether an axis that starts with a node points to a side, by the angle between two arrows."""
    assert node.below is not None
    x, y, _ = node.axis()[-1].tip - node.below.tip
    along = x * np.cos(np.radians(side_deg)) + y * np.sin(np.radians(side_deg))
    cosine = along / np.hypot(x, y)
    return bool(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) <= within_deg)


@given(
    st.integers(0, 2**32 - 1),
    st.floats(-360, 360),
    st.floats(1, 180),
    st.floats(0, 1),
    st.floats(0, 2),
)
def test_branches_are_chosen_by_side_and_height(
    seed: int, side: float, within: float, low: float, more: float
) -> None:
    m, trees = random_arena(np.random.default_rng(seed), 2, 40)
    heads = [n for n in read_plant(m, trees, 1) if n.order == 1 and n.below.order == 0]
    height = {n.serial: float(n.below.tip[2]) for n in heads}

    def chosen(**choice: float) -> list[int]:
        return choose_branches(m, trees, 1, Branches.of("test", **choice)).tolist()

    on_side = [n.serial for n in heads if _points_to(n, side, within)]
    assert chosen(side_deg=side, within_deg=within) == on_side
    between = [s for s in on_side if low <= height[s] <= low + more]
    assert chosen(side_deg=side, within_deg=within, from_m=low, to_m=low + more) == between
    assert chosen(below_m=low + 0.1) == [s for s, h in height.items() if h < low + 0.1]
    half = chosen(side_deg=side) + chosen(side_deg=side + (180 if side < 0 else -180))
    assert sorted(half) == sorted(height)


def test_a_branch_straight_up_points_to_no_side() -> None:
    m, trees = random_arena(np.random.default_rng(3), 1, 2)
    trees.size[0] = 2
    at = int(trees.start[0])
    m.parent[at : at + 2] = -1, 0
    m.order[at : at + 2] = 0, 1
    m.state[at : at + 2] = MAIN | BRANCHED, 0
    m.serial[at : at + 2] = 0, 1
    m.tip[at : at + 2] = [[0, 0, 1], [0, 0, 2]]
    assert not len(choose_branches(m, trees, 0, Branches.of("test", side_deg=0, within_deg=180)))
    assert choose_branches(m, trees, 0, Branches.of("test", below_m=1.5)).tolist() == [1]
