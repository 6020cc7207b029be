"""Tools that choose whole trees or places of a live stand: fell, mark, plant."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from forest.errors import InputError
from forest.viewer.colours import species_label
from forest.viewer.desk import Desk
from forest.viewer.picking import Hit
from forest.viewer.tool_options import as_number, choice_field, number_field


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

    def _toggle(self, keys: dict[str, Any]) -> None:
        """Queue an act, or take it back if it waits."""
        for number, act in enumerate(self.desk.source.pending):
            if all(act.get(key) == value for key, value in keys.items()):
                self.desk.undo(number)
                return
        self.desk.act(**keys)


class FellTool(LiveTool):
    """Fell by click, by list, by rule."""

    name = "fell"
    label = "Fell"
    icon = "mdi-axe"
    hint = "Click a tree to fell it; once more to let it stand."

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.state.update(
            {"fell_ids": "", "fell_rule": "below", "fell_to": "n_ha", "fell_value": 0}
        )
        trigger = self.app.server.controller.trigger
        trigger("fell_list")(lambda ids: self.app.tried(lambda: self._by_list(str(ids))))
        trigger("fell_rule")(lambda *rule: self.app.tried(lambda: self._by_rule(*rule)))

    def click(self, hit: Hit) -> None:
        """Fell the tree, or let it stand after all."""
        if hit.tree_id is not None:
            self._toggle({"kind": "fell", "tree_ids": [hit.tree_id]})

    def _by_list(self, ids: str) -> None:
        words = re.split(r"[\s,;]+", ids.strip())
        wrong = [word for word in words if not word.isdigit()]
        if wrong:
            raise InputError(f"{wrong[0]!r} is no tree's number"[:200], expected="as 3, 14, 15")
        self.desk.act(kind="fell", tree_ids=[int(word) for word in words])
        self.state.fell_ids = ""

    def _by_rule(self, rule: str, to: str, number: Any) -> None:
        value = as_number(number, "the number")
        if rule == "diameter_limit":
            self.desk.act(kind="harvest", method=rule, limit_cm=value)
        else:
            self.desk.act(kind="thin", method=rule, **{to: value})

    def build(self, v: Any, html: Any) -> None:
        """Make fields for a list and for a rule."""
        html.H3("Fell by number")
        with html.Div(classes="d-flex align-center"):
            v.VTextField(
                v_model=("fell_ids",),
                label="Numbers of trees",
                density="compact",
                variant="outlined",
                hide_details=True,
                id="fell-ids",
            )
            v.VBtn("Fell", variant="text", click="trigger('fell_list', [fell_ids])", id="fell-list")
        html.H3("Fell by rule")
        rules = [
            {"title": "Thin from below", "value": "below"},
            {"title": "Thin from above", "value": "above"},
            {"title": "Thin at random", "value": "random"},
            {"title": "All from a diameter on", "value": "diameter_limit"},
        ]
        goals = [
            {"title": "to N, 1/ha", "value": "n_ha"},
            {"title": "to G, m²/ha", "value": "basal_area_m2ha"},
        ]
        choice_field(v, "fell_rule", "Rule", ("fell_rules", rules))
        with html.Div(v_if=("fell_rule !== 'diameter_limit'",)):
            choice_field(v, "fell_to", "Down", ("fell_goals", goals))
        number_field(v, "fell_value", "N, G or dbh in cm", min=0)
        v.VBtn(
            "Fell",
            variant="text",
            click="trigger('fell_rule', [fell_rule, fell_to, fell_value])",
            id="fell-rule-go",
        )


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
            self._toggle({"kind": "mark", "tree_ids": [hit.tree_id], "mark": word})

    def build(self, v: Any, html: Any) -> None:
        """Make a field for the word."""
        v.VTextField(
            v_model=("mark_word",),
            label="Mark with the word",
            density="compact",
            variant="outlined",
            hide_details=True,
            classes="mb-2",
            id="mark-word",
        )
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
        self._names = [{"title": species_label(name), "value": name} for name in names]

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
