"""The implicit function of a blended tree: what eqs 26 to 31 make of a branching."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.errors import InputError
from forest.species import load_species
from forest.surface.blend import Flare, Reaction, blend_of, crossings, reaction_wood
from tests.reference import blend as slow
from tests.surface.branchings import branching, stem, tree
from tests.surface.bushes import bush

UP = np.array([0.0, 0.0, 1.0])


def surface_at(blend, base, way, most=1.0):  # type: ignore[no-untyped-def]
    """How far from `base` a ray leaves the wood, m."""
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        if blend.value(np.asarray(base) + middle * np.asarray(way))[0] < 0.0:
            low = middle
        else:
            high = middle
    return low


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 12), st.booleans())
def test_function_is_that_of_the_equations(seed: int, n: int, paper: bool) -> None:
    skeleton = bush(seed, n)
    if np.all(skeleton.length <= 1e-9):
        return
    rng = np.random.default_rng(seed)
    axes = int(skeleton.axis.max()) + 1
    wood = Reaction(rng.uniform(0.0, 0.5, axes), rng.uniform(0.0, 0.05, axes), below=bool(n % 2))
    blend = blend_of(
        skeleton, reaction=wood, flare=None, readings="paper" if paper else "corrected"
    )
    points = skeleton.end[rng.integers(0, n, 20)] + rng.normal(0.0, 0.1, (20, 3))
    limbs = blend.limbs
    expected = [slow.value(limbs.cones, limbs.joints, x, paper) for x in points]
    assert blend.value(points) == pytest.approx(np.array(expected), abs=1e-7)


def test_print_makes_a_notch_where_the_reading_does_not() -> None:
    skeleton = branching(thin=0.02)
    joint = (0.0, 0.0, 1.0)
    printed = blend_of(skeleton, readings="paper")
    corrected = blend_of(skeleton)
    # at the joint x1 = x2, d1 = d2 and r = (r1 + r2) / 2; the blend's share there is nearly 1
    assert surface_at(printed, joint, (-1.0, 0.0, 0.0)) < 0.07
    assert surface_at(corrected, joint, (-1.0, 0.0, 0.0)) == pytest.approx(0.1, abs=1e-9)


def test_blend_fades_with_the_distance_from_its_joint() -> None:
    blend = blend_of(branching(45.0))
    reach = float(blend.limbs.joints.reach[0])
    assert reach == pytest.approx((0.1 + 0.06) / np.sin(np.deg2rad(22.5)))
    above = surface_at(blend, (0.0, 0.0, 1.0 + reach), (1.0, 0.0, 0.0), 0.2)
    assert above == pytest.approx(0.1, abs=1e-9)
    plain = 0.1 / np.sin(np.deg2rad(22.5))  # where equal limbs would part
    bisector = (np.sin(np.deg2rad(22.5)), 0.0, np.cos(np.deg2rad(22.5)))
    crotch = surface_at(blend_of(branching(45.0, thin=0.1)), (0.0, 0.0, 1.0), bisector)
    assert 1.1 * plain < crotch < 2.0 * plain


def test_function_is_continuous_and_has_a_slope_without_jumps() -> None:
    """Along a line around the crotch the slope of plain cones jumps, that of the blend does not."""
    blend = blend_of(branching(50.0, thin=0.07))
    turn = np.linspace(0.0, 2.0 * np.pi, 20001)
    line = np.column_stack(
        (0.13 + 0.12 * np.cos(turn), 0.05 * np.sin(turn), 1.15 + 0.12 * np.sin(turn))
    )
    f = blend.value(line)
    plain = np.min(
        [[slow.cone(blend.limbs.cones, i, x)[0] for i in range(2)] for x in line[::10]], 1
    )
    second = np.abs(np.diff(f[::10], 2))
    assert np.max(second) < 0.2 * np.max(np.abs(np.diff(plain, 2)))
    assert np.max(np.abs(np.diff(f))) < 3.0 * np.max(np.linalg.norm(np.diff(line, axis=0), axis=1))


@pytest.mark.parametrize("below", [True, False])
def test_reaction_wood_thickens_one_side(below: bool) -> None:
    """Eq. 31 on a level limb: Delta r c(l / delta) on the thick side, nothing on the other."""
    skeleton = branching(90.0, thin=0.05)
    wood = Reaction(np.array([0.0, 1.0]), np.array([0.0, 0.03]), below=below)
    blend = blend_of(skeleton, reaction=wood)
    for s in (0.5, 0.7, 0.9):
        base = np.array([s, 0.0, 1.0])
        low, high = surface_at(blend, base, -UP), surface_at(blend, base, UP)
        thick, thin = (low, high) if below else (high, low)
        assert thick == pytest.approx(0.05 + 0.03 * slow.fade(s), abs=1e-9)
        assert thin == pytest.approx(0.05, abs=1e-9)


def test_reaction_wood_of_a_level_limb_holds_its_moment() -> None:
    """Eq. 25: F_R delta sin(theta_d) = W X sin(theta_X); Delta r supports F_R more."""
    spruce, beech = load_species("picea_abies"), load_species("fagus_sylvatica")
    skeleton = branching(90.0, thin=0.05)
    wood = reaction_wood(skeleton, spruce)
    density = spruce.mechanics.green_density_kg_m3
    mass = np.pi * 0.05**2 * 1.2 * density
    leaf = spruce.leaves.area_m2 / spruce.leaves.sla_m2_kg * spruce.mechanics.leaf_water_factor
    supports = np.pi / 3.0 * spruce.balance.height_limit_m * density * 0.05**2
    if spruce.balance.crushing_strength_mpa is not None:
        supports = np.pi * 0.05**2 * spruce.balance.crushing_strength_mpa * 1e6 / 9.80665
    assert wood.reach_m[1] == pytest.approx((mass * 0.6 + leaf * 1.2) / supports)
    assert wood.widening_m[1] == pytest.approx(0.05 * (np.sqrt(2.0) - 1.0))
    assert wood.below and not reaction_wood(skeleton, beech).below


def test_foot_widens_in_lobes() -> None:
    blend = blend_of(stem(), flare=Flare(height=3.0, widening=0.5, lobes=4, depth=0.6))
    at = (0.0, 0.0, 1e-9)
    assert surface_at(blend, at, (1.0, 0.0, 0.0)) == pytest.approx(0.15, abs=1e-6)
    between = (np.sqrt(0.5), np.sqrt(0.5), 0.0)
    assert surface_at(blend, at, between) == pytest.approx(0.12, abs=1e-6)
    assert surface_at(blend, (0.0, 0.0, 0.3), (1.0, 0.0, 0.0)) == pytest.approx(0.1, abs=1e-9)
    assert blend.value([0.0, 0.0, -0.01])[0] > 0.0


def test_projection_and_nearest_limb() -> None:
    blend = blend_of(branching())
    rng = np.random.default_rng(2)
    on = blend.project(np.array([0.1, 0.0, 1.1]) + rng.normal(0.0, 0.02, (200, 3)), steps=20)
    assert np.max(np.abs(blend.value(on))) < 1e-7
    found = blend.limb([(0.1, 0.0, 0.4), (0.7, 0.0, 1.75)])
    assert found.axis.tolist() == [0, 1]
    assert found.along == pytest.approx([0.4, np.sqrt(0.5) * 1.45])


def test_same_bits_in_one_thread_and_two() -> None:
    blend = blend_of(bush(3, 12))
    points = np.random.default_rng(1).normal(0.0, 0.5, (1000, 3))
    with using_threads(1):
        one = blend.value(points)
    with using_threads(2):
        assert np.array_equal(one, blend.value(points))


def test_crossing_limbs_are_found() -> None:
    crossing = tree(
        [-1, 0, 0, 2, 1],
        [(0, 0, 0), (0, 0, 1), (0, 0, 2), (0.8, 0, 1.0), (0.8, 0, 2.2), (1.4, 0, 1.6)],
        [0.05, 0.05, 0.03, 0.03, 0.03],
        [True, True, False, True, False],
    )
    assert crossings(blend_of(crossing)).tolist() == [[1, 2]]
    assert len(crossings(blend_of(branching()))) == 0


def test_bad_words_are_refused() -> None:
    for word in (
        {"readings": "papr"},
        {"flare": "big"},
        {"reaction": Reaction(np.ones(1), np.ones(1), True)},
    ):
        with pytest.raises(InputError):
            blend_of(branching(), **word)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"flare\.depth"):
        Flare(depth=2.0)
