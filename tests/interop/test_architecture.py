"""The architecture of trees, on a tree small enough to measure by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from forest.errors import InputError
from forest.interop.architecture import axes_of, bud_fates, distances, distributions, orders
from forest.interop.cylinders import UNKNOWN_YEAR
from forest.trees.skeleton import Skeleton
from tests.interop.test_cylinder_files import fork, random_tree


def measured(tree: Skeleton) -> Skeleton:
    """The same shape, as a file would tell it."""
    n = len(tree)
    return replace(tree, birth_year=np.full(n, UNKNOWN_YEAR, np.int32), leafy=np.zeros(n, np.bool_))


def test_axes_of_a_fork() -> None:
    axes = axes_of([fork()])
    assert axes["tree_id"].tolist() == [4, 4, 4]
    assert axes["order"].tolist() == [0, 1, 2]
    assert axes["length_m"].tolist() == [3.0, 2.0, 1.0]
    assert axes["angle_deg"].tolist()[1:] == pytest.approx([90.0, 90.0])
    assert np.isnan(axes["angle_deg"][0])
    assert axes["base_radius_m"].tolist() == [0.3, 0.15, 0.05]
    # the trunk's nodes: one bears the branch, one a living bud; the branch's bears the twig
    assert axes["nodes"].tolist() == [2, 1, 0]
    assert axes["grown"].tolist() == [1.0, 1.0, 0.0]
    assert axes["living"].tolist() == [1.0, 0.0, 0.0]
    assert axes["dead"].tolist() == [0.0, 0.0, 0.0]
    assert axes["laterals_per_m"].tolist() == pytest.approx([1 / 3, 0.5, 0.0])


def test_a_node_without_branch_and_living_bud_is_dead() -> None:
    tree = replace(fork(), leafy=np.zeros(6, np.bool_))
    fates = bud_fates(axes_of([tree, fork()])).set_index(["order", "fate"])
    assert fates.loc[(0, "grown")].tolist() == [2, 0.5]
    assert fates.loc[(0, "living")].tolist() == [1, 0.25]
    assert fates.loc[(0, "dead")].tolist() == [1, 0.25]
    assert np.isnan(fates.loc[(2, "dead"), "share"])


def test_a_measured_tree_tells_branches_but_no_buds() -> None:
    axes = axes_of([measured(fork())])
    assert axes["grown"].tolist() == [1.0, 1.0, 0.0]
    assert axes[["living", "dead"]].isna().all(axis=None)
    fates = bud_fates(axes).set_index(["order", "fate"])["share"]
    assert fates[0, "grown"] == 0.5
    assert np.isnan(fates[0, "living"])


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 60))
def test_fates_add_up_and_match_a_walk_over_the_nodes(seed: int, n: int) -> None:
    tree = random_tree(seed, n)
    axes = axes_of([tree])
    np.testing.assert_array_equal(axes[["grown", "living", "dead"]].sum(axis=1), axes["nodes"])
    expected = {fate: np.zeros(len(axes)) for fate in ("grown", "living", "dead")}
    length = np.zeros(len(axes))
    for i in range(len(tree)):
        length[tree.axis[i]] += tree.length[i]
        above = np.flatnonzero(tree.parent == i)
        on_axis = tree.axis[above] == tree.axis[i]
        if on_axis.any():
            fate = "grown" if not on_axis.all() else "living" if tree.leafy[i] else "dead"
            expected[fate][tree.axis[i]] += 1
    for fate, counts in expected.items():
        np.testing.assert_array_equal(axes[fate], counts, fate)
    np.testing.assert_allclose(axes["length_m"], length, rtol=1e-12)


def test_orders_and_distributions_share_out_all_branches() -> None:
    sets = {"one": axes_of([fork(), fork()]), "other": axes_of([random_tree(3, 60)])}
    shares = orders(sets)
    one = shares[shares["set"] == "one"].set_index("order")
    assert one["branches"].tolist() == [2, 2]
    assert one["per_tree"].tolist() == [1.0, 1.0]
    assert one["length_share"].tolist() == pytest.approx([2 / 3, 1 / 3])
    table = distributions(sets, bins=4)
    totals = table.groupby(["set", "quantity", "order"])[["axes", "share"]].sum()
    np.testing.assert_allclose(totals["share"], 1.0)
    assert totals.loc[("one", "length_m", 1), "axes"] == 2
    assert ("one", "angle_deg", 0) not in totals.index
    edges = table[(table["quantity"] == "length_m") & (table["order"] == 0)]
    assert edges[edges["set"] == "one"]["high"].tolist() == (
        edges[edges["set"] == "other"]["high"].tolist()
    )


def test_distances_are_those_of_kolmogorov_and_smirnov() -> None:
    one, other = axes_of([random_tree(5, 60)]), axes_of([random_tree(6, 60)])
    rows = distances(one, other)
    assert {"length_m", "angle_deg"} <= set(rows["quantity"])
    for row in rows.itertuples():
        a, b = (s.loc[s["order"] == row.order, row.quantity].dropna() for s in (one, other))
        assert (row.n_one, row.n_other) == (len(a), len(b))
        assert row.distance == pytest.approx(ks_2samp(a, b).statistic)
    assert (distances(one, one)["distance"] == 0.0).all()


def test_no_trees_are_refused() -> None:
    with pytest.raises(InputError, match="no trees to measure"):
        axes_of([])
