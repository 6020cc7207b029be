"""The carbon budget against its slow twin."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from forest.growth.allocate import allocate
from forest.growth.budget import (
    ACCOUNTS,
    INCOME,
    LEAVES,
    RESERVE_CHANGE,
    SPEND,
    UPKEEP,
    affordable_scale,
    extension,
    light_response,
    lowest_scale,
    path_lengths,
    threshold_bin,
)
from forest.growth.dealing import Workbench, deal
from forest.growth.parameters import SpeciesTraits, Year
from forest.random import STREAM_ABORT
from forest.trees.metamers import LATERAL, TERMINAL
from tests.builders import random_arena
from tests.growth.growing import extent, make_species, make_traits, make_year
from tests.reference import budget as slow
from tests.reference.plant import read_plant
from tests.reference.random import uniforms

seeds = st.integers(0, 2**32 - 1)
TREE = make_species()


def prices_of(traits: SpeciesTraits, vigour: float, year: Year) -> slow.Prices:
    """The numbers that the twin needs, from the species' record."""
    of = traits.of[0]
    rate = of["light_use"] * of["leaf_area"] * vigour * year.income_factor[0] / year.full_light
    names = set(slow.Prices.__dataclass_fields__) - {"rate", "full_light"}
    full = year.full_light
    return slow.Prices(
        rate=float(rate), full_light=full, **{name: float(of[name]) for name in names}
    )


@given(seeds, st.sampled_from([0.35, 1.0, 2.0]))
def test_path_lengths(seed: int, kappa: float) -> None:
    m, trees = random_arena(np.random.default_rng(seed), 1, 30)
    here = extent(trees, 0)
    path, pipe_path = np.empty((2, int(trees.size[0])))
    path_lengths(m.parent[here], m.order[here], m.length[here], kappa, path, pipe_path)
    for node in read_plant(m, trees, 0):
        np.testing.assert_allclose(path[node.index], slow.path(node), rtol=1e-5)
        np.testing.assert_allclose(pipe_path[node.index], slow.pipe_path(node, kappa), rtol=1e-5)


@given(
    st.floats(0.0, 1.0, allow_subnormal=False),
    st.sampled_from([0.0, 0.3, 2.0]),
    st.sampled_from([1.0, 4.0]),
)
def test_light_response(share: float, half: float, full: float) -> None:
    """Full light counts fully, shade by more than its share; without a half, by its share."""
    traits = make_traits(make_species(carbon={"light_half_saturation": half}))
    prices = prices_of(traits, 1.0, make_year(full_light=full))
    counted = light_response(share * full, full, half)
    np.testing.assert_allclose(counted, slow.response(share * full, prices), rtol=1e-12)
    np.testing.assert_allclose(light_response(full, full, half), full, rtol=1e-12)
    assert counted >= share * full * (1.0 - 1e-12)
    if half == 0.0:
        assert counted == share * full


@given(st.floats(0.0, 100.0), st.sampled_from([5.0, 40.0, np.inf]))
def test_extension(height: float, limit: float) -> None:
    """Internodes shorten linearly towards the limit, to a tenth; without one not at all."""
    assert extension(height, limit) == slow.extension(height, limit)
    assert extension(0.0, limit) == 1.0


@given(seeds, st.floats(0.0, 1.2), st.integers(1, 5), st.sampled_from([25.0, np.inf]))
def test_affordable_scale(seed: int, part: float, most: int, limit: float) -> None:
    """The s that is found pays, and one bin of the histogram (1/32 octave) more does not."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 25))
    v = rng.uniform(0.0, 6.0, (2, n)) * (rng.random((2, n)) < 0.7)
    carried = (rng.random((n, 2)) * 0.99 * (rng.random((n, 2)) < 0.5)).astype(np.float32)
    order = rng.integers(0, 10, n).astype(np.uint8)
    pipe_path = rng.uniform(0.1, 5.0, n)
    wood = rng.uniform(0.2, 1.0, 8)
    unit = np.column_stack((wood + rng.uniform(0.3, 1.0, 8), rng.uniform(0.1, 0.3, 8), wood))
    stretch = np.array([slow.extension(z, limit) for z in rng.uniform(0.0, 30.0, n)])
    kappa, pipe_cost = 0.35, 0.4
    buds = []
    for i in range(n):
        for bud in range(2):
            on = int(order[i]) + bud
            cost, step, primary = unit[min(on, 7)]
            cost -= (1.0 - stretch[i]) * primary
            step *= stretch[i] * (kappa if on > 0 else 1.0)
            costs = [cost + pipe_cost * (pipe_path[i] + k * step) for k in range(1, most + 1)]
            buds.append(slow.Bud(v[bud, i], float(carried[i, bud]), tuple(costs)))
    at_most = sum(b.cost(1.0) for b in buds)
    budget = part * at_most * (1.0 + 1e-12)  # sums in another order may differ in the last digits
    s = affordable_scale(
        carried, v[0], v[1], pipe_path, stretch, order, unit, pipe_cost, kappa, most, budget
    )
    best = slow.affordable(buds, budget)
    assert 0.0 < s <= best
    assert sum(b.cost(s) for b in buds) <= budget * (1 + 1e-9)
    assert s >= best / (1 + 1 / 32) * (1 - 1e-6) or best < 2**-19
    if part >= 1.0001:
        assert s == 1.0


@given(st.floats(2**-20, 1.0))
def test_bins_of_thresholds(s: float) -> None:
    """A bin reaches from its edge (what is found if it cannot be paid) to the next one's."""
    k = threshold_bin(s)
    edges = []
    for first in (k, k + 1):
        costs = np.zeros(21 * 32)
        if first < len(costs):
            costs[first] = 1.0
        edges.append(lowest_scale(costs, 0.5))
    low, high = edges
    assert low < s
    assert s < high * (1 + 1e-9) or s == 1.0
    assert high / low < 1 + 1 / 32 + 1e-9 or s == 1.0


def _allocated(m, trees, traits, year):  # type: ignore[no-untyped-def]
    accounts = np.zeros((len(trees.tree_id), ACCOUNTS))
    shared = deal(trees.size)
    scratch = Workbench().scratch(shared)
    allocate(m, trees, shared, scratch, traits, year, accounts, None, None, None)
    return accounts


@given(seeds, st.sampled_from([0.0, 0.3, 1.0]), st.sampled_from([0.0, 0.5]))
def test_yearly_accounts(seed: int, factor: float, half: float) -> None:
    """Income, leaves and upkeep site by site; the reserve takes what is not spent."""
    m, trees = random_arena(np.random.default_rng(seed), 3, 25)
    reserve = trees.reserve.copy()
    bad = trees.bad_years.copy()
    tree = make_species(carbon={"light_half_saturation": half})
    traits, year = make_traits(tree), make_year(income_factor=factor)
    books = [
        slow.books(read_plant(m, trees, r), prices_of(traits, float(trees.vigour[r]), year))
        for r in range(3)
    ]
    accounts = _allocated(m, trees, traits, year)
    for r, (income, leaves, upkeep) in enumerate(books):
        have = reserve[r] + income - leaves - upkeep
        spend = (1.0 - TREE.carbon.reserve_fraction) * max(have, 0.0)
        np.testing.assert_allclose(accounts[r, INCOME], income, rtol=1e-5)
        np.testing.assert_allclose(accounts[r, LEAVES], leaves, rtol=1e-5)
        np.testing.assert_allclose(accounts[r, UPKEEP], upkeep, rtol=1e-5)
        np.testing.assert_allclose(accounts[r, SPEND], spend, rtol=1e-5, atol=1e-12)
        np.testing.assert_allclose(trees.reserve[r], have - spend, rtol=1e-5, atol=1e-12)
        change = accounts[r, RESERVE_CHANGE]
        np.testing.assert_allclose(change, have - spend - reserve[r], rtol=1e-5, atol=1e-9)
        poor = income - leaves - upkeep < TREE.carbon.suppression_ratio * income or income == 0.0
        assert trees.bad_years[r] == (bad[r] + 1 if poor else 0)


@given(seeds, st.integers(0, 3), st.sampled_from([0.0, 0.4, 1.0]))
def test_sites_that_do_not_pay_abort(seed: int, deficit: int, probability: float) -> None:
    m, trees = random_arena(np.random.default_rng(seed), 1, 25)
    here = extent(trees, 0)
    m.deficit[here] = deficit
    m.light[here] *= 0.5
    carbon = {"abortion_probability": probability, "first_pipe_diameter_m": 0.002}
    traits, year = make_traits(make_species(carbon=carbon)), make_year()
    prices = prices_of(traits, float(trees.vigour[0]), year)
    nodes = read_plant(m, trees, 0)
    tree_id = int(trees.tree_id[0])
    _allocated(m, trees, traits, year)
    for node in nodes:
        state = int(m.state[here][node.index])
        pays = slow.does_pay(node, prices)
        if node.buds:
            assert m.deficit[here][node.index] == (0 if pays else deficit + 1)
        gone = not pays and deficit + 1 > TREE.carbon.deficit_years
        draw = uniforms(year.seed, STREAM_ABORT, tree_id, node.serial, year.step)
        terminal_dies = gone and draw[0] < probability
        lateral_dies = gone and draw[1] < probability
        assert bool(state & TERMINAL) == (node.terminal and not terminal_dies)
        assert bool(state & LATERAL) == (node.lateral and not lateral_dies)


def test_old_foliage_goes() -> None:
    """Lateral sites lose their foliage at the leaves' retention; terminal ones renew it."""
    m, trees = random_arena(np.random.default_rng(5), 1, 40)
    here = extent(trees, 0)
    m.birth[here] = np.arange(int(trees.size[0])) // 4
    before = m.state[here].copy()
    traits = make_traits(make_species(leaves={"retention_years": 3}))
    _allocated(m, trees, traits, make_year(step=6))
    old = 6 - m.birth[here] >= 3
    lateral = (before & LATERAL) != 0
    assert (lateral & old).any()
    assert (((m.state[here] & LATERAL) != 0) == (lateral & ~old)).all()
    assert ((m.state[here] & TERMINAL) == (before & TERMINAL)).all()


def test_the_budget_limits_new_metamers() -> None:
    """Offered all it could want, a tree makes what it can pay for and carries the rest."""
    m, trees = random_arena(np.random.default_rng(8), 1, 40)
    here = extent(trees, 0)
    m.resource[here] = 0.25
    traits = make_traits(make_species(bud_fate={"alpha": 50.0}))
    rich = _allocated(m, trees, traits, make_year())
    made = np.floor(m.resource[here]).sum()
    assert made >= 1
    m.resource[here] = 0.25
    trees.reserve[0] = 0.0
    _allocated(m, trees, traits, make_year(income_factor=0.0))
    assert np.floor(m.resource[here]).sum() == 0
    assert (m.resource[here] >= 0.25).all()
    assert rich[0, SPEND] > 0.0
