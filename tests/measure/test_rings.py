"""Rings at breast height add up to the radius under bark."""

from __future__ import annotations

import numpy as np
import pytest

from forest.measure.rings import remember_breast, ring_rows, ring_widths
from forest.measure.trees import TreeMeasures
from forest.trees.table import empty


def measures(serial, radius_m, birth) -> TreeMeasures:
    columns = {name: np.zeros(len(serial)) for name in TreeMeasures._fields}
    columns["breast_serial"] = np.array(serial, np.int32)
    columns["breast_radius_m"] = np.array(radius_m, np.float32)
    columns["breast_birth"] = np.array(birth, np.int32)
    return TreeMeasures(**columns)


def test_rings_of_three_trees_over_three_years():
    trees = empty(3)
    trees.tree_id[:] = (4, 7, 9)
    trees.breast_serial[:] = -1
    total = np.zeros(3)
    years = (
        measures([-1, 12, -1], [0, 0.004, 0], [-1, 5, -1]),
        measures([20, 12, -1], [0.003, 0.004, 0], [6, 5, -1]),
        measures([20, 12, -1], [0.0055, 0.007, 0], [6, 5, -1]),
    )
    tables = []
    for step, now in enumerate(years, start=5):
        tables.append(ring_rows(2000 + step, step, trees, now))
        total += np.nan_to_num(ring_widths(trees, now))
        remember_breast(trees, now)
    assert [t["tree_id"].tolist() for t in tables] == [[7], [4, 7], [4, 7]]
    assert [t["cambial_age"].tolist() for t in tables] == [[1], [1, 2], [2, 3]]
    assert tables[0]["width_mm"] == pytest.approx([4.0])  # the first is the whole radius
    assert tables[1]["width_mm"] == pytest.approx([3.0, 0.0])  # a missing ring is a ring of 0
    assert tables[2]["width_mm"] == pytest.approx([2.5, 3.0], rel=1e-4)
    assert total == pytest.approx([5.5, 7.0, 0.0])
    assert np.isnan(tables[2]["thick_side_deg"]).all()


def test_a_stem_that_regrew_thinner_has_no_negative_ring():
    trees = empty(1)
    trees.breast_serial[0], trees.breast_radius[0] = 3, 0.05
    assert ring_widths(trees, measures([30], [0.01], [8])).tolist() == [0.0]
