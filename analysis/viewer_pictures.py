"""Pictures of `forest view` for its page: `python analysis/viewer_pictures.py RUN.h5 TREE`.

TREE is a sample tree, thick enough for bark. The viewer is started as a user does, its page opened
in a headless Chromium, and what is seen saved in docs/gallery.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
GALLERY = ROOT / "docs" / "gallery"
_PATIENCE_MS = 240_000


def answered(page: Any) -> None:
    """Wait until the viewer has done what the page has sent."""
    page.evaluate("window.trame.trigger('key', [''])")  # a key of no meaning, answered in turn


def shoot(page: Any, name: str, *, still: bool = False) -> None:
    """Save the page as a picture of the gallery, in few colours; `still` leaves the pointer."""
    from io import BytesIO

    from PIL import Image

    if not still:
        page.mouse.move(4, 4)
    for wait_ms in (500, 3500):  # what is drawn soon, and its picture
        answered(page)
        page.wait_for_timeout(wait_ms)
    image = Image.open(BytesIO(page.screenshot())).convert("RGB")
    image.quantize(256, kmeans=1, dither=Image.Dither.NONE).save(
        GALLERY / f"{name}.png", optimize=True
    )


def tour(page: Any, tree: str) -> None:
    """Go through the views."""
    page.wait_for_selector("#year", timeout=_PATIENCE_MS)
    shoot(page, "viewer_stand")
    page.click(".v-tab:has-text('Map')")
    page.wait_for_selector("#plan svg")
    page.click("#look-side")
    page.click("#colour-by", force=True)
    page.click(".v-list-item:has-text('Diameter')")
    shoot(page, "viewer_map")
    stems = page.locator("#plan g circle")
    stem = stems.nth(stems.count() - 1).bounding_box()
    page.mouse.click(stem["x"] + stem["width"] / 2, stem["y"] + stem["height"] / 2)
    page.click(".v-tab:has-text('Tree')")
    page.wait_for_selector("#card-title", timeout=_PATIENCE_MS)
    page.click("#look-tree")
    page.click("#cut")
    page.wait_for_selector("#disc", timeout=_PATIENCE_MS)
    page.locator("#disc").scroll_into_view_if_needed()
    shoot(page, "viewer_tree")
    page.fill("#find", tree)
    page.click("#find-button")
    page.wait_for_function(
        "id => document.querySelector('#card-title').innerText.includes('Tree ' + id)", arg=tree
    )
    page.click("#shape-bark")
    page.wait_for_function(
        "document.querySelector('#shape-said').innerText.includes('triangles')",
        timeout=_PATIENCE_MS,
    )
    page.click("#alone")
    page.click("#look-tree")
    box = page.locator("#picture").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y + 200)
    page.mouse.down(button="middle")
    page.mouse.move(x, y, steps=5)
    page.mouse.move(x, y - 60, steps=5)
    page.mouse.up(button="middle")
    for _ in range(14):
        page.mouse.wheel(0, -240)
        page.wait_for_timeout(300)
    shoot(page, "viewer_bark")
    page.click("#alone")
    page.click("#year")
    page.keyboard.press("Escape")
    page.click(".v-tab:has-text('Light')")
    page.click("#look-stand")
    page.click("#inside-slice")
    page.wait_for_selector("#inside-off", timeout=_PATIENCE_MS)
    shoot(page, "viewer_slice")
    page.click("#inside-sun")
    page.wait_for_selector("#light-view", timeout=_PATIENCE_MS)
    page.locator("#light-view").click()
    page.evaluate("document.querySelector('.v-navigation-drawer__content').scrollTop = 0")
    shoot(page, "viewer_light")


def main(arguments: Sequence[str]) -> None:
    """Take the pictures of a run."""
    from playwright.sync_api import sync_playwright

    if len(arguments) != 2:
        sys.exit("usage: python analysis/viewer_pictures.py RUN.h5 TREE")
    code = "from forest.cli import main; main()"
    view = subprocess.Popen(
        [sys.executable, "-c", code, "view", arguments[0], "--port", "0", "--no-browser"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
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
            tour(page, arguments[1])
            browser.close()
    finally:
        view.terminate()
        view.wait()


if __name__ == "__main__":
    main(sys.argv[1:])
