"""The viewer: what is shown now, and how the page's controls change it.

All pages that are open show one state, which lives here and not in the page: a page that is closed
and opened again, or a second one, shows the same.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from typing import Any, Protocol

from forest.errors import InputError
from forest.view.stand_years import conifers_of
from forest.viewer.colours import CHOICES, colour_trees, colours_of_others, legend_of_others
from forest.viewer.detail import trees_in_detail
from forest.viewer.fields import choices
from forest.viewer.picking import Hit
from forest.viewer.picture import Picture
from forest.viewer.server import import_trame
from forest.viewer.source import Source
from forest.viewer.stage import GRID_M, Stage
from forest.viewer.tools import PickTool, Tool

_STILL_PX = 5.0  # a press and a release no further apart are a click
_REDRAWN_S = 0.01  # what comes within this time is drawn once


class Panel(Protocol):
    """A part of the page that keeps itself up to date: charts, a card, controls.

    Attributes
    ----------
    title, icon : str
        Of its tab.
    """

    title: str
    icon: str

    def build(self) -> None:
        """Make its widgets inside the one that is open."""

    def refresh(self) -> None:
        """Bring its state up to date with the app's year, colours and chosen tree."""


class App:
    """A viewer of a source, with its server; `forest.viewer.server.serve` runs it.

    Parameters
    ----------
    source : Source
        What is shown.
    panels : callables
        More panels than the usual ones; each is given the app and makes one.

    Attributes
    ----------
    server : trame_server.Server
    source : Source
    stage : Stage
    surfaces : Surfaces
        What the chosen tree is shown as.
    panels : list of Panel
    tools : dict of str to Tool
        What the pointer can do, by name.
    """

    def __init__(self, source: Source, panels: tuple[Callable[[App], Panel], ...] = ()) -> None:
        from forest.viewer.page import build_page
        from forest.viewer.panels import usual_panels
        from forest.viewer.surfaces import Surfaces

        trame = import_trame()
        self.server = trame.get_server(f"forest-{id(self)}", client_type="vue3")
        self.state = self.server.state
        self.source = source
        self.stage = Stage(source.scenario.plot.size_m, conifers_of(source.scenario))
        self._picture = Picture(self)
        self.tools: dict[str, Tool] = {}
        self._pressed: tuple[float, float, Hit] | None = None
        self._wanted: dict[str, Callable[[], None]] = {}
        self._player: asyncio.Task[None] | None = None
        self._in_detail: tuple[int, ...] = ()
        self._fresh_state()
        self.add_tool(PickTool(self.choose))
        self.surfaces = Surfaces(self)
        self.panels: list[Panel] = [make(self) for make in (*panels, *usual_panels)]
        self.show_year()
        self.look("stand")
        build_page(self)
        self._listen()

    def _fresh_state(self) -> None:
        self.state.trame__title = f"{self.source.title} - forest"
        self.state.update(
            {
                "title": self.source.title,
                "where": self.source.where,
                "years": list(self.source.years),
                "step": len(self.source.years) - 1,
                "year": self.source.years[-1],
                "playing": False,
                "speed": 2,
                "colour_by": "species",
                "colour_choices": choices(CHOICES),
                "legend": {},
                "grid": f"grid {GRID_M:g} m"
                if max(self.source.scenario.plot.size_m) > GRID_M
                else "",
                "chosen": None,
                "branches": False,
                "branches_known": False,
                "alone": False,
                "tool": "pick",
                "tool_list": [],
                "tool_drags": False,
                "tool_wheels": False,
                "tool_hint": "",
                "tab": "stand",
                "message": "",
                "warned": 0,
                "heard": 0,
            }
        )

    def add_tool(self, tool: Tool) -> None:
        """Offer one more tool for the pointer."""
        self.tools[tool.name] = tool
        self.state.tool_list = [
            {"name": each.name, "label": each.label, "icon": each.icon}
            for each in self.tools.values()
        ]

    # ------------------------------------------------------------------ what is shown

    @property
    def year(self) -> int:
        """The calendar year that is shown."""
        return int(self.state.year)

    @property
    def chosen(self) -> int | None:
        """The tree that is chosen."""
        return None if self.state.chosen is None else int(self.state.chosen)

    def show_year(self) -> None:
        """Draw the trees of the year that the slider stands on, and all that goes with it."""
        state, years = self.state, self.source.years
        state.step = min(max(int(state.step), 0), len(years) - 1)
        state.year = years[state.step]
        self.trees = self.source.trees(self.year)
        self.colours, legend = colour_trees(self.source, self.trees, state.colour_by)
        others = self.source.others(self.year)
        self._legend_of_others = legend_of_others(others)
        state.legend = legend.with_more(self._legend_of_others).as_state()
        known = self.source.with_branches(self.year)
        state.branches_known = bool(known)
        self._in_detail = trees_in_detail(self)
        shapes = [self.source.skeleton(tree, self.year) for tree in self._in_detail]
        alone = self.chosen if state.alone else None
        self.stage.show_trees(self.trees, self.colours, shapes, alone=alone)
        standing = self.source.standing_obstacles(self.year) if alone is None else ()
        others = others if alone is None else others.iloc[:0]
        self.stage.show_others(others, colours_of_others(others), standing)
        self.refresh()

    def show_colours(self) -> None:
        """Colour the trees anew."""
        self.colours, legend = colour_trees(self.source, self.trees, self.state.colour_by)
        self.state.legend = legend.with_more(self._legend_of_others).as_state()
        self.stage.recolour(self.colours)
        self.refresh()

    def choose(self, tree_id: int | None, *, card: bool = True) -> None:
        """Choose a tree, or none; turn to its card, unless told otherwise."""
        self.state.chosen = tree_id
        if tree_id is None:
            self.state.alone = False
        self.stage.choose(tree_id)
        if self.state.alone or trees_in_detail(self) != self._in_detail:
            self.show_year()
        if tree_id is not None and card:
            self.state.tab = "tree"
        self.refresh()

    def look(self, way: str) -> None:
        """Point the camera: "stand", "side", "above", or "tree" for the chosen one."""
        if way != "tree":
            self.stage.look(way)
        elif self.chosen is not None:
            self.stage.look_at_tree(self.chosen)
        self.come_closer()
        self.push()

    def come_closer(self) -> None:
        """Show other trees with branches, if the camera has come near them."""
        if trees_in_detail(self) != self._in_detail:
            self.show_year()

    def refresh(self) -> None:
        """Bring panels and picture up to date."""
        self.refresh_panels()
        self.push()

    def refresh_panels(self) -> None:
        """Bring the panels up to date."""
        for panel in self.panels:
            panel.refresh()

    def show_inside(self, add: Callable[[Any], None] | None) -> None:
        """Put something among the trees, whose crowns then make way for it; None takes it away."""
        self.stage.put("inside", add)
        self.stage.crowns = add is None
        self.show_year()

    def push(self) -> None:
        """Send the picture to the pages that are open."""
        if self.server.running:
            self.server.controller.view_update()

    @property
    def dragging(self) -> bool:
        """Whether a tool is dragged, and pictures follow it."""
        return self._pressed is not None and self._tool.drags

    def warn(self, message: str) -> None:
        """Tell the user in a line why something was not done."""
        self.state.message = message
        self.state.warned += 1

    # ------------------------------------------------------------------ what the page does

    def fault(self, *what: Any, **_: Any) -> None:
        """Say that the viewer itself went wrong: trame keeps such faults to itself."""
        said = " ".join(str(part) for part in what)
        if "closing transport" not in said:  # a page was closed while a picture was on its way
            print(f"forest view: fault: {said}", file=sys.stderr, flush=True)

    def _listen(self) -> None:
        self.server.controller.on_exception.add(self.fault)
        state, trigger = self.state, self.server.controller.trigger
        state.change("step")(lambda **_: self.soon(self.show_year))
        state.change("branches")(lambda **_: self.soon(self.show_year))
        state.change("alone")(lambda **_: self.soon(self.show_year))
        state.change("colour_by")(lambda **_: self.soon(self.show_colours))
        state.change("playing")(lambda **_: self._play())
        state.change("tab")(lambda **_: self.soon(self.refresh_panels))
        state.change("tool")(lambda **_: self._take_tool())
        self.stage.when_moved(lambda: self.soon(self.come_closer))
        trigger("pointer")(self._pointer)
        trigger("wheel")(lambda turns: self.tried(lambda: self._tool.wheel(float(turns))))
        trigger("key")(self._key)
        trigger("look")(self.look)
        trigger("choose")(lambda tree_id: self.choose(tree_id))
        trigger("go")(self._go)

    def soon(self, draw: Callable[[], None]) -> None:
        """Draw when the messages that wait are read: of a slider's many only the last counts."""
        if not self.server.running:
            return
        waits = bool(self._wanted)
        self._wanted[draw.__name__] = draw
        if not waits:
            asyncio.get_running_loop().create_task(self._draw_wanted())

    async def _draw_wanted(self) -> None:
        await asyncio.sleep(_REDRAWN_S)
        wanted, self._wanted = self._wanted, {}
        with self.state:
            for draw in wanted.values():
                self.tried(draw)

    def tried(self, draw: Callable[[], None]) -> None:
        try:
            draw()
        except InputError as error:
            self.warn(str(error))

    def _play(self) -> None:
        if self.state.playing and (self._player is None or self._player.done()):
            self._player = asyncio.get_running_loop().create_task(self._playing())

    async def _playing(self) -> None:
        """Go on by a year until told to stop, or at the last year; from there start anew."""
        last = len(self.source.years) - 1
        with self.state:
            if self.state.step >= last:
                self.state.step = 0
        while self.state.playing:
            await asyncio.sleep(1.0 / max(float(self.state.speed), 0.1))
            with self.state:
                if self.state.step >= len(self.source.years) - 1:
                    self.state.playing = False
                elif self.state.playing:
                    self.state.step = int(self.state.step) + 1

    def _go(self, years: int) -> None:
        self.state.step = min(max(int(self.state.step) + years, 0), len(self.source.years) - 1)

    def _key(self, key: str) -> None:
        if key in ("ArrowLeft", "ArrowRight"):
            self._go(1 if key == "ArrowRight" else -1)
        elif key in ("Home", "End"):
            self.state.step = 0 if key == "Home" else len(self.source.years) - 1
        elif key == " ":
            self.state.playing = not self.state.playing
        elif key == "Escape":
            self.choose(None)

    @property
    def _tool(self) -> Tool:
        return self.tools[self.state.tool]

    def _take_tool(self) -> None:
        tool = self._tool
        self.state.tool_drags = tool.drags
        self.state.tool_wheels = tool.wheels
        self.state.tool_hint = tool.hint

    def _pointer(
        self, kind: str, across: float, down: float, width: float, height: float, pressure: float
    ) -> None:
        """Take a press, move or release of the pointer, at pixels of a view of this size."""
        tool = self._tool
        place = self._picture.place(across, down, width, height)
        if kind == "down":
            hit = self.stage.hit(*place, pressure)
            self._pressed = (across, down, hit)
            if tool.drags:
                self.tried(lambda: tool.drag(hit, hit, done=False))
            return
        if self._pressed is None:
            return
        x, y, start = self._pressed
        still = abs(across - x) <= _STILL_PX and abs(down - y) <= _STILL_PX
        if kind == "up":
            self._pressed = None
        if kind == "up" and still:
            self.tried(lambda: tool.click(start))
        elif tool.drags:
            now = self.stage.hit(*place, pressure)
            self.tried(lambda: tool.drag(start, now, done=kind == "up"))
            if kind == "up":
                self.push()  # smooth again
