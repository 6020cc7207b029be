"""Reaction wood at branch points against its slow twin, and its signs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.mechanics.branch_points import reaction_rings, support_offset, widening
from forest.trees.metamers import MAIN, TERMINAL, Metamers
from forest.trees.table import Trees
from tests.builders import random_arena
from tests.mechanics.stem_cases import SPECIES, pole, tapered, wood_of, woody_arena
from tests.reference import stems as slow
from tests.reference.plant import Node, read_plant

seeds = st.integers(0, 2**32 - 1)


def _limb(node: Node) -> Node:
    """The first metamer of a metamer's axis."""
    while node.below is not None and node.below.onward is node:
        node = node.below
    return node


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_reaction_rings(seed: int) -> None:
    m, trees = woody_arena(np.random.default_rng(seed), 2, 30)
    rings = reaction_rings(m, trees, SPECIES)
    assert np.all((rings[:, 0] >= 0.0) & (rings[:, 0] < 1.0))
    for row in range(2):
        kind = int(trees.species[row])
        for node in read_plant(m, trees, row):
            wanted = slow.reaction(_limb(node), node, wood_of(kind), kind == 0)
            e, azimuth = rings[trees.start[row] + node.index]
            assert e == pytest.approx(wanted[0], rel=1e-4, abs=1e-6)
            if e < 1e-6:
                continue
            turn = (azimuth - wanted[1] + np.pi) % (2.0 * np.pi) - np.pi
            assert turn == pytest.approx(0.0, abs=1e-3)


@given(st.floats(0.005, 0.5), st.floats(0.01, 1.0))
@settings(max_examples=25, deadline=None)
def test_reaction_wood_supports_the_force(radius: float, lean: float) -> None:
    """The widened base supports F_R / (g cos(theta_R)) more than before."""
    wide = widening(radius, lean)
    more = (radius + wide) ** 2 - radius**2
    assert more == pytest.approx(radius**2 / lean, rel=1e-9)


def test_reaction_offset_balances_the_moment() -> None:
    """W X sin(theta_X) = delta F_R sin(theta_d), and delta stays on the limb."""
    delta = support_offset(20.0, 0.8, 50.0, 0.7, 2.0)
    assert delta * 50.0 * 0.7 == pytest.approx(20.0 * 0.8)
    assert support_offset(500.0, 0.8, 50.0, 0.7, 2.0) == 2.0
    assert support_offset(20.0, -0.8, 50.0, 0.7, 2.0) == 0.0
    assert support_offset(20.0, 0.8, 50.0, 0.0, 2.0) == 0.0


def _with_branch(azimuth: float, species: int) -> tuple[Metamers, Trees, slice]:
    """A vertical trunk of 10 metamers with a limb of 10 that leans by 60 degrees, and leaves."""
    m, trees = pole(np.concatenate((np.full(10, 0.05), np.full(10, 0.02))), 8.0)
    trees.species[:] = species
    m.parent[10] = 4
    m.state[9] = MAIN | TERMINAL
    m.state[10:19] &= ~MAIN & 0xFF
    m.state[11:20] |= MAIN
    m.state[19] |= TERMINAL
    m.order[10:20] = 1
    m.pipe[:10] = 0.1 ** SPECIES.pipe_exponent[species]
    m.pipe[10:20] = 0.02 ** SPECIES.pipe_exponent[species]
    heading = np.array([np.sin(1.05) * np.cos(azimuth), np.sin(1.05) * np.sin(azimuth), 0.5])
    m.tip[10:20] = m.tip[4] + 0.4 * np.arange(1, 11)[:, None] * heading
    return m, trees, slice(10, 20)


@pytest.mark.parametrize("azimuth", [0.4, -2.0])
@pytest.mark.parametrize("conifer", [True, False])
def test_reaction_wood_lies_below_conifers_and_above_broadleaves(
    azimuth: float, conifer: bool
) -> None:
    m, trees, limb = _with_branch(azimuth, 0 if conifer else 1)
    rings = reaction_rings(m, trees, SPECIES)
    thick = np.column_stack((np.cos(rings[:, 1]), np.sin(rings[:, 1])))
    outward = np.array([np.cos(azimuth), np.sin(azimuth)])
    side = 1.0 if conifer else -1.0
    assert thick[10] @ outward == pytest.approx(side, abs=1e-5)
    # The crown pulls the trunk to the limb's side.
    assert rings[0, 0] > 0.0
    assert thick[0] @ outward == pytest.approx(side, abs=1e-5)
    # It fades from the base of the limb outwards.
    assert rings[10, 0] > 0.02
    assert np.all(np.diff(rings[limb, 0]) <= 1e-7)
    assert rings[19, 0] < 0.5 * rings[10, 0]


def test_upright_tree_needs_no_reaction_wood() -> None:
    m, trees = pole(tapered(20, 1.0, 0.1), 8.0)
    np.testing.assert_array_equal(reaction_rings(m, trees, SPECIES)[:20, 0], 0.0)


def test_more_lean_more_reaction_wood() -> None:
    found = []
    for lean in (0.05, 0.1, 0.2, 0.4):
        m, trees = pole(tapered(40, 1.0, 0.2), 24.0, lean=lean)
        rings = reaction_rings(m, trees, SPECIES)
        found.append(rings[0, 0])
        assert rings[0, 1] == pytest.approx(0.0)
    assert np.all(np.diff(found) > 0.0)


@given(seeds, st.floats(-3.0, 3.0))
@settings(max_examples=25, deadline=None)
def test_reaction_turns_with_the_world(seed: int, angle: float) -> None:
    m, trees = random_arena(np.random.default_rng(seed), 1, 20)
    before = reaction_rings(m, trees, SPECIES)
    c, s = np.cos(angle), np.sin(angle)
    m.tip[:, :2] = m.tip[:, :2] @ np.array([[c, s], [-s, c]])
    after = reaction_rings(m, trees, SPECIES)
    np.testing.assert_allclose(after[:, 0], before[:, 0], rtol=1e-3, atol=1e-5)
    here = slice(int(trees.start[0]), int(trees.start[0] + trees.size[0]))
    turn = np.where(after[here, 0] > 1e-4, after[here, 1] - before[here, 1] - angle, 0.0)
    np.testing.assert_allclose((turn + np.pi) % (2.0 * np.pi) - np.pi, 0.0, atol=1e-3)


def test_threads_give_the_same_rings() -> None:
    m, trees = woody_arena(np.random.default_rng(7), 40, 40)
    with using_threads(1):
        one = reaction_rings(m, trees, SPECIES)
    with using_threads(3):
        np.testing.assert_array_equal(one, reaction_rings(m, trees, SPECIES))
