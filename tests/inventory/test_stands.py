"""Stands that start from measured trees."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from forest._threads import using_threads
from forest.errors import InputError
from forest.scenario import Scenario
from forest.simulation import simulate
from forest.stand import Stand
from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, MAIN, TERMINAL
from tests.tiny import assert_same_runs, assert_same_state, forest

PINE = "pinus_sylvestris"
BEECH = "fagus_sylvatica"
TREES = [
    {"x_m": 1.0, "y_m": 1.0, "species": PINE, "dbh_cm": 6.0, "height_m": 4.5, "age": 14},
    {"x_m": 3.0, "y_m": 1.0, "species": PINE, "dbh_cm": 3.0, "height_m": 3.5},
    {"x_m": 5.0, "y_m": 1.0, "species": PINE, "dbh_cm": 1.0, "height_m": 1.3},
    {"x_m": 1.0, "y_m": 3.0, "species": PINE, "height_m": 0.9},
    {"x_m": 3.0, "y_m": 3.0, "species": BEECH, "dbh_cm": 3.5, "height_m": 4.0, "crown_base_m": 1.0},
    {"x_m": 5.0, "y_m": 3.0, "species": PINE, "dbh_cm": 3.0, "height_m": 3.5, "age": 8},
]


def plot(trees: list[dict[str, Any]] = TREES, **changes: Any) -> Scenario:
    given: dict[str, Any] = {
        "years": 6,
        "plot": {"size_m": [6, 6], "boundary": "periodic"},
        "environment": {"shadow": {}, "canopy": {}},
        "species": {PINE: {}, BEECH: {}},
        "planting": {"kind": "inventory", "trees": trees},
        "output": {"checkpoint_every_years": 2, "sample_trees": {"ids": [1]}},
    }
    return Scenario(**(given | changes))


@pytest.fixture(scope="module")
def stand() -> Stand:
    return Stand(plot())


KINDS = {
    "mass balance": {},
    "paper": {"mode": "paper"},
    "bending": {"mechanics": {"wind_m_s": 15.0}},
    "markers": {"environment": {"markers": {"clouds": [[1.0, 1.0, 1.0]]}}},
    "rendered, in a clearing": {
        "environment": {"rendered": {"clearing_radius_m": 4.0, "clearing_height_m": 2.0}},
        "plot": {"size_m": [6, 6], "boundary": "open"},
    },
}


@pytest.mark.parametrize("changes", KINDS.values(), ids=KINDS)
def test_sizes_are_met_and_the_trees_grow(changes: dict[str, Any]) -> None:
    stand = Stand(plot([TREES[0], TREES[2], TREES[3]], **changes))
    built = stand.built
    assert built is not None
    np.testing.assert_allclose(built.built_height_m, [4.5, 1.3, 0.9], rtol=1e-5)
    np.testing.assert_allclose(built.built_dbh_cm, [6.0, 1.0, np.nan], rtol=1e-5)
    stand.step()
    after = stand.measure()
    if changes.get("mechanics"):  # a stem that bends may lose a little
        assert (after.height_m > 0.9 * built.built_height_m).all()
        assert (after.lean_deg < 15.0).all()
    else:
        assert (after.height_m >= built.built_height_m).all()
    assert (after.dbh_cm[:2] >= 0.999 * built.built_dbh_cm[:2]).all()


def test_a_built_tree_is_a_valid_tree(stand: Stand) -> None:
    arena, rows = stand.arena.metamers, stand.rows
    twig = [s.wood.twig_diameter_m**2 for s in stand.species]
    kappa = [s.carbon.branch_pipe_ratio for s in stand.species]
    for row in range(len(rows.tree_id)):
        here = slice(int(rows.start[row]), int(rows.start[row] + rows.size[row]))
        n = int(rows.size[row])
        parent, state, serial = arena.parent[here], arena.state[here], arena.serial[here]
        assert parent[0] == -1
        assert (parent[1:] >= 0).all()
        assert (parent[1:] < np.arange(1, n)).all()
        assert (np.diff(serial) > 0).all()
        assert rows.next_serial[row] > serial[-1]
        main = np.zeros(n, int)
        side = np.zeros(n, int)
        np.add.at(main, parent[1:], (state[1:] & MAIN) != 0)
        np.add.at(side, parent[1:], (state[1:] & MAIN) == 0)
        np.testing.assert_array_equal(main, (state & CONTINUED) != 0)
        np.testing.assert_array_equal(side, (state & BRANCHED) != 0)
        assert not ((state & TERMINAL != 0) & (main > 0)).any()
        assert not ((state & LATERAL != 0) & (side > 0)).any()
        tip = arena.tip[here].astype(float)
        below = np.where(parent[:, None] >= 0, tip[np.maximum(parent, 0)], 0.0)
        np.testing.assert_allclose(
            np.linalg.norm(tip - below, axis=1), arena.length[here], rtol=1e-3, atol=1e-5
        )
        np.testing.assert_allclose(np.linalg.norm(arena.bud[here], axis=1), 1.0, atol=1e-5)
        assert (arena.sapwood[here] <= arena.pipe[here]).all()
        birth = arena.birth[here]
        assert birth[0] >= rows.birth[row]
        assert (birth[1:] >= birth[parent[1:]]).all()
        assert birth.max() <= 0
        rings = arena.pipe[here] - twig[rows.species[row]]
        order = arena.order[here]
        thickest = np.zeros(n)  # a node has at least the rings of the thickest limb that it bears
        turn = np.where((order[1:] > 0) & (order[parent[1:]] == 0), kappa[rows.species[row]], 1.0)
        np.maximum.at(thickest, parent[1:], rings[1:] / np.maximum(turn, 1.0))
        assert (rings >= thickest - 1e-4).all()


def test_ages_are_handed_over(stand: Stand) -> None:
    assert stand.built is not None
    ages = -stand.rows.birth
    assert (ages[0], ages[5]) == (14, 8)
    others = [1, 2, 3, 4]
    np.testing.assert_array_equal(ages[others], stand.built.donor_age[others])


def test_trees_of_one_size_are_not_all_alike() -> None:
    places = [(1.0 + 2 * i, 1.0 + 2 * j) for i in range(3) for j in range(3)]
    same = [{"x_m": x, "y_m": y, "species": PINE, "dbh_cm": 3, "height_m": 3} for x, y in places]
    built = Stand(plot(same)).built
    assert built is not None
    assert len({*built.donor_height_m, *built.donor_dbh_cm}) > 4


def test_a_given_crown_base_is_looked_for() -> None:
    """Of trees of one dbh and height, those with a higher crown base get a higher one."""

    def crowns(base: float) -> float:
        trees = [dict(TREES[0], crown_base_m=base, x_m=1.0 + k) for k in range(4)]
        built = Stand(plot(trees)).built
        assert built is not None
        return float(np.mean(built.built_crown_base_m))

    assert crowns(2.5) > crowns(0.2) + 0.5


def test_they_are_planted_with_their_size() -> None:
    tables = Stand(plot()).step().tables
    events = tables["events"]
    np.testing.assert_allclose(events["dbh_cm"][[0, 1]], [6.0, 3.0], rtol=1e-5)
    np.testing.assert_allclose(events["height_m"], [t["height_m"] for t in TREES], rtol=1e-5)
    assert len(events["kind"]) == len(TREES)
    np.testing.assert_array_equal(tables["trees"]["age"][[0, 5]], [15, 9])


def test_same_bits_on_any_threads_and_seeds_differ() -> None:
    stands = []
    for threads in (1, 2):
        with using_threads(threads):
            stands.append(Stand(plot()))
            stands[-1].step()
    assert_same_state(*stands)
    other = Stand(plot(seed=2))
    assert not np.array_equal(other.arena.metamers.tip[:9], Stand(plot()).arena.metamers.tip[:9])


def test_resumed_without_a_nursery(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = simulate(plot(years=4), tmp_path / "whole.h5")
    simulate(plot(years=2), tmp_path / "run.h5").close()
    monkeypatch.setattr("forest.stand.settle", None)  # a nursery would be an error now
    resumed = simulate(plot(years=4), tmp_path / "run.h5", resume=True)
    assert_same_runs(whole, resumed)


def test_rings_lie_around_the_wood_that_was_there(tmp_path: Path) -> None:
    run = simulate(plot(years=3), tmp_path / "run.h5")
    bark = run.scenario.species[PINE].mensuration.bark_factor
    for tree_id in (1, 2):  # the first is a sample tree
        disc = run.disc(tree_id, 1.3)
        before = 0.005 * TREES[tree_id - 1]["dbh_cm"] * (1.0 - bark)
        assert disc.undated_radius == pytest.approx(before, rel=1e-3)
        assert list(disc.years) == list(run.years)
    assert run.disc(1, 0.3).undated_radius > before


def test_the_years_after_are_like_those_before() -> None:
    """A stand written down and built anew goes on as it would have."""
    space = {"size_m": [8, 8], "boundary": "periodic"}
    planted = plot(plot=space, planting={"kind": "random", "density_ha": 6000}, species={PINE: {}})
    true = Stand(planted)
    for _ in range(14):
        true.step()
    trees = true.trees.dropna(subset="dbh_cm")[["x_m", "y_m", "dbh_cm", "height_m"]]
    built = Stand(plot(trees.to_dict("records"), plot=space, species={PINE: {}}))
    top = set(built.rows.tree_id[np.argsort(-built.measure().height_m)[: len(trees) // 3]])
    widths = []
    for stand in (true, built):
        years = [stand.step().tables["trees"]["ring_width_mm"] for _ in range(5)]
        widths.append(np.nanmean(np.concatenate(years)))
    assert 0.5 < widths[1] / widths[0] < 2.0
    assert len(top & set(built.rows.tree_id)) >= 0.9 * len(top)
    area = [stand.measure().basal_area_m2.sum() for stand in (true, built)]
    assert area[1] == pytest.approx(area[0], rel=0.15)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"dbh_cm": 40.0}, ["trees[0]", "h/d 11", "cm for pinus_sylvestris of that height"]),
        ({"dbh_cm": 0.7}, ["trees[0]", "h/d 643", "cm for pinus_sylvestris of that height"]),
    ],
)
def test_no_such_tree(change: dict[str, float], says: list[str]) -> None:
    with pytest.raises(InputError) as refused:
        Stand(plot([TREES[0] | change, TREES[1]]))
    for part in says:
        assert part in str(refused.value)


def test_taller_than_the_nursery(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("forest.inventory.nursery._MOST_YEARS", 8)
    with pytest.raises(InputError, match=r"trees\[0\]: pinus_sylvestris of 4.5 m: the nursery's"):
        Stand(plot([TREES[0], TREES[3]]))


def test_check_tells_how_near_they_come(tmp_path: Path) -> None:
    path = tmp_path / "plot.toml"
    path.write_text(plot(TREES[:2], species={PINE: {}}).to_toml())
    code, out, err = forest("check", path)
    assert code == 0, err
    assert "2 trees built from 2 of the nursery" in " ".join(out.split())


def test_the_study_of_the_finnish_plot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from scenarios.inventory_continued import main

    main(["--out", str(tmp_path), "--years", "1"])
    heading, *rows = capsys.readouterr().out.splitlines()
    assert "start of 2000" in heading
    assert rows[0].split()[2] == "12600.0"
    assert (tmp_path / "inventory_continued.png").read_bytes().startswith(b"\x89PNG")
