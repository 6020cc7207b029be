"""The yearly ring against its slow twin, and what holds of any ring."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from forest._threads import using_threads
from forest.growth.dealing import deal
from forest.mechanics.righting import BETA, NONE, STRAIN
from forest.mechanics.rods import Rods, allocate_rods
from forest.mechanics.wood import lay_wood, section, stiffness_per_modulus, widen, wood_traits
from forest.species import Species, shipped_table
from forest.trees.metamers import Metamers
from forest.trees.table import Trees
from tests.builders import random_arena
from tests.reference import wood as slow

seeds = st.integers(0, 2**32 - 1)
WAYS = {"none": NONE, "beta": BETA, "strain": STRAIN}


def traits_of(name: str = "picea_abies", **changes: float) -> NDArray[Any]:
    """Traits of one species with some of its mechanics changed; pipes add by area."""
    table = shipped_table(name)
    table["mechanics"].update(changes)
    return wood_traits([Species(**table)], np.array([2.0]))


def unit_quaternions(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Orientations, all alike likely."""
    q = rng.normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1)[:, None]


def fill(rods: Rods, **values: Any) -> None:
    """Set fields of all metamers."""
    for name, value in values.items():
        getattr(rods, name)[...] = value


def round_rods(n: int, radius: float, modulus: float, **values: Any) -> Rods:
    """Make n straight upright metamers of one round piece of wood."""
    rods = allocate_rods(n)
    j, i, _ = stiffness_per_modulus(radius, radius, 0.06)
    fill(rods, joint=0.0, rest=0.0, curvature=0.0, ringed=radius, frame=UPRIGHT)
    fill(rods, rigidity=np.array([j, i, i]) * modulus)
    fill(rods, **values)
    return rods


#: Turns H, the first axis of the body, up.
UPRIGHT = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0])


def one_stem(n: int, order: int = 0) -> tuple[Metamers, Trees]:
    """A tree of n metamers of one order."""
    m, trees = random_arena(np.random.default_rng(n), 1, 1, slack=n + 1)
    trees.start[0], trees.size[0] = 0, n
    m.order[:n] = order
    return m, trees


def lay(
    rods: Rods, radius: Any, woods: NDArray[Any], way: np.int64, order: int = 0
) -> NDArray[Any]:
    """Lay a ring on metamers of one tree; give what it recorded of the ring."""
    n = len(rods.ringed)
    m, trees = one_stem(n, order)
    m.pipe[:n] = (2.0 * np.asarray(radius)) ** 2
    ring = np.full((n, 2), 9.0, np.float32)
    lay_wood(m, trees, deal(trees.size), rods, woods, way, ring)
    return ring


def _random_rods(rng: np.random.Generator, n: int) -> Rods:
    rods = allocate_rods(n)
    fill(rods, joint=0.0)
    radius = rng.uniform(0.001, 0.3, n)
    modulus = rng.uniform(4e9, 12e9, (n, 1))
    stretch = rng.uniform(0.7, 1.4, n)
    sections = zip(radius * stretch, radius / stretch, strict=True)
    pieces = [stiffness_per_modulus(a, b, 0.06) for a, b in sections]
    fill(rods, rigidity=modulus * pieces, ringed=radius, frame=unit_quaternions(rng, n))
    fill(rods, rest=rng.normal(0, 0.2, (n, 3)), curvature=rng.normal(0, 0.2, (n, 3)))
    young = rng.random(n) < 0.1
    rods.ringed[young] = 0.0
    rods.rigidity[young] = 0.0
    return rods


def _twin_of(w: NDArray[Any], order: int) -> slow.Wood:
    names = ("juvenile", "mature", "reaction", "shear", "righting_from", "righting_span", "strain")
    names += ("strain_difference", "swell", "deviation_limit", "rest_share")
    return slow.Wood(
        **{name: float(w[name]) for name in names},
        maturing_years=1.0 / float(w["maturing"]),
        conifer=bool(w["conifer"]),
        sought=float(w["stem_angle" if order == 0 else "branch_angle"]),
    )


@given(seeds, st.sampled_from(list(WAYS)), st.integers(0, 2))
def test_ring_and_reaction_against_twin(seed: int, way: str, order: int) -> None:
    rng = np.random.default_rng(seed)
    rods = _random_rods(rng, 6)
    name = str(rng.choice(["picea_abies", "fagus_sylvatica"]))
    woods = traits_of(name, deviation_limit_rad_m=0.15)
    before = Rods(*(field.astype(float) for field in rods))
    radius = np.float32(rods.ringed * rng.choice([1.0, 1.003, 1.05, 1.6], 6))
    radius[rods.ringed == 0.0] = np.float32(0.002)
    ring = lay(rods, radius.astype(float), woods, WAYS[way], order)
    for i in range(6):
        piece = slow.Piece(
            before.ringed[i],
            before.rigidity[i],
            before.rest[i],
            before.curvature[i],
            slow.frame_of(before.frame[i]),
        )
        new = slow.lay(piece, float(rods.ringed[i]), _twin_of(woods[0], order), way)
        np.testing.assert_allclose(rods.rigidity[i], new.rigidity, rtol=1e-5)
        np.testing.assert_allclose(rods.rest[i], new.rest, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(ring[i, 0], new.eccentricity, rtol=1e-5, atol=1e-6)
        if new.eccentricity > 0.0:
            side = piece.frame @ [0.0, np.cos(ring[i, 1]), np.sin(ring[i, 1])]
            np.testing.assert_allclose(side, new.thick, atol=1e-5)
    np.testing.assert_allclose(rods.ringed, radius, rtol=1e-6)


@given(seeds)
def test_ellipses_are_recovered_from_their_rigidities(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.01, 0.5, 2)
    _, about_l, about_u = stiffness_per_modulus(a, b, 0.06)
    np.testing.assert_allclose(section(np.sqrt(a * b), about_l, about_u), (a, b), rtol=1e-9)


@given(seeds)
def test_widening_adds_the_area_in_the_given_widths(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.01, 0.5, 2)
    swell = rng.uniform(1.0, 2.0, 2)
    grown = rng.uniform(1e-6, 0.2)
    c, d = widen(a, b, *swell, grown)
    np.testing.assert_allclose(c * d - a * b, grown, rtol=1e-7)
    np.testing.assert_allclose((c - a) * swell[1], (d - b) * swell[0], rtol=1e-9)


@given(st.floats(0.005, 0.2), st.floats(0.0005, 0.02))
def test_one_ring_is_as_stiff_as_ten_thin_ones(inner: float, width: float) -> None:
    woods = traits_of()
    woods["mature"] = woods["juvenile"]
    once, often = (round_rods(1, inner, woods["juvenile"][0], curvature=0.1) for _ in range(2))
    lay(once, inner + width, woods, NONE)
    for k in range(10):
        lay(often, inner + width * (k + 1) / 10, woods, NONE)
    np.testing.assert_allclose(often.rigidity, once.rigidity, rtol=1e-5)
    np.testing.assert_allclose(often.rest, once.rest, rtol=1e-4, atol=1e-7)
    solid = woods["juvenile"][0] * np.pi / 4 * (inner + width) ** 4
    np.testing.assert_allclose(once.rigidity[0, 1:], solid, rtol=1e-5)


@given(st.lists(st.floats(0.0, 0.01), min_size=1, max_size=25), st.floats(1.0, 40.0))
def test_wood_ages_ring_by_ring(widths: list[float], years: float) -> None:
    """One stored rigidity holds what a list of rings with their ages would."""
    woods = traits_of(maturing_years=years)
    radii = list(np.float32(0.001 + np.cumsum(widths)).astype(float))
    rods = round_rods(1, 1.0, 0.0, ringed=0.0)
    for radius in radii:
        lay(rods, radius, woods, NONE)
    w = woods[0]
    exact = slow.rings_rigidity(radii, w["juvenile"], w["mature"], years)
    np.testing.assert_allclose(rods.rigidity[0, 1:], exact, rtol=1e-5)
    np.testing.assert_allclose(rods.rigidity[0, 0], 2.0 * w["shear"] * exact, rtol=1e-5)


@given(seeds, st.sampled_from(list(WAYS)))
def test_modulus_stays_between_those_of_the_wood(seed: int, way: str) -> None:
    rng = np.random.default_rng(seed)
    woods = traits_of("betula_pendula", deviation_limit_rad_m=0.1)
    rods = round_rods(8, 0.001, 0.0, ringed=0.0, frame=unit_quaternions(rng, 8))
    radius = rng.uniform(0.001, 0.01, 8)
    for _ in range(12):
        fill(rods, curvature=rods.rest + rng.normal(0, 0.2, (8, 3)))
        lay(rods, radius, woods, WAYS[way])
        radius *= rng.choice([1.0, 1.02, 1.5], 8)
    w = woods[0]
    about_l, about_u = rods.rigidity[:, 1].astype(float), rods.rigidity[:, 2].astype(float)
    modulus = np.sqrt(about_l * about_u) / (np.pi / 4 * rods.ringed.astype(float) ** 4)
    assert (modulus > w["juvenile"] * (1 - 1e-5)).all()
    assert (modulus < max(w["mature"], w["reaction"]) * (1 + 1e-5)).all()


def test_a_ring_keeps_the_bent_shape() -> None:
    """Eqs 8 and 9 in numbers: a ring as stiff as the core gives half of the bend."""
    woods = traits_of()
    woods["mature"] = woods["juvenile"]
    rods = round_rods(1, 0.01, woods["juvenile"][0], curvature=[0.0, 0.4, -0.2])
    lay(rods, 0.01 * 2**0.25, woods, NONE)
    np.testing.assert_allclose(rods.rest[0], [0.0, 0.2, -0.1], rtol=1e-5, atol=1e-9)


@given(seeds)
def test_growth_and_age_leave_a_loaded_rod_where_it_is(seed: int) -> None:
    """The moment that holds it, rigidity times (curvature - rest), is the same before and after."""
    rods = _random_rods(np.random.default_rng(seed), 5)
    old = rods.ringed > 0.0
    fields = [f.astype(float) for f in (rods.rigidity, rods.curvature, rods.rest)]
    lay(rods, rods.ringed * 1.1 + 1e-3, traits_of(), NONE)
    moment = rods.rigidity * (rods.curvature - rods.rest.astype(float))
    expected = fields[0] * (fields[1] - fields[2])
    np.testing.assert_allclose(moment[old], expected[old], rtol=1e-3, atol=1e-5 * moment.max())


def test_first_wood_keeps_its_shape_and_no_growth_is_no_ring() -> None:
    woods = traits_of()
    new = round_rods(2, 1.0, 0.0, ringed=0.0, rest=0.3, curvature=0.1)
    lay(new, 0.002, woods, STRAIN)
    assert (new.rest == np.float32(0.3)).all()
    np.testing.assert_allclose(new.rigidity[:, 1], 4.4e9 * np.pi / 4 * 0.002**4, rtol=1e-5)
    still = round_rods(1, 0.02, woods["mature"][0], frame=[1.0, 0.0, 0.0, 0.0])
    before = still.rigidity.copy()
    ring = lay(still, np.float64(still.ringed[0]), woods, STRAIN)
    assert (ring == 0.0).all()
    assert (still.rest == 0.0).all()
    np.testing.assert_allclose(still.rigidity, before, rtol=1e-6)


@pytest.mark.parametrize("way", WAYS.values())
def test_threads_do_not_change_bits(way: np.int64) -> None:
    results = []
    for count in (1, 2, 3):
        rng = np.random.default_rng(4)
        m, trees = random_arena(rng, 20, 30)
        rods = _random_rods(rng, len(m.parent))
        m.pipe[:] = (2.1 * rods.ringed + 1e-3) ** 2
        ring = np.zeros((len(m.parent), 2), np.float32)
        with using_threads(count):
            lay_wood(m, trees, deal(trees.size), rods, traits_of(), way, ring)
        results.append((ring, *rods))
    for other in results[1:]:
        for a, b in zip(results[0], other, strict=True):
            np.testing.assert_array_equal(a, b)
