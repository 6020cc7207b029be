"""What a click or a drag in the view does: each tool is a small class."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from forest.viewer.picking import Hit


class Tool(Protocol):
    """Something that the pointer does while it is chosen.

    Attributes
    ----------
    name : str
        By which it is chosen.
    label, icon, hint : str
        Its button's title, its icon (mdi-...), and what to do with it, in a short sentence.
    drags : bool
        Whether it takes drags; the view then turns only with Alt held.
    wheels : bool
        Whether it takes the wheel; the view then does not come nearer with it.
    """

    name: str
    label: str
    icon: str
    hint: str
    drags: bool
    wheels: bool

    def click(self, hit: Hit) -> None:
        """Do what a click on something does."""

    def drag(self, start: Hit, now: Hit, *, done: bool) -> None:
        """Follow a drag; at its start `now` is `start`, at its end it is `done`."""

    def wheel(self, turns: float) -> None:
        """Take a turn of the wheel, towards the user if positive."""


class PickTool:
    """Choose the tree that is clicked; a click on the ground chooses none.

    Parameters
    ----------
    choose : callable
        Is given the tree's id, or None.
    """

    name = "pick"
    label = "Choose a tree"
    icon = "mdi-cursor-default-click-outline"
    hint = "Click a tree to see its card."
    drags = False
    wheels = False

    def __init__(self, choose: Callable[[int | None], None]) -> None:
        self._choose = choose

    def click(self, hit: Hit) -> None:
        """Choose the tree."""
        self._choose(hit.tree_id)

    def drag(self, start: Hit, now: Hit, *, done: bool) -> None:
        """Nothing: drags turn the view."""

    def wheel(self, turns: float) -> None:
        """Nothing: the wheel moves the view."""


class Options(Protocol):
    """What a tool can be told, in the panel beside the view.

    Attributes
    ----------
    tool : str
        Its name.
    """

    @property
    def tool(self) -> str:
        """Its name."""

    def build(self, v: Any, html: Any) -> None:
        """Make its widgets, of vuetify and plain HTML."""

    def refresh(self) -> None:
        """Bring them up to date with the stand."""
