"""Snags and dead wood: pools that balance, falls as drawn, shade that fades."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.dynamics.mortality import Death
from forest.dynamics.snags import DeadWood, years_standing
from forest.environment.canopy import Canopy
from forest.environment.plant_area import PlantArea
from forest.measure.trees import MeasureSpecies, measure_trees
from forest.species import load_species
from forest.stand import Stand
from forest.trees.table import keep
from tests.builders import random_arena
from tests.fixed import fixed
from tests.reference import mortality as twin
from tests.reference.random import uniforms
from tests.tiny import TOML, steps, tiny

SPECIES = tuple(load_species(name) for name in ("betula_pendula", "quercus_robur"))
EXPONENT = np.array([2.0, 2.0])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 12))
def test_pools_year_by_year(seed: int, years: int) -> None:
    rng = np.random.default_rng(seed)
    metamers, trees = random_arena(rng, 15, 12, n_species=2)
    measured = MeasureSpecies.of(SPECIES, EXPONENT)
    wood = DeadWood(SPECIES, seed)
    standing: list[dict[str, Any]] = []
    lying = {0: [0.0, 0.0], 1: [0.0, 0.0]}
    for step in range(1, years + 1):
        measures = measure_trees(metamers, trees, measured)
        stand: Any = SimpleNamespace(
            steps=step, rows=trees, arena=SimpleNamespace(metamers=metamers), pipe_exponent=EXPONENT
        )
        n = len(trees.tree_id)
        causes = rng.choice(["fire", "wind", "age", "buckling"], n)
        rows = np.flatnonzero(rng.random(n) < 0.3)
        deaths = [Death(int(row), "died", str(causes[row])) for row in rows]
        dead = []
        for death in deaths:
            kind = int(trees.species[death.row])
            traits = SPECIES[kind].mortality
            draw = uniforms(seed, twin.SNAG, int(trees.tree_id[death.row]), 0, 0)[0]
            leaves = measures.leaf_area_m2[death.row] / SPECIES[kind].leaves.sla_m2_kg
            mass = measures.biomass_kg[death.row] - leaves
            tall = not math.isnan(measures.dbh_cm[death.row])
            spell = twin.years_standing(
                draw, traits.snag_half_life_years, traits.snag_fall_exponent
            )
            dead.append(
                {
                    "id": int(trees.tree_id[death.row]),
                    "species": kind,
                    "amounts": [measures.stem_volume_m3[death.row], mass],
                    "fall": step + spell,
                    "stands": tall and death.cause in ("fire", "age"),
                }
            )
        before = _total(wood)
        wood.pass_year(stand, deaths, measures)
        flows = twin.pass_year(standing, lying, dead, [s.mortality for s in SPECIES], step)
        for name, amounts in flows.items():
            expected = [amounts[0], amounts[1]]
            np.testing.assert_allclose(wood.flows[name], expected, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(wood.lying, [lying[0], lying[1]], rtol=1e-9, atol=1e-15)
        assert wood.snags.tree_id.tolist() == [snag["id"] for snag in standing]
        found = [snag["amounts"] for snag in standing]
        assert wood.snags.mass_kg.tolist() == pytest.approx([mass for _, mass in found])
        gained = wood.flows["input"] - wood.flows["decayed"]
        np.testing.assert_allclose(_total(wood), before + gained, rtol=1e-9, atol=1e-12)
        alive = np.ones(n, np.bool_)
        alive[rows] = False
        trees = keep(trees, alive)


def _total(wood: DeadWood) -> np.ndarray:
    total = wood.lying.copy()
    np.add.at(total, wood.snags.species, np.stack((wood.snags.volume_m3, wood.snags.mass_kg), 1))
    return total


def test_half_of_the_snags_have_fallen_after_their_half_life() -> None:
    draws = (np.arange(10_000) + 0.5) / 10_000
    for exponent in (1.0, 2.0, 4.0):
        years = years_standing(draws, np.full(10_000, 12.0), np.full(10_000, exponent))
        assert (years > 12).mean() == pytest.approx(0.5, abs=1e-3)
        assert (years > 6).mean() == pytest.approx(0.5 ** (0.5**exponent), abs=1e-3)
        assert years.min() >= 1


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_plant_area_lands_where_it_stands(seed: int, periodic: bool) -> None:
    """Every square millimetre is found again, in the coarse voxel around its place."""
    rng = np.random.default_rng(seed)
    n, ratio, shape = 30, 4, (20, 16)
    far = Canopy(
        shape,
        near_voxel_m=0.25,
        ratio=ratio,
        lift=2,
        periodic=periodic,
        extinction=0.5,
        directions=np.array([[0.0, 0.0, 1.0]]),
        weights=np.ones(1),
    )
    place = rng.uniform((-3.0, -3.0, 0.0), (8.0, 7.0, 9.0), (n, 3))
    others = PlantArea.at(place, rng.uniform(0.0, 2.0, n), 0.25)
    far.clear(others.voxel.min(axis=0), others.voxel.max(axis=0))
    others.add_to(far.field, shape)
    expected: dict[tuple[int, ...], int] = {}
    for (x, y, z), area in zip(place.tolist(), others.area_mm2.tolist(), strict=True):
        i, j = math.floor(x), math.floor(y)
        if periodic:
            i, j = i % 5, j % 4
        key = (math.floor(z), j - int(far.origin[1]), i - int(far.origin[0]))
        expected[key] = expected.get(key, 0) + area
    found = {tuple(map(int, at)): int(far.leaf[tuple(at)]) for at in np.argwhere(far.leaf)}
    assert found == {at: area for at, area in expected.items() if area}


def grown(*rules: str) -> Stand:
    """Trees of twelve years, of which all die in the year 2012."""
    stand = Stand(fixed(TOML, "years=60", "mortality.events=[{year=2012, share=1.0}]", *rules))
    steps(stand, 12)
    assert not len(stand.trees)
    return stand


def test_snags_shade_until_they_have_fallen() -> None:
    bare, stand = grown(), grown("mortality.snags=true")
    assert stand.dead_wood is not None
    snags = stand.dead_wood.snags
    assert len(snags.tree_id) == len(stand.snags) >= 8
    area = stand.dead_wood.plant_area(stand.steps, 0.2).area_mm2.sum() * 1e-6
    cones = [
        twin.cone_surface(0.01 * base, height)
        for base, height in zip(snags.base_diameter_cm, snags.height_m, strict=True)
    ]
    assert area == pytest.approx(sum(cones) + snags.branch_area_m2.sum(), rel=1e-4)
    steps(bare, 1)
    assert bare.floor_light == 1.0
    light = []
    while len(stand.snags):
        before = stand.dead_wood.snags.tree_id
        falls = stand.dead_wood.snags.fall_step
        (record,) = steps(stand, 1)
        fallen = before[falls == stand.steps]
        assert set(stand.dead_wood.snags.tree_id) == set(before) - set(fallen)
        row = {name: column[-1] for name, column in record.tables["deadwood"].items()}
        assert row["fallen_snags_ha"] == len(fallen) / 0.01
        assert row["snags_ha"] == len(stand.snags) / 0.01
        light.append(stand.floor_light)
    assert light[0] < 1.0
    assert light == sorted(light)
    steps(stand, 1)
    assert stand.floor_light == 1.0
    assert stand.dead_wood.lying[:, 1].sum() > 0.0


def test_felled_trees_are_taken_away_unless_they_are_left() -> None:
    stand = Stand(tiny("mortality.snags=true"))
    steps(stand, 6)
    mass = stand.trees.set_index("tree_id").biomass_kg
    stand.fell([1, 2], cause="harvest")
    stand.fell([3, 4, 3], cause="tending")
    arrays, meta = stand.state()
    arrays = {name: array.copy() for name, array in arrays.items()}
    (record,) = steps(stand, 1)
    row = {name: column[-1] for name, column in record.tables["deadwood"].items()}
    assert 0.6 * mass[[3, 4]].sum() < 1000 * row["input_tha"] * 0.01 < mass[[3, 4]].sum()
    assert row["lying_tha"] == pytest.approx(row["input_tha"] - row["decayed_tha"])
    assert row["snags_ha"] == 0
    restored = Stand.restore(stand.scenario, arrays, meta)  # between the felling and the year
    (again,) = steps(restored, 1)
    assert (
        again.tables["deadwood"]["input_tha"].tolist()
        == record.tables["deadwood"]["input_tha"].tolist()
    )


def test_the_table_adds_up() -> None:
    deaths = "[{year=2006, share=0.5}, {year=2008, share=0.3, cause='wind'}]"
    rules = ["mortality.snags=true", f"mortality.events={deaths}", "planting.density_ha=3000"]
    records = steps(Stand(tiny(*rules)), 12)
    before = dict.fromkeys(("m3ha", "tha"), np.zeros(3))
    for record in records:
        table = record.tables["deadwood"]
        for unit, old in before.items():
            now = table[f"standing_{unit}"] + table[f"lying_{unit}"]
            gained = table[f"input_{unit}"] - table[f"decayed_{unit}"]
            np.testing.assert_allclose(now, old + gained, rtol=1e-9, atol=1e-12)
            before[unit] = now
        for name, column in table.items():
            if name not in ("year", "species"):
                assert column[-1] == pytest.approx(column[:-1].sum()), name
    assert table["snags_ha"][-1] > 0
    assert table["lying_tha"][-1] > 0
