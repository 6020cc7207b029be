"""Mensuration of trees: hand-built trees with known numbers, and the slow twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.measure.trees import MeasureSpecies, TreeMeasures, measure_trees
from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, MAIN, TERMINAL, allocate
from forest.trees.table import empty
from tests.builders import random_arena
from tests.reference.measure import measure_tree

INTEGERS = ("metamers", "buds", "breast_serial", "breast_birth")
ONE = MeasureSpecies(*(np.array([v]) for v in (2.0, 0.1, 500.0, 0.5, 10.0, 0.1, 0.5)))


def build(*rows, serials=None):
    """Make one tree of rows (parent, state, tip, diameter under bark, light)."""
    m = allocate(16)
    for field in m:
        field[...] = 0
    for i, (parent, state, tip, diameter, light) in enumerate(rows):
        m.parent[i] = parent
        m.state[i] = state
        m.tip[i] = tip
        m.length[i] = np.linalg.norm(np.subtract(tip, m.tip[parent] if parent >= 0 else (0, 0, 0)))
        m.pipe[i] = diameter**2
        m.light[i] = light
        m.serial[i] = i if serials is None else serials[i]
        m.birth[i] = 10 + i
    trees = empty(1)
    trees.size[0] = len(rows)
    trees.breast_serial[0] = -1
    return m, trees


def one(measures: TreeMeasures) -> dict[str, float]:
    return {name: column[0] for name, column in measures._asdict().items()}


def test_a_seedling_has_no_dbh():
    m, trees = build((-1, MAIN | TERMINAL | LATERAL, (0, 0, 0.3), 0.009, 0.5))
    got = one(measure_trees(m, trees, ONE, full_light=2.0))
    assert math.isnan(got["dbh_cm"])
    assert got["basal_area_m2"] == 0.0
    assert got["breast_serial"] == -1
    assert got["base_diameter_cm"] == pytest.approx(1.0)
    assert got["height_m"] == pytest.approx(0.3)
    assert got["light"] == pytest.approx(0.25)
    assert got["buds"] == 2
    assert got["leaf_area_m2"] == pytest.approx(1.0)
    assert got["biomass_kg"] == pytest.approx(math.pi / 4 * 0.009**2 * 0.3 * 500 + 0.1)


def test_a_straight_stem_over_bark():
    m, trees = build(
        (-1, MAIN | CONTINUED, (0, 0, 1), 0.18, 0),
        (0, MAIN | CONTINUED, (0, 0, 2), 0.09, 0),
        (1, MAIN | TERMINAL, (0, 0, 3), 0.045, 1),
    )
    got = one(measure_trees(m, trees, ONE))
    assert got["dbh_cm"] == pytest.approx(10.0)
    assert got["breast_metamer"] == 1
    assert got["stem_volume_m3"] == pytest.approx(math.pi / 4 * (0.04 + 0.01 + 0.0025))
    # above the stump of 0.5 m, and at least 10 cm thick
    assert got["merchantable_volume_m3"] == pytest.approx(math.pi / 4 * (0.04 * 0.5 + 0.01), 1e-5)
    assert got["lean_deg"] == 0.0
    assert got["crown_base_m"] == got["height_m"] == 3.0
    assert got["crown_area_m2"] == 0.0


def test_a_leaning_stem():
    m, trees = build(
        (-1, MAIN | CONTINUED, (1, 0, 1), 0.09, 0), (0, MAIN | TERMINAL, (2, 0, 2), 0.09, 1)
    )
    got = one(measure_trees(m, trees, ONE))
    assert got["lean_deg"] == pytest.approx(45.0)
    assert got["height_m"] == 2.0
    assert got["stem_volume_m3"] == pytest.approx(math.pi / 4 * 0.01 * math.sqrt(8), 1e-5)
    assert got["crown_radius_m"] == pytest.approx(2.0 / 8)


def test_the_stem_follows_its_branch_where_the_axis_ended():
    m, trees = build(
        (-1, MAIN | CONTINUED | BRANCHED, (0, 0, 1), 0.2, 0),
        (0, 0, (1, 0, 1), 0.15, 0),  # a thick branch lower down is not the stem
        (0, MAIN | BRANCHED, (0, 0, 2), 0.1, 0),
        (2, TERMINAL, (0, 1, 3), 0.09, 1),
    )
    got = one(measure_trees(m, trees, ONE))
    wood = 0.2**2 + 0.1**2 + 0.09**2 * math.sqrt(2)
    assert got["stem_volume_m3"] == pytest.approx(math.pi / 4 * wood / 0.81, 1e-5)
    assert got["breast_serial"] == 2
    assert got["lean_deg"] == pytest.approx(math.degrees(math.atan2(1, 3)))


def test_the_octagon_of_a_round_crown():
    angles = [(k + 0.5) * math.pi / 4 for k in range(8)]
    rows = [(-1, MAIN | CONTINUED, (0, 0, 1), 0.2, 0)]
    rows += [
        (k, MAIN | LATERAL, (2 * math.cos(a), 2 * math.sin(a), 2), 0.01, 1)
        for k, a in enumerate(angles)
    ]
    got = one(measure_trees(*build(*rows), ONE))
    assert got["crown_radius_m"] == pytest.approx(2.0)
    assert got["crown_area_m2"] == pytest.approx(8 * math.sqrt(2))


def test_dbh_stays_with_its_metamer():
    rows = (
        (-1, MAIN | CONTINUED, (0, 0, 1.2), 0.2, 0),
        (0, MAIN | TERMINAL, (0, 0, 1.8), 0.1, 1),
    )
    m, trees = build(*rows, serials=(3, 7))
    trees.breast_serial[0] = 3  # the stem has bent down since
    assert one(measure_trees(m, trees, ONE))["dbh_cm"] == pytest.approx(20 / 0.9)
    trees.breast_serial[0] = 5  # that metamer is gone
    assert one(measure_trees(m, trees, ONE))["breast_serial"] == 7


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 60))
def test_equals_the_slow_twin(seed, n):
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 4, n, n_species=2, internode_m=0.3)
    trees.breast_serial[:] = rng.integers(-1, n + 5, 4)
    species = MeasureSpecies(
        pipe_exponent=np.array([2.0, 2.5]),
        bark_factor=np.array([0.05, 0.2]),
        density_kg_m3=np.array([400.0, 600.0]),
        leaf_area_m2=np.array([0.01, 0.03]),
        sla_m2_kg=np.array([12.0, 25.0]),
        merchantable_top_m=np.array([0.01, 0.05]),
        stump_height_m=np.array([0.1, 0.3]),
    )
    got = measure_trees(m, trees, species, full_light=1.5)
    for row in range(4):
        for name, value in measure_tree(m, trees, species, 1.5, row).items():
            measured = getattr(got, name)[row]
            if name in INTEGERS:
                assert measured == value, name
            else:
                assert measured == pytest.approx(value, rel=1e-5, abs=1e-9, nan_ok=True), name
