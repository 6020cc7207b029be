"""Processes that tests may kill: forked from one that has imported what they need."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import Any

from forest.progress import Silent
from forest.scenario import Scenario
from forest.simulation import simulate
from forest.stand import Stand

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload([__name__, "tests.record.years"])


def start(call: Callable[..., object], *words: Any, output: Path) -> ForkServerProcess:
    """Start a process of a call; what it prints goes to a file."""
    process = _FORKS.Process(target=_with_output, args=(call, words, output), daemon=True)
    process.start()
    return process


def _with_output(call: Callable[..., object], words: tuple[Any, ...], output: Path) -> None:
    with output.open("w") as file, contextlib.redirect_stdout(file):
        try:
            call(*words)
        except Exception:
            traceback.print_exc(file=file)
            file.flush()
            sys.exit(1)


class Dies(Silent):
    """Kills its process some share of a year's length after a year is done."""

    def __init__(self, after: int, share: float) -> None:
        self._after, self._share = after, share

    def begin(self, years: int, done: int) -> None:
        """Take the time."""
        self._last = time.monotonic()

    def year_done(self, stand: Stand) -> None:
        """Set the clock, if this is the year."""
        took, self._last = time.monotonic() - self._last, time.monotonic()
        if stand.year == self._after:
            words = (os.getpid(), signal.SIGKILL)
            threading.Timer(self._share * took, os.kill, words).start()


def _simulate(scenario: Path, out: Path, after: int, share: float) -> None:
    simulate(Scenario.load(scenario), out, resume=True, progress=Dies(after, share))


def run_and_die(scenario: Path, out: Path, *, after: int, share: float) -> int:
    """Run or resume a scenario in a process that kills itself: give its exit code."""
    said = out.with_suffix(".out")
    process = start(_simulate, scenario, out, after, share, output=said)
    process.join()
    assert process.exitcode in (-signal.SIGKILL, 0), said.read_text()
    said.unlink()
    return process.exitcode
