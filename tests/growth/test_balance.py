"""The allocation of Hart & Baker against its slow twin, and what it keeps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest.growth.balance import (
    hand_up,
    hand_up_priced,
    lay_cones,
    survey,
    trunk_growth,
)
from forest.growth.limbs import Limbs, Tree, Wood, cone_centre, cone_volume, supports
from forest.growth.parameters import species_traits, support
from forest.species import Species
from forest.trees.metamers import LATERAL, NO_ROOM_LATERAL, NO_ROOM_TERMINAL, TERMINAL
from tests.builders import random_arena
from tests.growth.growing import extent
from tests.reference import balance as slow
from tests.reference.plant import read_plant

seeds = st.integers(0, 2**32 - 1)


class Case:
    """One random tree, its limbs as the kernels know them and as the twin does."""

    def __init__(self, seed: int, traits: slow.Traits, *, thin: bool = False) -> None:
        rng = np.random.default_rng(seed)
        m, trees = random_arena(rng, 1, 25)
        here = extent(trees, 0)
        self.n = int(trees.size[0])
        for flag in (NO_ROOM_TERMINAL, NO_ROOM_LATERAL):
            m.state[here] |= (rng.random(self.n) < 0.1).astype(np.uint8) * flag
        if thin:
            m.pipe[here] *= rng.choice([1e-3, 1.0], self.n)
        self.traits = traits
        self.tree = Tree(*(getattr(m, name)[here] for name in Tree._fields))
        self.wood = Wood(traits.density, traits.support, traits.exponent, traits.twig, traits.cones)
        self.limbs = Limbs(*np.empty((2, self.n), np.int32), *np.empty((7, self.n)))
        self.units = np.zeros((8, 2))
        self.units[:, 1] = [traits.unit_of(order) for order in range(8)]
        self.v_main, self.v_side = np.empty((2, self.n))
        state = self.tree.state
        lateral = (state & LATERAL != 0) & (state & NO_ROOM_LATERAL == 0)
        self.may: NDArray[np.bool_] = lateral & (rng.random(self.n) < 0.7)
        self.limbs.bud[:] = self.may
        self.nodes = read_plant(m, trees, 0)
        self.trunk = self.read()

    def read(self) -> slow.Limb:
        """The twin's limbs of the tree as it was."""
        bud = self.tree.bud.astype(float)
        return slow.limb_of(
            self.nodes[0], self.traits, lambda i: bud[i], lambda n: self.may[n.index]
        )

    def survey(self) -> None:
        t = self.traits
        gains = (t.min_growth, t.offset_gain, t.light_gain)
        survey(self.tree, self.units, self.wood, gains, (t.offset_length, t.area), self.limbs)

    def hand_up(self, e_0: float) -> float:
        return float(
            hand_up(
                self.tree,
                e_0,
                self.units,
                self.traits.most,
                self.wood,
                self.limbs,
                self.v_main,
                self.v_side,
            )
        )


def _close(found: float, expected: float) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-12)


@given(st.floats(1e-3, 2.0), st.floats(0.0, 1.0))
def test_cone(base: float, part: float) -> None:
    """Volume and centre of mass against the sum of thin slices (eqs 5, 9, 11)."""
    tip, length, slices = part * base, 3.0, 4000
    y = (np.arange(slices) + 0.5) / slices
    area = np.pi * (base + (tip - base) * y) ** 2
    assert cone_volume(length, base, tip) == pytest.approx(area.mean() * length, rel=1e-6)
    assert cone_centre(base, tip) == pytest.approx((area * y).sum() / area.sum(), rel=1e-6)


def test_height_limit() -> None:
    """A cone of 300 feet carries itself exactly (eq. 8)."""
    k = support([Species(name="a")], np.array([500.0]))[0]
    wood = Wood(500.0, k, 2.0, 0.0, True)
    assert supports(0.5, wood) == pytest.approx(500.0 * cone_volume(91.44, 0.5, 0.0))


def test_crushing_strength() -> None:
    """Where wood has a strength, a base carries what crushes it, whatever its density (3.4)."""
    weak, strong = (Species(name="a", balance={"crushing_strength_mpa": s}) for s in (2.0, 20.0))
    k = support([weak, strong, strong], np.array([400.0, 400.0, 900.0]))
    of = [Wood(d, kd, 2.0, 0.0, True) for d, kd in zip((400.0, 400.0, 900.0), k, strict=True)]
    crushed = np.pi * 0.1**2 * np.array([2e6, 20e6, 20e6]) / 9.80665
    np.testing.assert_allclose([supports(0.1, wood) for wood in of], crushed)
    traits = species_traits([weak], paper=False).of["support"]
    assert traits[0] * weak.wood.density_kg_m3 == pytest.approx(k[0] * 400.0)


@given(seeds, st.sampled_from([1.0, 20.0, 500.0]), st.sampled_from([2.0, 2.5, 3.0]), st.booleans())
@settings(max_examples=25)
def test_survey(seed: int, offset_length: float, exponent: float, cones: bool) -> None:
    """Masses, light and growth rates of every limb and bud."""
    case = Case(seed, slow.Traits(offset_length=offset_length, exponent=exponent, cones=cones))
    case.survey()
    limbs, trunk = case.limbs, case.trunk
    buds = np.zeros(case.n)
    for limb in trunk.above():
        if not limb.nodes:
            buds[limb.at] = limb.total(trunk)
            continue
        assert limbs.last[limb.at] == limb.nodes[-1].index
        assert (limbs.head[[n.index for n in limb.nodes]] == limb.at).all()
        _close(limbs.length[limb.at], limb.length)
        _close(limbs.supported[limb.at], limb.supported)
        _close(limbs.light[limb.at], limb.light)
        _close(limbs.rate[limb.at], limb.rate(trunk))
        _close(limbs.total[limb.at], limb.total(trunk))
    np.testing.assert_allclose(limbs.bud, buds, rtol=1e-5)


@given(seeds, st.sampled_from([1e-3, 0.02, 0.3, 5.0]), st.booleans())
@settings(max_examples=25)
def test_hand_up(seed: int, e_0: float, thin: bool) -> None:
    """Radii and metamers, and what is left over, where wood is all that growth costs."""
    case = Case(seed, slow.Traits(), thin=thin)
    case.survey()
    expected = slow.Grown()
    slow.hand_up(case.trunk, e_0, case.trunk, expected)
    left = case.hand_up(e_0)
    _close(left, expected.left)
    for head, base in expected.base.items():
        _close(0.5 * np.sqrt(case.tree.pipe[head]), base)
    for i in range(case.n):
        np.testing.assert_allclose(case.v_main[i], expected.main.get(i, 0.0), rtol=1e-4, atol=1e-9)
        np.testing.assert_allclose(case.v_side[i], expected.side.get(i, 0.0), rtol=1e-4, atol=1e-9)


@given(seeds, st.sampled_from([0.0, 1e-4, 0.02]), st.booleans())
@settings(max_examples=25)
def test_trunk_growth(seed: int, gain: float, thin: bool) -> None:
    case = Case(seed, slow.Traits(), thin=thin)
    case.survey()
    _close(
        trunk_growth(case.tree, case.limbs, case.wood, gain), slow.trunk_growth(case.trunk, gain)
    )


@given(seeds, st.sampled_from([1e-3, 0.05, 0.5, 5.0]), st.booleans())
def test_mass_in_is_mass_out(seed: int, e_0: float, thin: bool) -> None:
    """What the tree weighs more, as cones, is what was handed up less what no limb took."""
    case = Case(seed, slow.Traits(most=1000.0), thin=thin)
    before = case.trunk.supported
    case.survey()
    left = case.hand_up(e_0)
    assert -1e-12 <= left <= e_0 * (1.0 + 1e-9)
    assert (case.v_main >= 0.0).all()
    assert (case.v_side >= 0.0).all()
    grow(case)
    assert case.read().supported - before == pytest.approx(e_0 - left, rel=1e-4, abs=1e-6)


def grow(case: Case) -> None:
    """Give the twin's nodes what the year gave: thicker bases and promised metamers."""
    for node in case.nodes:
        node.pipe = float(case.tree.pipe[node.index])
        held = node.resource
        node.resource = held[0] + case.v_main[node.index], held[1] + case.v_side[node.index]


@given(seeds, st.sampled_from([1e-3, 0.05, 0.5, 50.0]), st.sampled_from([20.0, 91.44]))
def test_limbs_support_what_they_carry(seed: int, e_0: float, height_limit: float) -> None:
    """A limb that supported what it carried does so when it has grown (eqs 17-19)."""
    traits = slow.Traits(support=np.pi * height_limit / 3.0, most=20.0)
    case = Case(seed, traits)
    for limb in case.trunk.above():
        assert limb.supported <= traits.supports(limb.base)
    case.survey()
    e_0 = min(e_0, traits.supports(case.trunk.base) - case.trunk.supported)
    case.hand_up(e_0)
    grow(case)
    for limb in case.read().above():
        assert limb.supported <= traits.supports(limb.base) * (1.0 + 1e-5)


@given(seeds, st.sampled_from([1e-3, 0.05, 5.0]), st.booleans())
@settings(max_examples=25)
def test_hand_up_priced(seed: int, budget: float, thin: bool) -> None:
    """Metamers that have a price: never more than the budget and than limbs can support."""
    traits = slow.Traits(support=3.0, cones=False)
    case = Case(seed, traits, thin=thin)
    rng = np.random.default_rng(seed)
    case.units[:, 0] = rng.uniform(1e-3, 1e-2, 8)
    pipe_path = rng.uniform(0.5, 5.0, case.n)
    pipe_cost, branch_pipe = 5e-4, 0.35

    def price(node: slow.Node, order: int) -> float:
        step = traits.unit_of(order) * (branch_pipe if order > 0 else 1.0)
        return float(case.units[min(order, 7), 0] + pipe_cost * (pipe_path[node.index] + step))

    expected = slow.Grown()
    slow.hand_up_priced(case.trunk, budget, case.trunk, price, expected)
    case.survey()
    prices = (pipe_path, pipe_cost, branch_pipe)
    hand_up_priced(
        case.tree,
        budget,
        case.units,
        prices,
        case.wood,
        case.limbs,
        case.v_main,
        case.v_side,
    )
    cost = 0.0
    for node in case.nodes:
        i = node.index
        _close(case.v_main[i], expected.main.get(i, 0.0))
        _close(case.v_side[i], expected.side.get(i, 0.0))
        cost += case.v_main[i] * price(node, node.order)
        cost += case.v_side[i] * price(node, node.order + 1)
    spare = max(0.0, traits.supports(case.trunk.base) - case.trunk.supported)
    assert cost <= min(budget, spare) * (1.0 + 1e-9)


@given(seeds, st.sampled_from([2.0, 2.5]), st.booleans())
@settings(max_examples=25)
def test_cones(seed: int, exponent: float, thin: bool) -> None:
    traits = slow.Traits(exponent=exponent)
    case = Case(seed, traits, thin=thin)
    tree = case.tree
    expected = {}
    for limb in case.trunk.above():
        if limb.nodes:
            expected.update(slow.cone_pipes(limb.nodes[0], traits))
    lay_cones(tree.parent, tree.state, tree.length, tree.pipe, case.wood, *np.empty((2, case.n)))
    for i, pipe in expected.items():
        np.testing.assert_allclose(tree.pipe[i], pipe, rtol=1e-5)


def test_growth_goes_to_the_light_side() -> None:
    """A tree that leans to +x: the limb on the other side grows, the one on this side hardly."""
    m, trees = random_arena(np.random.default_rng(0), 1, 1)
    s = int(trees.start[0])
    m.parent[s : s + 4] = [-1, 0, 1, 1]
    m.state[s : s + 4] = [1 | 16, 1 | 16 | 8, 1 | TERMINAL, TERMINAL]
    m.order[s : s + 4] = [0, 0, 0, 1]
    m.tip[s : s + 4] = [[0, 0, 1], [0.5, 0, 2], [1.5, 0, 2], [-0.1, 0, 2.5]]
    m.length[s : s + 4] = 1.0
    m.pipe[s : s + 4] = 1e-4
    m.resource[s : s + 4] = 0.0
    trees.size[0] = 4
    here = extent(trees, 0)
    tree = Tree(*(getattr(m, name)[here] for name in Tree._fields))
    limbs = Limbs(*np.empty((2, 4), np.int32), *np.zeros((7, 4)))
    units = np.full((8, 2), 0.2)
    wood = Wood(500.0, np.pi * 30.48, 2.0, 0.001, True)
    survey(tree, units, wood, (0.1, 0.45, 0.0), (1.0, 0.01), limbs)
    heavy, light = limbs.rate[0], limbs.rate[3]
    assert heavy == pytest.approx(0.1)
    assert light == pytest.approx(1.0)
