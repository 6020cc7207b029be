"""Thickening against its slow twin, and the identities that hold whatever grew."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.growth.budget import ACCOUNTS, EXTENSION, RESERVE_CHANGE, RING, SPEND
from forest.growth.dealing import Workbench, deal
from forest.growth.pipes import NO_NEED, reinforce, thicken
from forest.trees.metamers import LATERAL
from tests.builders import random_arena
from tests.growth.growing import copied, extent, make_species, make_traits, make_year
from tests.growth.test_budget import prices_of
from tests.reference import balance
from tests.reference import pipes as slow
from tests.reference.plant import read_plant

seeds = st.integers(0, 2**32 - 1)
TREE = make_species(carbon={"light_half_saturation": 0.5})
STEP = 9


def _thicken(m, trees, traits, year, accounts) -> None:  # type: ignore[no-untyped-def]
    shared = deal(trees.size)
    thicken(m, trees, shared, Workbench().scratch(shared), traits, year, accounts)


def _newborn(rng: np.random.Generator, m, trees) -> None:  # type: ignore[no-untyped-def]
    """Make the tree's last metamers those of this year; they have no wood yet."""
    n = int(trees.size[0])
    s = int(trees.start[0])
    first = max(1, n - int(rng.integers(0, 8)))
    m.birth[s : s + first] = STEP - 1
    m.birth[s + first : s + n] = STEP
    m.pipe[s + first : s + n] = 0.0
    m.sapwood[s + first : s + n] = 0.0


@given(seeds, st.sampled_from([2.0, 2.5, 3.0]))
def test_paper_mode(seed: int, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 1, 30)
    _newborn(rng, m, trees)
    traits = make_traits(
        make_species(wood={"pipe_exponent": exponent, "twig_diameter_m": 0.01}), paper=True
    )
    nodes = read_plant(m, trees, 0)
    expected = slow.thicken_paper(nodes, STEP, 0.01**exponent)
    _thicken(m, trees, traits, make_year(STEP, paper=True), np.zeros((1, ACCOUNTS)))
    for index, pipe in expected.items():
        np.testing.assert_allclose(m.pipe[extent(trees, 0)][index], pipe, rtol=1e-5)


def test_paper_mode_remembers() -> None:
    """d^n = d1^n + d2^n + what grew here: after branches are cut nothing gets thinner."""
    m, trees = random_arena(np.random.default_rng(2), 1, 60)
    s, n = int(trees.start[0]), int(trees.size[0])
    here = extent(trees, 0)
    m.birth[here] = STEP
    m.pipe[here] = 0.0
    traits = make_traits(TREE, paper=True)
    _thicken(m, trees, traits, make_year(STEP, paper=True), np.zeros((1, ACCOUNTS)))
    strand = TREE.wood.twig_diameter_m**TREE.wood.pipe_exponent
    above = np.bincount(m.parent[here][1:], m.pipe[s + 1 : s + n], minlength=n)
    np.testing.assert_allclose(m.pipe[here], above + strand, rtol=1e-5)
    whole = m.pipe[here].copy()
    trees.size[0] = n // 2
    _thicken(m, trees, traits, make_year(STEP + 1, paper=True), np.zeros((1, ACCOUNTS)))
    np.testing.assert_array_equal(m.pipe[s : s + n // 2], whole[: n // 2])


def _growth_rates(nodes, bud) -> dict[int, float]:  # type: ignore[no-untyped-def]
    """Growth rate of each metamer's limb, by the twin of the balance model."""
    t = TREE
    traits = balance.Traits(
        density=t.wood.density_kg_m3,
        twig=t.wood.twig_diameter_m / 2,
        cones=False,
        light_gain=t.balance.light_gain,
        offset_length=t.balance.offset_length_factor,
        area=t.leaves.area_m2,
        unit=(t.architecture.internode_length_m,),
    )
    trunk = balance.limb_of(nodes[0], traits, bud, lambda node: False)
    limbs = [limb for limb in trunk.above() if limb.nodes]
    return {n.index: limb.rate(trunk) for limb in limbs for n in limb.nodes}


@given(seeds, st.sampled_from([0.0, 0.02, 0.4, 10.0]), st.booleans(), st.booleans())
def test_mass_balance(seed: int, spend: float, dark: bool, balanced: bool) -> None:
    """Pipes, sapwood and accounts; the mass that is laid down is the mass that is booked."""
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 1, 30)
    _newborn(rng, m, trees)
    here = extent(trees, 0)
    m.pipe[here] *= rng.choice([0.01, 1.0], int(trees.size[0]))
    m.sapwood[here] = 0.7 * m.pipe[here]
    if dark:
        m.light[here] = 0.0
    trees.reserve[0] = 1.0
    traits, year = make_traits(TREE), make_year(STEP, balance=balanced)
    prices = prices_of(traits, float(trees.vigour[0]), year)
    nodes = read_plant(m, trees, 0)
    bud = m.bud[here].astype(float)
    favour = (lambda grown: _growth_rates(grown, lambda i: bud[i])) if balanced else None
    expected = slow.thicken_balanced(nodes, STEP, prices, spend, favour)
    accounts = np.zeros((1, ACCOUNTS))
    accounts[0, SPEND] = spend
    before = copied(m)
    _thicken(m, trees, traits, year, accounts)
    for node in nodes:
        k = int(trees.start[0]) + node.index
        np.testing.assert_allclose(m.pipe[k], expected.pipe[node.index], rtol=1e-5)
        np.testing.assert_allclose(m.sapwood[k], expected.sapwood[node.index], rtol=1e-5)
    assert (m.pipe[here] >= before.pipe[here]).all()
    booked = accounts[0, EXTENSION] + accounts[0, RING]
    np.testing.assert_allclose(accounts[0, EXTENSION], expected.extension, rtol=1e-5)
    np.testing.assert_allclose(accounts[0, RING], expected.ring, rtol=1e-5, atol=1e-12)
    short = max(0.0, expected.extension - spend)
    kept = expected.kept - short
    np.testing.assert_allclose(trees.reserve[0], 1.0 + kept, rtol=1e-5)
    np.testing.assert_allclose(accounts[0, RESERVE_CHANGE], kept, rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(booked + kept, spend, rtol=1e-5, atol=1e-9)
    grown = (m.pipe[here].astype(float) - before.pipe[here]) * m.length[here]
    laid = TREE.wood.density_kg_m3 * np.pi / 4 * grown.sum()
    laid += (m.birth[here] == STEP).sum() * prices.leaf_mass
    np.testing.assert_allclose(laid, booked, rtol=1e-5, atol=1e-9)


def test_a_thin_limb_is_thickened_first() -> None:
    """What is laid down before the ring makes every limb carry its load, if it can be paid."""
    m, trees = random_arena(np.random.default_rng(6), 1, 50)
    here = extent(trees, 0)
    m.state[here] |= LATERAL
    m.pipe[here] = 1e-9
    n = int(trees.size[0])
    leaf_mass, density = 0.02, 500.0
    load = np.array(
        [
            sum(500.0 * np.pi / 4 * a.pipe * a.length + a.buds * leaf_mass for a in node.above())
            for node in read_plant(m, trees, 0)
        ]
    )
    wood = (density, slow.SUPPORT, leaf_mass)
    fresh = (1.0, 1.0, 0.0)
    arguments = (m.parent[here], m.length[here], m.pipe[here], m.state[here], wood, fresh)
    thin = m.pipe[here].copy()
    half = reinforce(*arguments, NO_NEED, 1e-4, np.empty((4, n)))
    assert half == pytest.approx(1e-4)
    m.pipe[here] = thin
    reinforce(*arguments, NO_NEED, 1e9, np.empty((4, n)))
    radius = np.sqrt(m.pipe[here]) / 2
    needed = np.array([slow.needs_to_support(w, density) for w in load])
    np.testing.assert_allclose(radius, needed, rtol=1e-5)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_no_limb_sags_beyond_the_limit(seed: int) -> None:
    """Where trees bend: W h^2 / E I of what is beyond a metamer, at most the limit."""
    m, trees = random_arena(np.random.default_rng(seed), 1, 50)
    here = extent(trees, 0)
    m.state[here] |= LATERAL
    m.pipe[here] = 1e-9
    density, leaf_mass, fresh_wood, fresh_leaf = 500.0, 0.02, 1.9, 2.5
    modulus, limit, gravity = 6e9, 0.3, 9.80665
    sag = 64.0 * gravity / (np.pi * modulus * limit)
    nodes = read_plant(m, trees, 0)
    expected = []
    for node in nodes:
        weight = turning = 0.0
        for n in node.above():
            wood = fresh_wood * density * np.pi / 4 * n.pipe * n.length
            leaves = fresh_leaf * n.buds * leaf_mass
            beyond = 0.0  # from the lower end of `node` to that of n
            on_the_way = n
            while on_the_way is not node:
                on_the_way = on_the_way.below
                beyond += on_the_way.length
            weight += gravity * (wood + leaves)
            turning += gravity * (wood * (beyond + 0.5 * n.length) + leaves * (beyond + n.length))
        expected.append(turning**2 / weight / (modulus * limit))  # W h^2 / (E limit) = I
    reinforce(
        m.parent[here],
        m.length[here],
        m.pipe[here],
        m.state[here],
        (density, 1e12, leaf_mass),  # so strong that its load asks for nothing
        (fresh_wood, fresh_leaf, sag),
        NO_NEED,
        1e9,
        np.empty((4, int(trees.size[0]))),
    )
    area_moment = np.pi / 64 * m.pipe[here].astype(float) ** 2
    np.testing.assert_allclose(area_moment, expected, rtol=1e-4)
