"""Felling by rule: the acts that its fields become, what they begin with, what is said before."""

from __future__ import annotations

import pandas as pd
import pytest

from forest.errors import InputError
from forest.live import LiveSession
from forest.viewer.fell_tool import GOALS, RULES, act_of, usual_number, words_of_rule
from forest.viewer.live_source import LiveSource
from tests.tiny import tiny


def test_fields_become_acts() -> None:
    assert act_of("below", "share_g", "25", "") == {
        "kind": "thin",
        "method": "below",
        "share_g": 0.25,
    }
    assert act_of("above", "n_ha", 400, "picea_abies")["species"] == "picea_abies"
    assert act_of("diameter_limit", "n_ha", 40, "")["limit_cm"] == 40
    assert act_of("clearcut", "n_ha", "", "picea_abies") == {
        "kind": "harvest",
        "method": "clearcut",
        "species": "picea_abies",
    }
    assert words_of_rule(act_of("below", "share_g", 29, "picea_abies")) == (
        "thin from below, take 29 % of G, Picea abies"
    )
    assert words_of_rule({"kind": "thin", "method": "geometric", "every_row": 3}) == ""
    with pytest.raises(InputError, match="no number"):
        act_of("below", "n_ha", "", "")
    with pytest.raises(InputError, match="0 to 100"):
        act_of("below", "share_n", 120, "")


def test_rules_begin_with_a_light_thinning() -> None:
    trees = pd.DataFrame({"dbh_cm": [10.0, 20.0, 30.0, 40.0, float("nan")]})
    assert usual_number("below", "share_g", trees, 0.1) == 20.0
    assert usual_number("below", "n_ha", trees, 0.1) == 40.0
    assert usual_number("below", "basal_area_m2ha", trees, 0.1) == pytest.approx(1.9)
    assert usual_number("diameter_limit", "", trees, 0.1) == 37.0
    assert usual_number("diameter_limit", "", trees.iloc[4:], 0.1) == 30.0


def test_what_a_rule_would_fell_is_said_before_and_is_what_it_fells() -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    from forest.viewer.app import App
    from forest.viewer.live import LivePart

    session = LiveSession(tiny())
    for _ in range(6):
        session.step()
    part = LivePart()
    app = App(LiveSource(session, "here"), (part.panel,))
    tool, state = app.tools["fell"], app.state
    state.tool = "fell"
    first = session.trees()
    for rule, goal in (
        *((rule, "share_g") for rule in RULES),
        *(("above", goal) for goal in GOALS),
    ):
        state.update({"fell_rule": rule, "fell_to": goal})
        tool._begin_rule()  # type: ignore[attr-defined]
        act = act_of(rule, goal, state.fell_value, "")
        would = session.would_fell(**act)
        assert state.fell_said.startswith(f"Would fell {len(would)} of {len(first)} trees")
        session.act(**act)
        fallen = session.trees().query("pending == 'fell'").tree_id
        assert sorted(fallen) == sorted(would)
        session.undo()
    assert session.pending == () and session.trees().equals(first)
    state.fell_value = ""
    state.fell_rule = "below"
    tool.refresh()  # type: ignore[attr-defined]
    assert "no number" in state.fell_said
