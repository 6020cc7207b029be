"""What tools of a live stand share; those that mark trees and plant them."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest.viewer.colours import species_label
from forest.viewer.desk import Desk
from forest.viewer.fields import choice_field, choices, text_field
from forest.viewer.picking import Hit


class LiveTool:
    """What the tools of a live stand share; a tool's class is also the options of that tool.

    Parameters
    ----------
    desk : Desk
    """

    name = label = icon = hint = ""
    drags = wheels = False
    #: Whether it works on branches, so that they are shown while it is in hand.
    on_branches = False

    def __init__(self, desk: Desk) -> None:
        self.desk, self.app, self.state = desk, desk.app, desk.app.state

    @property
    def tool(self) -> str:
        """Its name, as the options of a tool have it."""
        return self.name

    def click(self, hit: Hit) -> None:
        """Nothing."""

    def drag(self, start: Hit, now: Hit, *, done: bool) -> None:
        """Nothing: drags turn the view."""

    def wheel(self, turns: float) -> None:
        """Nothing."""

    def put_down(self) -> None:
        """Take away what it has drawn, when another tool is taken or a year is grown."""

    def build(self, v: Any, html: Any) -> None:
        """Make no widgets."""

    def refresh(self) -> None:
        """Nothing to bring up to date."""

    def toggle(self, keys: dict[str, Any]) -> None:
        """Queue an act, or take it back if it waits."""
        for number, act in enumerate(self.desk.source.pending):
            if all(act.get(key) == value for key, value in keys.items()):
                self.desk.undo(number)
                return
        self.desk.act(**keys)


class MarkTool(LiveTool):
    """Mark by click."""

    name = "mark"
    label = "Mark"
    icon = "mdi-spray"
    hint = "Click a tree to mark it; once more to take the mark back."

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.state.mark_word = "crop"

    def click(self, hit: Hit) -> None:
        """Mark the tree, or take the mark back if it still waits."""
        if hit.tree_id is not None:
            word = str(self.state.mark_word).strip()
            self.toggle({"kind": "mark", "tree_ids": [hit.tree_id], "mark": word})

    def build(self, v: Any, html: Any) -> None:
        """Make a field for the word."""
        text_field(v, "mark_word", "Mark with the word", classes="mb-2")
        html.Div("Acts by rule can name marked trees in the scenario.", classes="quiet")


class PlantTool(LiveTool):
    """Plant by click."""

    name = "plant"
    label = "Plant"
    icon = "mdi-sprout"
    hint = "Click the ground to plant a seedling there."

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        names = [kind.name for kind in desk.source.scenario.species_list]
        self.state.plant_species = names[0]
        self._names = choices({name: species_label(name) for name in names})

    def click(self, hit: Hit) -> None:
        """Plant where the line of sight meets the ground, whatever stands before it."""
        place = hit.ray.on_plane(np.zeros(3), np.array([0.0, 0.0, 1.0]))
        if place is None:
            return
        x, y = (round(float(each), 3) for each in place[:2])
        species = [str(self.state.plant_species)]
        self.desk.act(kind="plant", species=species, x_m=[x], y_m=[y])

    def build(self, v: Any, html: Any) -> None:
        """Make a choice of species."""
        choice_field(v, "plant_species", "Species", ("plant_names", self._names))
