"""Trees that are marked and bent, and obstacles that come and go: on record, and resumed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from forest.errors import ActError, InputError
from forest.live import LiveSession
from forest.management.places import check_places
from forest.scenario import Scenario
from forest.stand import Stand
from tests.tiny import assert_same_state, assert_same_years, forest, steps, tiny, write_tiny

ALONE = (
    "plot={size_m=[8, 8], boundary='open'}",
    "species={quercus_robur={}}",
    "planting={kind='explicit', trees=[{x_m=4, y_m=4}]}",
    "climate={noise_sd=0}",
    "output={sample_trees={ids=[1]}}",
)
BENDING = "mechanics={wind_m_s=0}"
WALL = "{kind='box', name='wall', min_m=[0.0, 2.0, 0.0], max_m=[10.0, 2.6, 1.0]}"


def limb(stand: Stand, tree_id: int = 1) -> tuple[int, np.ndarray[Any, Any]]:
    """Give the last metamer of the longest branch of a tree, and where it ends."""
    shape = stand.skeleton(tree_id)
    axis = np.bincount(shape.axis[shape.order == 1]).argmax()
    last = np.flatnonzero(shape.axis == axis)[-1]
    return int(shape.serial[last]), shape.end[last]


def grown(*settings: str, years: int = 5) -> Stand:
    stand = Stand(tiny(*ALONE, *settings))
    steps(stand, years)
    return stand


@pytest.mark.parametrize("mechanics", [(), (BENDING,)], ids=["stiff", "bending"])
def test_a_branch_is_bent_and_nothing_else(mechanics: tuple[str, ...]) -> None:
    stand = grown(*mechanics)
    before = stand.skeleton(1)
    metamer, end = limb(stand)
    to = end + np.array([0.03, -0.05, 0.06])
    left = stand.bend(1, metamer, to)
    after = stand.skeleton(1)
    place = int(np.flatnonzero(before.serial == metamer)[0])
    assert np.linalg.norm(after.end[place] - to) == pytest.approx(left, abs=1e-5)
    assert left < np.linalg.norm(to - end)
    np.testing.assert_allclose(after.length, before.length, rtol=0, atol=2e-6)
    moved = (after.end != before.end).any(axis=1)
    axis = before.axis == before.axis[place]
    start = int(np.flatnonzero(axis)[0])
    beyond = np.zeros(len(before), bool)
    for i in range(len(before)):
        beyond[i] = i == start or (before.parent[i] >= 0 and beyond[before.parent[i]])
    assert moved[place]
    assert not moved[~beyond].any()
    (record,) = steps(stand, 1)
    assert np.isin(8 - 1, record.tables["events"]["kind"])  # bent
    assert record.tables["treatments"]["kind"].tolist() == [6] * len(
        record.tables["treatments"]["kind"]
    )


def test_a_bent_branch_stays_bent() -> None:
    """Where trees bend, the joints keep the turn: it springs back only by what its load changed.

    Nothing rights it here; reaction wood may, over the years.
    """
    unrighted = "mechanics={righting='none'}"
    stand, other = grown(unrighted), grown(unrighted)
    metamer, end = limb(stand)
    to = end + np.array([0.05, 0.05, 0.08])
    stand.bend(1, metamer, to)
    bent = stand.skeleton(1)
    place = int(np.flatnonzero(bent.serial == metamer)[0])
    turned = np.linalg.norm(bent.end[place] - end)
    assert stand.mechanics is not None
    stand.mechanics.settle(stand.arena, stand.rows)
    sprung = stand.skeleton(1).end[place]
    assert np.linalg.norm(sprung - bent.end[place]) < 0.15 * turned
    steps(stand, 1), steps(other, 1)
    later, never = stand.skeleton(1), other.skeleton(1)
    now = later.end[later.serial == metamer][0]
    straight = never.end[never.serial == metamer][0]
    assert np.linalg.norm(now - straight) > 0.6 * turned


def test_the_light_sees_the_new_place() -> None:
    """A branch that is bent gets the light of its new place in the next year."""
    one, other = grown(), grown()
    metamer, end = limb(one)
    one.bend(1, metamer, end + np.array([0.3, 0.0, 0.2]))
    steps(one, 1), steps(other, 1)
    light = []
    for stand in (one, other):
        arena, n = stand.arena.metamers, int(stand.rows.size[0])
        light.append(dict(zip(arena.serial[:n].tolist(), arena.light[:n].tolist(), strict=True)))
    both = light[0].keys() & light[1].keys()
    assert any(light[0][serial] != light[1][serial] for serial in both)


def test_bending_to_where_it_is_changes_nothing() -> None:
    stand = grown()
    metamer, end = limb(stand)
    before = stand.skeleton(1).end
    assert stand.bend(1, metamer, end) < 1e-4
    np.testing.assert_array_equal(stand.skeleton(1).end, before)


def test_never_into_the_ground_or_a_wall() -> None:
    stand = grown()
    metamer, end = limb(stand)
    before = stand.skeleton(1).end
    with pytest.raises(InputError, match="below the ground"):
        stand.bend(1, metamer, [end[0], end[1], -0.5])
    wall = {"kind": "box", "name": "w", "min_m": [0.0, 0.0, 0.0], "max_m": [8.0, 8.0, 9.0]}
    with pytest.raises(InputError, match="tree 1 stands there"):
        stand.obstacle(add=wall)
    with pytest.raises(InputError, match="tree 1 has no metamer 99999"):
        stand.bend(1, 99999, end)
    with pytest.raises(InputError, match="clamped in the ground"):
        stand.bend(1, 0, [4.0, 4.0, 1.0])
    with pytest.raises(InputError, match="no living tree has the id 7"):
        stand.bend(7, 1, end)
    np.testing.assert_array_equal(stand.skeleton(1).end, before)
    assert stand.pending == []


def test_marks_name_trees_for_later_acts() -> None:
    scenario = tiny(
        "acts=[{kind='mark', year=2006, thickest_ha=300, mark='crop'},"
        "{kind='mark', year=2003, tree_ids=[5, 6], mark='out'},"
        "{kind='fell', year=2003, marked='out', cause='tending'},"
        "{kind='prune', year=2007, marked='crop', below_share=0.5}]"
    )
    stand = Stand(scenario)
    records = steps(stand, 7)
    events = [record.tables["events"] for record in records]
    crop = stand.marks.bearing("crop")
    assert len(crop) == 3
    assert events[5]["tree_id"][events[5]["kind"] == 6].tolist() == crop
    assert sorted(events[2]["tree_id"][events[2]["kind"] == 3].tolist()) == [5, 6]
    pruned = events[6]["tree_id"][events[6]["kind"] == 4].tolist()
    assert pruned
    assert set(pruned) <= set(crop)
    assert stand.marks.of_tree(crop[0]) == ["crop"]


def test_a_mark_alone_changes_no_growth() -> None:
    plain, marked = (
        Stand(tiny()),
        Stand(tiny("acts=[{kind='mark', year=2003, all_trees=true, mark='a'}]")),
    )
    for one, other in zip(steps(plain, 5), steps(marked, 5), strict=True):
        for name in ("trees", "rings", "stand"):
            for column, values in one.tables[name].items():
                np.testing.assert_array_equal(values, other.tables[name][column])


def test_a_wall_cuts_shades_and_stops() -> None:
    stand = grown(years=6)
    shape = stand.skeleton(1)
    side = float(shape.end[:, 0].max())
    low = 4.0 + 0.5 * (side - 4.0)
    wall = {"kind": "box", "name": "wall", "min_m": [low, 0.0, 0.0], "max_m": [8.0, 8.0, 6.0]}
    assert stand.obstacle(add=wall) == 1
    cut = stand.skeleton(1)
    voxel = stand.surroundings.voxel_m
    limit = np.rint(low / voxel) * voxel
    assert len(cut) < len(shape)
    assert cut.end[:, 0].max() < limit
    first, *_ = records = steps(stand, 3)
    assert 4 in first.tables["events"]["kind"]
    assert set(first.tables["treatments"]["kind"]) == {7}
    assert stand.skeleton(1).end[:, 0].max() < limit
    stand.obstacle(move="wall", by_m=[1.0, 0.0, 0.0])
    assert stand.obstacles.now[0].min_m[0] == low + 1.0
    stand.obstacle(remove="wall")
    assert stand.obstacles.now == ()
    steps(stand, 3)
    assert stand.skeleton(1).end[:, 0].max() > limit
    assert len(records) == 3


ACTS = {
    "mark": "{kind='mark', year=2005, tree_ids=[2, 3], mark='crop'}",
    "bend": "{kind='bend', year=2006, tree_id=1, metamer=3, to_m=[MX, MY, MZ]}",
    "wall": f"{{kind='obstacle', year=2004, add={WALL}}}",
    "marked": "{kind='mark', year=2003, thickest_ha=200, mark='crop'},"
    "{kind='prune', year=2006, marked='crop', below_share=0.4}",
    "moved": f"{{kind='obstacle', year=2003, add={WALL}}},"
    "{kind='obstacle', year=2006, move='wall', by_m=[0, 0, 0.4]},"
    "{kind='obstacle', year=2008, remove='wall'}",
}


def scenario_of(name: str, *settings: str) -> Scenario:
    """Give a tiny stand with acts; a bending goes beside where the metamer is."""
    act = ACTS[name]
    if "MX" in act:
        stand = Stand(tiny(*settings))
        steps(stand, 5)
        x, y, z = stand.skeleton(1).end[stand.skeleton(1).serial == 3][0] + [0.02, 0.01, -0.005]
        act = act.replace("MX", str(x)).replace("MY", str(y)).replace("MZ", str(z))
    return tiny(f"acts=[{act}]", *settings)


@pytest.mark.parametrize("settings", [(), (BENDING,)], ids=["stiff", "bending"])
@pytest.mark.parametrize("name", ACTS)
def test_stopped_and_gone_on(name: str, settings: tuple[str, ...]) -> None:
    """Restored in any year, the stand goes on to the same bits."""
    scenario = scenario_of(name, *settings)
    whole = Stand(scenario)
    records = steps(whole, 5)
    middle = Stand.restore(scenario, *whole.state())
    records += steps(whole, 2)
    late = Stand.restore(scenario, *whole.state())
    records += steps(whole, 1)
    assert_same_years(records[5:], steps(middle, 3))
    assert_same_years(records[7:], steps(late, 1))
    assert_same_state(whole, middle)
    assert any("treatments" in record.tables for record in records)


def test_regeneration_lives_under_the_new_light() -> None:
    """A roof over all takes the seedlings' light, and is there again after a restart."""
    settings = ("regeneration={}", "years=8")
    roof = "{kind='box', name='roof', min_m=[0, 0, 4], max_m=[10, 10, 5]}"
    scenario = tiny(f"acts=[{{kind='obstacle', year=2003, add={roof}}}]", *settings)
    stand = Stand(scenario)
    steps(stand, 2)
    open_light = stand.floor_light
    steps(stand, 1)
    assert stand.floor_light < 0.2 * open_light
    again = Stand.restore(scenario, *stand.state())
    assert_same_years(steps(stand, 2), steps(again, 2))


REFUSED = {
    "unknown mark": ("{kind='fell', year=2003, marked='crip'}", "no act marks trees"),
    "no word": ("{kind='mark', year=2003, all_trees=true}", "missing key 'mark'"),
    "two ways": ("{kind='mark', year=2003, all_trees=true, tree_id=2, mark='a'}", "both given"),
    "no name": (
        "{kind='obstacle', year=2003, add={kind='box', min_m=[0,0,0], max_m=[1,1,1]}}",
        "missing key 'name'",
    ),
    "no word at all": ("{kind='mark', year=2003, all_trees=true, mark='Two words'}", "short word"),
    "below the ground": (
        "{kind='obstacle', year=2003, add={kind='box', name='w', min_m=[0,0,-2], max_m=[1,1,-1]}}",
        "add.max_m: lies below the ground",
    ),
    "unknown wall": ("{kind='obstacle', year=2003, remove='wal'}", "no obstacle 'wal'"),
    "no distance": ("{kind='obstacle', year=2003, move='wall'}", "by_m"),
    "nothing": ("{kind='obstacle', year=2003}", "nothing to do"),
    "no place": ("{kind='bend', year=2003, tree_id=1, metamer=2}", "missing key 'to_m'"),
    "felled before": (
        "{kind='fell', year=2002, tree_ids=[1]},"
        "{kind='bend', year=2003, tree_id=1, metamer=2, to_m=[0,0,1]}",
        "tree 1 is felled by acts",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused_in_one_line(name: str, tmp_path: Path) -> None:
    acts, message = REFUSED[name]
    path = write_tiny(tmp_path)
    code, _, err = forest("check", path, "--set", f"acts=[{acts}]")
    assert code == 2
    assert message in err
    assert err.count("\n") == 1


def test_refused_in_its_year() -> None:
    wall = "{kind='box', name='wall', min_m=[0, 2, 5], max_m=[10, 2.6, 6]}"
    twice = f"{{kind='obstacle', years=[2002, 2003], add={wall}}}"
    stand = Stand(tiny(f"acts=[{twice}]"))
    steps(stand, 2)
    before = stand.state()
    with pytest.raises(ActError, match=r"acts\[0\].add.name in 2003: there is an obstacle 'wall'"):
        stand.step()
    for name, array in stand.state()[0].items():
        np.testing.assert_array_equal(array, before[0][name], name)


BOX = {"kind": "box", "name": "wall", "min_m": [3.0, 3.0, 0.0], "max_m": [5.0, 5.0, 2.0]}


def test_nothing_is_planted_in_an_obstacle() -> None:
    """One tree is refused, before anything of the year is done; a pattern leaves it out."""
    built = "obstacles=[{kind='box', min_m=[3, 3, 0], max_m=[5, 5, 2]}]"
    with pytest.raises(InputError, match=r"planting.trees\[0\]: \(4, 4\) lies in an obstacle"):
        Stand(tiny(*ALONE, built))
    rows = "planting={kind='regular', spacing_m=[1, 1]}"
    assert Stand(tiny(*ALONE, rows, built)).rows.tree_id.size == 64 - 4
    roof = "obstacles=[{kind='box', min_m=[3, 3, 1], max_m=[5, 5, 2]}]"
    assert Stand(tiny(*ALONE, roof)).rows.tree_id.size == 1
    stand = Stand(tiny(*ALONE, "planting.trees=[{x_m=1, y_m=1}]"))
    stand.obstacle(add=BOX)
    with pytest.raises(InputError, match=r"Stand.plant: \(4, 4.5\) lies in an obstacle"):
        stand.plant([1.5, 4.0], [2.0, 4.5])
    assert len(stand.plant(pattern="regular", spacing_m=[1.0, 1.0], clear_m=0.1)) == 64 - 4


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            ("planting.trees=[{x_m=1, y_m=1}, {x_m=4, y_m=4}]",),
            r"planting.trees\[1\]: \(4, 4\) lies",
        ),
        (
            ("acts=[{kind='plant', years=[2001, 2002], x_m=[2, 4], y_m=[2, 3.5]}]",),
            r"acts\[0\].x_m\[1\] in 2001: \(4, 3.5\) lies",
        ),
        (
            (
                "acts=[{kind='obstacle', year=2002, move='wall', by_m=[-2, 0, 0]}, "
                "{kind='plant', years=[2001, 2002], x_m=[2], y_m=[4]}]",
            ),
            r"acts\[1\].x_m\[0\] in 2002: \(2, 4\) lies",
        ),
        (
            ("acts=[{kind='obstacle', years=[2001, 2003], remove='wall'}]",),
            r"acts\[0\].remove in 2003: no obstacle 'wall'",
        ),
        (
            (
                "acts=[{kind='obstacle', year=2002, remove='wall'}, "
                "{kind='plant', year=2002, x_m=[4], y_m=[4]}]",
            ),
            None,
        ),
        (("acts=[{kind='plant', year=2001, pattern='regular', spacing_m=[1, 1]}]",), None),
    ],
)
def test_places_are_checked_before_anything_grows(
    changes: tuple[str, ...], said: str | None
) -> None:
    wall = "obstacles=[{kind='box', name='wall', min_m=[3, 3, 0], max_m=[5, 5, 2]}]"
    scenario = tiny(*ALONE, wall, "planting.trees=[{x_m=1, y_m=1}]", *changes)
    if said is None:
        check_places(scenario)
    else:
        with pytest.raises(InputError, match=said):
            check_places(scenario)


def test_planting_sees_the_obstacles_of_its_year() -> None:
    wall = "{kind='obstacle', year=2001, add={kind='box', name='w', min_m=[0,0,0], max_m=[2,2,2]}}"
    away = "{kind='obstacle', year=2002, remove='w'}"
    seed = "{kind='plant', year=2001, x_m=[1.5], y_m=[1.5]}"
    with pytest.raises(ActError, match=r"acts\[0\].x_m\[0\] in 2001: \(1.5, 1.5\) lies in an ob"):
        Stand(tiny(*ALONE, f"acts=[{seed}, {wall}]"))
    late = seed.replace("2001", "2002")
    stand = Stand(tiny(*ALONE, f"acts=[{wall}, {away}, {late}]"))
    steps(stand, 2)
    assert stand.rows.tree_id.size == 2


def test_too_far_is_refused_where_it_stands() -> None:
    stand = grown(years=1)
    stand.obstacle(add={**BOX, "min_m": [0, 0, 0], "max_m": [1, 1, 1]})
    before = stand.obstacles.now
    with pytest.raises(InputError, match="by_m: 'wall' would be moved too far"):
        stand.obstacle(move="wall", by_m=[1e5, 0, 0])
    huge = {**BOX, "name": "huge", "min_m": [0, 0, 0], "max_m": [9e4, 9e4, 1]}
    with pytest.raises(InputError, match=r"Stand.obstacle: add: obstacles: too large or"):
        stand.obstacle(add=huge)
    assert stand.obstacles.now == before


def test_a_live_bend_shows_and_replays() -> None:
    session = LiveSession(tiny(*ALONE, BENDING))
    for _ in range(4):
        session.step()
    metamer, end = limb(session.stand)
    to = end + np.array([0.02, 0.03, 0.04])
    session.act(kind="bend", tree_id=1, metamer=metamer, to_m=to.tolist())
    shown = session.skeleton(1)
    assert (shown.end != session.stand.skeleton(1).end).any()
    assert session.trees().pending.tolist() == ["bend"]
    session.act(kind="mark", tree_ids=[1], mark="fell")
    session.act(
        kind="obstacle", add={"kind": "box", "name": "w", "min_m": [0, 0, 0], "max_m": [1, 1, 2]}
    )
    session.step()
    session.step()
    again = Stand(Scenario.from_toml(session.scenario.to_toml()))
    assert_same_years(session.records, steps(again, 6))
