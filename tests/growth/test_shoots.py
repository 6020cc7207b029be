"""Shoots by hand: direction, length, number, phyllotaxis, what stops them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from forest.dynamics.planting import seedlings
from forest.environment.obstacles import Solid, no_solid
from forest.growth.dealing import deal
from forest.growth.parameters import SpeciesTraits, Year
from forest.growth.shoots import extend, shooting_buds, sprout
from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, MAIN, TERMINAL, Arena
from forest.trees.table import Trees
from tests.growth.growing import VOXEL_M, make_species, make_traits, make_year
from tests.growth.invariants import assert_valid
from tests.reference import budget as slow_budget
from tests.reference import shoots as slow

PAPER = make_year(1, paper=True)
STAND = make_year(1)
UP = np.array([0.0, 0.0, 1.0])


def traits_of(paper: bool = True, **sections: dict[str, Any]) -> SpeciesTraits:
    """The paper's tree without jitter, light pull or tropism, and with these keys changed."""
    changes = {
        "architecture": {"angle_jitter_deg": 0.0},
        "shoots": {"light_weight": 0.0, "tropism_weight": 0.0},
    }
    for name, values in sections.items():
        changes.setdefault(name, {}).update(values)
    return make_traits(make_species(**changes), paper=paper)


def plant_one(traits: SpeciesTraits, year: Year) -> tuple[Arena, Trees]:
    """A seedling: one upright internode with a terminal and a lateral bud."""
    at = np.array([1.0])
    trees = seedlings(
        at,
        at,
        np.zeros(1, np.int16),
        first_id=1,
        step=0,
        seed=3,
        voxel_m=VOXEL_M,
        vigour_sd=np.zeros(1),
        seed_reserve_kg=np.zeros(1),
    )
    arena = Arena()
    arena.make_room(trees.start, trees.size, trees.room, np.ones(1, np.int64))
    one = np.ones(1, np.int64)
    sprout(arena.metamers, trees, 0, UP[None], one, traits, year._replace(step=0))
    return arena, trees


def shoot(
    traits: SpeciesTraits,
    year: Year,
    terminal: float = 0.0,
    lateral: float = 0.0,
    toward: tuple[float, float, float] = (0.0, 0.0, 0.0),
    solid: Solid | None = None,
) -> tuple[Any, Trees]:
    """Give a seedling's two buds a resource and let them shoot."""
    arena, trees = plant_one(traits, year)
    arena.metamers.resource[trees.start[0]] = (terminal, lateral)
    shared = deal(trees.size)
    shoots = shooting_buds(arena.metamers, trees, shared, traits)
    arena.make_room(trees.start, trees.size, trees.room, trees.size + shoots.new)
    m = arena.metamers
    pull = np.tile(np.array(toward, np.float32), (len(shoots.metamer), 1))
    extend(m, trees, shared, shoots, pull, traits, year, solid or no_solid(), VOXEL_M)
    here = slice(int(trees.start[0]), int(trees.start[0] + trees.size[0]))
    m.pipe[here] = np.maximum(m.pipe[here], 1e-6)  # new metamers have no wood yet
    assert_valid(m, trees)
    return type(m)(*(field[here] for field in m)), trees


def test_seedling() -> None:
    arena, trees = plant_one(traits_of(), PAPER)
    m, s = arena.metamers, int(trees.start[0])
    assert trees.size[0] == 1
    assert m.state[s] == TERMINAL | LATERAL
    np.testing.assert_allclose(m.tip[s], [0, 0, 0.2], rtol=1e-6)
    assert (m.order[s], m.birth[s], m.serial[s], m.parent[s]) == (0, 0, 0, -1)


@given(
    st.floats(1.0, 6.99),
    st.sampled_from([0.0, 0.4, 1.0]),
    st.sampled_from([-0.3, 0.0, 0.2]),
    st.tuples(*[st.floats(-1, 1)] * 3),
    st.booleans(),
)
def test_directions_and_lengths(
    v: float, xi: float, eta: float, toward: tuple[float, float, float], lateral: bool
) -> None:
    """Default direction + xi V + eta tropism, metamer by metamer; n = floor(v), l = v / n."""
    pull = np.array(toward)
    pull = pull / max(float(np.linalg.norm(pull)), 1e-3)
    pull[2] = abs(pull[2])
    traits = traits_of(shoots={"light_weight": xi, "tropism_weight": eta})
    v = float(np.float32(v))
    m, _ = shoot(traits, PAPER, *((0.0, v) if lateral else (v, 0.0)), toward=tuple(pull))
    tips = slow.shoot_tips(
        m.tip[0].astype(float),
        m.bud[0].astype(float) if lateral else UP,
        np.asarray(pull, np.float32).astype(float),
        UP,
        xi=xi,
        eta=eta,
        v=v,
        most=4,
        unit_length=0.2,
    )
    assert len(m.serial) == 1 + len(tips)
    np.testing.assert_allclose(m.tip[1:], tips, rtol=1e-4, atol=2e-6)
    np.testing.assert_allclose(m.length[1:], 0.2 * v / len(tips), rtol=1e-5)
    assert (m.order[1:] == (1 if lateral else 0)).all()
    assert (m.birth[1:] == 1).all()
    assert m.parent.tolist() == [-1, *range(len(tips))]
    assert m.shoot_height[1:].tolist() == [255 * k // len(tips) for k in range(1, len(tips) + 1)]


def test_internodes_shorten_towards_the_turgor_limit() -> None:
    """A shoot that starts at 0.2 m of a limit of 1 m; the paper's trees know no limit."""
    carbon = {"turgor_limit_m": 1.0}
    m, _ = shoot(traits_of(paper=False, carbon=carbon), STAND, terminal=3.5)
    np.testing.assert_allclose(m.length[1:], 0.2 * slow_budget.extension(0.2, 1.0), rtol=1e-6)
    m, _ = shoot(traits_of(carbon=carbon), PAPER, terminal=3.0)
    np.testing.assert_allclose(m.length[1:], 0.2, rtol=1e-6)


def test_states_of_a_new_shoot() -> None:
    m, trees = shoot(traits_of(), PAPER, terminal=3.5, lateral=1.5)
    assert m.state.tolist() == [
        CONTINUED | BRANCHED,
        MAIN | LATERAL | CONTINUED,
        MAIN | LATERAL | CONTINUED,
        MAIN | LATERAL | TERMINAL,
        LATERAL | TERMINAL,
    ]
    assert m.parent.tolist() == [-1, 0, 1, 2, 0]
    assert m.serial.tolist() == [0, 1, 2, 3, 4]
    assert trees.next_serial[0] == 5
    assert (m.resource == 0).all()


def test_less_than_one_makes_nothing() -> None:
    m, _ = shoot(traits_of(), PAPER, terminal=0.999, lateral=0.5)
    assert len(m.serial) == 1


def test_phyllotaxis() -> None:
    """Successive lateral buds of a straight shoot stand 137.5 degrees apart, at one angle."""
    m, _ = shoot(traits_of(), PAPER, terminal=4.0)
    azimuth = np.degrees(np.arctan2(m.bud[:, 1], m.bud[:, 0]))
    np.testing.assert_allclose(np.diff(azimuth) % 360.0, 137.5, atol=1e-3)
    np.testing.assert_allclose(np.degrees(np.arccos(m.bud[:, 2])), 45.0, atol=1e-3)


def test_phyllotaxis_goes_on_along_a_slanting_branch() -> None:
    m, _ = shoot(traits_of(), PAPER, lateral=4.0)
    axis = m.bud[0].astype(float)
    around = m.bud[1:] - np.outer(m.bud[1:] @ axis, axis)
    around /= np.linalg.norm(around, axis=1)[:, None]
    np.testing.assert_allclose(m.bud[1:] @ axis, np.cos(np.pi / 4), atol=1e-5)
    turn = np.cross(around[:-1], around[1:]) @ axis
    cosine = (around[:-1] * around[1:]).sum(axis=1)
    angle = np.degrees(np.arctan2(turn, cosine)) % 360.0
    np.testing.assert_allclose(angle, 137.5, atol=1e-2)


@pytest.mark.parametrize("sympodial", [False, True])
def test_the_fraction_is_carried(sympodial: bool) -> None:
    """In mass balance no part of the resource is lost: it stays with the shoot's last bud."""
    axis = {"axis": "sympodial"} if sympodial else {}
    m, _ = shoot(traits_of(paper=False, architecture=axis), STAND, terminal=2.75, lateral=1.5)
    np.testing.assert_allclose(m.length[1:], 0.2, rtol=1e-6)
    assert len(m.serial) == 4
    bud = 1 if sympodial else 0
    assert m.resource[2, bud] == 0.75
    assert m.resource[3, bud] == 0.5
    assert m.resource.sum() == 1.25


def test_a_sympodial_shoot_ends() -> None:
    m, _ = shoot(traits_of(architecture={"axis": "sympodial"}), PAPER, terminal=3.0)
    assert not (m.state[1:] & TERMINAL).any()
    assert (m.state[1:] & LATERAL).all()


@given(st.floats(1.0, 4.9), st.sampled_from([0.3, 0.5, 0.6]))
def test_sylleptic(v: float, bias: float) -> None:
    """Every new node's two buds share what is left at once."""
    v = float(np.float32(v))
    traits = traits_of(architecture={"ramification": "sylleptic"}, bud_fate={"apical_bias": bias})
    m, _ = shoot(traits, PAPER, terminal=v)
    assert len(m.serial) == 1 + slow.sylleptic_count(v, bias)
    np.testing.assert_allclose(m.length, 0.2, rtol=1e-6)


def test_sylleptic_keeps_the_resource() -> None:
    traits = traits_of(paper=False, architecture={"ramification": "sylleptic"})
    m, _ = shoot(traits, STAND, terminal=4.5)
    assert m.order.max() == 1
    np.testing.assert_allclose(len(m.serial) - 1 + m.resource.sum(), 4.5, atol=1e-5)


def test_maximum_of_metamers() -> None:
    traits = traits_of(architecture={"max_metamers_per_shoot": 2})
    m, _ = shoot(traits, PAPER, terminal=9.0)
    assert len(m.serial) == 3
    np.testing.assert_allclose(m.length[1:], 0.4, rtol=1e-6)  # never more than doubled


def test_growth_stops_at_the_ground() -> None:
    """A bud 0.2 m above the ground that is drawn down makes one of four short internodes."""
    down = {"tropism_weight": 10.0, "tropism_direction": [0.0, 0.0, -1.0]}
    short, _ = shoot(traits_of(shoots=down), PAPER, lateral=4.0)
    assert len(short.serial) == 2
    assert short.tip[1, 2] > 0.0
    assert short.state[1] == TERMINAL | LATERAL
    long, _ = shoot(traits_of(shoots=down), PAPER, lateral=4.5)
    assert len(long.serial) == 1
    assert long.state[0] == TERMINAL | LATERAL


def test_growth_stops_at_an_obstacle() -> None:
    """A slab from z = 0.75 m on: the shoot ends below it, and its bud lives on."""
    slab = Solid(
        np.ones((1, 40, 40), np.uint8), np.array([0, 0, 3], np.int32), 0, np.array([40, 40])
    )
    m, _ = shoot(traits_of(), PAPER, terminal=4.0, solid=slab)
    np.testing.assert_allclose(m.tip[:, 2], [0.2, 0.4, 0.6], rtol=1e-6)
    assert m.state[2] == MAIN | TERMINAL | LATERAL


def test_user_drawn_curves() -> None:
    """Internode length by order, tropism by order: Taylor-Hell 2005, 3.1."""
    traits = traits_of(
        architecture={"internode_factor_by_order": [[0, 1.0], [1, 0.5]]},
        shoots={"tropism_weight": 1.0, "tropism_factor_by_order": [[0, 0.0], [1, 1.0]]},
    )
    m, _ = shoot(traits, PAPER, terminal=2.0, lateral=2.0)
    np.testing.assert_allclose(m.length, [0.2, 0.2, 0.2, 0.1, 0.1], rtol=1e-6)
    first = (m.tip[3] - m.tip[0]) / m.length[3]
    np.testing.assert_allclose(first, slow.unit(m.bud[0].astype(float) + UP), atol=1e-5)
