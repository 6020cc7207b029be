"""The page: a bar above, the view with its legend, panels beside it, the years below."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from forest.viewer.fields import choice_field

if TYPE_CHECKING:
    from forest.viewer.app import App

_THEME = {
    "theme": {
        "defaultTheme": "forest",
        "themes": {
            "forest": {
                "dark": False,
                "colors": {
                    "background": "#f6f6f2",
                    "surface": "#ffffff",
                    "primary": "#3f6b4b",
                    "secondary": "#8a7a5c",
                },
            }
        },
    }
}

_STYLE = """
html { overflow: hidden !important; }
.v-application { outline: none; }
body { font-family: Roboto, "Helvetica Neue", Arial, sans-serif; color: #2f3a33; }
.view { position: relative; height: 100%; width: 100%; overflow: hidden; background: #dde6ea; }
.legend { position: absolute; left: 14px; bottom: 14px; background: rgba(255,255,255,.88);
  border-radius: 6px; padding: 8px 12px; font-size: 12.5px; pointer-events: none; }
.legend b { font-weight: 500; }
.swatch { display: inline-block; width: 11px; height: 11px; border-radius: 50%; margin-right: 7px; }
.ramp { height: 10px; width: 200px; border-radius: 3px; margin: 5px 0 2px; }
.ends { display: flex; justify-content: space-between; width: 200px; }
.hint { position: absolute; left: 14px; top: 10px; font-size: 12.5px; color: #4a564e;
  background: rgba(255,255,255,.75); border-radius: 6px; padding: 3px 9px; pointer-events: none; }
#picture img { object-fit: contain; }
.draws { cursor: crosshair; touch-action: none; }
.year { font-size: 22px; font-weight: 500; min-width: 64px; text-align: center;
  font-variant-numeric: tabular-nums; }
.panel h3 { font-size: 14px; font-weight: 500; margin: 14px 0 2px; }
.panel h3:first-child { margin-top: 2px; }
.panel table { border-collapse: collapse; width: 100%; font-size: 13px; }
.panel td { padding: 2.5px 0; border-bottom: 1px solid #eceee9; }
.panel td:last-child { text-align: right; font-variant-numeric: tabular-nums; }
.panel .quiet { color: #6d776f; font-size: 12.5px; }
.panel svg { display: block; width: 100%; height: auto; }
.panel svg text { font-family: inherit; }
"""

# The pointer's place in the view, and the size of the view, pixels.
_PLACE = (
    "$event.clientX - $event.currentTarget.getBoundingClientRect().left, "
    "$event.clientY - $event.currentTarget.getBoundingClientRect().top, "
    "$event.currentTarget.clientWidth, $event.currentTarget.clientHeight, $event.pressure"
)


def _pointer(kind: str) -> str:
    return f"trigger('pointer', ['{kind}', {_PLACE}])"


# A tool takes the left button; with Alt held the view takes it even from tools that drag.
_OURS = "$event.button === 0 && !$event.altKey"
_HOLD = (
    "tool_drags && ($event.stopPropagation(), "
    "$event.currentTarget.setPointerCapture($event.pointerId))"
)
_KEYS = (
    "if (!$event.target.closest('input, textarea, [role=slider], [role=listbox]') "
    "&& ['ArrowLeft', 'ArrowRight', 'Home', 'End', ' ', 'Escape'].includes($event.key)) "
    "{ $event.preventDefault(); trigger('key', [$event.key]); }"
)


def build_page(app: App) -> None:
    """Lay out the page of an app."""
    from trame.ui.vuetify3 import VAppLayout
    from trame.widgets import client, html
    from trame.widgets import vuetify3 as v

    with VAppLayout(app.server, vuetify_config=_THEME) as layout:
        layout.root._attributes["keys"] = (
            f'@keydown="{_KEYS}" tabindex="-1" @vue:mounted="(node) => node.el.focus()"'
        )
        client.Style(_STYLE)
        _bar(v, html)
        with v.VNavigationDrawer(
            location="right", width=392, permanent=True, border=0, elevation=1
        ):
            _panels(app, v, html)
        with v.VMain(style="height: 100vh;"), html.Div(classes="view", id="view"):
            _view(app, html)
        _years(v, html)
        with v.VSnackbar(
            model_value=("warned > heard",),
            update_modelValue="heard = warned",
            key=("warned",),  # each has its full time
            timeout=7000,
            location="top",
        ):
            html.Span("{{ message }}", id="message")


def _bar(v: Any, html: Any) -> None:
    with v.VAppBar(density="compact", flat=True, border="b"):
        v.VIcon("mdi-pine-tree", classes="ml-4 mr-2", color="primary")
        v.VAppBarTitle("{{ title }}")
        with v.VBtnToggle(
            v_model=("tool",),
            mandatory=True,
            density="compact",
            v_if=("tool_list.length > 1",),
            classes="mr-3 flex-shrink-0",
        ):
            v.VBtn(
                v_for="each in tool_list",
                key="each.name",
                value=("each.name",),
                icon=("each.icon",),
                title=("each.label",),
                size="small",
                min_width=30,
            )
        choice_field(
            v,
            "colour_by",
            "Colour by",
            ("colour_choices",),
            style="max-width: 200px; min-width: 130px;",
            classes="mr-3 mt-1",
        )
        # A button that is off shows no title of its own; what is around it does.
        no_branches = "No tree has its branches on record in this year"
        branches = "Branches of the trees that have them on record"
        with html.Div(title=(f"branches_known ? '{branches}' : '{no_branches}'",)):
            v.VBtn(
                icon="mdi-source-branch",
                size="small",
                disabled=("!branches_known",),
                color=("branches ? 'primary' : undefined",),
                click="branches = !branches",
                id="branches",
            )
        for way, icon, title in (
            ("stand", "mdi-axis-arrow", "The whole stand"),
            ("side", "mdi-image-filter-hdr", "From the side"),
            ("above", "mdi-arrow-down-bold-box-outline", "From above"),
            ("tree", "mdi-target", "The chosen tree"),
        ):
            none = "chosen === null" if way == "tree" else "false"
            with html.Div(title=(f"{none} ? 'Choose a tree first' : '{title}'",)):
                v.VBtn(
                    icon=icon,
                    size="small",
                    click=f"trigger('look', ['{way}'])",
                    id=f"look-{way}",
                    disabled=(none,),
                )


def _view(app: App, html: Any) -> None:
    from trame.widgets import vtk

    with html.Div(
        style="position: absolute; inset: 0;",
        raw_attrs=[
            f'@pointerdown.capture="{_OURS} && ({_HOLD}, {_pointer("down")})"',
            f'@pointermove.capture="tool_drags && ($event.buttons & 1) && !$event.altKey '
            f'&& ($event.stopPropagation(), {_pointer("move")})"',
            f'@pointerup.capture="{_OURS} && {_pointer("up")}"',
            "@pointerenter=\"trigger('entered', "
            '[$event.currentTarget.clientWidth, $event.currentTarget.clientHeight])"',
            '@wheel.capture="tool_wheels && ($event.preventDefault(), $event.stopPropagation(), '
            "trigger('wheel', [$event.deltaY]))\"",
            ":class=\"tool_drags ? 'draws' : ''\"",
        ],
        id="picture",
    ):
        view = vtk.VtkRemoteView(
            app.stage.window,
            ref="picture",
            interactive_ratio=0.6,
            interactive_quality=55,
            still_quality=90,
        )
    app.server.controller.view_update = view.update
    html.Div("{{ tool_hint }}", v_if=("tool_hint",), classes="hint")
    with html.Div(classes="legend", id="legend"):
        html.B("{{ legend.title }}")
        html.Span("{{ legend.unit ? ', ' + legend.unit : '' }}")
        with html.Div(v_if=("legend.gradient",)):
            html.Div(classes="ramp", style=("'background: ' + legend.gradient",))
            with html.Div(classes="ends"):
                html.Span("{{ legend.low }}")
                html.Span("{{ legend.high }}")
        with html.Div(v_for="entry in legend.entries", key="entry.name"):
            html.Span(classes="swatch", style=("'background: ' + entry.colour",))
            html.Span("{{ entry.name }}")
        html.Div("{{ grid }}", v_if=("grid",), style="color: #7c857e; margin-top: 3px;")


def _panels(app: App, v: Any, html: Any) -> None:
    with v.VTabs(v_model=("tab",), density="compact", grow=True, color="primary"):
        for panel in app.panels:
            v.VTab(panel.title, value=panel.title.lower(), min_width=40)
    v.VDivider()
    for panel in app.panels:
        name = panel.title.lower()
        with html.Div(v_if=(f"tab === '{name}'",), classes="panel pa-4", id=f"panel-{name}"):
            panel.build()


def _years(v: Any, html: Any) -> None:
    with v.VFooter(app=True, border="t", height=62, classes="px-4"):
        with html.Div(title=("years.length < 2 ? 'There is one year' : 'Play or pause (space)'",)):
            v.VBtn(
                icon=("playing ? 'mdi-pause' : 'mdi-play'",),
                variant="tonal",
                size="small",
                color="primary",
                disabled=("years.length < 2",),
                click="playing = !playing",
                id="play",
            )
        html.Div("{{ year }}", classes="year mx-3", id="year")
        v.VSlider(
            v_model=("step",),
            min=0,
            max=("years.length - 1",),
            step=1,
            hide_details=True,
            color="primary",
            thumb_size=16,
            id="years",
            disabled=("years.length < 2",),
        )
        html.Div(
            "{{ years[0] }} – {{ years[years.length - 1] }}", classes="quiet mx-3 text-caption"
        )
        speeds = ("[1, 2, 5, 10]",)
        choice_field(v, "speed", "Years/s", speeds, style="max-width: 92px;", classes="mt-1")
