"""Palubicki et al. 2009, Figs 11 to 14 and 19 to 21: tropism, light, shedding and neighbours."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.tree_form import (
    Form,
    branching_angles,
    density_by_height,
    form_of,
    grow,
    mean_form,
    overlap,
    runions,
)

_ALONE = ("obstacles=[]",)


@pytest.fixture(scope="module")
def by_tropism() -> dict[str, Form]:
    """Trees of Fig. 12 by eta and xi; means of two seeds."""
    weights = {"a": (0.1, 0.1), "b": (-0.1, 0.1), "c": (-0.8, 1.0), "d": (-0.8, 0.1)}
    return {
        panel: mean_form(
            "12",
            [f".shoots.tropism_weight={eta}", f".shoots.light_weight={xi}"],
            seeds=(1, 2),
        )
        for panel, (eta, xi) in weights.items()
    }


def test_downward_tropism_spreads_the_crown(by_tropism):
    assert by_tropism["b"].width > 1.15 * by_tropism["a"].width
    assert by_tropism["b"].droop < by_tropism["a"].droop - 0.2


def test_strong_tropism_and_strong_light_make_gnarled_branches(by_tropism):
    gnarled = by_tropism["c"]
    assert gnarled.gnarl_deg > 3.0 * by_tropism["a"].gnarl_deg
    assert gnarled.gnarl_deg > 1.4 * by_tropism["d"].gnarl_deg
    assert gnarled.width > 1.1


def test_strong_downward_tropism_alone_makes_branches_hang(by_tropism):
    assert by_tropism["d"].droop < -0.6
    assert by_tropism["c"].droop > -0.3


def test_tropism_that_turns_late_bends_the_young_shoots_only():
    turned = mean_form("13", seeds=(1,))
    constant = mean_form("13", [".shoots.tropism_factor_by_age=[]"], seeds=(1,))
    assert turned.droop < 0.0
    assert constant.droop > 0.5
    assert turned.height_m == pytest.approx(constant.height_m, rel=0.1)
    assert turned.trunk_wood == pytest.approx(constant.trunk_wood, rel=0.15)


@pytest.mark.parametrize("eta", [0.1, -0.1])
def test_branch_density_stays_even_when_the_tropism_changes(eta):
    trees = [grow("12", [f".shoots.tropism_weight={eta}"], seed)[0] for seed in (1, 2)]
    density = np.mean([density_by_height(tree) for tree in trees], axis=0)
    assert density.max() / density.min() < 1.5, density
    assert density.mean() == pytest.approx(10.0, rel=0.25)


def test_shedding_clears_the_bole():
    shed = mean_form("14", seeds=(1, 2))
    kept = mean_form("14", [".shedding.light_per_internode=0.0"], seeds=(1, 2))
    assert shed.clear > 0.25
    assert shed.clear > kept.clear + 0.1
    assert shed.height_m == pytest.approx(kept.height_m, rel=0.1)


def test_a_tree_goes_from_excurrent_to_decurrent():
    young = form_of(grow("11", ["years=5"])[0])
    old = form_of(grow("11")[0])
    assert young.leader > 0.85
    assert old.leader < 0.5
    assert old.width > 1.15 * young.width


def test_crowns_of_neighbours_give_way():
    left, right = grow("11", _ALONE)
    alone = [
        grow("11", [f"planting.trees=[{{x_m={x}, y_m=15.0}}]", *_ALONE])[0] for x in (12.0, 16.0)
    ]
    assert overlap(left, right) < 0.6 * overlap(*alone)


def test_no_branch_enters_the_wall():
    trees = grow("11")
    for tree in trees:
        middle = 0.5 * (tree.start + tree.end)
        inside = (middle[:, 0] > 5.2) & (middle[:, 0] < 8.8) & (middle[:, 2] < 8.8)
        inside &= (middle[:, 1] > 10.2) & (middle[:, 1] < 19.8)
        assert not inside.any()
    free = grow("11", _ALONE)
    in_walls_place = [int(((t.end[:, 0] < 9.0) & (t.end[:, 2] < 9.0)).sum()) for t in (free[0],)]
    assert in_walls_place[0] > 0


def test_buds_order_what_space_colonization_leaves_wild():
    """Fig. 21a: without buds, branches leave at any angle."""
    with_buds = grow("21")[0]
    without = runions(seed=1)
    assert np.std(branching_angles(with_buds)) < 0.6 * np.std(branching_angles(without))
    assert form_of(with_buds).gnarl_deg < 0.5 * form_of(without).gnarl_deg
    assert form_of(with_buds).trunk_wood > 1.15 * form_of(without).trunk_wood
