"""Strokes in a growing stand: filled regions, constrained branches, same bits, bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from forest.environment.marker_buds import list_buds
from forest.errors import ActError, InputError
from forest.record.checkpoint import latest_checkpoint
from forest.record.schema import ACT_KINDS
from forest.scenario import Scenario
from forest.simulation import simulate
from forest.stand import Stand
from forest.trees.metamers import LATERAL, NO_ROOM_LATERAL, NO_ROOM_TERMINAL
from tests.reference.brush import distance_beyond
from tests.tiny import assert_same_runs, assert_same_state, steps, tiny

TOML = """
years = 12
start_year = 2001
mode = "paper"
plot = { size_m = [8, 8] }
environment = { markers = { everywhere = false, spacing_m = 0.12 } }
planting = { kind = "explicit", trees = [{ x_m = 4, y_m = 4 }] }
[species.generic_deciduous]
architecture = { internode_length_m = 0.1 }
"""
INTERNODE, PERCEPTION = 0.1, 0.5
STEM = [[4.0, 4.0, 0.1], [4.1, 4.0, 0.6], [4.0, 4.0, 1.2]]


def tree(*overrides: str) -> Scenario:
    return Scenario.from_toml(TOML).with_overrides(overrides)


def sketched(*overrides: str) -> Stand:
    """Give a tree with a sketched stem."""
    stand = Stand(tree(*overrides))
    stand.stroke(STEM, 0.2, steps=3)
    steps(stand, 6)
    return stand


def test_without_markers_nothing_grows() -> None:
    stand = Stand(tree())
    steps(stand, 3)
    assert len(stand.skeleton(1)) == len(Stand(tree()).skeleton(1))
    assert stand.strokes.empty


@pytest.mark.parametrize("radius", [0.25, 0.8])
def test_a_tree_fills_its_strokes_and_stays_in_them(radius: float) -> None:
    """At least 80 % are colonised; wood lies no farther out than a bud can see and step."""
    stand = sketched()
    crown = [[4.0, 4.0, 1.4], [4.6, 4.3, 1.9], [3.8, 4.6, 2.2]]
    stand.stroke(crown, [radius, radius, 0.8 * radius])
    steps(stand, 15)
    found = stand.strokes
    assert (found.colonised > 0.8 * found.markers).all()
    assert found.laid.equals(found.markers)
    ends = stand.skeleton(1).end
    regions = [(STEM, [0.2] * 3), (crown, [radius, radius, 0.8 * radius])]
    beyond = [min(distance_beyond(p, *region, 30) for region in regions) for p in ends.tolist()]
    assert max(beyond) < INTERNODE + PERCEPTION
    assert np.percentile(beyond, 95) < INTERNODE
    assert len(ends) > 30


def test_parts_are_laid_year_by_year() -> None:
    """Part k is there in step k: the stem follows the brush."""
    stand = Stand(tree())
    assert stand.stroke([[4, 4, 0.1], [4, 4, 2.1]], 0.2, steps=4) == 1
    laid, height = [], []
    for _ in range(5):
        stand.step()
        laid.append(int(stand.strokes.laid[0]))
        height.append(float(stand.trees.height_m[0]))
    assert 0 < laid[0] < laid[1] < laid[2] < laid[3] == laid[4] == stand.strokes.markers[0]
    for k, top in enumerate(height):
        assert top < 0.1 + 0.5 * (k + 1) + 0.2 + INTERNODE


def extent(stand: Stand) -> slice:
    """The first tree's part of the arena."""
    start = int(stand.rows.start[0])
    return slice(start, start + int(stand.rows.size[0]))


def other_buds(stand: Stand, serials: np.ndarray) -> dict[str, np.ndarray]:
    """Give what a constrained stroke may not change: all fields but thickness and light."""
    arena, part = stand.arena.metamers, extent(stand)
    at = part.start + np.searchsorted(arena.serial[part], serials)
    kept = {name: field[at] for name, field in arena._asdict().items()}
    for name in ("pipe", "sapwood", "light", "resource"):
        del kept[name]
    kept["state"] = kept["state"] & (255 - int(NO_ROOM_LATERAL) - int(NO_ROOM_TERMINAL))
    return kept


@pytest.mark.parametrize("mode", ["paper", "mass_balance"])
def test_a_constrained_stroke_moves_no_other_bud(mode: str) -> None:
    shedding = "species.generic_deciduous.shedding.light_per_internode=0.6"
    stand = sketched(f"mode='{mode}'", shedding if mode == "paper" else "seed=2")
    if mode == "mass_balance":
        steps(stand, 3)
    before = stand.skeleton(1)
    may = np.flatnonzero(stand.arena.metamers.state[extent(stand)] & int(LATERAL))
    place = int(may[len(may) // 2])
    lateral = int(before.serial[place])
    old = other_buds(stand, before.serial)
    foot = before.end[place]
    heading = stand.arena.metamers.bud[extent(stand)][place]
    path = [(foot + t * heading).tolist() for t in (0.3, 0.8)]
    stand.stroke(
        path, 0.3, tree_id=1, metamer=lateral, bud="lateral", from_metamer=lateral, hold_steps=4
    )
    stand.stroke([[4.0, 4.0, 1.5]], 0.6)  # which no other bud may follow yet
    steps(stand, 5)
    after = stand.skeleton(1)
    assert set(before.serial) <= set(after.serial)  # nothing is shed
    new = other_buds(stand, before.serial)
    for name, field in old.items():
        changed = np.flatnonzero((field != new[name]).reshape(len(field), -1).any(axis=1))
        assert set(changed) <= ({place} if name == "state" else set()), name
    grown = ~np.isin(after.serial, before.serial)
    assert grown.any()
    for k in np.flatnonzero(grown):
        while grown[k]:
            k = after.parent[k]
        assert after.serial[k] == lateral
    steps(stand, 3)  # it is over: the others grow on, or are shed
    later = stand.skeleton(1)
    if mode == "paper":
        assert not set(after.serial) <= set(later.serial)
    else:
        assert later.end[:, 2].max() > after.end[:, 2].max() + INTERNODE


def test_other_trees_go_on() -> None:
    """Constraints are one tree's; two of them on a tree each let theirs grow."""
    two = "planting.trees=[{x_m=3, y_m=4}, {x_m=5, y_m=4}]"
    stand = Stand(tree(two))
    stand.stroke([[3, 4, 0.3]], 0.6)
    stand.stroke([[5, 4, 0.3]], 0.6)
    steps(stand, 3)
    old = len(stand.skeleton(1)), len(stand.skeleton(2))
    tip = int(stand.skeleton(1).serial[-1])
    foot = stand.skeleton(1).end[-1]
    stand.stroke([foot.tolist()], 0.01, tree_id=1, metamer=tip, bud="terminal", hold_steps=2)
    stand.stroke([[3, 4, 1.2]], 0.9)
    stand.stroke([[5, 4, 1.2]], 0.9)
    steps(stand, 2)
    first = stand.skeleton(1)
    new = np.flatnonzero(first.serial > stand_serial(first, old[0]))
    for k in new:
        while first.serial[k] != tip and first.parent[k] >= 0:
            k = first.parent[k]
        assert first.serial[k] == tip
    assert len(stand.skeleton(2)) > old[1] + 5


def stand_serial(skeleton, n: int) -> int:
    """The last serial of a tree that had n metamers and shed none."""
    return int(skeleton.serial[n - 1])


def test_a_stroke_begins_where_its_metamer_is_bent_to() -> None:
    """Strokes are the last acts of a year: they see the tree as it is pruned and bent."""
    grown = sketched()
    shape = grown.skeleton(1)
    k = int(np.argmax(shape.end[:, 2]))
    metamer, to = int(shape.serial[k]), shape.end[k] + [0.1, 0.1, -0.02]
    year = grown.year + 1
    bend = f"{{kind='bend', year={year}, tree_id=1, metamer={metamer}, to_m={to.tolist()}}}"
    stroke = f"kind='stroke', year={year}, radius_m=0.1, tree_id=1, from_metamer={metamer}"
    first = f"{{kind='stroke', year=2001, points_m={STEM}, radius_m=0.2, steps=3}}"
    stand = Stand(tree(f"acts=[{first}, {{{stroke}}}, {bend}]", "seed=1"))
    steps(stand, 6)
    stand.step()
    bent = Stand(tree(f"acts=[{first}, {bend}]", "seed=1"))
    steps(bent, 6)
    bent.bend(1, metamer, to)
    there = bent.skeleton(1).end[k]
    laid = stand.surroundings.markers.laid
    new = laid.point[laid.due == 7]
    assert len(new) and np.linalg.norm(new - there, axis=1).max() <= 0.1 + 1e-6
    cut = f"{{kind='prune', year={year}, tree_id=1, metamer={metamer}}}"
    stand = Stand(tree(f"acts=[{first}, {{{stroke}}}, {cut}]", "seed=1"))
    steps(stand, 6)
    with pytest.raises(ActError, match=rf"acts\[1\].from_metamer in {year}: tree 1 has no metamer"):
        stand.step()


def test_obstacles_and_ground_stay_free() -> None:
    box = "obstacles=[{kind='box', min_m=[4.2, 3, 0], max_m=[4.4, 5, 2]}]"
    stand = Stand(tree(box))
    stand.stroke([[4.0, 4.0, 0.2]], 1.0)
    laid = stand.surroundings.markers.laid.point
    inside = (laid[:, 0] > 4.2) & (laid[:, 0] < 4.4) & (np.abs(laid[:, 1] - 4) < 1)
    assert not inside.any()
    assert (laid[:, 0] > 4.4).any() and (laid[:, 2] >= 0).all()
    free = Stand(tree())
    free.stroke([[4.0, 4.0, 0.2]], 1.0)
    assert len(free.surroundings.markers.laid.point) > len(laid) + 20


@pytest.mark.parametrize("boundary", ["open", "periodic"])
def test_released_markers_are_counted_while_a_bud_is_near(boundary: str) -> None:
    stand = Stand(tree("environment.markers.release=true", f"plot.boundary={boundary}"))
    stand.stroke(STEM, 0.2)
    stand.stroke([[0.1, 0.1, 0.1]], 0.2)
    steps(stand, 2)
    buds = list_buds(stand.arena.metamers, stand.rows)
    species = stand.scenario.species_list[0]
    reach = species.shoots.occupancy_radius_internodes * species.architecture.internode_length_m
    point = stand.surroundings.markers.laid.point
    apart = np.linalg.norm(point[:, None] - buds.position[None], axis=2).min(axis=1)
    assert stand.strokes.colonised.tolist() == [int((apart <= reach).sum()), 0]
    assert 0 < stand.strokes.colonised[0] < stand.strokes.markers[0]


STROKES = (
    "{kind='stroke', year=2001, points_m=[[4,4,0.1],[4,4,1.2]], radius_m=0.2, steps=4}",
    "{kind='stroke', year=2006, points_m=[[4.3,4,1.5]], radius_m=0.7, tree_id=1, metamer=2, "
    "hold_steps=2, rotation={x_m=4, y_m=4, times=3}}",
    "{kind='stroke', years=[2007, 2008], points_m=[[4,4,1.9]], radius_m=[0.5], markers_m3=900}",
)


def acts(*more: str) -> str:
    return f"acts=[{', '.join((*STROKES, *more))}]"


@pytest.mark.usefixtures("three_threads")
def test_strokes_on_file_resumed_and_on_threads(tmp_path: Path) -> None:
    """In the middle of strokes and holds; the same by hand."""
    every = "output={checkpoint_every_years=1, sample_trees={ids=[1]}}"
    with simulate(tree(acts(), every), tmp_path / "one.h5", threads=1) as whole:
        for first in (2, 6, 8):
            out = tmp_path / f"{first}.h5"
            simulate(tree(acts(), every, f"years={first}"), out, threads=2).close()
            with simulate(tree(acts(), every), out, resume=True, threads=2) as run:
                assert_same_runs(whole, run)
        table = whole.treatments
        assert set(table.kind) == {"stroke"}
        assert sorted(set(table.year)) == [2001, 2006, 2007, 2008]
    found = latest_checkpoint(tmp_path / "one.h5")
    assert found is not None
    arrays, meta = found
    resumed = Stand.restore(tree(acts(), every), arrays, meta)
    by_hand = Stand(tree(every))
    for year in range(2001, 2013):
        if year == 2001:
            by_hand.stroke([[4, 4, 0.1], [4, 4, 1.2]], 0.2, steps=4)
        elif year == 2006:
            turns = {"x_m": 4, "y_m": 4, "times": 3}
            by_hand.stroke([[4.3, 4, 1.5]], 0.7, tree_id=1, metamer=2, hold_steps=2, rotation=turns)
        elif year in (2007, 2008):
            by_hand.stroke([[4, 4, 1.9]], [0.5], markers_m3=900)
        by_hand.step()
    assert resumed.strokes.equals(by_hand.strokes)
    assert_same_state(resumed, by_hand)


def test_kinds_have_their_order() -> None:
    """Strokes come last in a year, and have their row in the record."""
    both = "{kind='plant', year=2001, x_m=[2], y_m=[2]}"
    record = Stand(tree(acts(both))).step()
    kinds = [ACT_KINDS[k] for k in record.tables["treatments"]["kind"]]
    assert kinds == sorted(kinds) and {"plant", "stroke"} == set(kinds)


def test_symmetry_in_a_stand() -> None:
    stand = Stand(tree())
    mirror = {"x_m": 4.1, "y_m": 4.0, "normal_deg": 90}
    tiling = {"shifts_m": [[0.9, 0, 0]], "counts": [2]}
    stand.stroke([[4.2, 4.2, 0.8]], 0.4, mirror=mirror, tiling=tiling)
    points = stand.surroundings.markers.laid.point
    image = points * [1, -1, 1] + [0, 8, 0]
    assert {tuple(p) for p in points.tolist()} == {tuple(p) for p in image.tolist()}
    assert np.ptp(points[:, 0]) > 1.5


def test_a_path_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("x_m,y_m,z_m,radius_m\n4,4,0.1,0.2\n4,4,1.2,0.3\n")
    text = TOML + "[[acts]]\nkind = 'stroke'\nyear = 2001\npoints_m = 'path.csv'\n"
    scenario = Scenario.from_toml(text, folder=tmp_path)
    assert scenario.acts[0].points_m == ((4.0, 4.0, 0.1), (4.0, 4.0, 1.2))
    assert scenario.acts[0].radius_m == (0.2, 0.3)
    assert Scenario.from_toml(scenario.to_toml()) == scenario
    with pytest.raises(InputError, match=r"acts\[0\].radius_m: given beside the column radius_m"):
        Scenario.from_toml(text + "radius_m = 1\n", folder=tmp_path)
    (tmp_path / "path.csv").write_text("x_m,y_m,z_m,radius_m\n4,4,0.1,-1\n")
    with pytest.raises(InputError, match=r"points_m: 'path.csv' line 2, column 'radius_m'"):
        Scenario.from_toml(text, folder=tmp_path)
    (tmp_path / "path.csv").write_text("x_m,y_m\n4,4\n")
    with pytest.raises(InputError, match="has no column 'z_m'"):
        Scenario.from_toml(text, folder=tmp_path)


BASE = "kind='stroke', year=2001"


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ("radius_m=1", "points_m: no point"),
        ("points_m=[[4,4,1]]", "radius_m: missing key"),
        ("points_m=[[4,4]], radius_m=1", "points_m"),
        ("points_m=[[4,4,1]], radius_m=0", "radius_m"),
        ("points_m=[[4,4,1]], radius_m=[1,2]", "radius_m: 2 for 1 points"),
        ("points_m=[[4,4,1]], radius_m=1, step=2", "did you mean 'steps'?"),
        ("points_m=[[4,4,1]], radius_m=1, steps=2", "steps: 2 for one point"),
        ("points_m=[[4,4,1]], radius_m=1, metamer=2", "missing key 'tree_id'"),
        ("points_m=[[4,4,1]], radius_m=1, tree_id=1", "tree_id: given alone"),
        ("points_m=[[4,4,1]], radius_m=1, bud='lateral'", "bud: given without metamer"),
        ("points_m=[[4,4,1]], radius_m=1, hold_steps=2", "hold_steps: given without metamer"),
        ("points_m=[[4,4,1]], radius_m=1, spacing_m=1, markers_m3=1", "markers_m3: given beside"),
        ("points_m=[[4,4,1]], radius_m=1, rotation={x_m=1, y_m=1, times=1}", "rotation.times: 1"),
        ("points_m=[[4,4,1]], radius_m=1, mirror={x_m=1}", "mirror.y_m: missing key"),
        (
            "points_m=[[4,4,1]], radius_m=1, tiling={shifts_m=[[1,0,0]], counts=[1,2]}",
            "tiling.counts: 2 for 1 shifts_m",
        ),
        ("points_m=[[900,4,1]], radius_m=1", "points_m: reaches to (900, 4)"),
        ("points_m=[[4,4,-3]], radius_m=1", "points_m: lies below the ground"),
        ("points_m=[[4,4,1]], radius_m=1, mirror={x_m=900, y_m=4}", "mirror: reaches to (1796, 4)"),
        (
            "points_m=[[4,4,1]], radius_m=1, rotation={x_m=900, y_m=4, times=2}",
            "rotation: reaches to (1796, 4)",
        ),
        (
            "points_m=[[4,4,1]], radius_m=1, tiling={shifts_m=[[9,0,0]], counts=[20]}",
            "tiling: reaches to (175, 4)",
        ),
        (
            f"points_m=[{', '.join(200 * ['[-9e4,0,1], [9e4,0,1]'])}], radius_m=0.001",
            "radius_m: up to 1.88e+09 markers",
        ),
        ("points_m=[[4,4,1]], radius_m=90", "radius_m: up to 1.77e+09 markers"),
        (
            "points_m=[[4,4,1]], radius_m=1, tiling={shifts_m=[[1,0,0],[0,1,0]], "
            "counts=[9999, 9999]}",
            "tiling: 99,980,001 copies",
        ),
        ("points_m='none.csv', radius_m=1", "points_m: no such file"),
    ],
)
def test_bad_strokes_are_refused_before_the_run(keys: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        tree(f"acts=[{{{BASE}, {keys}}}]")
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_strokes_need_markers() -> None:
    act = f"acts=[{{{BASE}, points_m=[[4,4,1]], radius_m=1}}]"
    with pytest.raises(InputError, match=r"acts\[0\]: no bud perceives markers; expected a table"):
        tiny(act)
    with pytest.raises(InputError, match="no bud perceives markers"):
        Stand(tiny()).stroke([[4, 4, 1]], 1)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"tree_id": 9, "metamer": 0}, "tree_id: no living tree has the id 9"),
        ({"tree_id": 1, "metamer": 900}, "metamer: tree 1 has no metamer 900"),
        ({"tree_id": 1, "from_metamer": 900}, "from_metamer: tree 1 has no metamer 900"),
        ({"radius_m": "a"}, "radius_m: 'a' is not allowed"),
        ({"radus": 1}, "did you mean 'radius_m'?"),
    ],
)
def test_bad_strokes_by_hand(keys: dict, says: str) -> None:
    stand = Stand(tree())
    with pytest.raises(InputError) as caught:
        stand.stroke([[4, 4, 1]], **{"radius_m": 0.5, **keys})
    assert "Stand.stroke: " in str(caught.value) and says in str(caught.value)
    assert stand.strokes.empty


def test_a_bud_that_is_not_there() -> None:
    stand = sketched()
    tip = stand.skeleton(1)
    inner = int(tip.serial[0])
    stand.prune(1, int(tip.serial[1]))
    with pytest.raises(InputError, match=f"bud: metamer {inner} has no terminal bud"):
        stand.stroke([[4, 4, 1]], 0.5, tree_id=1, metamer=inner, bud="terminal")


def test_a_tree_that_is_gone() -> None:
    """Felled by an earlier act: refused before the run; dead: it stops, the years are kept."""
    felled = "{kind='fell', year=2007, tree_ids=[1]}"
    late = STROKES[1].replace("2006", "2008")
    with pytest.raises(InputError, match=r"tree 1 is felled by acts\[0\] in 2007"):
        tree(f"acts=[{felled}, {late}]")
    stand = Stand(tree(f"acts=[{late}]"))
    steps(stand, 6)
    stand.fell([1])
    steps(stand, 1)
    with pytest.raises(ActError, match=r"acts\[0\].tree_id in 2008: no living tree has the id 1"):
        stand.step()
    assert stand.year == 2007
