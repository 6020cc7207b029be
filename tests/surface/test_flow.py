"""The chain of particles: relinking, staying on the surface, grain and spiral grain."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from forest._threads import using_threads
from forest.errors import InputError
from forest.surface.blend.around import empty_around, gather, kin_of, value_around
from forest.surface.blend.field import Blend
from forest.surface.blend.limbs import limbs_of
from forest.surface.flow import Flow, FlowRules, angle_to_limb, flow, grain
from forest.surface.flow.chain import (
    DONE,
    FLOWING,
    _mend_links,
    _push,
    empty_chain,
    grain_heading,
    with_room,
)
from forest.surface.flow.laying import lay, start
from forest.surface.flow.relink import relink
from forest.surface.flow.surface import CLOSE, Seen, limbed, settle
from tests.reference import flow as slow
from tests.surface.limbs import Limb, branched, pole, tree

PRINTED = FlowRules(steering=0.0, finest_link=np.inf)


@pytest.fixture(scope="module")
def junction() -> tuple[Blend, Flow]:
    blend = Blend.of(limbs_of(branched()))
    return blend, flow(blend)


def _loops(ahead: np.ndarray) -> list[set[int]]:
    left, found = set(range(len(ahead))), []
    while left:
        loop, k = set(), min(left)
        while k not in loop:
            loop.add(k)
            k = int(ahead[k])
        found.append(loop)
        left -= loop
    return found


@settings(max_examples=25, deadline=None)
@given(
    n=st.integers(4, 24),
    limbs=st.integers(2, 3),
    seed=st.integers(0, 10_000),
    printed=st.booleans(),
)
def test_relinking_is_table_2(n: int, limbs: int, seed: int, printed: bool) -> None:
    rng = np.random.default_rng(seed)
    turn = 2.0 * np.pi * np.arange(n) / n
    place = np.column_stack((np.cos(turn), 0.3 * np.sin(turn), np.zeros(n)))
    place += rng.normal(0.0, 0.1, (n, 3))
    limb = rng.integers(0, limbs, n).astype(np.int32)
    foot, heading = rng.normal(0.0, 0.4, (n, 3)), np.tile([0.1, 0.2, 1.0], (n, 1))
    heading /= np.linalg.norm(heading[0])
    ahead, behind = (np.arange(n) + 1) % n, (np.arange(n) - 1) % n
    links = {k: int(ahead[k]) for k in range(n)}

    def goes_around(part: list[int]) -> bool:
        way = [place[k] for k in part]
        runs = [k for j, k in enumerate(part) if j == 0 or limb[k] != limb[part[j - 1]]]
        return any(abs(slow.turns(way, foot[k], heading[k])) > 0.5 for k in runs)

    def allowed(one: list[int], other: list[int]) -> bool:
        return printed or (goes_around(one) and goes_around(other))

    for a in range(n):
        b = int(ahead[a])
        count = relink(a, b, limb, place, ahead, behind, foot, heading, printed)
        assert count == slow.relink(a, b, limb.tolist(), place.tolist(), links, allowed)
        assert ahead.tolist() == [links[k] for k in range(n)]
    assert sorted(ahead) == list(range(n))
    assert (behind[ahead] == np.arange(n)).all()


def test_a_chain_across_a_crotch_parts_into_one_loop_for_each_limb() -> None:
    turn = 2.0 * np.pi * np.arange(20) / 20
    one = np.column_stack((np.cos(turn) - 1.02, np.sin(turn), np.zeros(20)))  # from the crotch
    other = np.column_stack((1.02 - np.cos(turn), np.sin(turn), np.zeros(20)))
    place = np.concatenate((one[1:], other[1:]))  # an eight whose crossing is open
    limb = np.repeat([0, 1], 19).astype(np.int32)
    ahead, behind = (np.arange(38) + 1) % 38, (np.arange(38) - 1) % 38
    foot = np.where(limb[:, None] == 0, [-1.02, 0.0, 0.0], [1.02, 0.0, 0.0])
    heading = np.tile([0.0, 0.0, 1.0], (38, 1))
    place[19:] = place[19:][::-1]  # so that links over the crossing run side by side
    place[18], place[19] = (-0.1, -0.3, 0.0), (0.3, -0.3, 0.0)
    place[37], place[0] = (0.3, 0.0, 0.0), (-0.1, 0.0, 0.0)
    assert relink(18, 19, limb, place, ahead, behind, foot, heading, False) == 1
    assert _loops(ahead) == [set(range(19)), set(range(19, 38))]


def test_links_pull_like_springs_without_length() -> None:
    rng = np.random.default_rng(3)
    n = 7
    chain = empty_chain(n)
    chain.place[:], chain.velocity[:] = rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    chain.ahead[:], chain.behind[:] = (np.arange(n) + 1) % n, (np.arange(n) - 1) % n
    chain.state[:] = FLOWING
    rules = FlowRules(skeleton_damping=0.0, steering=0.0)
    for i in range(n):
        _push(chain, rules.forces(1.0), np.int64(i))
    for i in range(n):
        expected = slow.push(
            chain.place.tolist(), chain.velocity.tolist(), i, spring=100.0, damping=1.0
        )
        np.testing.assert_allclose(chain.push[i], expected, rtol=1e-12, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), lean=st.floats(-80.0, 80.0))
def test_steering_turns_particles_to_the_leaning_heading(seed: int, lean: float) -> None:
    rng = np.random.default_rng(seed)
    normal, heading = rng.normal(size=(2, 3))
    normal /= np.linalg.norm(normal)
    heading = normal.copy() if seed % 7 == 0 else heading / np.linalg.norm(heading)
    way = slow.grain_heading(normal, heading, np.radians(lean))
    got = grain_heading(normal, heading, np.cos(np.radians(lean)), np.sin(np.radians(lean)))
    np.testing.assert_allclose(got, way, atol=1e-9)
    chain = empty_chain(3)
    chain.ahead[:], chain.behind[:] = (1, 2, 0), (2, 0, 1)
    chain.velocity[:] = velocity = rng.normal(size=3)
    chain.normal[:], chain.heading[:] = normal, heading
    rules = FlowRules(skeleton_damping=0.0, steering=3.0, speed=1.5, spiral_deg=lean)
    _push(chain, rules.forces(1.0), np.int64(0))
    np.testing.assert_allclose(chain.push[0], 3.0 * (1.5 * np.array(way) - velocity), atol=1e-9)


def test_particles_settle_where_the_slope_leads() -> None:
    rng = np.random.default_rng(5)
    blend = Blend.of(limbs_of(branched()))
    surface, around = limbed(blend), empty_around(1)
    for _ in range(8):
        on = blend.project(rng.uniform((-0.1, -0.1, 0.1), (0.3, 0.1, 0.6)))[0]
        normal = blend.gradient(on)[0]
        normal /= np.linalg.norm(normal)
        x = on + rng.normal(0.0, 0.003, 3)
        hint = np.int64(blend.limb(on).cone[0])
        gather(blend.kernel, surface.kin, around, 0, 0, *x.tolist(), 0.1)
        got = settle(Seen(surface.field, surface.kin, around, 0), *x.tolist(), hint, normal)
        place, way = slow.settle(lambda p: slow.seen(blend, {0, 1}, p)[0], x.tolist())
        assert abs(slow.seen(blend, {0, 1}, got[:3])[0]) <= CLOSE * 0.1
        assert np.linalg.norm(np.subtract(got[:3], place)) < 0.1 * np.linalg.norm(x - on)
        assert np.dot(got[3:6], way) > 0.999


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(3, 20), wide=st.sampled_from([0.004, 1.0]))
def test_links_are_split_and_merged_one_by_one(seed: int, n: int, wide: float) -> None:
    """On a flat side of a trunk as thick as can be, particles stay in their links' middles."""
    rng = np.random.default_rng(seed)
    radius = 1e4
    surface = limbed(Blend.of(limbs_of(pole(radius, 3e4))))
    forces = FlowRules(steering=0.0).forces(1.0)
    chain = empty_chain(3 * n)
    turn = np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
    size = wide * rng.uniform(0.1, 0.4)
    chain.place[:n] = (radius, 0.0, 1e4)
    chain.place[:n, 1:] += size * np.column_stack((np.cos(turn), np.sin(turn)))
    chain.velocity[:n, 1:] = rng.normal(size=(n, 2))
    chain.normal[:n] = (1.0, 0.0, 0.0)
    chain.radius[:n] = radius
    chain.state[:n] = np.where(rng.random(n) < 0.2, DONE, FLOWING)
    chain.velocity[:n][chain.state[:n] == DONE] = 0.0
    chain.ahead[:n], chain.behind[:n] = (np.arange(n) + 1) % n, (np.arange(n) - 1) % n
    chain.live[:n], chain.tally[:2] = np.arange(n), n
    beads = {
        k: slow.Bead(chain.place[k].tolist(), chain.velocity[k].tolist(), chain.state[k] == DONE)
        for k in range(n)
    }
    loop, after = slow.mend(list(range(n)), beads, forces.least, forces.greatest)
    _mend_links(surface, chain, forces)
    assert sorted(chain.live[: chain.tally[1]].tolist()) == sorted(loop)
    assert [int(chain.ahead[k]) for k in loop] == loop[1:] + loop[:1]
    assert [int(chain.behind[k]) for k in loop] == loop[-1:] + loop[:-1]
    for k in loop:
        np.testing.assert_allclose(chain.place[k, 1:], after[k].place[1:], atol=1e-3 * wide)
        np.testing.assert_allclose(chain.velocity[k, 1:], after[k].velocity[1:], atol=1e-3)
        assert (chain.state[k] == DONE) == after[k].done


def _hub() -> Blend:
    """Seven limbs that leave a trunk at one height, some of them side by side."""
    shapes = [Limb(-1, 0, (0, 0, 0), (0, 0, 0.8), 0.06, 0.04)]
    for k in range(7):
        around, lean = 0.6 * k, np.radians(35.0 + 8.0 * (k % 3))
        way = np.array([np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)])
        base = np.array([0.0, 0.0, 0.3 + 0.01 * (k % 2)])
        shapes.append(Limb(0, 2, base, base + 0.4 * way, 0.035, 0.02))
    return Blend.of(limbs_of(tree(*shapes)))


def test_every_limb_of_a_hub_has_a_ring() -> None:
    """The chain hangs between limbs side by side; rings laid past the place go on."""
    blend = _hub()
    found = flow(blend)
    assert found.stuck == 0
    assert found.laid > 0
    last = found.chains[-1]
    on = [set(part.tolist()) for part in np.split(last.limb, last.first[1:-1])]
    assert set(range(8)) <= {min(part) for part in on if len(part) == 1}


def test_a_ring_is_laid_where_the_limb_is_alone() -> None:
    surface = limbed(_hub())
    forces = FlowRules().forces(0.06)
    chain = with_room(start(surface, forces), 5000)
    first = int(chain.tally[0])
    chain = lay(surface, chain, forces, 3, 0.0)
    new = np.arange(first, chain.tally[0])
    assert len(new) >= 6 and (chain.limb[new] == 3).all()
    assert np.abs(np.linalg.norm(chain.place[new] - chain.foot[new], axis=1) / 0.035).max() < 1.2
    before = chain.tally.copy()
    chain = lay(surface, chain, forces, 3, 0.39)  # at the tip no ring has room
    assert np.array_equal(chain.tally, before)


@pytest.mark.parametrize("rules", [PRINTED, FlowRules()], ids=["printed", "steered"])
@pytest.mark.parametrize("angle", [40.0, 80.0])
def test_the_chain_parts_into_two_loops_at_a_branching(rules: FlowRules, angle: float) -> None:
    found = flow(Blend.of(limbs_of(branched(angle))), rules=rules)
    assert found.relinked == 1
    assert found.stuck <= (2 if rules.steering == 0.0 else 0)  # momentum alone may leave two
    counts = [len(chain) for chain in found.chains]
    assert counts == sorted(counts)
    assert counts[0] == 1 and counts[-1] == 2
    last = found.chains[-1]
    on = [set(part.tolist()) for part in np.split(last.limb, last.first[1:-1])]
    assert sorted(on, key=min) == [{0}, {1}]


def test_the_chain_parts_at_every_limb_of_a_crown() -> None:
    """Limbs of all angles, thin ones, two from one place and one on a limb."""
    shapes = [Limb(-1, 0, (0, 0, 0), (0, 0, 1.6), 0.1, 0.05)]
    for k, (at, lean, thick) in enumerate(
        ((1, 90.0, 0.05), (2, 60.0, 0.02), (4, 75.0, 0.05), (4, 75.0, 0.04), (6, 35.0, 0.04))
    ):
        around, lean = (np.pi if k == 3 else 2.4 * k), np.radians(lean)
        way = np.array([np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)])
        base = np.array([0.0, 0.0, 0.2 * (at + 1)])
        shapes.append(Limb(0, at, base, base + 0.6 * way, thick, 0.6 * thick))
    middle, side = shapes[1].start + 0.525 * (shapes[1].end - shapes[1].start), (0.1, 0.25, 0.1)
    shapes.append(Limb(1, 6, middle, middle + np.array(side), 0.02, 0.015))
    found = flow(Blend.of(limbs_of(tree(*shapes))))
    assert found.stuck == 0
    assert found.relinked == len(shapes) - 1
    last = found.chains[-1]
    on = [set(part.tolist()) for part in np.split(last.limb, last.first[1:-1])]
    assert sorted(on, key=min) == [{k} for k in range(len(shapes))]


def test_by_momentum_alone_the_chain_hangs_under_a_limb_at_90_degrees() -> None:
    blend = Blend.of(limbs_of(branched(90.0)))
    printed = flow(blend, rules=PRINTED, seconds=8.0)
    assert printed.relinked == 0
    assert printed.stuck > 0


def test_no_particle_leaves_the_surface(junction: tuple[Blend, Flow]) -> None:
    blend, found = junction
    place = found.trails.place
    slope = np.linalg.norm(blend.gradient(place), axis=1)
    off = np.abs(blend.value(place)) / (slope * blend.limb(place).radius)
    assert off.max() < 1.02e-4
    assert np.abs(found.trails.off_m).max() < 1e-4 * 0.1


def test_links_stay_between_their_limits(junction: tuple[Blend, Flow]) -> None:
    _, found = junction
    for chain in found.chains[:-1]:
        for part in np.split(chain.place, chain.first[1:-1]):
            link = np.linalg.norm(part - np.roll(part, 1, axis=0), axis=1) / found.unit_m
            assert link.max() < 0.15 + 1e-9
            if len(part) > 6:
                assert np.median(link) > 0.05


def _crossing() -> Blend:
    """Two limbs of one trunk, from far apart, that cross."""
    return Blend.of(
        limbs_of(
            tree(
                Limb(-1, 0, (0, 0, 0), (0, 0, 2.4), 0.1, 0.08),
                Limb(0, 0, (0, 0, 0.3), (0.9, 0.0, 1.2), 0.04, 0.03),
                Limb(0, 5, (0, 0, 1.8), (0.9, 0.02, 0.9), 0.04, 0.03),
            )
        )
    )


def test_limbs_that_cross_do_not_hold_the_chain() -> None:
    blend = _crossing()
    found = flow(blend)
    assert found.relinked == 2
    assert found.stuck == 0
    place = found.trails.place
    assert blend.value(place).min() > -0.0102 * 0.1  # no trail within the other's wood
    last = found.chains[-1]
    on = [set(part.tolist()) for part in np.split(last.limb, last.first[1:-1])]
    assert sorted(on, key=min) == [{0}, {1}, {2}]


def test_lists_give_the_surface_that_a_limb_sees() -> None:
    rng = np.random.default_rng(8)
    blend = _crossing()
    kin = kin_of(blend.limbs)
    pairs = [set(kin.other[kin.first[k] : kin.first[k + 1]].tolist()) for k in range(3)]
    assert pairs == [{1, 2}, {0}, {0}]
    around = empty_around(1)
    cones = blend.limbs.cones
    for _ in range(300):
        k = int(rng.integers(len(cones.axis)))
        axis = cones.axis[k]
        middle = cones.start[k] + rng.random() * (cones.end[k] - cones.start[k])
        middle = middle + rng.normal(0.0, 0.06, 3)
        gather(blend.kernel, kin, around, 0, axis, *middle.tolist(), 0.05)
        for _ in range(3):
            x = (middle + rng.normal(0.0, 0.04, 3)).tolist()
            got, which = value_around(blend.kernel, kin, around, 0, *x, k)
            expected, nearest = slow.seen(blend, {int(axis)} | pairs[axis], x)
            assert (got, which) == (expected, nearest)


def test_grain_follows_the_branches(junction: tuple[Blend, Flow]) -> None:
    blend, found = junction
    for axis, low, high in ((0, 0.02, 0.12), (0, 0.62, 0.78), (1, 0.42, 0.68)):
        place = found.trails.place
        on = blend.limb(place)
        here = place[(on.axis == axis) & (on.along > low) & (on.along < high)]
        angle = np.abs(angle_to_limb(grain(here, found.trails, blend), here, blend))
        assert len(here) > 50
        assert np.percentile(angle, 90) < 15.0
        assert np.median(angle) < 6.0


def test_grain_is_tangential_and_changes_smoothly(junction: tuple[Blend, Flow]) -> None:
    blend, found = junction
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    ring = np.column_stack((0.1 * np.cos(turn), 0.1 * np.sin(turn), np.full(400, 0.6)))
    ring = blend.project(ring)
    ways = grain(ring, found.trails, blend)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1.0, rtol=1e-9)
    slope = blend.gradient(ring)
    assert np.abs(np.sum(ways * slope, axis=1)).max() < 1e-6
    steps = np.degrees(np.arccos(np.clip(np.sum(ways[1:] * ways[:-1], axis=1), -1.0, 1.0)))
    assert steps.max() < 5.0


@pytest.mark.parametrize("angle", [-12.0, 20.0])
@pytest.mark.parametrize("steering", [0.0, 2.0])
def test_a_tangential_start_gives_spiral_grain(angle: float, steering: float) -> None:
    blend = Blend.of(limbs_of(pole()))
    found = flow(blend, rules=FlowRules(spiral_deg=angle, steering=steering))
    place = found.trails.place
    place = place[(place[:, 2] > 0.1) & (place[:, 2] < 1.8)]
    seen = angle_to_limb(grain(place, found.trails, blend), place, blend)
    np.testing.assert_allclose(seen, angle, atol=1.5)
    # A whole trail: tan(angle) = way around per way up.
    way = max(found.trails.polylines(), key=len)
    way = way[(way[:, 2] > 0.2) & (way[:, 2] < 1.8)]
    turn = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    slope = 0.146 * (turn[-1] - turn[0]) / (way[-1, 2] - way[0, 2])
    assert slope == pytest.approx(np.tan(np.radians(angle)), abs=0.02)


def test_same_bits_for_any_number_of_threads() -> None:
    blend = Blend.of(limbs_of(branched(60.0)))
    with using_threads(1):
        one = flow(blend)
        grain_one = grain(one.trails.place, one.trails, blend)
    with using_threads(2):
        two = flow(blend)
        grain_two = grain(two.trails.place, two.trails, blend)
    assert np.array_equal(one.trails.place, two.trails.place)
    assert np.array_equal(grain_one, grain_two)


def test_a_smaller_unit_lays_a_finer_chain() -> None:
    blend = Blend.of(limbs_of(pole(0.15, 0.6)))
    coarse, fine = flow(blend), flow(blend, unit_m=0.075)
    assert len(fine.chains[0].place) == pytest.approx(2 * len(coarse.chains[0].place), abs=2)


def test_each_stem_has_a_ring() -> None:
    stems = tree(
        Limb(-1, 0, (0, 0, 0), (0, 0, 0.6), 0.1, 0.09),
        Limb(-1, 0, (0.5, 0, 0), (0.6, 0, 0.5), 0.05, 0.04),
    )
    found = flow(Blend.of(limbs_of(stems)))
    for chain in (found.chains[0], found.chains[-1]):
        assert [set(p.tolist()) for p in np.split(chain.limb, chain.first[1:-1])] == [{0}, {1}]
    assert np.diff(found.chains[0].first).tolist() == [63, 32]
    assert found.relinked == 0
    assert found.stuck == 0
    alone = flow(Blend.of(limbs_of(tree(Limb(-1, 0, (0, 0, 0), (0, 0, 0.6), 0.1, 0.09)))))
    of_trunk = found.chains[0].place[found.chains[0].limb == 0]
    assert np.array_equal(of_trunk, alone.chains[0].place)


def test_wrong_rules_are_refused() -> None:
    blend = Blend.of(limbs_of(pole()))
    for unit in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="unit_m"):
            flow(blend, unit_m=unit)
    with pytest.raises(InputError, match="show_every_s"):
        flow(blend, show_every_s=0.0)
    with pytest.raises(InputError, match="greatest_link"):
        FlowRules(greatest_link=0.1, least_link=0.06)
    with pytest.raises(InputError, match="readings"):
        FlowRules(readings="papr")


@pytest.mark.parametrize(
    "rules",
    [
        {"steps_per_s": 0.0},
        {"speed": 0.0},
        {"speed": np.inf},
        {"least_link": 0.0},
        {"finest_link": 0.0},
        {"finest_link": np.nan},
        {"spring": np.nan},
        {"skeleton_damping": -1.0},
        {"spiral_deg": 90.0},
        {"steering": np.nan},
    ],
    ids=lambda rules: "".join(rules),
)
def test_wrong_constants_are_named(rules: dict[str, float]) -> None:
    with pytest.raises(InputError, match=next(iter(rules))):
        FlowRules(**rules)


def test_table_2_as_printed_makes_loops_that_enclose_no_limb() -> None:
    blend = Blend.of(limbs_of(branched(80.0)))
    ours, printed = (
        flow(blend, unit_m=0.13, seconds=4.0, rules=FlowRules(readings=readings))
        for readings in ("corrected", "paper")
    )
    assert printed.relinked > ours.relinked
    sizes = [np.diff(chain.first).min() for chain in printed.chains]
    assert min(sizes) < 3 <= min(np.diff(chain.first).min() for chain in ours.chains)
