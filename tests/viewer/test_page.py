"""The page in a real browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from forest.record.run import open_run
from forest.viewer.colours import colour_trees
from forest.viewer.source import RunSource
from forest.viewer.stage import Stage
from tests.viewer.browser import Viewing, changed, open_page, still, wait_for_text

_SAMPLE, _PLAIN = 4, 2  # a sample tree, and one that is none


@pytest.fixture(scope="module")
def page(browser: Any, viewing: Viewing) -> Any:
    """One page for the tests that can share it."""
    return open_page(browser, viewing.address)


def _to_year(page: Any, year: int) -> None:
    """Move the slider by its keys, a year at a time."""
    while (shown := int(page.inner_text("#year"))) != year:
        page.locator(".v-slider-thumb").focus()
        page.keyboard.press("ArrowRight" if shown < year else "ArrowLeft")
        wait_for_text(page, "#year", str(shown + (1 if shown < year else -1)))


def _places(page: Any, run_path: Path, sized: Any = None) -> dict[int, tuple[float, float]]:
    """Find where trees are seen in the last year, as pixels of the page: by the same stage.

    `sized` is the page whose size the picture has; it is shown whole in the middle of others.
    """
    with open_run(run_path) as run:
        source = RunSource(run)
        trees = source.trees(source.years[-1])
        stage = Stage(run.scenario.plot.size_m, ["pinus_sylvestris"])
    stage.show_trees(trees, colour_trees(source, trees, "species")[0])
    stage.look("stand")
    box = page.locator("#picture").bounding_box()
    own = (sized or page).locator("#picture").bounding_box()
    wide, high = int(own["width"]), int(own["height"])
    stage.plotter.window_size = [wide, high]
    scale = min(box["width"] / wide, box["height"] / high)
    left = box["x"] + 0.5 * (box["width"] - scale * wide)
    top = box["y"] + 0.5 * (box["height"] - scale * high)
    found: dict[int, tuple[float, float]] = {}
    for down in np.arange(0.04, 1.0, 0.04):
        for across in np.arange(0.04, 1.0, 0.04):
            tree = stage.hit(across, down).tree_id
            if tree is not None:
                found[tree] = (left + across * scale * wide, top + down * scale * high)
    return found


def test_it_loads_without_complaints_and_asks_no_one_else(page: Any) -> None:
    assert page.inner_text("#year") == "2008"
    assert "Pinus sylvestris" in page.inner_text("#legend")
    assert page.complaints == []
    assert page.strangers == []


def test_each_button_without_a_word_says_what_it_does(page: Any) -> None:
    around = "node => (node.closest('[title]') || node).title"
    assert page.locator("#look-tree").is_disabled()
    assert page.locator("#look-tree").evaluate(around) == "Choose a tree first"
    for name in ("branches", "look-stand", "look-side", "look-above", "play"):
        assert len(page.locator(f"#{name}").evaluate(around)) > 5


def test_the_slider_changes_year_and_picture(page: Any) -> None:
    before = still(page)
    _to_year(page, 2003)
    assert changed(page, before) != before
    assert "In 2003" in page.inner_text("#stand-html")
    _to_year(page, 2008)


def test_a_click_chooses_a_tree_and_its_card_says_what_is_on_file(
    page: Any, run_path: Path
) -> None:
    before = still(page)
    places = _places(page, run_path)
    assert len(places) >= 5
    tree, place = max(places.items())
    page.mouse.click(*place)
    wait_for_text(page, "#card-title", f"Tree {tree} ")
    assert changed(page, before)
    with open_run(run_path) as run:
        trees = run.read("trees", years=(2008, 2008))
    row = trees[trees["tree_id"] == tree].iloc[0]
    said = page.inner_text("#card td[data-column=dbh_cm]")
    assert said == f"{row['dbh_cm']:.1f} cm"
    assert page.inner_text("#card td[data-column=height_m]") == f"{row['height_m']:.1f} m"


def test_clicks_choose_the_right_tree_in_pages_of_different_sizes(
    browser: Any, viewing: Viewing, page: Any, run_path: Path
) -> None:
    page.click("#look-stand")
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + 5, box["y"] + 5)
    other = open_page(browser, viewing.address, width=760, height=900)
    still(page)

    def choose(where: Any, sized: Any, which: int) -> None:
        tree, place = sorted(_places(where, run_path, sized).items())[which]
        where.mouse.click(*place)
        for each in (page, other):
            wait_for_text(each, "#card-title", f"Tree {tree} ")

    choose(page, other, 0)  # the pointer was there before: the picture keeps the other's size
    choose(other, other, 1)
    page.mouse.move(4, 4)
    page.mouse.move(box["x"] + 5, box["y"] + 5)  # it comes again: the picture fits this page
    still(page)
    choose(page, page, 2)
    assert other.complaints == []
    other.close()


def test_a_tree_is_found_by_its_number_and_cut(page: Any) -> None:
    page.click(".v-tab:has-text('Tree')")
    page.fill("#find", "4")
    page.click("#find-button")
    wait_for_text(page, "#card-title", "Tree 4 ")
    page.fill("#disc-height", "0.3")
    page.click("#cut")
    page.wait_for_selector("#disc", timeout=60_000)
    page.fill("#find", "4000")
    page.click("#find-button")
    wait_for_text(page, "#message", "no tree 4000")


def test_colours_and_branches_change_the_picture(page: Any) -> None:
    first = still(page)
    page.click("#branches")
    second = changed(page, first)
    page.click("#branches")
    third = changed(page, second)
    page.click("#colour-by", force=True)
    page.click(".v-list-item:has-text('Height')")
    wait_for_text(page, "#legend", "Height")
    assert changed(page, third)


def test_the_map_chooses_trees_too(page: Any) -> None:
    page.click("#year")  # out of the list of colours
    page.keyboard.press("Escape")
    page.click(".v-tab:has-text('Map')")
    page.wait_for_selector("#plan svg")
    page.wait_for_function("!document.querySelector('#plan circle[stroke]')")
    stem = page.locator("#plan g circle").last.bounding_box()
    page.mouse.click(stem["x"] + stem["width"] / 2, stem["y"] + stem["height"] / 2)
    page.wait_for_selector("#plan circle[stroke]", timeout=60_000)


def test_light_is_sliced_from_the_nearest_checkpoint(page: Any) -> None:
    page.click(".v-tab:has-text('Light')")
    wait_for_text(page, "#panel-light", "as it stood in 20")
    before = still(page)
    page.click("#inside-slice")
    page.wait_for_selector("#inside-off", timeout=180_000)
    changed(page, before)
    page.click("#inside-sun")
    page.wait_for_selector("#light-view", timeout=60_000)
    page.click("#light-view")
    page.wait_for_selector("#light-pixels")
    first = page.get_attribute("#light-view", "src")
    page.click("#light-by", force=True)
    page.click(".v-list-item:has-text('Species')")
    page.wait_for_function(
        "old => document.querySelector('#light-view')?.src != old", arg=first, timeout=60_000
    )
    page.click("#inside-off")
    page.click(".v-tab:has-text('Stand')")


def test_years_play_and_stop_at_the_last(page: Any) -> None:
    _to_year(page, 2006)
    page.click("#play")
    wait_for_text(page, "#year", "2008")
    page.wait_for_selector("#play .mdi-play", timeout=60_000)


def test_a_second_page_and_one_opened_later_show_the_same(
    browser: Any, viewing: Viewing, page: Any
) -> None:
    _to_year(page, 2005)
    other = open_page(browser, viewing.address)
    assert other.inner_text("#year") == "2005"
    other.keyboard.press("ArrowLeft")
    wait_for_text(page, "#year", "2004")
    other.close()
    _to_year(page, 2006)
    later = open_page(browser, viewing.address)
    assert later.inner_text("#year") == "2006"
    assert later.complaints == []
    later.close()


def test_the_card_shows_surfaces_and_says_why_not(viewing: Viewing, browser: Any) -> None:
    page = open_page(browser, viewing.address)
    page.click(".v-tab:has-text('Tree')")
    page.fill("#find", str(_SAMPLE))
    page.click("#find-button")
    wait_for_text(page, "#card-title", f"Tree {_SAMPLE} ")
    page.click("#look-tree")
    branches = still(page)
    page.click("#shape-tubes")
    wait_for_text(page, "#shape-said", "triangles")
    surface = changed(page, branches)
    page.click("#shape-body")
    changed(page, surface)
    page.click("#shape-bark")
    wait_for_text(page, "#shape-said", "no bark that could be seen")
    page.wait_for_timeout(500)
    assert "no bark that could be seen" in page.inner_text("#shape-said")  # and it stays
    page.fill("#find", str(_PLAIN))
    page.click("#find-button")
    wait_for_text(page, "#shape-said", "not on record")
    assert page.locator("#shape-bark").is_disabled()
    assert page.complaints == []
    page.close()


def test_the_page_never_complained(page: Any) -> None:
    assert page.complaints == []
    assert page.strangers == []
