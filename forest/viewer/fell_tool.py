"""The tool that fells trees of a live stand: by click, by number, by rule."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from forest.errors import InputError
from forest.viewer.colours import species_label
from forest.viewer.desk import Desk
from forest.viewer.fields import as_number, choice_field, choices, number_field, text_field
from forest.viewer.live_tools import LiveTool
from forest.viewer.picking import Hit

if TYPE_CHECKING:
    import pandas as pd

#: Methods of thinning and harvest, as foresters call them.
RULES = {
    "below": "Thin from below",
    "above": "Thin from above",
    "selective": "Thin around crop trees",
    "random": "Thin at random",
    "diameter_limit": "Target diameter: all from it on",
    "clearcut": "Fell all of them",
}
_TO_A_GOAL = ("below", "above", "random")
_HARVESTS = ("diameter_limit", "clearcut")
#: What such a thinning takes or leaves.
GOALS = {
    "share_g": "take % of G",
    "share_n": "take % of N",
    "basal_area_m2ha": "leave G, m²/ha",
    "n_ha": "leave N, 1/ha",
}
_LIGHT = 0.2  # share that a thinning takes, where nothing else is said
_CROP_TREES_HA = 100.0
_THICK = 0.9  # share of the trees that are thinner than the first target diameter


def act_of(rule: str, to: str, number: Any, species: str) -> dict[str, Any]:
    """Give the act of a rule: of `RULES`, to one of `GOALS`; "" is all species.

    Raises
    ------
    InputError
        If the number is none, or a share above 100 %.
    """
    of = {"species": species} if species else {}
    kind = {"kind": "harvest" if rule in _HARVESTS else "thin", "method": rule}
    if rule == "clearcut":
        return {**kind, **of}
    value = as_number(number, "the number")
    if rule == "diameter_limit":
        return {**kind, "limit_cm": value, **of}
    if rule == "selective":
        return {**kind, "crop_trees_ha": value, **of}
    if not to.startswith("share"):
        return {**kind, to: value, **of}
    if not 0.0 <= value <= 100.0:
        raise InputError(f"{value:g} % are taken", expected="0 to 100")
    return {**kind, to: value / 100.0, **of}


def words_of_rule(act: dict[str, Any]) -> str:
    """Say what an act by one of `RULES` does; "" of other acts."""
    if act["kind"] not in ("thin", "harvest") or act["method"] not in RULES:
        return ""
    said = RULES[act["method"]].lower()
    values = {
        "share_g": "take {:.3g} % of G",
        "share_n": "take {:.3g} % of N",
        "basal_area_m2ha": "leave G {:g} m²/ha",
        "n_ha": "leave N {:g}/ha",
        "limit_cm": "{:g} cm",
        "crop_trees_ha": "{:g}/ha",
    }
    for key, words in values.items():
        if act.get(key) is not None:
            said += ", " + words.format(act[key] * (100 if key.startswith("share") else 1))
    names = act.get("species") or ()
    names = [names] if isinstance(names, str) else names
    return said + "".join(f", {species_label(name)}" for name in names)


def usual_number(rule: str, to: str, trees: pd.DataFrame, hectares: float) -> float:
    """Give a number to begin with, for a light thinning of these trees."""
    if rule == "selective":
        return _CROP_TREES_HA
    if rule == "diameter_limit":
        dbh = trees["dbh_cm"].dropna()
        return float(max(math.ceil(dbh.quantile(_THICK)), 1)) if len(dbh) else 30.0
    if to.startswith("share"):
        return 100.0 * _LIGHT
    if to == "n_ha":
        return float(round((1.0 - _LIGHT) * len(trees) / hectares))
    return round((1.0 - _LIGHT) * basal_area_m2(trees) / hectares, 1)


def basal_area_m2(trees: pd.DataFrame) -> float:
    """Give the sum of the cross sections at breast height, m2."""
    return float(0.25e-4 * np.pi * (trees["dbh_cm"].fillna(0.0) ** 2).sum())


class FellTool(LiveTool):
    """Fell by click, by list, by rule."""

    name = "fell"
    label = "Fell"
    icon = "mdi-axe"
    hint = "Click a tree to fell it; once more to let it stand."

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        scenario = desk.source.scenario
        self._hectares = scenario.plot.size_m[0] * scenario.plot.size_m[1] * 1e-4
        names = [kind.name for kind in scenario.species_list]
        self._species = {"": "all species", **{name: species_label(name) for name in names}}
        self.state.update(
            {
                "fell_ids": "",
                "fell_rule": "below",
                "fell_to": "share_g",
                "fell_species": "",
                "fell_value": 100.0 * _LIGHT,
                "fell_label": "",
                "fell_said": "",
            }
        )
        trigger = self.app.server.controller.trigger
        trigger("fell_list")(lambda ids: self.app.tried(lambda: self._by_list(str(ids))))
        trigger("fell_rule")(lambda *rule: self.app.tried(lambda: self._by_rule(*rule)))
        self.state.change("fell_rule", "fell_to", "fell_species")(lambda **_: self._begin_rule())
        self.state.change("fell_value", "tool")(lambda **_: self.refresh())
        self._begin_rule()

    def click(self, hit: Hit) -> None:
        """Fell the tree, or let it stand after all."""
        if hit.tree_id is not None:
            self.toggle({"kind": "fell", "tree_ids": [hit.tree_id]})

    def _by_list(self, ids: str) -> None:
        words = re.split(r"[\s,;]+", ids.strip())
        wrong = [word for word in words if not word.isdigit()]
        if wrong:
            raise InputError(f"{wrong[0]!r} is no tree's number"[:200], expected="as 3, 14, 15")
        self.desk.act(kind="fell", tree_ids=[int(word) for word in words])
        self.state.fell_ids = ""

    def _by_rule(self, rule: str, to: str, number: Any, species: str) -> None:
        self.desk.act(**act_of(rule, to, number, species))

    def _begin_rule(self) -> None:
        """Put a number for the rule into its field, and name it."""
        state, rule, to = self.state, str(self.state.fell_rule), str(self.state.fell_to)
        labels = {"diameter_limit": "dbh, cm", "selective": "Crop trees, 1/ha"}
        state.fell_label = labels.get(rule, GOALS[to].partition(" ")[2])
        state.fell_value = usual_number(
            rule, to, self._standing(state.fell_species), self._hectares
        )
        self.refresh()

    def _standing(self, species: str) -> pd.DataFrame:
        """The trees, of a species or all, that do not wait to be felled."""
        trees = self.desk.source.living
        stays = ~trees["pending"].str.contains("fell")
        if species:
            stays &= trees["species"].astype(str) == species
        return trees[stays]

    def refresh(self) -> None:
        """Say what the rule would fell."""
        state = self.state
        if state.tool != self.name:
            return
        try:
            act = act_of(state.fell_rule, state.fell_to, state.fell_value, str(state.fell_species))
            with self.desk.source.at_rest() as session:
                fallen = session.would_fell(**act)
        except InputError as error:
            state.fell_said = str(error)
            return
        trees = self._standing("")
        going = trees[trees["tree_id"].isin(fallen)]
        taken, there = (basal_area_m2(each) / self._hectares for each in (going, trees))
        state.fell_said = (
            f"Would fell {len(going)} of {len(trees)} trees, {taken:.1f} of {there:.1f} m²/ha."
        )

    def build(self, v: Any, html: Any) -> None:
        """Make fields for a list and for a rule."""
        html.H3("Fell by number")
        with html.Div(classes="d-flex align-center"):
            go = "trigger('fell_list', [fell_ids])"
            text_field(v, "fell_ids", "Numbers of trees", enter=go)
            v.VBtn("Fell", variant="text", click=go, id="fell-list")
        html.H3("Fell by rule")
        choice_field(v, "fell_rule", "Rule", ("fell_rules", choices(RULES)))
        with html.Div(v_if=(" || ".join(f"fell_rule === '{rule}'" for rule in _TO_A_GOAL),)):
            choice_field(v, "fell_to", "How much", ("fell_goals", choices(GOALS)))
        with html.Div(v_if=("fell_rule !== 'clearcut'",)):
            number_field(v, "fell_value", ("fell_label",), min=0)
        if len(self._species) > 2:
            choice_field(v, "fell_species", "Of", ("fell_kinds", choices(self._species)))
        html.Div("{{ fell_said }}", classes="quiet", id="fell-said")
        v.VBtn(
            "Fell",
            variant="text",
            click="trigger('fell_rule', [fell_rule, fell_to, fell_value, fell_species])",
            id="fell-rule-go",
        )
