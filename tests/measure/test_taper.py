"""Stems drawn through discs, beside scipy's curves, the true stems and numbers by hand."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from forest.measure.taper import STEP_M, disc_diameters, monotone_slopes, taper_stems


def _rows(*rows: tuple[int, int, float, int, float], place: str = "height") -> pd.DataFrame:
    names = ["tree_id", "year", "stem_height_m", "cambial_age", "width_mm"]
    return pd.DataFrame(rows, columns=names).assign(place=place)


def test_rings_add_up_to_diameters():
    rings = pd.concat(
        [
            _rows((1, 2000, 0.3, 1, 5.0), (1, 2001, 0.3, 2, 2.0), (1, 2001, 5.0, 1, 1.5)),
            _rows((2, 2000, 0.3, 3, 9.0)),  # gone in 2001
            _rows((3, 1999, 0.3, 4, 9.0), (3, 2000, 0.3, 1, 1.0), (3, 2001, 0.3, 2, 1.0)),
            _rows((1, 2001, 4.0, 7, 1.0), place="crown_base"),
        ]
    )
    got = disc_diameters(rings)
    assert got.columns.tolist() == [0.3, 5.0]
    assert got.index.tolist() == [1, 3]
    assert got.loc[1].tolist() == pytest.approx([0.014, 0.003])
    assert got.loc[3, 0.3] == pytest.approx(0.004)  # grown anew in 2000
    assert np.isnan(got.loc[3, 5.0])


@settings(max_examples=25, deadline=None)
@given(
    st.integers(3, 7).flatmap(
        lambda k: st.lists(
            st.tuples(st.floats(0.05, 5.0), st.floats(0.0, 1.0)), min_size=k, max_size=k
        )
    )
)
def test_slopes_are_those_of_scipy(points: list[tuple[float, float]]):
    steps, y = np.array(points).T
    x = np.cumsum(steps)
    ours = monotone_slopes(np.stack([x, 2.0 * x]), np.stack([y, y]))
    theirs = PchipInterpolator(x, y).derivative()(x)
    assert ours[0] == pytest.approx(theirs, rel=1e-6, abs=1e-9)
    assert ours[1] == pytest.approx(theirs / 2.0, rel=1e-6, abs=1e-9)


def _tree(height: float, volume: float, crown_base: float = 8.0) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "tree_id": [4],
            "height_m": [height],
            "crown_base_m": [crown_base],
            "stem_volume_m3": [volume],
            "base_diameter_cm": [20.0],
            "dbh_cm": [18.0],
        }
    )


@pytest.mark.parametrize("crown_base", [0.0, 8.0, 11.9])
def test_a_drawn_stem_keeps_what_is_known(crown_base: float):
    """Bark of a tenth of the diameter; a disc of 13 cm at 5 m; height and volume."""
    bark = np.array([0.1])
    discs = pd.DataFrame({5.0: [0.13]}, index=[4])
    stems = taper_stems(_tree(12.0, 0.16, crown_base), discs, bark)
    assert len(stems) == 1
    assert stems.height_m[0] == pytest.approx(12.0)
    assert stems.volume()[0] == pytest.approx(0.16)
    assert stems.volume(over_bark=False)[0] == pytest.approx(0.16 * 0.81)
    assert stems.diameter_at(1.3)[0] == pytest.approx(0.18, abs=0.002)
    assert stems.diameter_at(5.0, over_bark=False)[0] == pytest.approx(0.13, abs=0.002)
    thick = stems.diameter_m
    assert (np.diff(thick) <= 1e-12).all()
    assert (np.diff(stems.end_m) > 0).all()
    assert np.diff(stems.end_m).max() < STEP_M + 1e-9


def test_a_volume_out_of_reach_comes_as_near_as_it_can():
    bark = np.array([0.0])
    discs = pd.DataFrame({5.0: [0.13]}, index=[4])
    huge = taper_stems(_tree(12.0, 9.0), discs, bark)
    at_8_m = huge.diameter_at(8.0)[0]  # no thicker than below
    assert at_8_m == pytest.approx(0.13, abs=0.001)
    assert huge.volume()[0] < 1.0


def test_trees_of_all_sizes_at_once():
    """A seedling below 1.3 m, a tree below its highest disc, one above it."""
    trees = pd.concat([_tree(0.85, 0.001, 0.1), _tree(4.0, 0.03, 1.0), _tree(12.0, 0.16)])
    trees["tree_id"] = [1, 2, 4]
    trees.loc[trees["tree_id"] == 1, "dbh_cm"] = np.nan
    trees["base_diameter_cm"] = [5.0, 20.0, 20.0]
    discs = pd.DataFrame({0.3: [0.04, 0.185, 0.19], 5.0: [np.nan, np.nan, 0.13]}, index=[1, 2, 4])
    together = taper_stems(trees, discs, np.full(3, 0.05))
    assert together.height_m == pytest.approx([0.85, 4.0, 12.0])
    for k in range(3):
        alone = taper_stems(trees[k : k + 1], discs, np.full(1, 0.05))
        part = slice(together.first[k], together.first[k + 1])
        np.testing.assert_array_equal(alone.diameter_m, together.diameter_m[part])


def test_no_tree_no_stem():
    nobody = taper_stems(_tree(12.0, 0.1)[:0], pd.DataFrame(), np.empty(0))
    assert len(nobody) == 0
    assert nobody.volume().size == 0
