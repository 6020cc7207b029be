"""What stands among the trees in pictures: residual trees, snags and obstacles, year by year."""

from __future__ import annotations

import numpy as np
import pytest

from forest.live import LiveSession
from forest.record.run import Run
from forest.simulation import simulate
from forest.view import bodies_scene
from forest.view.bodies_picture import Stage
from forest.view.stand_years import StandYears, _going
from forest.view.standing import SNAG, obstacles_at
from forest.view.tree_colours import RESIDUAL, TreeColours
from forest.viewer.live_source import LiveSource
from forest.viewer.source import RunSource
from tests.tiny import tiny
from tests.view.test_tree_bodies import frame

WALL = "{kind='box', name='wall', min_m=[8, 8, 4], max_m=[9, 9, 6]}"
RULES = (
    "output.tables=['trees', 'stand', 'events', 'deadwood', 'treatments', 'residual']",
    "mortality={background=true, snags=true}",
    "species.pinus_sylvestris.mortality={background_per_year=0.2, snag_half_life_years=1.5}",
    f"acts=[{{kind='obstacle', year=2003, add={WALL}}}, "
    "{kind='obstacle', years=[2004, 2006], move='wall', by_m=[0.5, 0, 0]}, "
    "{kind='fell', year=2006, residual='oak'}]",
    "residual_trees=[{name='oak', x_m=5, y_m=9.5, species='lilac', height_m=6, dbh_cm=31, "
    "leaf_area_m2=4}]",
)
ROW = (160, 100)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return simulate(tiny(*RULES), tmp_path_factory.mktemp("standing") / "run.h5")


def test_snags_are_those_of_the_run(run: Run) -> None:
    years = StandYears(run)
    hectares = np.prod(run.scenario.plot.size_m) / 10_000.0
    whole = run.deadwood[run.deadwood["species"].astype(str) == "all"].set_index("year")
    counted = [(years.others(year)["fate"] == SNAG).sum() for year in whole.index]
    assert counted == pytest.approx((whole["snags_ha"] * hectares).tolist())
    assert sum(counted) > 0 and whole["fallen_snags_ha"].sum() > 0.0


def test_residual_trees_stand_until_they_are_felled(run: Run) -> None:
    years = StandYears(run)
    for year, there in ((2001, 1), (2005, 1), (2006, 0)):
        others = years.others(year)
        assert (others["tree_id"] < 0).sum() == there
    trees = years.at(2002.0, 2001.9)
    rgb = TreeColours.of_run(run, "species").of(trees)
    assert rgb[trees["tree_id"] < 0].tolist() == [list(RESIDUAL)]


def test_obstacles_come_and_move_in_their_years(run: Run) -> None:
    years = StandYears(run)
    left = [[o.min_m[0] for o in years.obstacles(year)] for year in (2002, 2003, 2004, 2008)]
    assert left == [[], [8.0], [8.5], [9.0]]
    planned = [obstacles_at(run.scenario, year, None) for year in range(2001, 2009)]
    assert planned == [years.obstacles(year) for year in range(2001, 2009)]


def test_the_viewer_shows_the_same(run: Run) -> None:
    source, years = RunSource(run), StandYears(run)
    session = LiveSession(run.scenario)
    live = LiveSource(session, "session.toml")
    for _ in source.years:
        session.step()
    live.refresh()
    for year in source.years:
        wanted = years.others(year)[["tree_id", "x_m", "height_m", "fate"]]
        for one in (source, live):
            found = one.others(year)[["tree_id", "x_m", "height_m", "fate"]]
            assert found.to_numpy().tolist() == wanted.to_numpy().tolist(), (one, year)
    assert source.standing_obstacles(2003)[0].name == "wall"


def test_trees_that_are_felled_come_down(run: Run) -> None:
    gone = StandYears(run).living(2004).head(3).assign(fate=["felled", "died", "windthrown"])
    half, end = _going(gone, 0.5), _going(gone, 1.0)
    height = gone["height_m"].to_numpy()
    assert (end["height_m"] < half["height_m"]).tolist() == [True, False, True]
    length = end["height_m"] / np.cos(np.radians(end["lean_deg"]))
    assert length[[0, 2]].to_numpy() == pytest.approx(height[[0, 2]], rel=1e-6)
    reach = (end["crown_radius_m"] / gone["crown_radius_m"]).to_numpy()
    assert reach == pytest.approx([1.0, 0.25, 1.0])


def test_a_picture_has_what_stands_there(run: Run) -> None:
    years = StandYears(run)
    colours = TreeColours.of_run(run, "species")
    trees = years.at(2003.0, 2003.0)
    with Stage(run.scenario.plot.size_m, 7.0, window=ROW) as stage:
        with_wall = stage.picture(trees, colours, obstacles=years.obstacles(2003)).astype(int)
        without = stage.picture(trees, colours).astype(int)
        without_oak = stage.picture(trees[trees["tree_id"] > 0], colours).astype(int)
    assert (np.abs(with_wall - without).sum(axis=2) > 30).sum() > 20
    assert (np.abs(without_oak - without).sum(axis=2) > 30).sum() > 20


def test_what_stands_under_a_crown_is_darker() -> None:
    stage = Stage((8.0, 8.0), 20.0, window=ROW)
    scene = bodies_scene.BodiesScene(stage._plotter, [], ((10, (4, 8, 5)),))
    trees = frame(3, x_m=[2.0, 2.5, 7.0], height_m=[20.0, 8.0, 8.0], crown_base_m=[8.0, 3.0, 3.0])
    scene.show(trees)
    bright = [scene._light[scene.bodies.crown & (scene.bodies.tree == k)].max() for k in range(3)]
    stage.close()
    assert bright[1] < 0.8 * bright[2]
    assert bright[0] == pytest.approx(bright[2], rel=0.15)
