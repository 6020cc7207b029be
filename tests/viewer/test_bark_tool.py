"""A click on bark that is shown becomes an act, and the bark is made anew."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from forest.errors import InputError
from forest.live import LiveSession
from forest.scenario import Scenario
from forest.surface.export import Material, Part
from forest.surface.tubes import tubes
from forest.viewer.bark_tool import CrackTool
from forest.viewer.live_source import LiveSource
from forest.viewer.picking import Hit, Ray
from forest.viewer.surfaces import _Wanted
from tests.tiny import tiny
from tests.viewer.browser import Viewing, heard, open_page, still, wait_for_text

_PINE = """
title = "a young pine"
years = 1
start_year = 2001
plot = { size_m = [4, 4], boundary = "open" }
environment = { shadow = {} }
species = { pinus_sylvestris = {} }
planting = { kind = "explicit", trees = [{ x_m = 2.0, y_m = 2.0 }] }
output = { sample_trees = { ids = [1] } }
"""


def test_a_click_on_bark_cracks_it_there() -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    from forest.viewer.app import App
    from forest.viewer.live import LivePart

    session = LiveSession(tiny("years=6", "output={sample_trees={ids=[4]}}"))
    for _ in range(6):
        session.step()
    source, part = LiveSource(session, "here"), LivePart()
    app = App(source, (part.panel,))
    tool = app.tools["crack"]
    assert isinstance(tool, CrackTool)
    shape = source.skeleton(4, source.now)
    foot = shape.start[0]
    ray = Ray(foot + np.array([0.0, 5.0, 0.05]), np.array([0.0, -1.0, 0.0]))
    app.choose(4)
    with pytest.raises(InputError, match="no bark"):
        tool.click(Hit(4, 0, None, ray))
    shown = _Wanted(4, source.now, "bark", "")
    app.surfaces._kept[shown] = [Part(tubes(shape), Material("bark_0"))]
    app.surfaces._shown = shown
    tool.click(Hit(4, 0, None, ray))
    (act,) = session.pending
    assert (act["kind"], act["tree_id"]) == ("crack", 4)
    assert act["height_m"] == pytest.approx(0.05, abs=0.01)
    assert act["azimuth_deg"] == pytest.approx(90.0, abs=10.0)
    assert source.waiting_for(4) and not source.waiting_for(3)  # its bark is another now
    with pytest.raises(InputError, match="no sample tree"):
        source.surface(3, source.now, "bark")
    with pytest.raises(InputError, match="no bark that could be seen"):
        source.surface(4, source.now, "bark")  # it is too thin yet: its rings are there


def test_a_click_on_bark_in_a_browser_is_an_act_and_the_bark_shows_it(
    browser: Any, tmp_path: Path
) -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    scenario, kept = tmp_path / "pine.toml", tmp_path / "pine.session.toml"
    scenario.write_text(_PINE)
    session = LiveSession(Scenario.load(scenario))
    for _ in range(9):
        session.step()
    session.keep_in(kept)
    whole = LiveSource(session, "here").surface(1, session.year, "bark")
    viewing = Viewing(scenario, "--session", str(kept), "--port", "0")
    try:
        page = open_page(browser, viewing.address)
        page.click(".v-tab:has-text('Tree')")
        page.fill("#find", "1")
        page.keyboard.press("Enter")
        wait_for_text(page, "#card-title", "Tree 1 ")
        page.click("#shape-bark")
        wait_for_text(page, "#shape-said", "triangles")
        page.click("#look-tree")
        page.click("button[title='Crack']")
        still(page)
        box = page.locator("#picture").bounding_box()
        down = box["y"] + 0.74 * box["height"]  # where its stem is free of branches
        for k in range(20):
            page.mouse.click(box["x"] + (0.5 + 0.004 * k) * box["width"], down)
            heard(page)
            if "crack the bark of tree 1" in page.inner_text("#panel-work"):
                break
        wait_for_text(page, "#panel-work", "crack the bark of tree 1")
        act = Scenario.load(kept).acts[0]
        assert act.kind == "crack" and act.tree_id == 1 and 0.0 <= act.height_m < 1.0
        page.click(".v-tab:has-text('Tree')")
        wait_for_text(page, "#shape-said", "triangles")
        assert page.complaints == []
        assert viewing.stop(signal.SIGINT)[0] == 0
    finally:
        viewing.process.kill()
    session.act(kind="crack", tree_id=1, height_m=act.height_m, azimuth_deg=act.azimuth_deg)
    torn = LiveSource(session, "here").surface(1, session.year, "bark")
    assert _colours(torn) != _colours(whole)


def _colours(parts: list[Part]) -> list[bytes]:
    images = [np.asarray(part.material.colour_image) for part in parts]
    return [image.tobytes() for image in images if image.size > 1]
