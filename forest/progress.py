"""How a run shows its progress: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

if TYPE_CHECKING:
    from forest.stand import Stand

_SECONDS_BETWEEN_LINES = 5.0


class Silent:
    """Says nothing."""

    def say(self, message: str) -> None:
        """Drop the line."""

    def begin(self, years: int, done: int) -> None:
        """Take no notice."""

    def year_done(self, stand: Stand) -> None:
        """Take no notice."""

    def end(self) -> None:
        """Take no notice."""


class Bar:
    """Writes to standard error.

    Parameters
    ----------
    years : bool
        Whether to show the years as they go by, or only say what else there is to say.
    """

    def __init__(self, *, years: bool = True) -> None:
        self._console = Console(stderr=True)
        self._shows_years = years
        self._progress: Progress | None = None
        self._years = 0
        self._last_line = 0.0

    def say(self, message: str) -> None:
        """Print a line."""
        self._console.print(message, highlight=False, soft_wrap=True)

    def begin(self, years: int, done: int) -> None:
        """Start the bar."""
        self._years = years
        self._last_line = time.monotonic()
        if not (self._shows_years and self._console.is_terminal):
            return
        self._progress = Progress(
            TextColumn("growing"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("years"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[stand]}"),
            console=self._console,
        )
        self._task = self._progress.add_task("growing", total=years, completed=done, stand="")
        self._progress.start()

    def year_done(self, stand: Stand) -> None:
        """Show the year, the trees and the metamers."""
        if not self._shows_years:
            return
        rows = stand.rows
        what = f"{len(rows.tree_id)} trees, {int(rows.size.sum()):,} metamers"
        if self._progress is not None:
            self._progress.update(self._task, completed=stand.steps, stand=what)
            return
        now = time.monotonic()
        if now - self._last_line >= _SECONDS_BETWEEN_LINES or stand.steps == self._years:
            self._last_line = now
            self.say(f"{stand.year}: year {stand.steps} of {self._years}, {what}")

    def end(self) -> None:
        """Stop the bar."""
        if self._progress is not None:
            self._progress.stop()
            self._progress = None
