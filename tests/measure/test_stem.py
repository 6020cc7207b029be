"""The stem: one truth for diameters, taper and volumes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest.errors import InputError
from forest.measure import bark
from forest.measure.stem import Stems, stems_of, stems_of_skeletons
from forest.measure.trees import MeasureSpecies, measure_trees
from forest.measure.volumes import (
    form_factor,
    huber,
    merchantable_volume,
    newton,
    normal_form_factor,
    section_volume,
    smalian,
    taper_curve,
)
from forest.trees.skeleton import skeleton_of
from tests.builders import random_arena
from tests.reference.mensuration import cylinder_volume, stem_path

SPECIES = MeasureSpecies(
    pipe_exponent=np.array([2.0, 2.5]),
    bark_factor=np.array([0.05, 0.2]),
    density_kg_m3=np.array([400.0, 600.0]),
    leaf_area_m2=np.array([0.01, 0.03]),
    sla_m2_kg=np.array([12.0, 25.0]),
    merchantable_top_m=np.array([0.004, 0.02]),
    stump_height_m=np.array([0.1, 0.3]),
)


def upright(*stems: tuple[list[float], list[float]], bark_factor: float = 0.0) -> Stems:
    """Make straight stems of (upper ends, diameters under bark)."""
    ends = np.concatenate([np.array(ends) for ends, _ in stems])
    counts = [len(ends) for ends, _ in stems]
    return Stems(
        first=np.cumsum([0, *counts]),
        metamer=np.concatenate([np.arange(k, dtype=np.int32) for k in counts]),
        end_m=ends,
        reach_m=ends.copy(),
        diameter_m=np.concatenate([np.array(d) for _, d in stems]),
        bark_factor=np.full(len(stems), bark_factor),
    )


def body(shape: float, n: int) -> Stems:
    """Cut a solid of 4 m, 40 cm to 30 cm thick, d^(2 / shape) linear, into n cylinders."""
    middle = (np.arange(n) + 0.5) / n
    low, high = 0.4 ** (2 / shape), 0.3 ** (2 / shape)
    diameter = (low + (high - low) * middle) ** (shape / 2)
    return upright((list(4.0 * np.arange(1, n + 1) / n), list(diameter)))


LOGS = {1: 0.392699, 2: 0.387463, 3: 0.385712}  # paraboloid, cone, neiloid


@pytest.mark.parametrize(("shape", "volume"), LOGS.items())
def test_log_formulas(shape, volume):
    low, high = 0.4 ** (2 / shape), 0.3 ** (2 / shape)
    middle = ((low + high) / 2) ** (shape / 2)
    assert newton(4.0, 0.4, middle, 0.3) == pytest.approx(volume, abs=1e-6)
    exact = shape == 1
    assert (abs(huber(4.0, 0.4, middle, 0.3) - volume) < 1e-6) == exact
    assert (abs(smalian(4.0, 0.4, middle, 0.3) - volume) < 1e-6) == exact


@pytest.mark.parametrize(("shape", "volume"), LOGS.items())
def test_the_integral_of_a_body_of_many_cylinders(shape, volume):
    stems = body(shape, 2000)
    assert stems.volume() == pytest.approx(volume, abs=1e-6)
    assert section_volume(stems, "newton", section_m=4.0) == pytest.approx(volume, rel=1e-3)
    assert section_volume(stems, "huber", section_m=0.1) == pytest.approx(volume, rel=1e-3)


def test_a_stem_by_hand():
    stems = upright(([1.0, 2.0, 3.0], [0.18, 0.09, 0.045]), ([0.5], [0.018]), bark_factor=0.1)
    assert stems.height_m.tolist() == stems.length_m.tolist() == [3.0, 0.5]
    assert stems.diameter_at(1.3) == pytest.approx([0.1, np.nan], nan_ok=True)
    assert stems.diameter_at(1.0, over_bark=False)[0] == 0.18  # a cut is the lower internode's
    assert stems.diameter_at([2.5, 0.0]) == pytest.approx([0.05, 0.02])
    volume = math.pi / 4 * (0.04 + 0.01 + 0.0025)
    assert stems.volume() == pytest.approx([volume, math.pi / 4 * 0.0004 * 0.5])
    assert stems.volume(over_bark=False) == pytest.approx(0.81 * stems.volume())
    # sections of 2 m: 2 m with 10 cm in its middle's lower internode 20 cm, then 1 m of 5 cm
    assert section_volume(stems, "huber")[0] == pytest.approx(math.pi / 4 * (0.08 + 0.0025))
    assert section_volume(stems, "smalian")[0] == pytest.approx(
        math.pi / 4 * ((0.04 + 0.01) + (0.01 + 0.0025) / 2)
    )
    assert form_factor(volume, 0.1, 3.0) == pytest.approx((0.04 + 0.01 + 0.0025) / 0.03)
    assert normal_form_factor(stems)[0] == pytest.approx((0.04 + 0.01 + 0.0025) / 0.12)
    assert np.isnan(form_factor(np.ones(2), np.array([0.0, np.nan]), np.ones(2))).all()


def test_taper_curve():
    stems = upright(([1.0, 2.0], [0.2, 0.1]), ([1.0], [0.03]), bark_factor=0.5)
    table = taper_curve(stems, steps=2)
    assert table["stem"].tolist() == [0, 0, 0, 1, 1, 1]
    assert table["height_m"].tolist() == [0.0, 1.0, 2.0, 0.0, 0.5, 1.0]
    assert table["diameter_over_bark_cm"].tolist() == pytest.approx([40, 40, 20, 6, 6, 6])
    assert table["diameter_under_bark_cm"].tolist() == pytest.approx([20, 20, 10, 3, 3, 3])
    assert table["relative_diameter"].tolist() == pytest.approx(
        [2, 2, 1, *[np.nan] * 3], nan_ok=True
    )


def test_bark():
    assert bark.diameter_over_bark(36.0, 0.1) == pytest.approx(40.0)
    assert bark.diameter_under_bark(40.0, 0.1) == pytest.approx(36.0)
    assert bark.bark_thickness([40.0, 20.0], 0.1) == pytest.approx([2.0, 1.0])


def test_refusals():
    stems = upright(([1.0], [0.1]))
    with pytest.raises(InputError, match="did you mean 'newton'"):
        section_volume(stems, "newtn")
    with pytest.raises(InputError, match="above 0 m"):
        section_volume(stems, section_m=0.0)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 60))
def test_stems_of_random_trees(seed, n):
    rng = np.random.default_rng(seed)
    m, trees = random_arena(rng, 4, n, n_species=2, internode_m=0.3)
    stems = stems_of(m, trees, SPECIES)
    measures = measure_trees(m, trees, SPECIES)
    for row in range(4):
        first = int(trees.start[row])
        here = slice(stems.first[row], stems.first[row + 1])
        path = stem_path(m, trees, row)
        assert stems.metamer[here].tolist() == path
        lengths = [float(m.length[first + j]) for j in path]
        heights = [float(m.tip[first + j, 2]) for j in path]
        assert stems.end_m[here] == pytest.approx(np.cumsum(lengths))
        assert stems.reach_m[here] == pytest.approx(np.maximum.accumulate([0.0, *heights])[1:])
        ends, diameters = list(stems.end_m[here]), list(stems.diameters()[here])
        for cut in rng.uniform(0, 1.2 * max([0.1, *ends]), 3):
            below = stems.volume_below(np.array([row]), np.array([cut]))
            assert below == pytest.approx(cylinder_volume(ends, diameters, 0.0, cut), abs=1e-15)
    # the numbers of the tree table, to float precision
    assert stems.volume() == pytest.approx(measures.stem_volume_m3, rel=1e-13)
    sold = merchantable_volume(
        stems,
        stump_m=SPECIES.stump_height_m[trees.species],
        top_m=SPECIES.merchantable_top_m[trees.species],
    )
    assert sold == pytest.approx(measures.merchantable_volume_m3, rel=1e-12, abs=1e-18)
    assert 100 * stems.diameter_at(1.3) == pytest.approx(measures.dbh_cm, rel=1e-13, nan_ok=True)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 60))
def test_a_skeleton_has_its_tree_s_stem(seed, n):
    m, trees = random_arena(np.random.default_rng(seed), 3, n, internode_m=0.3)
    shapes = [
        skeleton_of(m, trees, row, species="oak", pipe_exponent=2.0, start_year=1900)
        for row in range(3)
    ]
    some, others = stems_of(m, trees, SPECIES), stems_of_skeletons(shapes, 0.05)
    assert some.metamer.tolist() == others.metamer.tolist()
    assert some.first.tolist() == others.first.tolist()
    for name in ("end_m", "reach_m", "diameter_m", "bark_factor"):
        assert getattr(some, name) == pytest.approx(getattr(others, name), rel=1e-4, abs=1e-5)


def test_no_trees_at_all():
    stems = stems_of_skeletons([], 0.1)
    assert len(stems) == len(stems.volume()) == len(stems.height_m) == 0
