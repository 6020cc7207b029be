"""The map of the stand: crowns and stems from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from forest.viewer.colours import css

if TYPE_CHECKING:
    from forest.viewer.app import App

_MARGIN = 0.03  # of the longer side
_CHOSEN = "rgb(230,130,10)"


class PlanPanel:
    """A map with crowns; a click chooses the tree."""

    title = "Map"
    icon = "mdi-map-outline"

    def __init__(self, app: App) -> None:
        self._app = app
        app.state.plan_html = ""
        app.server.controller.trigger("plan_click")(self._click)

    def build(self) -> None:
        """Make its widgets."""
        from trame.widgets import html

        html.Div(
            v_html=("plan_html",),
            id="plan",
            style="cursor: pointer;",
            raw_attrs=[
                "@click=\"$event.target.closest('svg') && trigger('plan_click', "
                "[($event.clientX - $event.target.closest('svg').getBoundingClientRect().left) "
                "/ $event.target.closest('svg').getBoundingClientRect().width, "
                "($event.clientY - $event.target.closest('svg').getBoundingClientRect().top) "
                "/ $event.target.closest('svg').getBoundingClientRect().height])\""
            ],
        )
        html.Div(
            "Crowns and stems; x to the right, y upwards. Stems are drawn three times as thick.",
            classes="quiet mt-2",
        )

    def refresh(self) -> None:
        """Draw the map, if it is seen."""
        if self._app.state.tab == "map":
            self._app.state.plan_html = self._drawn()

    def _drawn(self) -> str:
        app = self._app
        width, depth = app.source.scenario.plot.size_m
        margin = _MARGIN * max(width, depth)
        trees = app.trees
        x, y = trees["x_m"].to_numpy(float), depth - trees["y_m"].to_numpy(float)
        crown = np.nan_to_num(trees["crown_radius_m"].to_numpy(float))
        stem = 1.5 * np.nan_to_num(0.01 * trees["base_diameter_cm"].to_numpy(float))
        least = 0.002 * max(width, depth)
        ids = trees["tree_id"].to_numpy()
        line = 0.0015 * max(width, depth)
        parts = [
            f'<svg viewBox="{-margin:.2f} {-margin:.2f} {width + 2 * margin:.2f} '
            f'{depth + 2 * margin:.2f}" role="img" aria-label="Map of the stand">'
            f'<rect width="{width}" height="{depth}" fill="#f3f0e6" stroke="#b9b39f" '
            f'stroke-width="{line:.3f}"/>'
        ]
        order = np.argsort(trees["height_m"].to_numpy(float), kind="stable")
        for k in order:
            parts.append(
                f'<circle cx="{x[k]:.2f}" cy="{y[k]:.2f}" r="{crown[k]:.2f}" '
                f'fill="{css(app.colours[k])}" fill-opacity=".55"/>'
            )
        stems = (
            f'<circle cx="{x[k]:.2f}" cy="{y[k]:.2f}" r="{max(stem[k], least):.2f}"/>'
            for k in order
        )
        parts.append(f'<g fill="#4a3a2a">{"".join(stems)}</g>')
        for k in np.flatnonzero(ids == app.chosen):
            parts.append(
                f'<circle cx="{x[k]:.2f}" cy="{y[k]:.2f}" r="{max(crown[k], 4 * least):.2f}" '
                f'fill="none" stroke="{_CHOSEN}" stroke-width="{4 * line:.3f}"/>'
            )
        step = 10.0 if max(width, depth) >= 20.0 else 1.0
        parts.append(
            f'<path d="M0 {depth + 0.5 * margin:.2f} h{step}" stroke="#5d675f" '
            f'stroke-width="{3 * line:.3f}"/><text x="{step + 0.4 * margin:.2f}" '
            f'y="{depth + 0.8 * margin:.2f}" font-size="{margin:.2f}" fill="#5d675f">'
            f"{step:g} m</text></svg>"
        )
        return "".join(parts)

    def _click(self, across: float, down: float) -> None:
        """Choose the highest tree whose crown is there, else the nearest stem close by."""
        app = self._app
        width, depth = app.source.scenario.plot.size_m
        margin = _MARGIN * max(width, depth)
        x = across * (width + 2 * margin) - margin
        y = depth + margin - down * (depth + 2 * margin)
        trees = app.trees
        away = np.hypot(trees["x_m"].to_numpy(float) - x, trees["y_m"].to_numpy(float) - y)
        crown = np.nan_to_num(trees["crown_radius_m"].to_numpy(float))
        height = np.nan_to_num(trees["height_m"].to_numpy(float))
        under = np.flatnonzero(away <= np.maximum(crown, 0.01 * max(width, depth)))
        if not len(under):
            app.choose(None)
            return
        # A stem that is clicked on is meant, whatever crown spreads above it.
        near = under[away[under] <= 0.008 * max(width, depth)]
        row = near[np.argmin(away[near])] if len(near) else under[np.argmax(height[under])]
        app.choose(int(trees["tree_id"].iloc[row]), card=False)
