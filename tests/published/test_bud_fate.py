"""Palubicki et al. 2009, Figs 6, 7, 9 and 10: what bud fate makes of a tree."""

from __future__ import annotations

from itertools import pairwise

import pytest

from analysis.tree_form import Form, mean_form

_SYMPODIAL = ('.architecture.ramification="proleptic"', '.architecture.axis="sympodial"')


@pytest.fixture(scope="module")
def by_bias() -> list[Form]:
    """Trees of Fig. 7, from left to right; means of three seeds."""
    return [
        mean_form("07", [f".bud_fate.apical_bias={bias}"])
        for bias in (0.46, 0.48, 0.50, 0.52, 0.54)
    ]


@pytest.fixture(scope="module")
def by_control() -> dict[str, Form]:
    """Trees of Fig. 10 by when apical control ends; means of three seeds."""
    ends = {"early": [3.0], "late": [14.0, 0.0], "kept_in_limbs": [3.0, 1000.0, 0.0]}
    return {
        name: mean_form("10", [f".bud_fate.apical_control_until_age_years={years}"])
        for name, years in ends.items()
    }


def test_bias_towards_the_main_axis_raises_its_share_of_the_height(by_bias):
    leader = [form.leader for form in by_bias]
    assert all(b >= a for a, b in pairwise(leader)), leader
    assert leader[0] < 0.35
    assert leader[2] < 0.8
    assert leader[-1] == pytest.approx(1.0)


def test_bias_towards_the_main_axis_raises_its_share_of_the_wood(by_bias):
    wood = [form.trunk_wood for form in by_bias]
    assert all(b > a for a, b in pairwise(wood)), wood
    assert wood[-1] > 5.0 * wood[0]


def test_bias_towards_the_main_axis_narrows_the_crown(by_bias):
    width = [form.width for form in by_bias]
    assert all(b < a for a, b in pairwise(width)), width
    assert width[0] > 1.0
    assert width[-1] < 0.7


@pytest.mark.parametrize("habit", [(), _SYMPODIAL], ids=["sylleptic", "sympodial"])
def test_sylleptic_and_sympodial_trees_are_decurrent_shrubs(habit, by_bias):
    shrub = mean_form("06", habit, seeds=(1, 2))
    excurrent = by_bias[-1]
    assert shrub.width > 1.0
    assert shrub.trunk_wood < 0.6 * excurrent.trunk_wood
    assert shrub.height_m < 0.6 * excurrent.height_m


def test_sympodial_axes_end_with_their_first_shoot():
    shrub = mean_form("06", _SYMPODIAL, seeds=(1,))
    assert shrub.leader < 0.25
    assert shrub.trunk_wood < 0.1


def test_fewer_favoured_branches_make_a_more_excurrent_tree():
    wide, narrow = (mean_form("09", [f".bud_fate.priority_kappa={k}"]) for k in (0.5, 0.35))
    assert narrow.trunk_wood > 1.4 * wide.trunk_wood
    assert narrow.width < 0.75 * wide.width
    assert narrow.leader == pytest.approx(1.0, abs=0.02)


def test_late_end_of_control_keeps_the_trunk(by_control):
    late = by_control["late"]
    assert late.leader > 0.9
    assert late.trunk_wood > 0.5
    assert by_control["early"].trunk_wood < 0.75 * late.trunk_wood
    assert by_control["kept_in_limbs"].trunk_wood < 0.3 * late.trunk_wood


def test_early_end_of_control_everywhere_widens_the_crown(by_control):
    early = by_control["early"]
    assert early.leader < 0.75
    assert early.width > 1.5 * by_control["late"].width


def test_control_kept_in_limbs_makes_limbs_the_leaders(by_control):
    kept = by_control["kept_in_limbs"]
    assert kept.leader < 0.3
    assert kept.limb_wood > 0.4
    assert by_control["early"].limb_wood < 0.5 * kept.limb_wood
    assert by_control["late"].limb_wood < 0.5 * kept.limb_wood
