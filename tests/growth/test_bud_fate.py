"""Both bud-fate models against their slow twins."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from forest.growth.bud_fate import gather_light, share_borchert_honda, share_priority
from forest.trees.metamers import LATERAL, NO_ROOM_LATERAL, NO_ROOM_TERMINAL, TERMINAL
from tests.builders import random_arena
from tests.reference import bud_fate as slow
from tests.reference.plant import read_plant

seeds = st.integers(0, 2**32 - 1)


class Case:
    """One random tree; its light comes in eighths, so that means tie and sums are exact."""

    def __init__(self, seed: int, n: int = 40) -> None:
        rng = np.random.default_rng(seed)
        self.m, self.trees = random_arena(rng, 1, n)
        s = int(self.trees.start[0])
        self.here = slice(s, s + int(self.trees.size[0]))
        k = self.here.stop - s
        self.m.light[self.here] = rng.integers(0, 9, k) / 8
        for flag in (NO_ROOM_TERMINAL, NO_ROOM_LATERAL):
            self.m.state[self.here] |= (rng.random(k) < 0.1).astype(np.uint8) * flag
        self.n = k
        self.parent = self.m.parent[self.here]
        self.state = self.m.state[self.here]
        self.order = self.m.order[self.here]
        self.light = self.m.light[self.here]
        self.q_main, self.q_side = np.empty(k), np.empty(k)
        self.v_main, self.v_side = np.empty(k), np.empty(k)
        self.q_base = gather_light(self.parent, self.state, self.light, self.q_main, self.q_side)
        self.nodes = read_plant(self.m, self.trees, 0)

    def by_bud(self) -> dict[tuple[int, str], float]:
        """What each living bud gets."""
        out = {}
        for i in range(self.n):
            if self.state[i] & TERMINAL:
                out[i, "main"] = self.v_main[i]
            if self.state[i] & LATERAL:
                out[i, "side"] = self.v_side[i]
        return out


@given(seeds)
def test_gathered_light(seed: int) -> None:
    case = Case(seed)
    assert case.q_base == slow.light_of(case.nodes[0])
    for node in case.nodes:
        assert case.q_main[node.index] == slow.light_of_terminal(node)
        assert case.q_side[node.index] == slow.light_of_lateral(node)


def _assert_same(case: Case, expected: dict[tuple[int, str], float]) -> None:
    got = case.by_bud()
    for bud, v in got.items():
        np.testing.assert_allclose(v, expected.get(bud, 0.0), rtol=1e-5, atol=1e-12)
    assert set(expected) <= set(got)


@given(seeds, st.sampled_from([0.0, 0.46, 0.5, 0.54, 1.0]), st.integers(0, 4))
def test_borchert_honda(seed: int, lam: float, max_order: int) -> None:
    case = Case(seed)
    bias = np.full(8, 0.5)
    bias[:2] = lam
    share_borchert_honda(
        case.parent,
        case.state,
        case.order,
        case.q_main,
        case.q_side,
        bias,
        float(max_order),
        2.0 * case.q_base,
        case.v_main,
        case.v_side,
    )
    expected: dict[tuple[int, str], float] = {}
    slow.borchert_honda(
        case.nodes[0],
        2.0 * case.q_base,
        lambda order: bias[min(order, 7)],
        max_order,
        expected,
    )
    _assert_same(case, expected)


def _share_priority(
    case: Case, control: np.ndarray, shape: tuple[float, float, float], max_order: int, v: float
) -> None:
    share_priority(
        case.parent,
        case.state,
        case.order,
        case.q_main,
        case.q_side,
        control,
        shape,
        float(max_order),
        v,
        case.v_main,
        case.v_side,
        np.empty((4, case.n), np.int32),
    )


@given(
    seeds,
    st.sampled_from([3, 40, 150]),
    st.sampled_from([0.006, 0.3, 1.0]),
    st.sampled_from([0.0, 0.2, 0.35, 0.5, 1.0]),
    st.integers(0, 3),
    st.integers(1, 200),
)
def test_priority(
    seed: int, n: int, w_min: float, kappa: float, controlled: int, max_order: int
) -> None:
    case = Case(seed, n)
    control = np.zeros(8)
    control[:controlled] = 1.0
    v = 2.0 * case.q_base
    _share_priority(case, control, (1.0, w_min, kappa), max_order, v)
    expected: dict[tuple[int, str], float] = {}
    slow.priority(
        case.nodes[0],
        v,
        lambda order: control[min(order, 7)] > 0.0,
        lambda k, of: slow.weight_of_place(k, of, 1.0, w_min, kappa),
        max_order,
        expected,
    )
    _assert_same(case, expected)


def _pole(lights: list[float], state: list[int]) -> Case:
    """A straight axis of metamers without branches."""
    case = Case(0, 1)
    k = len(lights)
    case.n = k
    case.parent = np.arange(-1, k - 1, dtype=np.int32)
    case.state = np.array(state, np.uint8)
    case.order = np.zeros(k, np.uint8)
    case.light = np.array(lights, np.float32)
    case.q_main, case.q_side, case.v_main, case.v_side = np.empty((4, k))
    case.q_base = gather_light(case.parent, case.state, case.light, case.q_main, case.q_side)
    return case


def test_weights_of_fig_8b() -> None:
    """w = 2, 1, 0.5 by hand; a branch of three buds and total light 2.1 counts as 0.7."""
    main, lateral, terminal, branched, continued = 1, 4, 2, 8, 16
    case = _pole([0.875, 0.0, 0.5, 1.0, 0.5, 0.625], [lateral | continued] * 6)
    # the axis: 0 (bud 0.875), 1 (branch), 2 (tip 0.5); the branch: 3, 4, 5 with 1.0, 0.5, 0.625
    case.parent[:] = [-1, 0, 1, 1, 3, 4]
    case.order[:] = [0, 0, 0, 1, 1, 1]
    case.state[:] = [
        main | lateral | continued,
        main | branched | continued,
        main | terminal,
        lateral | continued,
        main | lateral | continued,
        main | terminal,
    ]
    gather_light(case.parent, case.state, case.light, case.q_main, case.q_side)
    assert case.q_side[1] == 2.125
    control = np.zeros(8)
    # a line from 2 to 0.5 at 0.5 N has 2, 1, 0.5 at the three places
    _share_priority(case, control, (2.0, 0.5, 0.5), 9, 6.0)
    total = 0.875 * 2.0 + 2.125 * 1.0 + 0.5 * 0.5
    assert np.isclose(case.v_side[0], 6.0 * 0.875 * 2.0 / total)
    assert np.isclose(case.v_side[1], 6.0 * 2.125 * 1.0 / total)
    assert np.isclose(case.v_main[2], 6.0 * 0.5 * 0.5 / total)
    control[:] = 1.0
    _share_priority(case, control, (2.0, 0.5, 0.5), 9, 6.0)
    total = 0.5 * 2.0 + 0.875 * 1.0 + 2.125 * 0.5
    assert np.isclose(case.v_main[2], 6.0 * 0.5 * 2.0 / total)
    assert np.isclose(case.v_side[0], 6.0 * 0.875 * 1.0 / total)
    assert np.isclose(case.v_side[1], 6.0 * 2.125 * 0.5 / total)


def test_long_lists_sort_as_short_ones() -> None:
    """Past 24 items another sort is used; equal light must keep the order along the axis."""
    rng = np.random.default_rng(4)
    state = [LATERAL | 16] * 59 + [LATERAL | TERMINAL]
    case = _pole(list(rng.integers(0, 4, 60) / 8), [1 | s for s in state])
    _share_priority(case, np.zeros(8), (1.0, 0.1, 1.0), 9, 10.0)
    lit = np.flatnonzero(case.light > 0)
    by_light = lit[np.argsort(-case.light[lit], kind="stable")]
    weight = case.v_side[by_light] / case.light[by_light]
    assert (np.diff(weight) < 0).all()
