"""What it costs to show a hectare: opening it, a year, a frame, and frames in a browser.

`python -m tests.benchmarks.viewer RUN.h5` measures a run that is there.
"""

from __future__ import annotations

import resource
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

from tests.benchmarks import machine

ROOT = Path(__file__).parents[2]
_TURNS = 40
_DRAG_S = 4.0
_RATIO, _QUALITY = 0.6, 55  # of pictures while the view turns, as in `forest.viewer.page`


def measure_viewer(years: int) -> dict[str, Any]:
    """Grow the hectare for some years and show it; see `measure_run`."""
    import forest

    scenario = forest.Scenario.load(ROOT / "scenarios" / "hectare.toml")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hectare.h5"
        forest.simulate(scenario.with_overrides([f"years={years}"]), out=path).close()
        return machine.alone(measure_run, path)


def measure_run(path: Path) -> dict[str, Any]:
    """Show a run.

    Returns
    -------
    dict
        Trees shown; seconds to make the app; seconds of a year and its picture; seconds of a frame
        while the view turns, JPEG included, all of the wall clock and of the processors; frames
        per second that a browser gets during a drag, NaN without one; peak memory, MB.
    """
    from forest.record.run import open_run
    from forest.viewer.app import App
    from forest.viewer.source import RunSource

    found: dict[str, Any] = {}
    with open_run(path) as run:
        with _timed(found, "open"):
            app = App(RunSource(run))
            app.stage.window.Render()
        app.state.step = len(app.source.years) - 2
        with _timed(found, "year"):
            app.show_year()
            app.stage.window.Render()
        with _timed(found, "frame", _TURNS):
            _turn(app.stage)
        found["trees"] = len(app.trees)
    found["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    found["browser_fps"] = frames_in_browser(path)
    return found


@contextmanager
def _timed(found: dict[str, Any], what: str, times: int = 1) -> Iterator[None]:
    start, busy = time.perf_counter(), time.process_time()
    yield
    found[f"{what}_s"] = (time.perf_counter() - start) / times
    found[f"{what}_cpu_s"] = (time.process_time() - busy) / times


def _turn(stage: Any) -> None:
    from PIL import Image

    width, height = stage.plotter.window_size
    stage.plotter.window_size = [int(_RATIO * width), int(_RATIO * height)]
    stage.window.SetMultiSamples(0)
    for _ in range(_TURNS):
        stage.plotter.camera.Azimuth(3.0)
        stage.plotter.renderer.ResetCameraClippingRange()
        stage.window.Render()  # a screenshot alone would give the first picture again
        seen = stage.plotter.screenshot(return_img=True)
        Image.fromarray(seen).save(BytesIO(), "JPEG", quality=_QUALITY)


def frames_in_browser(run: Path) -> float:
    """Count the pictures that a headless browser gets per second while the view is dragged."""
    path = shutil.which("chromium") or shutil.which("google-chrome")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        return float("nan")
    if path is None:
        return float("nan")
    from tests.viewer.browser import Viewing, open_page

    viewing = Viewing(run, "--port", "0")
    got: list[float] = []

    def received(frame: Any) -> None:
        if len(frame) > 5_000:  # pictures; the rest is state
            got.append(time.perf_counter())

    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
            page = open_page(browser, viewing.address)
            page.on("websocket", lambda socket: socket.on("framereceived", received))
            page.reload()
            page.wait_for_selector("#year")
            page.wait_for_timeout(3000)
            box = page.locator("#picture").bounding_box()
            x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            page.mouse.move(x, y)
            page.mouse.down()
            got.clear()
            start = time.perf_counter()
            while time.perf_counter() - start < _DRAG_S:
                x += 2.0
                page.mouse.move(x, y)
            page.mouse.up()
            count = sum(at - start < _DRAG_S for at in got)
            browser.close()
    finally:
        viewing.process.kill()
        viewing.process.communicate()
    return count / _DRAG_S


if __name__ == "__main__":
    print(measure_run(Path(sys.argv[1])))
