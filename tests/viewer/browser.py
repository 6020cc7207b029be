"""A viewer that runs as a user starts it, and a real browser before it."""

from __future__ import annotations

import re
import select
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_PATIENCE_S = 400.0  # what ends a test that hangs; kernels may have to be compiled before


class Viewing:
    """`forest view` as a process of its own."""

    def __init__(self, file: Path, *words: str) -> None:
        code = "from forest.cli import main; main()"
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, "view", str(file), "--no-browser", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.address = self._address()

    def _address(self) -> str:
        assert self.process.stdout is not None
        ready, _, _ = select.select([self.process.stdout], [], [], _PATIENCE_S)
        line = self.process.stdout.readline() if ready else ""
        found = re.search(r"http://\S+", line)
        if not found:
            self.process.kill()
            raise AssertionError(f"it did not start: {line} {self.process.communicate()}")
        return found.group()

    @property
    def port(self) -> int:
        """The port of its address."""
        return int(self.address.rsplit(":", 1)[1].strip("/"))

    def stop(self, number: int) -> tuple[int, str, str]:
        """Send a signal: exit code, standard output, standard error."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=20)
        return self.process.returncode, out, err


def find_browser() -> str:
    """Give a browser's path; skip where none is installed."""
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed (extra dev)")
    for name in _BROWSERS:
        path = shutil.which(name)
        if path:
            return path
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        path = playwright.chromium.executable_path
    if not Path(path).exists():
        pytest.skip("no Chromium is installed: playwright install chromium")
    return path


def open_page(browser: Any, address: str, *, width: int = 1200, height: int = 760) -> Any:
    """Open the viewer's page, and collect what it complains of and what it asks others for."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.complaints = []
    page.strangers = []

    def heard(message: Any) -> None:
        if message.type in ("error", "warning"):
            page.complaints.append(message.text)

    def asked(request: Any) -> None:
        if not request.url.startswith((address, "data:", "blob:")):
            page.strangers.append(request.url)

    page.on("console", heard)
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.on("request", asked)
    page.goto(address)
    page.wait_for_selector("#year", timeout=60_000)
    still(page)
    return page


def still(page: Any) -> bytes:
    """Wait until the picture no longer changes, and give it."""
    before, end = b"", time.monotonic() + 60.0
    while time.monotonic() < end:
        page.wait_for_timeout(150)
        now = bytes(page.locator("#picture").screenshot())
        if now == before:
            return now
        before = now
    raise AssertionError("the picture did not come to rest")


def heard(page: Any) -> None:
    """Wait until the server has done what the page has sent, and the page shows it."""
    page.evaluate("window.trame.trigger('key', [''])")  # a key of no meaning, answered in turn
    page.wait_for_timeout(50)


def changed(page: Any, before: bytes) -> bytes:
    """Wait until the picture is another one, at rest, and give it."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        now = still(page)
        if now != before:
            return now
    raise AssertionError("the picture did not change")


def wait_for_text(page: Any, selector: str, text: str) -> None:
    """Wait until an element says something."""
    page.wait_for_function(
        "([selector, text]) => document.querySelector(selector)?.innerText.includes(text)",
        arg=[selector, text],
        timeout=60_000,
    )
