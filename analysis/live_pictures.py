"""Pictures of a live stand for docs/viewer.md: `python analysis/live_pictures.py`.

It starts `forest view` on scenarios, works on their stands in a headless Chromium as a user does,
and saves what is seen in docs/gallery.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from viewer_pictures import ROOT, answered, shoot

_PATIENCE_MS = 240_000
_STAND = ROOT / "scenarios" / "mixed_stand.toml"
_TREE = """
title = "a young beech"
years = 1
start_year = 2001
plot = { size_m = [4, 4], boundary = "open" }
environment = { shadow = {}, markers = { spacing_m = 0.12 } }
species = { fagus_sylvatica = {} }
planting = { kind = "explicit", trees = [{ x_m = 2.0, y_m = 2.0 }] }
"""
_SKETCH = """
title = "a seedling under the brush"
years = 1
start_year = 2001
mode = "paper"
plot = { size_m = [4, 4], boundary = "open" }
environment = { markers = { everywhere = false, release = false, spacing_m = 0.12 } }
planting = { kind = "explicit", trees = [{ x_m = 2.0, y_m = 2.0 }] }
[species.generic_deciduous]
architecture = { internode_length_m = 0.1, max_metamers_per_shoot = 3 }
bud_fate = { alpha = 2.0, apical_bias = 0.52 }
shoots = { light_weight = 0.6, tropism_weight = 0.05 }
wood = { pipe_exponent = 2.3, twig_diameter_m = 0.005 }
"""


def _place(page: Any, across: float, down: float) -> tuple[float, float]:
    box = page.locator("#picture").bounding_box()
    return box["x"] + across * box["width"], box["y"] + down * box["height"]


def _grow(page: Any, years: int) -> None:
    for _ in range(years):
        said = page.inner_text("#next-year")
        page.click("#step")
        page.wait_for_function(
            "said => !document.querySelector('#step').disabled"
            " && document.querySelector('#next-year').innerText !== said",
            arg=said,
            timeout=_PATIENCE_MS,
        )


def _a_branch(page: Any, least: int, most: int) -> tuple[float, float]:
    """Click about until a branch of so many metamers lights up; give the place."""
    for down in [0.2 + 0.015 * k for k in range(40)]:
        for across in (0.42, 0.45, 0.48, 0.52, 0.55, 0.58, 0.62):
            page.mouse.click(*_place(page, across, down))
            answered(page)
            page.wait_for_timeout(100)
            if page.locator("#prune-lit").count():
                found = re.findall(r": (\d+) metamers", page.inner_text("#prune-lit"))
                if least <= int(found[0]) <= most:
                    return across, down
                page.mouse.click(*_place(page, 0.03, 0.15))
                answered(page)
    sys.exit("no branch was met")


def shape_a_tree(page: Any) -> None:
    """Prune, bend, and draw with the brush."""
    _grow(page, 15)
    page.click("#look-side")
    page.click("button[title='Prune']")
    page.wait_for_timeout(1500)
    across, down = _a_branch(page, 4, 20)
    shoot(page, "live_prune")
    page.click("button[title='Bend']")
    page.wait_for_timeout(500)
    page.mouse.move(*_place(page, across, down))
    page.mouse.down()
    page.mouse.move(*_place(page, across, down - 0.1), steps=6)
    page.wait_for_timeout(1500)
    shoot(page, "live_bend", still=True)
    page.mouse.up()


def draw_a_tree(page: Any) -> None:
    """Draw a stem and a crown, and let a seedling grow into them."""
    page.click(".v-tab:has-text('Tree')")
    page.fill("#find", "1")
    page.click("#find-button")
    page.click("#look-side")
    page.click("button[title='Brush']")
    page.fill("#brush-steps", "5")
    page.keyboard.press("Tab")
    page.wait_for_timeout(1500)
    _stroke(page, 0.12, [(0.5, 0.57), (0.48, 0.5), (0.52, 0.42), (0.5, 0.34)])
    page.fill("#brush-steps", "8")
    page.keyboard.press("Tab")
    page.wait_for_timeout(500)
    _stroke(page, 0.25, [(0.5, 0.3), (0.4, 0.2), (0.32, 0.2), (0.25, 0.3), (0.26, 0.38)])
    _stroke(page, 0.25, [(0.5, 0.3), (0.57, 0.16), (0.68, 0.14), (0.74, 0.22)])
    shoot(page, "live_stroke")
    _grow(page, 24)
    shoot(page, "live_brushed")


def _stroke(page: Any, radius_m: float, places: list[tuple[float, float]]) -> None:
    page.fill("#brush-radius", str(radius_m))
    page.keyboard.press("Tab")
    page.wait_for_timeout(700)
    page.mouse.move(*_place(page, *places[0]))
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*_place(page, *place), steps=8)
    page.mouse.up()
    page.wait_for_timeout(1500)


def work_in_a_stand(page: Any) -> None:
    """Thin by rule, fell and mark."""
    _grow(page, 20)
    page.click("button[title='Fell']")
    page.wait_for_timeout(1500)
    page.click("#fell-to", force=True)
    page.click(".v-list-item:has-text('leave N')")
    page.wait_for_timeout(1500)
    page.fill("#fell-value", "1800")
    page.keyboard.press("Tab")
    page.wait_for_timeout(500)
    page.click("#fell-rule-go")
    page.wait_for_timeout(3000)
    page.click("#look-stand")
    shoot(page, "live_stand")


def _show(scenario: Path, folder: Path, work: Any) -> None:
    from playwright.sync_api import sync_playwright

    code = "from forest.cli import main; main()"
    words = ["view", str(scenario), "--port", "0", "--no-browser"]
    view = subprocess.Popen(
        [sys.executable, "-c", code, *words], cwd=folder, stdout=subprocess.PIPE, text=True
    )
    try:
        assert view.stdout is not None
        found = re.search(r"http://\S+", view.stdout.readline())
        if found is None:
            sys.exit("the viewer did not start")
        with sync_playwright() as playwright:
            path = shutil.which("chromium") or playwright.chromium.executable_path
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 1280, "height": 780})
            page.goto(found.group())
            page.wait_for_selector("#year", timeout=_PATIENCE_MS)
            work(page)
            browser.close()
    finally:
        view.terminate()
        view.wait()


def main() -> None:
    """Take the pictures."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "beech.toml").write_text(_TREE)
        _show(folder / "beech.toml", folder, shape_a_tree)
        (folder / "sketch.toml").write_text(_SKETCH)
        _show(folder / "sketch.toml", folder, draw_a_tree)
        _show(_STAND, folder, work_in_a_stand)


if __name__ == "__main__":
    main()
