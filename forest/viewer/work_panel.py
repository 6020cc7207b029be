"""The panel of a live stand: its years, the acts that wait, what the tool in hand can be told."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forest.errors import InputError, years_of
from forest.viewer.desk import Desk
from forest.viewer.fell_tool import words_of_rule
from forest.viewer.fields import text_field

if TYPE_CHECKING:
    from forest.live import LiveSession
    from forest.viewer.tools import Options

_MOST_SHOWN = 6  # ids in a line


def words_of(act: dict[str, Any]) -> str:
    """Say in a few words what an act does."""
    kind = act["kind"]
    ids = act.get("tree_ids") or ([act["tree_id"]] if act.get("tree_id") is not None else [])
    named = ", ".join(str(i) for i in ids[:_MOST_SHOWN]) + (" …" if len(ids) > _MOST_SHOWN else "")
    if kind in ("fell", "mark", "prune", "bend"):
        said = f"{kind} tree {named}" if len(ids) == 1 else f"{kind} trees {named}"
        if kind == "mark":
            return f"{said} {act['mark']!r}"
        if act.get("metamer") is not None:
            said += f" at metamer {act['metamer']}"
        return said
    if kind == "crack":
        place = f"{act['height_m']:.2f} m, {act['azimuth_deg'] % 360:.0f}°"
        return f"crack the bark of tree {named} at {place}"
    if kind == "plant" and act.get("x_m"):
        place = f"{act['x_m'][0]:.2f}, {act['y_m'][0]:.2f} m"
        return f"plant {act['species'][0].replace('_', ' ')} at {place}"
    if kind == "obstacle":
        if act.get("add"):
            return f"put up {act['add']['name']}"
        return f"move {act['move']}" if act.get("move") else f"remove {act['remove']}"
    if kind == "stroke":
        only = f", metamer {act['metamer']} alone grows" if act.get("metamer") is not None else ""
        return f"stroke of {len(act['points_m'])} points{only}"
    if said := words_of_rule(act):
        return said
    rule = (
        f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in act.items()
        if key not in ("kind", "method")
    )
    return f"{kind} {act.get('method', '')}, {', '.join(rule)}".replace(" ,", ",")


class WorkPanel:
    """Run, pause, step; what waits; the options of the tool in hand; the session's files.

    Parameters
    ----------
    desk : Desk
    options : sequence of Options
        Of the tools.
    """

    title = "Work"
    icon = "mdi-axe"

    def __init__(self, desk: Desk, options: tuple[Options, ...]) -> None:
        self._desk, self._options = desk, options
        app = desk.app
        self._file = Path(desk.source.where)
        app.state.update(
            {
                "live_acts": [],
                "live_file": str(self._file),
                "live_replay": shlex.join(
                    ["forest", "run", str(self._file), "--out", f"{self._file.stem}.h5"]
                ),
                "run_file": f"{self._file.stem}.h5",
                "live_saved": "",
            }
        )
        trigger = app.server.controller.trigger
        trigger("undo_act")(self._undo)
        trigger("save_run")(self._save)

    def build(self) -> None:
        """Make its widgets."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        self._build_years(v, html)
        for options in self._options:
            with html.Div(
                v_if=(f"tool === '{options.tool}'",), classes="mt-3", id=f"options-{options.tool}"
            ):
                options.build(v, html)
        self._build_acts(v, html)
        html.H3("Session")
        html.Div("Kept after each act and each year in", classes="quiet")
        html.Div("{{ live_file }}", style="word-break: break-all;", id="session-file")
        html.Div("The same stand, grown again without this page:", classes="quiet mt-2")
        html.Code("{{ live_replay }}", style="word-break: break-all;")
        with html.Div(classes="d-flex align-center mt-3"):
            go = "trigger('save_run', [run_file])"
            text_field(v, "run_file", "Run file", enter=go)
            v.VBtn("Save", variant="text", click=go, id="save-run")
        html.Div("{{ live_saved }}", classes="quiet mt-1", id="saved")

    def _build_years(self, v: Any, html: Any) -> None:
        with html.Div(classes="d-flex align-center mb-2"):
            v.VBtn(
                "Run",
                prepend_icon="mdi-fast-forward",
                color="primary",
                size="small",
                v_if=("!live_running",),
                click="trigger('run_years')",
                id="run",
            )
            v.VBtn(
                "Pause",
                prepend_icon="mdi-pause",
                color="primary",
                size="small",
                v_if=("live_running",),
                click="trigger('pause_years')",
                id="pause",
            )
            v.VBtn(
                "Step",
                prepend_icon="mdi-skip-next",
                variant="tonal",
                size="small",
                classes="ml-2",
                disabled=("live_growing",),
                click="trigger('step_year')",
                id="step",
            )
            html.Div(
                "{{ live_growing ? live_next + ' grows' : 'next: ' + live_next }}",
                classes="quiet ml-3",
                id="next-year",
            )
        v.VProgressLinear(
            model_value=("live_share",),
            active=("live_growing",),
            color="primary",
            height=4,
        )

    def _build_acts(self, v: Any, html: Any) -> None:
        html.H3("At the start of {{ live_next }}")
        html.Div("Nothing waits.", v_if=("!live_acts.length",), classes="quiet")
        with html.Div(
            v_for="each in live_acts",
            key="each.number",
            classes="d-flex align-center act",
        ):
            html.Span("{{ each.text }}", style="flex: 1; font-size: 13px;")
            v.VBtn(
                icon="mdi-close",
                size="x-small",
                variant="text",
                title="Take back",
                click="trigger('undo_act', [each.number])",
            )
        html.Div(
            "{{ live_waiting }} more are done when the year is grown.",
            v_if=("live_waiting",),
            classes="quiet",
        )
        v.VBtn(
            "Undo",
            prepend_icon="mdi-undo",
            variant="text",
            size="small",
            v_if=("live_acts.length",),
            click="trigger('undo_act', [live_acts.length - 1])",
            id="undo",
        )

    def refresh(self) -> None:
        """List the acts that wait."""
        self._desk.app.state.live_acts = [
            {"number": k, "text": words_of(act)} for k, act in enumerate(self._desk.source.pending)
        ]
        for options in self._options:
            options.refresh()

    def _undo(self, number: int) -> None:
        self._desk.app.tried(lambda: self._desk.undo(int(number)))

    def _save(self, words: Any) -> None:
        """Write a run file, beside the session's where no folder is named."""
        name = Path(str(words).strip() or "session.h5")
        to = name if name.is_absolute() else self._file.parent / name

        def write(session: LiveSession) -> None:
            if to.suffix != ".h5":
                raise InputError(
                    f"{to.name} is no run file's name", expected="one that ends in .h5"
                )
            if _is_there(to):
                raise InputError("exists already", where=str(to), expected="a new name")
            session.write_run(to)
            self._desk.app.state.live_saved = f"{to} holds {years_of(len(session.records))}"

        self._desk.app.tried(lambda: self._desk.do(write))


def _is_there(path: Path) -> bool:
    """Tell whether there is such a file; refuse what no file can be called."""
    try:
        return path.exists()
    except (OSError, ValueError):  # too long, or with a null byte
        raise InputError(f"{path.name[:40]!r} is no name that a file can have") from None
