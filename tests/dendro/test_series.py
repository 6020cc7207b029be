"""Rows of rings become dated series."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from forest.dendro import ring_series
from forest.errors import InputError

from .ringing import ring_frame


def test_two_trees_side_by_side():
    rings = pd.concat([ring_frame(7, 2003, [3, 0, 2]), ring_frame(4, 2001, [1, 2])])
    series = ring_series(rings.sample(frac=1.0, random_state=1))  # in any order of rows
    assert list(series.widths.columns) == ["T4", "T7"]
    assert series.widths.index.name == "Year"
    assert series.widths.index.tolist() == [2001, 2002, 2003, 2004, 2005]
    np.testing.assert_array_equal(series.widths["T4"], [1, 2, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(series.widths["T7"], [np.nan, np.nan, 3, 0, 2])
    about = series.about.loc["T7"]
    assert (about["tree_id"], about["first_year"], about["last_year"]) == (7, 2003, 2005)
    assert (about["first_cambial_age"], about["pith_offset"]) == (1, 0)
    assert about["stem_height_m"] == 1.3
    assert about["species"] == "picea_abies"


def test_a_year_without_a_row_is_a_missing_ring():
    rings = ring_frame(1, 2001, [1, 2, 3, 4]).drop(index=2)
    rings.loc[1, "width_mm"] = np.nan
    assert ring_series(rings).widths["T1"].tolist() == [1, 0, 0, 4]


def test_a_record_that_begins_late_keeps_its_distance_from_the_pith():
    late = ring_frame(1, 2001, [1, 2, 3, 4, 5]).iloc[3:]
    about = ring_series(late).about.loc["T1"]
    assert (about["first_cambial_age"], about["pith_offset"]) == (4, 3)


def test_a_stem_that_grew_anew_has_a_new_pith():
    old, new = ring_frame(1, 2001, [1, 2, 3]), ring_frame(1, 2006, [7, 8])
    series = ring_series(pd.concat([old, new]))
    assert series.widths["T1"].tolist() == [7, 8]
    assert series.about.loc["T1", "first_year"] == 2006


def test_heights_of_a_tree_get_letters_from_below():
    heights = [5.0, 0.3, 1.3]
    rings = pd.concat([ring_frame(12345, 2001, [h], stem_height_m=h) for h in heights])
    series = ring_series(rings)
    assert series.about["stem_height_m"].tolist() == [0.3, 1.3, 5.0]
    assert series.widths.iloc[0].tolist() == pytest.approx([0.3, 1.3, 5.0])
    assert list(series.about.index) == list(series.widths.columns)
    assert series.about["tree_id"].tolist() == [12345] * 3
    assert all(len(name) == 6 for name in series.widths.columns)
    few = ring_series(pd.concat([ring_frame(3, 2001, [h], stem_height_m=h) for h in heights]))
    assert list(few.widths.columns) == ["T3A", "T3B", "T3C"]


def test_moves_are_recorded():
    series = ring_series(ring_frame(1, 2101, [1, 2]))
    moved = series.moved(-200).moved(3)
    assert moved.widths.index.tolist() == [1904, 1905]
    assert moved.widths.index.name == "Year"
    assert moved.about.loc["T1", ["first_year", "last_year", "year_shift"]].tolist() == [
        1904,
        1905,
        -197,
    ]
    assert series.widths.index.tolist() == [2101, 2102]


@pytest.mark.parametrize(
    ("rings", "message"),
    [
        (ring_frame(1, 2001, []), "no rings"),
        (ring_frame(1, 2001, [1.0]).drop(columns="width_mm"), "no column 'width_mm'"),
        (pd.concat([ring_frame(3, 2001, [1.0])] * 2), "tree 3 has two rings of 2001 at 1.3 m"),
    ],
)
def test_refused(rings, message):
    with pytest.raises(InputError, match=message):
        ring_series(rings)
