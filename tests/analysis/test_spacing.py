"""The numbers of a spacing trial, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from analysis import spacing
from forest.trees.skeleton import Skeleton


def _tree() -> Skeleton:
    """A trunk of four internodes, 1 m each; branches at 1, 2 and 3 m; twigs; a top replaced.

    0-3 are the trunk; 4, 5 and 6 stand on its nodes at 1, 2 and 3 m; 7 continues 4; 8 stands on 5;
    9 stands where the trunk has ended, at 4 m.
    """
    parent = np.array([-1, 0, 1, 2, 0, 1, 2, 4, 5, 3], np.int32)
    axis = np.array([0, 0, 0, 0, 1, 2, 3, 1, 4, 5], np.int32)
    end = np.zeros((10, 3))
    end[:4, 2] = [1.0, 2.0, 3.0, 4.0]
    end[4:, 2] = [1.0, 2.0, 3.0, 1.0, 2.0, 5.0]
    start = np.where(parent[:, None] < 0, 0.0, end[parent])
    return Skeleton(
        parent=parent,
        start=start,
        end=end,
        radius=np.array([0.1, 0.09, 0.08, 0.07, 0.01, 0.02, 0.005, 0.05, 0.06, 0.03]),
        axis=axis,
        order=np.array([0, 0, 0, 0, 1, 1, 1, 1, 2, 1], np.int32),
        birth_year=np.full(10, 2000, np.int32),
        leafy=np.ones(10, np.bool_),
        serial=np.arange(10, dtype=np.int32),
    )


def test_branches_by_hand() -> None:
    tree = _tree()
    assert spacing.thickest_branch_cm(tree) == pytest.approx(4.0)  # not the twigs, nor the new top
    assert spacing.compact_crown_ratio(tree) == pytest.approx(1.0 - 3.0 / 5.0)
    pruned = np.array([0, 1, 2, 3, 5, 6])
    few = Skeleton(
        parent=np.array([-1, 0, 1, 2, 1, 2], np.int32),
        **{
            name: getattr(tree, name)[pruned]
            for name in ("start", "end", "radius", "axis", "order", "birth_year", "leafy", "serial")
        },
    )
    assert spacing.compact_crown_ratio(few) == 0.0
    bare = replace(few, axis=np.zeros(6, np.int32))
    assert np.isnan(spacing.thickest_branch_cm(bare))


def test_slenderness_by_hand() -> None:
    d = np.array([6.0, 10.0, 14.0])
    h = 1.3 + (d / (1.0 + 0.25 * d)) ** 2  # on a curve of Näslund's
    of = pd.DataFrame({"dbh_cm": d, "height_m": h})
    mean = np.sqrt((d**2).mean())
    on_curve = 1.3 + (mean / (1.0 + 0.25 * mean)) ** 2
    assert spacing.mean_tree_slenderness(of) == pytest.approx(100.0 * on_curve / mean)
    assert np.isnan(spacing.mean_tree_slenderness(of[:2]))
    rows = [(1, 1, 9.0, 8.0), (1, 2, 11.0, 8.8), (2, 1, 10.0, 9.0), (2, 2, 12.0, 20.0),
            (2, 3, 5.0, 6.0)]  # fmt: skip
    trees = pd.DataFrame(rows, columns=["year", "tree_id", "dbh_cm", "height_m"])
    assert spacing.at_size(trees) == pytest.approx((80.0 + 90.0) / 2)
    assert np.isnan(spacing.at_size(trees, 50.0))


def _trial(**changes: list[float]) -> pd.DataFrame:
    columns = {
        "species": ["pinus_sylvestris"] * 3,
        "spacing_m": [1.0, 2.0, 4.0],
        "replicate": [0] * 3,
        "h_d_most": [110.0, 90.0, 80.0],
        "h_d_at_10cm": [100.0, 70.0, 57.0],
        "h_d": [110.0, 80.0, 60.0],
        "h_d_dominant": [90.0, 70.0, 55.0],
        "h_d_suppressed": [130.0, 90.0, 65.0],
        "branch_cm": [1.0, 2.0, 3.0],
        "crown_ratio": [0.3, 0.4, 0.5],
        "crown_ratio_leaves": [0.4, 0.5, 0.6],
    }
    return pd.DataFrame({**columns, **changes})


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({}, []),
        ({"h_d_most": [112.0, 90.0, 80.0]}, [0]),
        ({"h_d_at_10cm": [100.0, 70.0, 55.0]}, [1]),
        ({"h_d": [110.0, 60.0, 60.0]}, [2]),
        ({"h_d_suppressed": [130.0, 69.0, 65.0]}, [3]),
        ({"branch_cm": [1.0, 0.9, 3.0]}, [4]),
        ({"crown_ratio": [0.3, 0.4, 0.4]}, [5]),
        ({"crown_ratio_leaves": [0.5, 0.6, 0.5]}, [6]),
    ],
)
def test_rules_by_hand(changes: dict[str, list[float]], broken: list[int]) -> None:
    found = spacing.rules(_trial(**changes))
    assert found.index[found["holds"] == "no"].tolist() == broken
    assert (found["holds"] == "yes").sum() == 7 - len(broken)


def test_rules_are_silent_where_nothing_was_measured() -> None:
    nothing = {"branch_cm": [np.nan] * 3, "h_d_at_10cm": [np.nan] * 3}
    found = spacing.rules(_trial(species=["quercus_robur"] * 3, **nothing))
    assert found["holds"].tolist() == ["–", "–", "yes", "yes", "–", "yes", "yes"]
    assert found["limit"].tolist()[:2] == ["–", "–"]
