"""The desk of a live session: years that grow beside the page's work, and acts between them."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from forest.errors import InputError
from forest.viewer.live_source import LiveSource
from forest.viewer.pending import draw_obstacles, draw_pending

if TYPE_CHECKING:
    from forest.live import LiveSession
    from forest.viewer.app import App

_SHOWN_EVERY_S = 0.4
_BREATH_S = 0.05  # between two years, for what the page wants meanwhile


class Desk:
    """What is done to a live session, one thing after the other.

    A year grows in a thread. What is asked for meanwhile is done at its end, before the next.

    Parameters
    ----------
    app : App
        Shows a `LiveSource`.

    Attributes
    ----------
    source : LiveSource
    changed : list of callables
        Called whenever acts were queued or taken back, or a year is complete.
    """

    def __init__(self, app: App) -> None:
        assert isinstance(app.source, LiveSource)
        self.app, self.source = app, app.source
        self.changed: list[Callable[[], None]] = []
        self._waiting: list[Callable[[LiveSession], Any]] = []
        self._grower: asyncio.Task[None] | None = None
        self._seconds = 1.0
        app.state.update(
            {
                "live_running": False,
                "live_growing": False,
                "live_share": 0,
                "live_next": self.source.session.next_year,
                "live_waiting": 0,
            }
        )
        trigger = app.server.controller.trigger
        trigger("step_year")(self.step)
        trigger("run_years")(self.run)
        trigger("pause_years")(self.pause)

    # ------------------------------------------------------------------ acts

    def do(self, work: Callable[[LiveSession], Any]) -> None:
        """Do something with the session now, or at the end of the year that grows.

        Raises
        ------
        InputError
            If it is done now and cannot be; then nothing has changed.
        """
        if self.source.growing:
            self._waiting.append(work)
            self.app.state.live_waiting = len(self._waiting)
            return
        with self.source.at_rest() as session:
            work(session)
        self._show()

    def act(self, **keys: Any) -> None:
        """Queue an act for the next step; raises as `do` does, and where a past year is shown."""
        if self.app.year != self.source.now:
            raise InputError(
                f"{self.app.year} is past", expected=f"the stand as it is now, of {self.source.now}"
            )
        self.do(lambda session: session.act(**keys))

    def undo(self, number: int) -> None:
        """Take back an act that waits, by its place among them; raises as `do` does."""
        self.do(lambda session: session.undo(number))

    def finish(self) -> None:
        """Do what still waits, and keep it, when the page is closed for good.

        Raises
        ------
        OutputError
            If the session's file is behind, and still cannot be written.
        """
        waiting, self._waiting = self._waiting, []
        with self.source.lock:
            for work in waiting:
                try:
                    work(self.source.session)
                except InputError as error:
                    self.app.warn(str(error))
            if not self.source.session.kept:
                self.source.session.keep()

    # ------------------------------------------------------------------ years

    def step(self) -> None:
        """Grow a year."""
        if self._grower is None or self._grower.done():
            self._grower = asyncio.get_running_loop().create_task(self._grow())
            self._grower.add_done_callback(self._ended)

    def run(self) -> None:
        """Grow year after year."""
        self.app.state.live_running = True
        self.step()

    def pause(self) -> None:
        """Stop at the end of the year that grows."""
        self.app.state.live_running = False

    def _ended(self, grower: asyncio.Task[None]) -> None:
        """Say what went wrong, if something did that is no user's error."""
        if grower.cancelled():  # the program ends, when the thread does
            return
        self.source.growing = False
        if grower.exception() is not None:
            self.app.fault(repr(grower.exception()))

    async def _grow(self) -> None:
        state = self.app.state
        while True:
            with state:
                state.live_growing, state.live_share = True, 0
            self.source.growing = True
            began = time.monotonic()
            growing = asyncio.get_running_loop().run_in_executor(None, self._grow_year)
            while not (await asyncio.wait((growing,), timeout=_SHOWN_EVERY_S))[0]:
                spent = time.monotonic() - began
                with state:
                    state.live_share = round(100 * min(spent / self._seconds, 0.98))
            with state:
                try:
                    growing.result()
                    self._seconds = max(time.monotonic() - began, 0.1)
                except InputError as error:
                    state.live_running = False
                    self.app.warn(str(error))
                self.source.growing = state.live_growing = False
                self._catch_up()
                self._show(follow=self.app.year == self.source.now)
                if not state.live_running:
                    return
            await asyncio.sleep(_BREATH_S)
            if not state.live_running:
                return

    def _grow_year(self) -> None:
        with self.source.lock:
            self.source.session.step()

    def _catch_up(self) -> None:
        """Do what was asked for while the year grew."""
        waiting, self._waiting = self._waiting, []
        self.app.state.live_waiting = 0
        with self.source.at_rest() as session:
            for work in waiting:
                try:
                    work(session)
                except InputError as error:
                    self.app.warn(str(error))

    def _show(self, *, follow: bool = False) -> None:
        """Show what the session has come to; the slider stays at the last year if it was there."""
        app, source = self.app, self.source
        source.refresh()
        app.state.years = list(source.years)
        app.state.live_next = source.session.next_year
        if follow:
            app.state.step = len(source.years) - 1
        for tell in self.changed:
            tell()
        self.draw()
        app.show_year()

    def draw(self, moved: Mapping[str, Sequence[float]] | None = None) -> None:
        """Draw what waits for the next year, and obstacles; `moved` as in `draw_obstacles`."""
        draw_pending(self.app.stage, self.source)
        draw_obstacles(self.app.stage, self.source, moved)
