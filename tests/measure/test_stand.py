"""The stand table, by hand on a quarter of a hectare."""

from __future__ import annotations

import math

import numpy as np
import pytest

from forest.measure.stand import Flows, Plot, stand_rows, top_height
from forest.measure.trees import TreeMeasures

PLOT = Plot((50.0, 50.0), True)


def measures(dbh_cm, height_m) -> TreeMeasures:
    n = len(dbh_cm)
    dbh = np.array(dbh_cm, float)
    columns = {name: np.zeros(n) for name in TreeMeasures._fields}
    columns |= {
        "dbh_cm": dbh,
        "height_m": np.array(height_m, float),
        "basal_area_m2": np.nan_to_num(math.pi / 4 * (dbh / 100) ** 2),
        "stem_volume_m3": np.full(n, 0.5),
        "biomass_kg": np.full(n, 200.0),
        "leaf_area_m2": np.full(n, 25.0),
        "crown_radius_m": np.full(n, 2.0),
    }
    return TreeMeasures(**columns)


def flows(n_species: int, recruits=0, deaths=0, removed=0, volume=0.0) -> Flows:
    each = np.arange(1, n_species + 1)
    return Flows(each * recruits, each * deaths, each * removed, each * volume)


def rows(dbh, height, species, k):
    n = len(dbh)
    x = np.linspace(1, 49, n) if n else np.empty(0)
    return stand_rows(
        1950, measures(dbh, height), x, x * 0 + 5, np.array(species, np.int16),
        flows(k, 1, 2, 3, 4.0), PLOT, 0.25,
    )  # fmt: skip


def test_sums_per_hectare():
    got = rows([20, 40, np.nan], [10, 20, 1], [0, 1, 0], 2)
    assert got["species"].tolist() == [0, 1, 2]
    assert got["n_ha"].tolist() == [8, 4, 12]
    g = math.pi / 4 * 4 * np.array([0.04, 0.16, 0.20])
    assert got["basal_area_m2ha"] == pytest.approx(g)
    assert got["qmd_cm"] == pytest.approx([20, 40, math.sqrt(1000)])
    # forest_patterns: Dq = sqrt(40000 G / (pi N))
    assert got["qmd_cm"][2] == pytest.approx(math.sqrt(40000 * g[2] / (math.pi * 8)))
    assert got["mean_dbh_cm"] == pytest.approx([20, 40, 30])
    assert got["lorey_height_m"] == pytest.approx([10, 20, (0.04 * 10 + 0.16 * 20) / 0.2])
    assert got["volume_m3ha"] == pytest.approx([4, 2, 6])
    assert got["biomass_tha"] == pytest.approx([1.6, 0.8, 2.4])
    assert got["lai"] == pytest.approx([0.02, 0.01, 0.03])
    assert got["sdi"][1] == pytest.approx(4 * (40 / 25.4) ** 1.605)
    assert got["recruits_ha"].tolist() == [4, 8, 12]
    assert got["deaths_ha"].tolist() == [8, 16, 24]
    assert got["removed_ha"].tolist() == [12, 24, 36]
    assert got["removed_volume_m3ha"].tolist() == [16, 32, 48]
    assert got["shannon"][:2].tolist() == [0, 0]
    assert got["simpson"][2] == pytest.approx(1 - 0.2**2 - 0.8**2)
    assert np.isnan(got["floor_light"][:2]).all()
    assert got["floor_light"][2] == 0.25
    assert got["mingling"] == pytest.approx([0.5, 1.0, 2 / 3])


def test_top_height_takes_the_last_tree_in_part():
    dbh = np.array([10.0, 30.0, 20.0, np.nan, np.nan])
    height = np.array([9.0, 20.0, 16.0, 0.5, 1.0])
    assert top_height(dbh, height, 2.5) == pytest.approx((20 + 16 + 0.5 * 9) / 2.5)
    assert top_height(dbh, height, 4) == pytest.approx((20 + 16 + 9 + 1.0) / 4)
    assert top_height(dbh, height, 50) == pytest.approx(height.mean())
    assert math.isnan(top_height(dbh[:0], height[:0], 2.0))


def test_an_empty_plot():
    got = rows([], [], [], 1)
    for name in ("n_ha", "basal_area_m2ha", "volume_m3ha", "lai", "sdi", "canopy_cover"):
        assert got[name].tolist() == [0, 0], name
    for name in ("qmd_cm", "top_height_m", "gini_basal_area", "clark_evans", "shannon"):
        assert np.isnan(got[name]).all(), name


def test_a_species_that_is_alone_equals_all():
    got = rows([20, 40, 25], [10, 20, 12], [0, 0, 0], 1)
    for name, column in got.items():
        if name not in ("species", "floor_light"):
            assert column[0] == column[1], name
