"""Taylor-Hell 2005 on grown trees: seedlings that right themselves, Figs 3, 5, 8, 9, and forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.bent_form import curvature, grow, inflections, lean_with_age, s_share, tip_height_m
from analysis.biomechanics import DECURRENT, FRUIT_KG, Seedling, fruit, last, life, tilted
from analysis.tree_form import form_of
from forest.trees.skeleton import Skeleton


def test_tilted_seedlings_right_themselves() -> None:
    """By strained rings alone: their stems feel neither light nor gravity as they grow.

    They turn as they thicken; so heights, not years, tell how far they have come.
    """
    for species in ("picea_abies", "fagus_sylvatica"):
        righted, left = (
            [s for s in tilted(righting, range(1, 21)) if s.species == species]
            for righting in ("strain", "none")
        )
        young = _first_of_height(righted, 0.5)
        assert 10.0 < young.lean_deg < 25.0
        grown = _first_of_height(righted, 1.5)
        assert grown.lean_deg < 5.0
        assert grown.base_lean_deg < 15.0  # it is the oldest wood that turns
        assert righted[-1].base_lean_deg < 10.0
        for without in (_first_of_height(left, 0.5), _first_of_height(left, 1.5), left[-1]):
            assert without.lean_deg > 30.0
            assert without.base_lean_deg == pytest.approx(30.0, abs=2.0)


def _first_of_height(seedlings: list[Seedling], height_m: float) -> Seedling:
    return next(s for s in seedlings if s.tree.end[:, 2].max() >= height_m)


def test_beta_righting_slows_a_fall_and_rights_nothing() -> None:
    """Rest curvature as printed (eq. 19) knows no direction to go back to in a straight stem."""
    for beta, none in zip(tilted("beta", (20,)), tilted("none", (20,)), strict=True):
        assert 30.0 < beta.lean_deg < none.lean_deg - 5.0


def test_reaction_wood_is_below_in_conifers_and_above_in_broadleaves() -> None:
    """Seedlings that lean towards azimuth 0; rings are round without righting."""
    spruce, beech = tilted("strain", (6,))
    assert (spruce.species, beech.species) == ("picea_abies", "fagus_sylvatica")
    assert spruce.eccentricity > 0.3
    assert beech.eccentricity > 0.3
    assert abs(spruce.thick_side_deg) < 10.0
    assert abs(beech.thick_side_deg) > 170.0
    assert all(s.eccentricity == 0.0 for s in tilted("none", (3,)))


def test_a_heavy_axis_that_grows_upwards_is_s_shaped() -> None:
    """Fig. 5: down near its base, up near its tip, and one inflection between."""
    (grown,) = grow("s_shaped_axis")
    rates = curvature(grown.tree)
    assert rates[:5].max() < -0.1
    assert rates[-5:].min() > 0.05
    assert len(inflections(rates)) == 1
    light = curvature(last("s_shaped_axis", "years=5"))
    assert light.mean() > 0.03  # up as a whole
    no_tropism = curvature(last("s_shaped_axis", ".mechanics.tropic_torque_nm=0.0"))
    assert no_tropism.max() < 0.005


def test_branches_spring_up_in_winter_and_fruit_bends_more() -> None:
    """Fig. 8."""
    heights = np.array([[tip_height_m(tree) for tree in fruit(mass, 9)] for mass in FRUIT_KG])
    assert (heights[:, 0] < heights[:, 1]).all()
    assert (np.diff(heights[:, 0]) < 0.0).all()
    assert (np.diff(heights[:, 1] - heights[:, 0]) > 0.0).all()


def test_a_load_of_fruit_bends_a_tree_that_stands() -> None:
    """The same wood: the fruit alone differs."""
    (grown,) = grow("fruit_tree", [".mechanics.fruit_mass_kg=0.1", "years=8"])
    winter = grown.stand.skeleton(1, season="winter")
    np.testing.assert_array_equal(winter.radius, grown.tree.radius)
    np.testing.assert_allclose(winter.length, grown.tree.length, rtol=1e-4)
    assert tip_height_m(winter) > tip_height_m(grown.tree) + 0.02


def test_curves_alone_make_two_architectures() -> None:
    """Fig. 3: an excurrent and a decurrent tree."""
    excurrent, decurrent = form_of(last("curves")), form_of(last("curves", *DECURRENT))
    assert excurrent.trunk_wood > 2.0 * decurrent.trunk_wood
    assert decurrent.width > 1.5 * excurrent.width


def test_biomechanics_bends_branches() -> None:
    """Fig. 9: lower and wider, and its branches are S-shaped."""
    bent = last("with_biomechanics")
    straight = last("with_biomechanics", "mechanics.bending=false")
    assert tip_height_m(bent) < 0.8 * tip_height_m(straight)
    assert form_of(bent).width > 1.4 * form_of(straight).width
    assert s_share(bent) > 0.5 > s_share(straight)


def test_axes_arch_over_in_champagnats_model() -> None:
    young, old = lean_with_age(life("champagnat"), range(9))
    assert young < 40.0
    assert old > young + 15.0


def test_stems_that_grow_sideways_rise_in_trolls_model() -> None:
    young, old = lean_with_age(life("troll"), [0])
    assert young > 60.0
    assert old < young - 30.0
    young, old = lean_with_age(life("troll", 'mechanics.righting="none"'), [0])
    assert old > young


def _bare(tree: Skeleton) -> NDArray[np.bool_]:
    """Which internodes bear no living site, on themselves or beyond."""
    alive = tree.leafy.copy()
    for i in range(len(tree) - 1, 0, -1):
        alive[tree.parent[i]] |= alive[i]
    return ~alive


def test_what_hangs_into_the_ground_dies_and_is_shed() -> None:
    """The wood of Champagnat's tree here is so weak that its stem falls over."""
    buried = 0
    for before, after in pairwise(life("champagnat", "seed=1")):
        assert not after.leafy[after.end[:, 2] < 0.0].any()
        dead = before.serial[_bare(before)]
        buried += len(dead)
        assert not np.isin(dead, after.serial).any()
    assert buried > 0
