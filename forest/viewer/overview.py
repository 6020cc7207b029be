"""The stand beside the view: its numbers over the years, and what happened in this one."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from forest.view.looks import look_of
from forest.viewer.charts import line_chart, share_chart, year_at
from forest.viewer.colours import css, species_label

if TYPE_CHECKING:
    from forest.viewer.app import App

_INK = "#3f6b4b"
_CHARTS = (
    ("n_ha", "Trees N, 1/ha", 0),
    ("basal_area_m2ha", "Basal area G, m²/ha", 1),
    ("qmd_cm", "Quadratic mean diameter Dq, cm", 1),
)
_KINDS = {
    "planted": "planted",
    "recruited": "recruited",
    "died": "died",
    "felled": "felled",
    "windthrown": "thrown by wind",
    "pruned": "pruned",
}


class StandPanel:
    """Charts of the stand, and the year's events."""

    title = "Stand"
    icon = "mdi-chart-line"

    def __init__(self, app: App) -> None:
        self._app = app
        app.state.stand_html = ""
        app.server.controller.trigger("chart_year")(self._go)

    def build(self) -> None:
        """Make its widgets."""
        from trame.widgets import html

        html.Div(
            v_html=("stand_html",),
            id="stand-html",
            raw_attrs=[
                "@click=\"$event.target.closest('svg') && trigger('chart_year', "
                "[($event.clientX - $event.target.closest('svg').getBoundingClientRect().left) "
                "/ $event.target.closest('svg').getBoundingClientRect().width])\""
            ],
        )

    def refresh(self) -> None:
        """Draw it for the year that is shown."""
        app = self._app
        stand, year = app.source.stand, app.year
        if not len(stand):
            app.state.stand_html = '<div class="quiet">No year is grown yet.</div>'
            return
        kind = stand["species"].astype(str)
        whole = stand[kind == "all"]
        years = [int(each) for each in whole["year"]]
        now = whole[whole["year"] == year]
        parts = []
        for column, title, decimals in _CHARTS:
            value = float(now[column].iloc[0]) if len(now) else float("nan")
            small = 0.0 < value < 0.5 * 10.0**-decimals  # else it would be said to be none
            said = f"{value:.{1 if small else decimals}{'g' if small else 'f'}}"
            said = said if np.isfinite(value) else "–"
            chart = line_chart(years, {title: (whole[column], _INK)}, year, title)
            parts.append(f"<h3>{title} <span class='quiet'>{year}: {said}</span></h3>{chart}")
        shares = {}
        for name in (species.name for species in app.source.scenario.species_list):
            rows = stand[kind == name].set_index("year")["basal_area_m2ha"]
            shares[species_label(name)] = (rows.reindex(years), css(look_of(name).line))
        if len(shares) > 1:
            title = "Shares of basal area, %"
            parts.append(f"<h3>{title}</h3>{share_chart(years, shares, year, title)}")
            keys = (
                '<span style="white-space: nowrap"><span class="swatch" '
                f'style="background:{colour}"></span>{escape(name)}</span>&ensp; '
                for name, (_, colour) in shares.items()
            )
            parts.append(f'<div class="quiet">{"".join(keys)}</div>')
        parts.append(f"<h3>In {year}</h3>{self._events(year)}")
        app.state.stand_html = "".join(parts)

    def _events(self, year: int) -> str:
        events = self._app.source.events
        events = events[events["year"] == year]
        if not len(events):
            return '<div class="quiet">Nothing came or went.</div>'
        kinds, causes = events["kind"].astype(str), events["cause"].astype(str)
        rows = []
        for (kind, cause), group in events.groupby([kinds, causes], sort=False):
            why = "" if cause == "none" else f", {cause.replace('_', ' ')}"
            said = escape(_KINDS.get(str(kind), str(kind)) + why)
            rows.append(f"<tr><td>{said}</td><td>{len(group)}</td></tr>")
        return f"<table>{''.join(rows)}</table>"

    def _go(self, share: Any) -> None:
        years = self._app.source.years
        self._app.state.step = years.index(year_at(float(share), years))
