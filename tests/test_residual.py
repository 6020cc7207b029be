"""Residual trees in a stand: what they measure, what they do to others, and how they go."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from forest._threads import using_threads
from forest.cli.shared import last_shapes
from forest.errors import ActError, InputError
from forest.interop import read_simpleforest
from forest.measure.stem import stems_of_skeletons
from forest.parametric import grow, load_parameters
from forest.record.checkpoint import latest_checkpoint, write_checkpoint
from forest.record.run import open_run
from forest.residual import grow_residual
from forest.scenario import Scenario
from forest.scenario.residual import ResidualTree
from forest.simulation import simulate
from forest.stand import Stand
from forest.view.scenery import scenery_of_run
from tests.test_same_bits import ENVIRONMENTS
from tests.tiny import (
    TOML,
    assert_same_runs,
    assert_same_state,
    assert_same_years,
    forest,
    steps,
    tiny,
)

ASPEN = '{name="old", x_m=5, y_m=5, species="quaking_aspen", height_m=8, dbh_cm=30}'
OAK = '{name="edge", x_m=0.5, y_m=9, species="quaking_aspen", height_m=5, seed=4, crown_lai=2}'
TREES = f"residual_trees=[{ASPEN}, {OAK}]"
FELL = 'acts=[{kind="fell", year=2004, residual="old"}]'


def residual(**given: object) -> ResidualTree:
    """Give a table of a scenario."""
    table = {"name": "a", "x_m": 2.0, "y_m": 3.0, "species": "quaking_aspen", "height_m": 9.0}
    return ResidualTree(**{**table, **given})


@pytest.mark.parametrize("species", ["quaking_aspen", "black_tupelo", "balsam_fir"])
@pytest.mark.parametrize("height_m", [1.0, 20.0])
def test_it_has_the_size_that_was_asked_for(species: str, height_m: float) -> None:
    dbh_cm = 33.0 if height_m > 2.0 else None
    tree = grow_residual(residual(species=species, height_m=height_m, dbh_cm=dbh_cm))
    skeleton = tree.skeleton
    assert skeleton.end[:, 2].max() == pytest.approx(height_m) == tree.height_m
    assert skeleton.start[0].tolist() == [2.0, 3.0, 0.0]
    assert skeleton.species == species
    measured = 100.0 * stems_of_skeletons([skeleton], 0.0).diameter_at(1.3)[0]
    if dbh_cm:
        assert measured == pytest.approx(dbh_cm) == tree.dbh_cm
    else:
        assert np.isnan(measured)
        assert np.isnan(tree.dbh_cm)
    assert tree.leaves.area.sum() == pytest.approx(tree.leaf_area_m2)
    assert 0.0 < tree.crown_base_m < height_m
    assert tree.stem_volume_m3 > 0.0


def test_leaf_area_by_crown_or_as_given() -> None:
    """An index of 4 over the crown's projection by default; the shape stays the same."""
    four, two = (grow_residual(residual(crown_lai=lai)) for lai in (4.0, 2.0))
    assert four.leaf_area_m2 == pytest.approx(2.0 * two.leaf_area_m2)
    given = grow_residual(residual(leaf_area_m2=123.0))
    assert given.leaf_area_m2 == 123.0 == pytest.approx(given.leaves.area.sum())
    assert np.array_equal(given.skeleton.end, four.skeleton.end)
    assert not np.array_equal(given.skeleton.end, grow_residual(residual(seed=2)).skeleton.end)
    bare = grow_residual(residual(species="saguaro", leaf_area_m2=0.0))
    assert bare.leaf_area_m2 == 0.0


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"species": "saguaro", "leaf_area_m2": 5.0}, "residual_trees[0].leaf_area_m2: 'saguaro'"),
        ({"leaf_area_m2": 1e5}, "residual_trees[0].leaf_area_m2: 100000 m2 of leaves stand over"),
        ({"height_m": 1.0, "dbh_cm": 9.0}, "residual_trees[0].dbh_cm: its stem does not reach"),
        (
            {"parameters": load_parameters("quaking_aspen").with_changes(["1Branches=5000"])},
            "residual_trees[0].species: level 2 brings the tree to more than",
        ),
    ],
)
def test_what_no_tree_can_be(given: dict[str, object], says: str) -> None:
    with pytest.raises(InputError) as caught:
        tree = residual(**given)
        if "parameters" in given:
            changes = ["2Branches=5000", "Leaves=5000"]
            tree = residual(parameters=tree.parameters.with_changes(changes))  # type: ignore[union-attr]
        grow_residual(tree)
    assert str(caught.value).startswith(says)


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_felled_before_the_first_year_it_was_never_there(environment: str) -> None:
    changes = ENVIRONMENTS[environment]
    stand = Stand(tiny(*changes, TREES))
    for name in ("old", "edge"):
        stand.fell_residual(name)
    without = Stand(tiny(*changes))
    for record, other in zip(steps(stand, 4), steps(without, 4), strict=True):
        for table in ("trees", "stand", "rings", "carbon"):
            for name, column in record.tables[table].items():
                np.testing.assert_array_equal(column, other.tables[table][name])
    assert not len(stand.residual)


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_it_holds_others_back(environment: str) -> None:
    changes = [*ENVIRONMENTS[environment], "planting.density_ha=6000"]
    heights = []
    low = '{name="tupelo", x_m=5, y_m=5, species="black_tupelo", height_m=4, crown_lai=6}'
    for more in ([], [f"residual_trees=[{low}]"]):
        stand = Stand(tiny(*changes, *more))
        stand.step()
        floor = stand.floor_light
        steps(stand, 5)
        trees = stand.trees
        near = np.hypot(trees.x_m - 5.0, trees.y_m - 5.0) < 2.0
        heights.append((trees.metamers[near].sum(), floor))
    (alone, bright), (below, dark) = heights
    assert below < 0.9 * alone
    assert not dark >= bright  # without a far field both are NaN


def test_the_table_tells_when_it_was_felled(tmp_path: Path) -> None:
    with simulate(tiny(TREES, FELL), tmp_path / "run.h5") as run:
        rows = run.residual
        stand, acts = run.stand, run.treatments
    old, edge = rows[rows.name == "old"], rows[rows.name == "edge"]
    assert old.year.tolist() == [2001, 2002, 2003, 2004]
    assert old.status.tolist() == ["standing"] * 3 + ["felled"]
    assert edge.year.tolist() == list(range(2001, 2009))
    assert (edge.status == "standing").all()
    assert (old.height_m == 8).all()
    assert old.dbh_cm.to_numpy() == pytest.approx(30.0)
    assert old.residual_id.unique().tolist() == [1]
    assert (rows.species == "quaking_aspen").all()
    whole = stand[stand.species == "all"].set_index("year")
    assert whole.floor_light[2004] > whole.floor_light[2003] + 0.05
    assert whole.removed_ha.sum() == 0.0  # the stand is that of the simulated trees
    assert acts.kind.unique().tolist() == ["fell"]


def test_it_stands_in_python_until_it_is_felled() -> None:
    stand = Stand(tiny(TREES))
    assert [tree.name for tree in stand.residual] == ["old", "edge"]
    assert stand.residual.table.set_index("name").height_m.to_dict() == {"old": 8.0, "edge": 5.0}
    assert stand.residual.skeleton("old").end[:, 2].max() == pytest.approx(8.0)
    stand.fell_residual("old")
    assert stand.residual.table.name.tolist() == ["edge"]
    for call in (stand.fell_residual, stand.residual.skeleton):
        with pytest.raises(InputError, match="'old' was felled before the growth of 2001"):
            call("old")
        with pytest.raises(InputError, match="no residual tree 'edgy', did you mean 'edge'"):
            call("edgy")
    with pytest.raises(InputError, match="the scenario has no residual_trees"):
        Stand(tiny()).fell_residual("old")
    assert stand.step().tables["residual"]["status"].tolist() == [1, 0]


def test_its_shape_is_grown_where_it_is_asked_for() -> None:
    """A stand keeps measures; the shape grown again is that of the tree that shades."""
    stand = Stand(tiny(TREES))
    for number, wanted in enumerate(stand.scenario.residual_trees, start=1):
        alone = grow_residual(wanted, number)
        kept = stand.residual.trees[number - 1]
        assert kept == alone.measures()
        assert not hasattr(kept, "leaves")
        again = stand.residual.skeleton(wanted.name)
        assert again.tree_id == -number
        np.testing.assert_array_equal(again.end, alone.skeleton.end)
        np.testing.assert_array_equal(again.radius, alone.skeleton.radius)


def test_a_form_is_grown_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trees of one species and seed share it, whatever their sizes; others do not."""
    import forest.residual as room

    grown = []
    monkeypatch.setattr(room, "grow", lambda p, seed: grown.append(seed) or grow(p, seed))
    row = '{{name="t{}", x_m={}, y_m=5, species="quaking_aspen", height_m={}, seed={}}}'
    seeds = [7, 8, 7]
    trees = ", ".join(row.format(k, k, 4 + k, seed) for k, seed in enumerate(seeds))
    stand = Stand(tiny(f"residual_trees=[{trees}]"))
    assert grown == [7, 8]
    assert stand.residual.table.name.tolist() == ["t0", "t1", "t2"]
    assert stand.residual.table.height_m.tolist() == [4.0, 5.0, 6.0]
    apart = stand.residual.table.crown_radius_m / stand.residual.table.height_m
    assert apart[0] == pytest.approx(apart[2], rel=1e-5)
    assert apart[0] != pytest.approx(apart[1], rel=1e-3)


def test_more_than_can_be_gathered_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("forest.residual.MOST_PARTS", 30_000)  # an aspen has 29,000 or so
    Stand(tiny("residual_trees=[" + ASPEN + "]"))
    with pytest.raises(InputError, match=r"residual_trees: the trees have more than 30,000"):
        Stand(tiny(TREES))


def test_an_act_on_what_is_gone_stops_the_run() -> None:
    stand = Stand(tiny(TREES, FELL))
    steps(stand, 2)
    stand.fell_residual("old")
    stand.step()
    with pytest.raises(ActError, match=r"acts\[0\].residual in 2004: 'old' was felled before"):
        stand.step()


def test_two_triggers_of_a_year_fell_it_once() -> None:
    act = '{kind="fell", when="age >= 2", at_most=1, residual=["old"]}'
    stand = Stand(tiny(TREES, f"acts=[{act}, {act}]"))
    steps(stand, 3)
    assert [tree.name for tree in stand.residual] == ["edge"]


def test_patterns_of_planting_keep_clear_of_it() -> None:
    stand = Stand(tiny(TREES))
    ids = stand.plant(species="fagus_sylvatica", pattern="regular", spacing_m=[0.5, 0.5], clear_m=2)
    trees = stand.trees.set_index("tree_id").loc[ids]
    assert np.hypot(trees.x_m - 5.0, trees.y_m - 5.0).min() >= 2.0


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_threads_and_checkpoints_change_nothing(tmp_path: Path, environment: str) -> None:
    scenario = tiny(TREES, FELL, *ENVIRONMENTS[environment])
    whole = Stand(scenario)
    with using_threads(1):
        before = steps(whole, 4)
        arrays, meta = whole.state()
        write_checkpoint(tmp_path / "run.h5", arrays, meta, step=4)
        after = steps(whole, 3)
    found = latest_checkpoint(tmp_path / "run.h5")
    assert found is not None
    restored, other = Stand.restore(scenario, *found), Stand(scenario)
    with using_threads(2):
        assert_same_years(after, steps(restored, 3))
        assert_same_years([*before, *after], steps(other, 7))
    assert_same_state(whole, restored)
    assert_same_state(whole, other)


def test_a_run_goes_on_where_it_was(tmp_path: Path) -> None:
    ids = "output.sample_trees={ids=[1, 4]}"
    out = tmp_path / "run.h5"
    simulate(tiny(TREES, FELL, ids, "years=5"), out).close()
    with (
        simulate(tiny(TREES, FELL, ids), tmp_path / "whole.h5") as whole,
        simulate(tiny(TREES, FELL, ids), out, resume=True) as run,
    ):
        assert_same_runs(whole, run)
    other = tiny(TREES.replace("height_m=8", "height_m=9"), FELL, ids, "years=9")
    with pytest.raises(InputError, match="made by a different scenario"):
        simulate(other, out, resume=True)


def test_without_them_nothing_is_written(tmp_path: Path) -> None:
    with simulate(tiny("years=1"), tmp_path / "run.h5") as run:
        assert "residual" not in run.tables
    stand = Stand(tiny())
    assert "residual" not in stand.memories
    assert stand.surroundings.standing is None


def test_a_file_of_ones_own_goes_into_the_run_file(tmp_path: Path) -> None:
    """The scenario is whole without the file, wherever it is read again."""
    form = load_parameters("quaking_aspen").with_changes(["1Branches=7"])
    text = (Path(__file__).parents[1] / "forest/species/forms/quaking_aspen.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace("branches = 50", "branches = 7"))
    table = '[[residual_trees]]\nname="a"\nx_m=1\ny_m=1\nspecies="mine.toml"\nheight_m=4\n'
    (tmp_path / "stand.toml").write_text(TOML + table)
    scenario = Scenario.load(tmp_path / "stand.toml")
    assert scenario.residual_trees[0].species == "mine"
    parameters = scenario.residual_trees[0].parameters
    assert parameters is not None
    assert parameters.level[1].branches == 7 == form.level[1].branches
    (tmp_path / "mine.toml").unlink()
    again = Scenario.from_toml(scenario.to_toml())
    assert again == scenario
    assert again.digest() == scenario.digest()
    assert Stand(again).residual.table.species.tolist() == ["mine"]


def test_commands(tmp_path: Path) -> None:
    path, out, to = tmp_path / "stand.toml", tmp_path / "run.h5", tmp_path / "old.csv"
    path.write_text(tiny(TREES, FELL, "years=4").to_toml())
    assert "old (quaking_aspen, 8 m), edge (quaking_aspen, 5 m)" in forest("check", path)[1]
    assert forest("run", path, "--out", out, "--no-progress")[0] == 0
    said = forest("measure", out, "--year", "2003")[1]
    assert "residual tree old (quaking_aspen, standing): 8.0 m, dbh 30.0 cm" in said
    assert "residual tree old (quaking_aspen, felled)" in forest("measure", out)[1]
    words = "export", out, "--residual", "old", "--as", "simpleforest", "--to", to
    assert forest(*words)[0] == 0
    assert read_simpleforest(to).end[:, 2].max() == pytest.approx(8.0, abs=1e-5)
    code, _, err = forest(*words[:3], "odl", *words[4:], "--force")
    assert (code, "no residual tree 'odl', did you mean 'old'?" in err) == (2, True)
    assert forest(*words, "--year", "2003", "--force")[0] == 2
    assert forest("export", out, "--table", "residual", "--to", tmp_path / "r.csv")[0] == 0
    assert len(pd.read_csv(tmp_path / "r.csv")) == 8
    with open_run(out) as run:
        _, shapes = last_shapes(out, run.scenario)
        assert [shape.species for shape in shapes[len(run.trees.query("year == 2004")) :]] == [
            "quaking_aspen"
        ]
        scenery = scenery_of_run(run, 2003, shapes=[s for s in shapes if s.tree_id > 0])
        places = scenery.instances.place[-2:, :2]
        scales = scenery.instances.scale[-2:] * scenery.heights[scenery.instances.model[-2:]]
    np.testing.assert_allclose(places, [[5.0, 5.0], [0.5, 9.0]], atol=1e-6)
    np.testing.assert_allclose(scales, [8.0, 5.0], rtol=1e-5)
