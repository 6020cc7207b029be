"""A small run, a viewer of it, and a browser: made once, for all tests of the page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from forest.record.run import open_run
from forest.viewer.inside import exposed, view_from_light
from forest.viewer.source import RunSource
from tests.tiny import forest, write_tiny
from tests.viewer.browser import Viewing, find_browser


@pytest.fixture(scope="session")
def run_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of ten young trees, with its checkpoints.

    What servers will call is compiled here, where nothing waits for it.
    """
    folder = tmp_path_factory.mktemp("viewer")
    to = folder / "tiny.h5"
    code, _, err = forest("run", write_tiny(folder), "--out", to)
    assert code == 0, err
    with open_run(to) as run:
        source = RunSource(run)
        source.disc(1, 0.3, source.years[-1])
        source.surface(1, source.years[-1], "tubes")
        view_from_light(exposed(source.stand_near(source.years[-1])))
    return to


@pytest.fixture(scope="module")
def viewing(run_path: Path) -> Iterator[Viewing]:
    """`forest view` of that run."""
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    process = Viewing(run_path, "--port", "0")
    yield process
    process.process.kill()
    process.process.communicate()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A headless browser."""
    path = find_browser()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield chromium
        chromium.close()
