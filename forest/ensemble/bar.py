"""How a sweep shows its progress: a bar over runs on a terminal, a line per run elsewhere."""

from __future__ import annotations

from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


class Listener(Protocol):
    """Who is told how a sweep goes on."""

    def say(self, message: str) -> None:
        """Take a line about what is going on."""

    def begin(self, runs: int, done: int) -> None:
        """Take the number of runs, and of those that are done."""

    def run_ended(self, name: str, *, failed: bool) -> None:
        """Take the end of a run."""

    def end(self) -> None:
        """Take the end of the sweep."""


class Silent:
    """Says nothing."""

    def say(self, message: str) -> None:
        """Drop the line."""

    def begin(self, runs: int, done: int) -> None:
        """Take no notice."""

    def run_ended(self, name: str, *, failed: bool) -> None:
        """Take no notice."""

    def end(self) -> None:
        """Take no notice."""


class RunsBar:
    """Writes to standard error."""

    def __init__(self) -> None:
        self._console = Console(stderr=True)
        self._progress: Progress | None = None
        self._runs = self._ended = self._failed = 0

    def say(self, message: str) -> None:
        """Print a line."""
        self._console.print(message, highlight=False, markup=False, soft_wrap=True)

    def begin(self, runs: int, done: int) -> None:
        """Start the bar."""
        self._runs, self._ended = runs, done
        if done:
            self.say(f"{done} of {runs} runs are done already")
        if not self._console.is_terminal:
            return
        self._progress = Progress(
            TextColumn("growing"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("runs"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[failed]}"),
            console=self._console,
        )
        self._task = self._progress.add_task("growing", total=runs, completed=done, failed="")
        self._progress.start()

    def run_ended(self, name: str, *, failed: bool) -> None:
        """Move the bar on, or print a line."""
        self._ended += 1
        self._failed += failed
        if self._progress is None:
            self.say(f"{self._ended} of {self._runs}: {name}{' failed' * failed}")
            return
        note = f"{self._failed} failed" if self._failed else ""
        self._progress.update(self._task, completed=self._ended, failed=note)

    def end(self) -> None:
        """Stop the bar."""
        if self._progress is not None:
            self._progress.stop()
            self._progress = None
