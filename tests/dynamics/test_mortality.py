"""Who dies of what: chances, patches, shares, precedence, against plain Python."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.dynamics.draws import uniforms_of
from forest.dynamics.mortality import (
    Death,
    Hazards,
    aged,
    ageing_hazard,
    buckled,
    deaths_of,
    first_of,
    unlucky,
)
from forest.random import STREAM_DEATH
from forest.record.schema import CAUSES
from forest.scenario.mortality import Disturbance, Mortality
from forest.species import load_species, species_names
from forest.stand import Stand
from forest.trees.table import empty
from tests.reference import mortality as twin
from tests.tiny import steps, tiny

NAMES = ("betula_pendula", "quercus_robur")
SPECIES = tuple(load_species(name) for name in NAMES)
SIZE = (20.0, 10.0)


@st.composite
def disturbances(draw: st.DrawFn) -> Disturbance:
    """Any disturbance of the year 2005."""
    cause = draw(st.sampled_from(["fire", "wind", "other"]))
    if draw(st.booleans()):
        return Disturbance(year=2005, tree_id=draw(st.integers(1, 40)), cause=cause)
    given: dict[str, Any] = {}
    if draw(st.booleans()):
        place = st.floats(0, 10).map(lambda v: round(v, 2))
        given = {"x_m": draw(place), "y_m": draw(place), "radius_m": draw(st.floats(0.5, 8))}
    if not given or draw(st.booleans()):
        given["share"] = draw(st.floats(0, 1))
    if draw(st.booleans()):
        given["species"] = draw(st.sampled_from(NAMES))
    if draw(st.booleans()):
        given["min_dbh_cm"] = draw(st.floats(0, 20))
    if draw(st.booleans()):
        given["max_dbh_cm"] = draw(st.floats(20, 40))
    return Disturbance(year=2005, cause=cause, **given)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**63 - 1),
    events=st.lists(disturbances(), max_size=4),
    rules=st.tuples(st.booleans(), st.booleans()),
    periodic=st.booleans(),
)
def test_deaths_of_a_year(
    seed: int, events: list[Disturbance], rules: tuple[bool, bool], periodic: bool
) -> None:
    rng = np.random.default_rng(seed)
    n, step = 40, 120
    trees = empty(n)
    trees.tree_id[:] = np.arange(1, n + 1)
    trees.species[:] = rng.integers(0, 2, n)
    trees.x[:], trees.y[:] = rng.uniform(0, SIZE[0], n), rng.uniform(0, SIZE[1], n)
    trees.birth[:] = rng.integers(-50, step, n)
    trees.bad_years[:] = rng.integers(0, 6, n)
    buds = rng.integers(0, 4, n).astype(np.int32)
    dbh = np.where(rng.random(n) < 0.2, np.nan, rng.uniform(0, 40, n))
    other = Disturbance(year=2004, share=1.0)
    mortality = Mortality(age=rules[0], background=rules[1], events=(other, *events))
    plot = SimpleNamespace(size_m=SIZE, boundary="periodic" if periodic else "open")
    scenario = SimpleNamespace(mortality=mortality, plot=plot, seed=seed, mode="mass_balance")
    stand: Any = SimpleNamespace(
        scenario=scenario, rows=trees, year=2005, steps=step, species=SPECIES, species_names=NAMES
    )
    measures: Any = SimpleNamespace(dbh_cm=dbh, buds=buds)
    expected = []
    for row in range(n):
        kind = int(trees.species[row])
        tree = {
            "id": row + 1,
            "species": NAMES[kind],
            "x": trees.x[row],
            "y": trees.y[row],
            "dbh": dbh[row],
            "birth": int(trees.birth[row]),
            "buds": buds[row],
            "bad_years": trees.bad_years[row],
            "suppression_years": SPECIES[kind].carbon.suppression_years,
            "traits": SPECIES[kind].mortality,
        }
        found = twin.death(tree, events, step, seed, mortality, SIZE, periodic)
        if found:
            expected.append(Death(row, *found))
    assert deaths_of(stand, measures) == expected


def test_the_first_cause_counts() -> None:
    fire, age = Death(3, "died", "fire"), Death(3, "died", "age")
    early = Death(1, "died", "age")
    assert first_of([[fire], [early, age]]) == [early, fire]


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 900), st.floats(20, 800), st.floats(0.001, 0.5), st.floats(1, 12))
def test_ageing_hazard(age: int, longevity: float, share: float, exponent: float) -> None:
    found = ageing_hazard(*(np.array([v], float) for v in (age, longevity, share, exponent)))
    if twin.survival(age, longevity, share, exponent) > 1e-200:
        assert found[0] == pytest.approx(twin.ageing(age, longevity, share, exponent), rel=1e-6)
    assert 0.0 < found[0] <= 1.0


@pytest.mark.parametrize("name", ["betula_pendula", "picea_abies"])
def test_one_in_a_hundred_reaches_the_longevity(name: str) -> None:
    """Twenty thousand trees from their planting on, dying of age alone."""
    n = 20_000
    hazards = Hazards.of([load_species(name)])
    trees = empty(n)
    trees.tree_id[:] = np.arange(1, n + 1)
    alive = np.ones(n, np.bool_)
    left = {}
    last = int(hazards.longevity_years[0])
    for step in range(1, last + 1):
        draws = uniforms_of(7, STREAM_DEATH, trees.tree_id, 0, step)[:, 0]
        alive[[death.row for death in aged(trees, step, hazards, draws)]] = False
        left[step] = alive.mean()
    share = float(hazards.longevity_share[0])
    assert left[last] == pytest.approx(share, abs=4 * np.sqrt(share / n))
    expected = twin.survival(last // 2, last, share, float(hazards.ageing_exponent[0]))
    assert left[last // 2] == pytest.approx(expected, abs=0.015)


def test_background_is_steady() -> None:
    n, years = 20_000, 20
    hazards = Hazards.of([load_species("fagus_sylvatica")])
    trees = empty(n)
    trees.tree_id[:] = np.arange(1, n + 1)
    deaths = [
        len(unlucky(trees, hazards, uniforms_of(3, STREAM_DEATH, trees.tree_id, 0, step)[:, 1]))
        for step in range(1, years + 1)
    ]
    rate = float(hazards.background_per_year[0])
    assert sum(deaths) / (n * years) == pytest.approx(rate, abs=4 * np.sqrt(rate / (n * years)))


def test_species_lose_what_forests_lose() -> None:
    """Background and age of a middle-aged stand stay below the 1.4 to 1.8 % of all causes."""
    for name in species_names():
        hazards = Hazards.of([load_species(name)])
        age = hazards.longevity_years / 3.0
        rate = hazards.background_per_year + ageing_hazard(age, *hazards[:3])
        assert 0.002 <= rate[0] < 0.014, name


def test_a_stem_that_bears_its_weight_does_not_buckle() -> None:
    assert buckled(np.array([0.99, 1.0, np.nan, 0.2])) == [
        Death(0, "died", "buckling"),
        Death(3, "died", "buckling"),
    ]


def test_wood_too_soft_for_its_weight() -> None:
    """Trees of rubber buckle, and lie at once; the same trees of wood stand."""
    soft = (
        "species.pinus_sylvestris.mechanics={modulus_juvenile_gpa=0.001, modulus_mature_gpa=0.001}"
    )
    rules = ["mortality={buckling=true, snags=true}", "mechanics={bending=false}"]
    stand = Stand(tiny(soft, *rules))
    records = steps(stand, 8)
    causes = Counter(int(c) for r in records for c in r.tables["events"]["cause"] if c)
    assert set(causes) == {CAUSES.index("buckling")}
    assert not len(stand.snags)
    assert records[-1].tables["deadwood"]["lying_tha"][-1] > 0.0
    assert all(not r.tables["events"]["cause"].any() for r in steps(Stand(tiny(*rules)), 8))
