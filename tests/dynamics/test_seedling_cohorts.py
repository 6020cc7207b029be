"""Cohorts of seedlings: light, survival, growth, room, and draws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.dynamics.regeneration.cells import Cells
from forest.dynamics.regeneration.cohorts import (
    Cohorts,
    germinate,
    join,
    keep,
    live_a_year,
    merge,
    survivors,
)
from forest.dynamics.regeneration.recruits import LEAST_DISTANCE_M, find_places
from forest.dynamics.regeneration.sprouts import Stumps, sprout_cohorts
from tests.dynamics.seedling_cases import (
    NAMES,
    SHIPPED,
    code,
    ground,
    one_per_cell,
    random_cohorts,
    slow_traits,
)
from tests.reference import regeneration as slow

EVERY_YEAR = np.ones(len(NAMES))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([1.0, 2.25]), st.integers(1, 2))
def test_a_year_is_that_of_the_slow_twin(seed: int, area: float, threads: int) -> None:
    rng = np.random.default_rng(seed)
    cells = 7
    cohorts = random_cohorts(rng, cells, 25)
    here = ground(rng.uniform(0.0, 1.0, cells), rng.uniform(0.0, 1.2, cells), area)
    factor = rng.uniform(0.5, 1.5, len(NAMES))
    lists = {name: column.tolist() for name, column in cohorts._asdict().items()}
    expected = slow.live_a_year(
        lists,
        here.light.tolist(),
        here.taken.tolist(),
        here.transmission,
        area,
        slow_traits(SHIPPED.seedling),
        factor.tolist(),
        seed,
        2001,
    )
    with using_threads(threads):
        found = live_a_year(cohorts, here, SHIPPED.seedling, factor, seed=seed, year=2001)
    for a, b in zip(found, expected, strict=True):
        assert a.tolist() == b
    assert cohorts.n.tolist() == lists["n"]
    for name in ("height", "age", "reserve"):
        assert getattr(cohorts, name) == pytest.approx(lists[name], rel=1e-9)


def test_a_good_year_lets_seedlings_grow_no_taller_than_full_light() -> None:
    heights, reserves = [], []
    for factor in (0.5, 1.0, 10.0):
        cohorts = random_cohorts(np.random.default_rng(1), 3, 9)
        here = ground(np.ones(3), np.zeros(3), 1.0)
        live_a_year(cohorts, here, SHIPPED.seedling, factor * EVERY_YEAR, seed=1, year=2001)
        heights.append(cohorts.height)
        reserves.append(cohorts.reserve.sum())
    assert (heights[0] < heights[1]).all()
    assert heights[1].tolist() == heights[2].tolist()
    assert reserves[0] < reserves[1] < reserves[2]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_no_cell_holds_more_than_its_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = 5
    cohorts = random_cohorts(rng, cells, 40)
    here = ground(rng.uniform(0.3, 1.0, cells), rng.uniform(0.0, 1.0, cells))
    live_a_year(cohorts, here, SHIPPED.seedling, EVERY_YEAR, seed=seed, year=2001)
    of = SHIPPED.seedling
    full = (
        of.density_1m_m2[cohorts.species] * cohorts.height ** -of.density_exponent[cohorts.species]
    )
    one = np.zeros(cells)  # a part of a plant is drawn, so the last one may be too many
    np.maximum.at(one, cohorts.cell, 1.0 / full)
    taken = here.taken + np.bincount(cohorts.cell, cohorts.n / full, cells)
    assert (taken <= np.maximum(1.0, here.taken) + one + 1e-9).all()


def test_thickets_thin_themselves_as_they_grow() -> None:
    pine = code("pinus_sylvestris")
    cohorts = one_per_cell(pine, 2500, 20)
    here = ground(np.ones(20), area=25.0)
    numbers = []
    for year in range(6):
        live_a_year(cohorts, here, SHIPPED.seedling, EVERY_YEAR, seed=1, year=year)
        numbers.append(cohorts.n.mean())
    assert numbers == sorted(numbers, reverse=True)
    of, height = SHIPPED.seedling, float(cohorts.height[0])
    most = of.density_1m_m2[pine] * height ** -of.density_exponent[pine] * 25.0
    assert most - 1.0 < numbers[-1] <= most + 1.0


def test_the_tall_shade_the_low() -> None:
    """Of two cohorts in a cell the lower one is in the shade; alone it would not be."""
    spruce, beech = code("picea_abies"), code("fagus_sylvatica")
    low = one_per_cell(spruce, 5, 1, height=0.2)
    tall = one_per_cell(beech, 12, 1, height=1.2)
    beside = join(low, tall)
    assert beside.height.tolist() == [1.2, 0.2]
    here = ground(0.4)
    live_a_year(low, here, SHIPPED.seedling, EVERY_YEAR, seed=1, year=1)
    live_a_year(beside, here, SHIPPED.seedling, EVERY_YEAR, seed=1, year=1)
    assert 0.2 < beside.height[1] < low.height[0]


def _share_alive(name: str, light: float, years: int) -> float:
    cohorts = one_per_cell(code(name), 4, 400, height=0.05)
    here = ground(np.full(400, light), area=100.0)
    for year in range(years):
        live_a_year(cohorts, here, SHIPPED.seedling, EVERY_YEAR, seed=1, year=year)
    return float(cohorts.n.sum() / 1600)


def test_the_tolerant_survive_where_the_intolerant_die() -> None:
    for tolerant in ("fagus_sylvatica", "picea_abies"):
        assert _share_alive(tolerant, 0.03, 5) > 0.5
    for intolerant in ("betula_pendula", "pinus_sylvestris"):
        assert _share_alive(intolerant, 0.03, 5) == 0.0
        assert _share_alive(intolerant, 0.6, 5) > 0.6
    assert (
        _share_alive("quercus_robur", 0.03, 5) < 0.01 < 0.5 < _share_alive("quercus_robur", 0.2, 5)
    )


def test_in_full_light_the_intolerant_are_faster() -> None:
    heights = {}
    for name in NAMES:
        cohorts = one_per_cell(code(name), 1, 1, height=SHIPPED.first_height_m[code(name)])
        for year in range(5):
            live_a_year(cohorts, ground(1.0), SHIPPED.seedling, EVERY_YEAR, seed=1, year=year)
        heights[name] = float(cohorts.height[0])
    assert max(heights, key=heights.__getitem__) == "betula_pendula"
    assert heights["pinus_sylvestris"] > heights["picea_abies"]


def test_survivors_have_the_binomial_moments() -> None:
    n, share = 37, 0.3
    drawn = np.array([survivors(n, share, 1, cell, 0, 2000) for cell in range(4000)])
    assert drawn.mean() == pytest.approx(n * share, abs=0.25)
    assert drawn.var() == pytest.approx(n * share * (1 - share), rel=0.1)
    assert survivors(n, 0.0, 1, 5, 0, 2000) == 0
    assert survivors(n, 1.0, 1, 5, 0, 2000) == n


@pytest.mark.parametrize("mean", [0.02, 1.7, 12.0, 29.9, 400.0])
def test_germinants_have_the_poisson_moments(mean: float) -> None:
    n = germinate(np.full(6000, mean), seed=2, kind=1, year=2000)
    assert n.mean() == pytest.approx(mean, abs=5 * np.sqrt(mean / 6000))
    assert n.var() == pytest.approx(mean, rel=0.2)
    assert (n >= 0).all()
    assert (germinate(np.zeros(10), seed=2, kind=1, year=2000) == 0).all()
    assert n.tolist() != germinate(np.full(6000, mean), seed=2, kind=0, year=2000).tolist()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 4))
def test_merging_keeps_numbers_and_means(seed: int, most: int) -> None:
    cohorts = random_cohorts(np.random.default_rng(seed), 3, 40, species=2)
    merged = merge(cohorts, most)
    for cell in range(3):
        for kind in range(2):
            one, other = (
                keep(c, (c.cell == cell) & (c.species == kind)) for c in (cohorts, merged)
            )
            assert len(other.n) == min(len(one.n), most)
            assert other.n.sum() == one.n.sum()
            for name in ("height", "age", "reserve"):
                total = (one.n * getattr(one, name)).sum()
                assert (other.n * getattr(other, name)).sum() == pytest.approx(total)
            alone = min(len(one.n), most) - 1
            alone = max(alone, 0)
            assert other.height[:alone] == pytest.approx(one.height[:alone])
            assert set(other.mother.tolist()) <= set(one.mother.tolist())
    order = np.lexsort((-merged.height, merged.cell))
    assert merged.height[order].tolist() == merged.height.tolist()


def test_recruits_keep_their_distance() -> None:
    cells = Cells.over((6.0, 6.0), 1.0, True)
    cohorts = one_per_cell(0, 3, cells.count, height=1.4)
    stems = np.array([0.5, 2.5, 5.99]), np.array([0.5, 2.5, 0.01])
    places = find_places(cohorts, cells, *stems, seed=1, year=2000)
    assert len(places.x) > 90
    assert cells.of(places.x, places.y).tolist() == cohorts.cell[places.cohort].tolist()
    x, y = np.append(places.x, stems[0]), np.append(places.y, stems[1])
    dx, dy = (np.abs(c[:, None] - c[None, :]) for c in (x, y))
    distance = np.hypot(np.minimum(dx, 6.0 - dx), np.minimum(dy, 6.0 - dy))
    np.fill_diagonal(distance, np.inf)
    assert distance.min() >= LEAST_DISTANCE_M
    crowd = one_per_cell(0, 200, 1, height=1.4)
    assert len(find_places(crowd, cells, *stems, seed=1, year=2000).x) < 60


def test_stumps_of_sprouting_species_sprout() -> None:
    cells = Cells.over((50.0, 50.0), 1.0, False)
    rng = np.random.default_rng(1)

    def sprouts(name: str, dbh_cm: float) -> Cohorts:
        n = 1000
        x, y = rng.uniform(0, 50, (2, n))
        kind = np.full(n, code(name))
        stumps = Stumps(np.arange(1, n + 1), kind, x, y, np.full(n, dbh_cm), np.full(n, 0.6))
        return sprout_cohorts(stumps, cells, SHIPPED.sprout, seed=1, year=2000)

    oak = sprouts("quercus_robur", 20.0)
    assert len(oak.n) / 1000 == pytest.approx(0.7, abs=0.06)
    assert oak.n.mean() == pytest.approx(3.0, abs=0.01)
    assert len(set(oak.mother.tolist())) == len(oak.n)
    assert oak.n * oak.reserve == pytest.approx(0.6)
    assert oak.sprout.all()
    assert len(sprouts("quercus_robur", np.nan).n) > 600  # a sapling below breast height
    assert not len(sprouts("quercus_robur", 41.0).n)
    assert not len(sprouts("picea_abies", 10.0).n)
