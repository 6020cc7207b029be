"""A live stand in a real browser: what is done on the page is in the session, and replays."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from forest.live import LiveSession, take_up
from forest.record.run import open_run
from forest.scenario import Scenario
from forest.simulation import simulate
from tests.tiny import assert_same_runs, forest
from tests.viewer.browser import Viewing, changed, heard, open_page, still, wait_for_text

_GROWN = 9
_LAST = 2000 + _GROWN
TOML = """
title = "three young trees"
years = 1
start_year = 2001
plot = { size_m = [4, 4], boundary = "open" }
environment = { shadow = {}, markers = { spacing_m = 0.12 } }
species = { fagus_sylvatica = {} }
planting = { kind = "explicit", trees = [
    { x_m = 2.0, y_m = 2.0 }, { x_m = 0.7, y_m = 1.4 }, { x_m = 3.3, y_m = 1.5 } ] }
output = { sample_trees = { ids = [2] } }
"""


class Kept:
    """A scenario and the file of its session."""

    def __init__(self, folder: Path) -> None:
        self.scenario, self.session = folder / "three.toml", folder / "three.session.toml"
        self.scenario.write_text(TOML)

    @property
    def now(self) -> Scenario:
        """What the session's file says."""
        return Scenario.load(self.session)

    @property
    def acts(self) -> list[dict[str, Any]]:
        """The acts in it, with the keys that they were given."""
        return [act.model_dump(exclude_none=True) for act in self.now.acts]

    def open(self) -> Viewing:
        """Start a viewer of it."""
        return Viewing(self.scenario, "--session", str(self.session), "--port", "0")


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Kept:
    """A session of some years."""
    kept = Kept(tmp_path_factory.mktemp("live"))
    session = LiveSession(Scenario.load(kept.scenario))
    for _ in range(_GROWN):
        session.step()
    session.keep_in(kept.session)
    return kept


@pytest.fixture(scope="module")
def viewing(kept: Kept) -> Iterator[Viewing]:
    """`forest view` of that session."""
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    process = kept.open()
    yield process
    process.process.kill()
    process.process.communicate()


@pytest.fixture(scope="module")
def page(browser: Any, viewing: Viewing) -> Any:
    """One page for all tests, seen from the side."""
    page = open_page(browser, viewing.address)
    page.click("#look-side")
    still(page)
    return page


def _take(page: Any, tool: str) -> None:
    page.click(f"button[title='{tool}']")
    wait_for_text(page, "#panel-work", "Session")
    still(page)


def _click(page: Any, across: float, down: float) -> None:
    """Click at shares of the picture."""
    box = page.locator("#picture").bounding_box()
    page.mouse.click(box["x"] + across * box["width"], box["y"] + down * box["height"])


def _drag(page: Any, start: tuple[float, float], *via: tuple[float, float]) -> None:
    """Drag from one place to others, by shares of the picture."""
    box = page.locator("#picture").bounding_box()
    places = [(box["x"] + a * box["width"], box["y"] + d * box["height"]) for a, d in (start, *via)]
    page.mouse.move(*places[0])
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*place, steps=4)
    page.mouse.up()


def _a_branch(page: Any) -> tuple[float, float, int, int]:
    """Click about until a branch lights up that is no whole tree: where, its tree and metamer."""
    for across in (0.5, 0.2, 0.22, 0.52, 0.24, 0.18, 0.8, 0.82):
        for down in [0.38 + 0.02 * k for k in range(14)]:
            _click(page, across, down)
            heard(page)
            if not page.locator("#prune-lit").count():
                continue
            said = re.findall(r"Tree (\d+), metamer (\d+): (\d+)", page.inner_text("#prune-lit"))
            tree, serial, metamers = (int(number) for number in said[0])
            if serial > 0 and metamers > 1:
                return across, down, tree, serial
            _click(page, 0.03, 0.2)  # the sky: nothing is lit
            heard(page)
    raise AssertionError("no branch was met")


def _step(page: Any) -> None:
    year = int(re.findall(r"\d+", page.inner_text("#next-year"))[0])
    page.click("#step")
    wait_for_text(page, "#next-year", f"next: {year + 1}")
    wait_for_text(page, "#year", str(year))


def test_a_session_is_taken_up_where_it_was(page: Any, kept: Kept) -> None:
    assert page.inner_text("#year") == str(_LAST)
    assert page.inner_text("#next-year") == f"next: {_LAST + 1}"
    assert kept.session.name in page.inner_text("#session-file")
    assert page.complaints == []


def test_a_branch_is_pruned_by_clicks(page: Any, kept: Kept) -> None:
    before = still(page)
    _take(page, "Prune")
    branches = changed(page, before)
    across, down, tree, serial = _a_branch(page)
    lit = changed(page, branches)
    _click(page, across, down)
    wait_for_text(page, "#panel-work", f"prune tree {tree} at metamer {serial}")
    pruned = changed(page, lit)
    assert pruned != branches  # what waits is shown already
    (act,) = kept.acts
    assert (act["kind"], act["year"], act["tree_id"]) == ("prune", _LAST + 1, tree)
    assert act["metamer"] == serial
    _step(page)
    now = take_up(Scenario.load(kept.scenario), kept.session).stand
    untouched = LiveSession(Scenario.load(kept.scenario))
    for _ in range(_GROWN + 1):
        untouched.step()
    assert serial not in now.skeleton(tree).serial
    assert len(now.skeleton(tree)) < len(untouched.stand.skeleton(tree))
    assert len(kept.now.acts) == 1  # taking a session up changes nothing in its file


def test_trees_are_felled_and_marked_and_acts_taken_back(page: Any, kept: Kept) -> None:
    _take(page, "Fell")
    page.fill("#fell-ids", "1 2")
    page.click("#fell-list")
    wait_for_text(page, "#panel-work", "fell trees 1, 2")
    page.click("#undo")
    wait_for_text(page, "#panel-work", "Nothing waits")
    wait_for_text(page, "#fell-said", "Would fell 1 of 3 trees")  # a light thinning from below
    page.click("#fell-to", force=True)
    page.click(".v-list-item:has-text('leave N')")
    heard(page)
    page.fill("#fell-value", "700")
    wait_for_text(page, "#fell-said", "Would fell 2 of 3 trees")
    page.click("#fell-rule-go")
    wait_for_text(page, "#panel-work", "thin from below, leave N 700/ha")
    wait_for_text(page, "#fell-said", "Would fell 0 of 1 trees")
    page.click("#undo")
    wait_for_text(page, "#panel-work", "Nothing waits")
    page.fill("#fell-ids", "1, 99")
    page.click("#fell-list")
    wait_for_text(page, "#message", "99")
    assert len(kept.acts) == 1
    _take(page, "Mark")
    for down in (0.5, 0.48, 0.52, 0.46, 0.54, 0.56, 0.44):  # the tree in the middle, by its stem
        _click(page, 0.5, down)
        heard(page)
        if "mark tree 1" in page.inner_text("#panel-work"):
            break
    wait_for_text(page, "#panel-work", "mark tree 1")
    _click(page, 0.5, down)
    wait_for_text(page, "#panel-work", "Nothing waits")
    _click(page, 0.5, down)
    wait_for_text(page, "#panel-work", "mark tree 1")
    assert kept.acts[-1]["mark"] == "crop"


def test_a_seedling_is_planted_and_a_box_put_up_by_clicks(page: Any, kept: Kept) -> None:
    page.click("#look-stand")
    still(page)
    _take(page, "Plant")
    _click(page, 0.45, 0.75)
    wait_for_text(page, "#panel-work", "plant fagus sylvatica at")
    _take(page, "Obstacle")
    page.fill("#box-width", "0.4")
    page.fill("#box-height", "0.3")
    page.keyboard.press("Tab")
    _click(page, 0.55, 0.75)
    wait_for_text(page, "#panel-work", "put up box 1")
    kinds = [act["kind"] for act in kept.acts]
    assert kinds == ["prune", "mark", "plant", "obstacle"]
    (x,), (y,) = kept.acts[2]["x_m"], kept.acts[2]["y_m"]
    assert 0.0 < x < 4.0 and 0.0 < y < 4.0
    low, high = kept.acts[3]["add"]["min_m"], kept.acts[3]["add"]["max_m"]
    assert [round(b - a, 3) for a, b in zip(low, high, strict=True)] == [0.4, 0.3, 0.3]
    _drag(page, (0.55, 0.74), (0.6, 0.74))
    wait_for_text(page, "#panel-work", "move box 1")
    assert kept.acts[4]["by_m"][0] > 0.0


def test_a_branch_is_bent_by_a_drag(page: Any, kept: Kept) -> None:
    page.click("#look-side")
    still(page)
    _take(page, "Prune")
    across, down, tree, serial = _a_branch(page)
    _take(page, "Bend")
    before = still(page)
    _drag(page, (across, down), (across + 0.01, down - 0.02), (across + 0.02, down - 0.03))
    wait_for_text(page, "#panel-work", f"bend tree {tree} at metamer {serial}")
    assert changed(page, before)
    act = kept.acts[-1]
    assert (act["kind"], act["tree_id"], act["metamer"]) == ("bend", tree, serial)
    session = take_up(Scenario.load(kept.scenario), kept.session)
    then, now = session.stand.skeleton(tree), session.skeleton(tree)
    place = list(then.serial).index(serial)
    assert abs(now.end[place] - then.end[place]).max() > 0.005


def test_a_stroke_of_the_brush_lays_markers(page: Any, kept: Kept) -> None:
    page.click("#look-side")
    _take(page, "Brush")
    before = still(page)
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.3 * box["height"])
    page.fill("#brush-radius", "0.2")
    page.keyboard.press("Tab")
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.35 * box["height"])
    page.mouse.wheel(0, -100)
    page.wait_for_function("document.querySelector('#brush-radius').value === '0.224'")
    _drag(page, (0.5, 0.65), (0.5, 0.5), (0.55, 0.4))
    wait_for_text(page, "#panel-work", "stroke of")
    assert changed(page, before)
    act = kept.acts[-1]
    assert act["kind"] == "stroke" and act["radius_m"] == (0.224,)
    assert len(act["points_m"]) > 2 and act["points_m"][-1][2] > act["points_m"][0][2] > -0.1
    session = take_up(Scenario.load(kept.scenario), kept.session)
    assert len(session.markers_to_come) > 50


def test_a_stroke_is_as_thick_as_the_pen_is_pressed(page: Any, kept: Kept) -> None:
    box = page.locator("#picture").bounding_box()
    x, y = box["x"] + 0.3 * box["width"], box["y"] + 0.6 * box["height"]
    page.mouse.move(x, y)
    before = len(kept.acts)
    pen = page.context.new_cdp_session(page)

    def sent(kind: str, k: int, force: float) -> None:
        held = {"button": "left", "buttons": 0 if kind == "mouseReleased" else 1, "clickCount": 1}
        at = {"x": x, "y": y - 25 * k, "force": force, "pointerType": "pen"}
        pen.send("Input.dispatchMouseEvent", {"type": kind, **at, **held})

    sent("mousePressed", 0, 0.25)
    pressures = (0.25, 0.25, 0.5, 0.75, 1.0)
    for k, force in enumerate(pressures):
        sent("mouseMoved", k + 1, force)
    sent("mouseReleased", len(pressures), 0.0)
    heard(page)
    assert len(kept.acts) == before + 1
    act = kept.acts[-1]
    radius = [0.224 * force / 0.5 for force in pressures]
    assert act["radius_m"][: len(radius)] == pytest.approx(radius, abs=2e-4)
    page.click("#undo")


def test_two_pages_and_one_opened_later_show_one_session(
    browser: Any, viewing: Viewing, page: Any
) -> None:
    other = open_page(browser, viewing.address)
    waiting = "At the start of" + page.inner_text("#panel-work").split("At the start of")[1]
    assert waiting in other.inner_text("#panel-work")
    _step(other)
    wait_for_text(page, "#next-year", f"next: {_LAST + 3}")
    wait_for_text(page, "#panel-work", "Nothing waits")
    other.close()
    later = open_page(browser, viewing.address)
    assert later.inner_text("#year") == str(_LAST + 2)
    later.close()


def test_the_saved_run_equals_the_headless_run_of_the_session(
    page: Any, kept: Kept, tmp_path: Path
) -> None:
    page.click("#run")
    wait_for_text(page, "#next-year", f"{_LAST + 4}")
    page.click("#pause")
    wait_for_text(page, "#next-year", "next:")
    for name, why in (("a" * 300 + ".h5", "no name"), (str(kept.session), "no run file's name")):
        page.fill("#run-file", name)
        page.click("#save-run")
        wait_for_text(page, "#message", why)
    page.fill("#run-file", "saved.h5")
    page.click("#save-run")
    wait_for_text(page, "#saved", "holds")
    code, _, err = forest("run", kept.session, "--out", tmp_path / "again.h5", "--no-progress")
    assert code == 0, err
    with (
        open_run(kept.session.parent / "saved.h5") as saved,
        open_run(tmp_path / "again.h5") as again,
    ):
        assert_same_runs(saved, again)
        kinds = set(saved.read("events")["kind"].astype(str))
        assert {"pruned", "marked", "planted", "bent"} <= kinds


def test_the_page_never_complained(page: Any) -> None:
    assert page.complaints == []
    assert page.strangers == []


def test_a_killed_server_loses_nothing(
    browser: Any, page: Any, viewing: Viewing, kept: Kept
) -> None:
    _take(page, "Fell")
    page.fill("#fell-ids", "3")
    page.click("#fell-list")
    wait_for_text(page, "#panel-work", "fell tree 3")
    years = page.inner_text("#year")
    viewing.process.send_signal(signal.SIGKILL)
    viewing.process.wait(20)
    text = kept.session.read_text()
    assert kept.acts[-1]["tree_ids"] == (3,)
    again = kept.open()
    try:
        reopened = open_page(browser, again.address)
        assert reopened.inner_text("#year") == years
        assert "fell tree 3" in reopened.inner_text("#panel-work")
        assert kept.session.read_text() == text
        reopened.close()
        code, out, err = again.stop(signal.SIGINT)
        assert code == 0 and "forest run" in out, err
    finally:
        again.process.kill()
    run = simulate(kept.now, kept.session.parent / "kept.h5")
    assert str(run.years[-1]) == years
    run.close()


def test_strange_sessions_are_refused_and_stay(kept: Kept, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text(TOML.replace("0.7", "0.8"))
    text = kept.session.read_text()
    code, out, err = forest("view", other, "--session", kept.session, "--no-browser")
    assert (code, out) == (2, "")
    assert "not a session of this scenario" in err and err.count("\n") == 1
    assert kept.session.read_text() == text
    copy = tmp_path / "copy.toml"
    copy.write_text(other.read_text())  # the same scenario, but no session
    code, _, err = forest("view", other, "--session", copy, "--no-browser")
    assert code == 2 and "is no live session" in err
    assert copy.read_text() == other.read_text()
    code, _, err = forest("view", other, "--session", other, "--no-browser")
    assert code == 2 and "itself" in err
    code, _, err = forest("view", "run.h5", "--session", other, "--no-browser")
    assert code == 2 and "--session" in err


def test_a_session_without_a_year_begins_there_again(tmp_path: Path) -> None:
    kept = Kept(tmp_path)
    session = take_up(Scenario.load(kept.scenario), kept.session)
    session.act(kind="fell", tree_ids=[1])
    again = take_up(Scenario.load(kept.scenario), kept.session)
    assert again.year == session.year and len(again.pending) == 1
    assert kept.now == session.scenario
    again.undo(0)
    assert kept.now.acts == ()
