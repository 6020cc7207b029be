"""Charts, colours, the map and the card, without a browser."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from forest.errors import InputError
from forest.record.run import Run, open_run
from forest.viewer.charts import line_chart, share_chart, ticks, year_at
from forest.viewer.colours import CHOICES, colour_trees, fates, vigour
from forest.viewer.source import RunSource
from forest.viewer.stage import Stage


@pytest.fixture
def run(run_path: Path) -> Iterator[Run]:
    with open_run(run_path) as opened:
        yield opened


def test_ticks_are_round_and_within() -> None:
    assert ticks(0.0, 100.0) == [0.0, 25.0, 50.0, 75.0, 100.0]
    assert ticks(0.0, 0.0) == [0.0]
    assert ticks(2001, 2030, 5) == [2010.0, 2020.0, 2030.0]


def test_charts_are_whole_and_pass_over_what_is_missing() -> None:
    values = [1.0, np.nan, 3.0, 4.0]
    chart = ElementTree.fromstring(line_chart([1, 2, 3, 4], {"<a>": (values, "red")}, 3, '<"N">'))
    assert len([part for part in chart if part.tag == "polyline"]) == 2
    assert chart.get("aria-label") == '<"N">'
    shares = {"a": ([0.0, 1.0], "red"), "b": ([0.0, 3.0], "blue")}
    bands = ElementTree.fromstring(share_chart([1, 2], shares, 2, "shares"))
    assert len([part for part in bands if part.tag == "polygon"]) == 2


def test_a_click_in_a_chart_is_a_year() -> None:
    years = list(range(2001, 2031))
    assert year_at(0.0, years) == 2001
    assert year_at(1.0, years) == 2030


def test_a_run_gives_the_rows_that_are_on_file(run: Run) -> None:
    source = RunSource(run)
    year = source.years[-1]
    trees = run.read("trees", years=(year, year))
    given = source.trees(year)
    for name in given.columns:
        np.testing.assert_array_equal(given[name], trees[name])
    life = source.life(4)
    assert list(life["year"]) == list(source.years)
    assert source.with_branches(year)
    assert source.skeleton(4, year).tree_id == 4
    assert source.stand_year(2004) == 2006  # of the two that are kept
    assert source.stand_near(2004).year == 2006


def test_without_checkpoints_there_is_no_stand(run_path: Path, tmp_path: Path) -> None:
    alone = tmp_path / "alone.h5"
    alone.write_bytes(run_path.read_bytes())
    with open_run(alone) as run, pytest.raises(InputError, match="no checkpoint"):
        RunSource(run).stand_near(2008)


@pytest.mark.parametrize("by", CHOICES)
def test_every_tree_has_a_colour_and_the_legend_says_what_it_means(run: Run, by: str) -> None:
    source = RunSource(run)
    for year in (source.years[0], source.years[-1]):
        trees = source.trees(year)
        colours, legend = colour_trees(source, trees, by)
        assert colours.shape == (len(trees), 3)
        assert ((colours >= 0.0) & (colours <= 1.0)).all()
        assert legend.title
        assert bool(legend.entries) or bool(legend.gradient)


def test_vigour_is_the_ring_area_per_leaf_area(run: Run) -> None:
    trees = RunSource(run).trees(2008)
    row = int(np.nanargmax(trees["ring_width_mm"].to_numpy(float)))
    tree = trees.iloc[row]
    outer, width = 0.5 * tree["dbh_cm"], 0.1 * tree["ring_width_mm"]
    grown = np.pi * (outer**2 - (outer - width) ** 2)
    np.testing.assert_allclose(vigour(trees)[row], grown / tree["leaf_area_m2"], rtol=1e-5)


def test_fates_are_what_events_say(run: Run) -> None:
    gone = run.events[run.events["kind"].astype(str).isin(("died", "felled", "windthrown"))]
    assert set(fates(RunSource(run))) == set(gone["tree_id"])


def test_the_whole_stand_stays_in_a_picture_of_another_size() -> None:
    stage = Stage((10.0, 10.0), [])
    corners = np.array([(x, y, 0.0) for x in (0.0, 10.0) for y in (0.0, 10.0)])

    def reach() -> float:
        """Give how far from the middle corners lie, as a share of half the picture's width."""
        camera, (width, height) = stage.plotter.camera, stage.plotter.window_size
        matrix = camera.GetCompositeProjectionTransformMatrix(width / height, -1.0, 1.0)
        seen = [matrix.MultiplyPoint((*corner, 1.0)) for corner in corners]
        return max(abs(x / w) for x, _, _, w in seen)

    stage.look("stand")
    for size in ((1100, 720), (500, 700), (1600, 500)):
        stage.plotter.window_size = size
        assert reach() < 1.0
    stage.plotter.camera.position = place = (5.0, -9.0, 4.0)  # turned by a user: let be
    stage.plotter.window_size = (500, 700)
    assert stage.plotter.camera.position == place
