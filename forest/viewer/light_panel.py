"""Light, markers and the light's own view, on demand."""

from __future__ import annotations

import asyncio
import base64
from collections.abc import Callable
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from forest.errors import InputError
from forest.view.scene import import_pyvista
from forest.viewer.fields import choice_field, choices, number_field
from forest.viewer.inside import (
    LIGHT_COLOURS,
    LightView,
    Slice,
    exposed,
    light_slice,
    markers_around,
    view_from_light,
)

if TYPE_CHECKING:
    from forest.stand import Stand
    from forest.viewer.app import App

_COLOURS = "inferno"
_RAMP = "linear-gradient(to right, #000004, #420a68, #932667, #dd513a, #fca50a, #fcffa4)"
_WAYS = (
    ("slice", "Light at a height", "mdi-layers-outline"),
    ("markers", "Free markers", "mdi-dots-hexagon"),
    ("sun", "Seen from the light", "mdi-white-balance-sunny"),
)
# The pointer's place in the picture, shares of its width and height.
_PLACE = "$event.offsetX / $event.target.clientWidth, $event.offsetY / $event.target.clientHeight"


class LightPanel:
    """What needs the stand with all its buds: a checkpoint's, or a living one."""

    title = "Light"
    icon = "mdi-weather-sunny"

    def __init__(self, app: App) -> None:
        self._app = app
        self._exposed: tuple[Stand, Stand] | None = None
        self._picture = 0
        self._seen: LightView | None = None
        app.state.update(
            {
                "light_height": 2.0,
                "light_why_not": "",
                "light_year": None,
                "light_said": "",
                "light_image": "",
                "light_pixels": "",
                "light_by": "tree",
                "light_colours": choices(LIGHT_COLOURS),
                "light_busy": False,
                "light_shown": "",
                "light_top": "",
            }
        )
        trigger = app.server.controller.trigger
        trigger("inside")(self._show)
        trigger("inside_off")(self._clear)
        trigger("light_pick")(self._pick)
        app.state.change("light_by")(self._colour_anew)

    def build(self) -> None:
        """Make its widgets."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        html.Div("{{ light_why_not }}", v_if=("light_why_not",), classes="quiet", id="light-why")
        with html.Div(v_if=("!light_why_not",)):
            html.Div("Of the stand as it stood in {{ light_year }}.", classes="quiet mb-2")
            number_field(v, "light_height", "Height above the ground, m", min=0, step=0.5)
            for name, label, icon in _WAYS:
                v.VBtn(
                    label,
                    prepend_icon=icon,
                    variant="tonal",
                    block=True,
                    size="small",
                    classes="mb-2",
                    disabled=("light_busy",),
                    click=f"trigger('inside', ['{name}'])",
                    id=f"inside-{name}",
                )
            v.VBtn(
                "Take away",
                variant="text",
                size="small",
                v_if=("light_shown",),
                click="trigger('inside_off')",
                id="inside-off",
            )
            v.VProgressLinear(indeterminate=True, v_if=("light_busy",), color="primary")
            html.Div("{{ light_said }}", classes="quiet mt-2", id="light-said")
            with html.Div(v_if=("light_top",)):
                html.Div(classes="ramp", style=f"background: {_RAMP}")
                with html.Div(classes="ends quiet"):
                    html.Span("0")
                    html.Span("{{ light_top }}")
            with html.Div(v_if=("light_image",)):
                choice_field(v, "light_by", "Colour leaves by", ("light_colours",), classes="mt-2")
                html.Div("{{ light_pixels }}", classes="quiet mt-2", id="light-pixels")
                html.Img(
                    src=("light_image",),
                    alt="The stand seen from the light",
                    style="width: 100%; border-radius: 4px; margin-top: 6px; cursor: pointer; "
                    "image-rendering: pixelated;",
                    click=f"trigger('light_pick', [{_PLACE}])",
                    id="light-view",
                )

    def refresh(self) -> None:
        """Say whether the year's stand is known."""
        state = self._app.state
        if state.tab != "light":
            return
        self._say_pixels()
        try:
            state.light_year = self._app.source.stand_year(self._app.year)
            state.light_why_not = ""
        except InputError as error:
            state.light_why_not = str(error)

    async def _show(self, way: str) -> None:
        """Reckon it beside the page's other work, then put it into view."""
        app = self._app
        draw: Callable[[Stand], str] = {
            "slice": self._slice,
            "markers": self._markers,
            "sun": self._sun,
            "again": self._sun,
        }[way]
        app.state.update({"light_busy": True, "light_top": ""})
        if way != "again":
            app.state.light_image = ""
        app.state.light_said = "reckoning (the first time on a machine takes a minute)"
        app.state.flush()
        try:
            stand = await asyncio.to_thread(self._reckon, way)
            app.state.light_said = draw(stand)
            app.state.light_shown = "sun" if way == "again" else way
        except InputError as error:
            app.state.light_said = str(error)
        app.state.light_busy = False

    def _reckon(self, way: str) -> Stand:
        """Get the stand ready, and the light's view of it if that is wanted, beside the page."""
        stand = self._stand()
        if way in ("sun", "again"):
            self._picture += way == "sun"
            self._seen = view_from_light(stand, self._picture - 1, self._app.state.light_by)
        return stand

    def _stand(self) -> Stand:
        stand = self._app.source.stand_near(self._app.year)
        if self._exposed is None or self._exposed[0] is not stand:
            self._exposed = (stand, exposed(stand))
        return self._exposed[1]

    def _clear(self) -> None:
        state = self._app.state
        state.light_said, state.light_image, state.light_shown, state.light_top = "", "", "", ""
        self._app.show_inside(None)

    def _slice(self, stand: Stand) -> str:
        height = float(self._app.state.light_height)
        cut = light_slice(stand, height)
        self._app.show_inside(lambda plotter: _add_slice(plotter, cut))
        light = cut.light
        self._app.state.light_top = f"{_top(cut):.2f}"
        return (
            f"Relative light {cut.height_m:g} m above the ground, mean of sun and sky: "
            f"{light.min():.2f} to {light.max():.2f}, mean {light.mean():.2f}."
        )

    def _markers(self, stand: Stand) -> str:
        chosen = self._app.chosen
        if chosen is not None and chosen not in stand.rows.tree_id:
            chosen = None
        points, step = markers_around(stand, chosen)
        self._app.show_inside(lambda plotter: _add_markers(plotter, points))
        where = "the plot" if chosen is None else f"tree {chosen}"
        share = "" if step == 1 else f", one row of {step} drawn"
        return f"{len(points)} free markers around {where}{share}."

    def _sun(self, stand: Stand) -> str:
        from PIL import Image

        seen = self._seen
        assert seen is not None
        buffer = BytesIO()
        Image.fromarray(np.ascontiguousarray(seen.image)).save(buffer, "PNG")
        coded = base64.b64encode(buffer.getvalue()).decode("ascii")
        self._app.state.light_image = f"data:image/png;base64,{coded}"
        self._say_pixels()
        elevation = np.degrees(np.arcsin(seen.toward[2]))
        azimuth = np.degrees(np.arctan2(seen.toward[0], seen.toward[1])) % 360.0
        return (
            f"Light from {azimuth:.0f}° (north 0, east 90), {elevation:.0f}° high; "
            f"{100 * seen.share:.0f} % of the leaf area is lit. Wood is brown. "
            "Once more: another place of the light."
        )

    async def _colour_anew(self, **_: object) -> None:
        if self._seen is not None:
            with self._app.state:
                await self._show("again")

    def _pick(self, across: float, down: float) -> None:
        """Choose the tree that the light sees there."""
        if self._seen is None:
            return
        lines, columns = self._seen.tree_id.shape
        line = min(max(int(down * lines), 0), lines - 1)
        column = min(max(int(across * columns), 0), columns - 1)
        tree_id = int(self._seen.tree_id[line, column])
        self._app.choose(tree_id or None, card=False)

    def _say_pixels(self) -> None:
        """Say how many pixels the chosen tree has."""
        said = "Click a leaf: how much of its tree the light sees."
        chosen = self._app.chosen
        if self._seen is not None and chosen is not None:
            lit = self._seen.lit
            share = lit.get(chosen, 0) / max(sum(lit.values()), 1)
            said = f"Tree {chosen}: {lit.get(chosen, 0):,} lit pixels, {100 * share:.1f} % of all."
        self._app.state.light_pixels = said


def _top(cut: Slice) -> float:
    """Give the light of the scale's upper end: deep shade would be all black on 0 to 1."""
    return max(float(cut.light.max()), 0.02)


def _add_slice(plotter: Any, cut: Slice) -> None:
    pv = import_pyvista()
    ny, nx = cut.light.shape
    grid = pv.ImageData(
        dimensions=(nx + 1, ny + 1, 1),
        spacing=(cut.voxel_m, cut.voxel_m, 1.0),
        origin=(*cut.corner_m, cut.height_m),
    )
    grid.cell_data["light"] = cut.light.ravel()
    plotter.add_mesh(
        grid,
        scalars="light",
        cmap=_COLOURS,
        clim=(0.0, _top(cut)),
        lighting=False,
        show_scalar_bar=False,
        reset_camera=False,
        render=False,
    )


def _add_markers(plotter: Any, points: Any) -> None:
    if len(points):
        plotter.add_points(
            points.astype(np.float32),
            color="#b3471d",
            point_size=2.5,
            lighting=False,
            reset_camera=False,
            render=False,
        )
