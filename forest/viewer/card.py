"""The card of the chosen tree: its numbers, its curves, its rings."""

from __future__ import annotations

import base64
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from forest.errors import InputError
from forest.viewer.charts import line_chart
from forest.viewer.colours import fates, species_label
from forest.viewer.fields import number_field, switch, text_field

if TYPE_CHECKING:
    import pandas as pd

    from forest.viewer.app import App

# Column, label, unit, decimals.
_NUMBERS = (
    ("dbh_cm", "Diameter dbh", "cm", 1),
    ("height_m", "Height", "m", 1),
    ("crown_base_m", "Crown base", "m", 1),
    ("crown_radius_m", "Crown radius", "m", 2),
    ("age", "Age", "years", 0),
    ("light", "Relative light", "", 2),
    ("ring_width_mm", "Ring at 1.3 m", "mm", 2),
    ("stem_volume_m3", "Stem volume", "m³", 3),
    ("leaf_area_m2", "Leaf area", "m²", 1),
    ("biomass_kg", "Biomass, dry", "kg", 1),
    ("lean_deg", "Lean", "°", 1),
    ("buds", "Living sites", "", 0),
)


class TreeCard:
    """What is known of one tree."""

    title = "Tree"
    icon = "mdi-tree"

    def __init__(self, app: App) -> None:
        self._app = app
        app.state.update(
            {
                "card_html": "",
                "find": "",
                "disc_height": 1.3,
                "disc_image": "",
                "disc_said": "",
            }
        )
        app.server.controller.trigger("find")(self._find)
        app.server.controller.trigger("disc")(self._cut)

    def build(self) -> None:
        """Make its widgets."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        with html.Div(classes="d-flex align-center mb-3"):
            go = "trigger('find', [find])"
            text_field(v, "find", "Find a tree by its number", enter=go)
            v.VBtn("Find", variant="text", click=go, id="find-button")
        html.Div(
            "Click a tree in the view or on the map.", v_if=("chosen === null",), classes="quiet"
        )
        with html.Div(v_if=("chosen !== null",)):
            switch(v, "alone", "Show this tree alone")
            self._app.surfaces.build()
            html.Div(v_html=("card_html",), id="card")
            html.H3("Disc")
            with html.Div(classes="d-flex align-center"):
                go, label = "trigger('disc')", "Height above the ground, m"
                number_field(v, "disc_height", label, enter=go, step=0.1, min=0, classes="")
                v.VBtn("Cut", variant="text", click=go, id="cut")
            html.Div("{{ disc_said }}", classes="quiet mt-1")
            html.Img(
                v_if=("disc_image",),
                src=("disc_image",),
                alt="The disc with its rings",
                style="width: 100%;",
                id="disc",
            )

    def refresh(self) -> None:
        """Write the card of the chosen tree in the year that is shown."""
        app = self._app
        app.state.disc_image, app.state.disc_said = "", ""
        app.surfaces.refresh()
        if app.chosen is None:
            app.state.card_html = ""
            return
        rows = app.trees[app.trees["tree_id"].to_numpy() == app.chosen]
        parts = [self._heading(rows)]
        if len(rows):
            parts.append(self._numbers(rows))
        parts.append(self._curves())
        app.state.card_html = "".join(parts)

    def _heading(self, rows: pd.DataFrame) -> str:
        app = self._app
        if len(rows):
            name = species_label(str(rows["species"].iloc[0]))
            said = "lives" if str(rows["status"].iloc[0]) == "living" else "died this year"
        else:
            name, said = "", f"is not in the stand at the end of {app.year}"
        fate = fates(app.source).get(app.chosen or 0)
        later = f"; it goes by {escape(fate.replace('_', ' '))}" if fate else ""
        return (
            f"<h3 id='card-title'>Tree {app.chosen} &middot; {escape(name)}</h3>"
            f"<div class='quiet mb-2'>{said}{later}</div>"
        )

    def _numbers(self, rows: pd.DataFrame) -> str:
        cells = []
        for column, label, unit, decimals in _NUMBERS:
            value = float(rows[column].iloc[0])
            said = f"{value:.{decimals}f} {unit}" if np.isfinite(value) else "–"
            cells.append(f"<tr><td>{label}</td><td data-column='{column}'>{said}</td></tr>")
        return f"<table>{''.join(cells)}</table>"

    def _curves(self) -> str:
        app = self._app
        life = app.source.life(app.chosen or 0).set_index("year")
        if not len(life):
            return ""
        years = list(app.source.years)
        parts = []
        for column, title, colour in (
            ("dbh_cm", "Diameter, cm", "#8a5a2b"),
            ("height_m", "Height, m", "#3f6b4b"),
        ):
            chart = line_chart(
                years, {title: (life[column].reindex(years), colour)}, app.year, title
            )
            parts.append(f"<h3>{title}</h3>{chart}")
        return "".join(parts)

    def _find(self, words: Any) -> None:
        app = self._app
        try:
            tree_id = int(str(words).strip())
        except ValueError:
            app.warn(f"{words!r} is no tree's number")
            return
        life = app.source.life(tree_id)
        if not len(life):
            app.warn(f"there is no tree {tree_id} in {app.source.where}")
            return
        if app.year not in set(life["year"]):
            first, last = int(life["year"].min()), int(life["year"].max())
            app.warn(f"tree {tree_id} lived from {first} to {last}")
        app.choose(tree_id)

    def _cut(self) -> None:
        """Cut the disc that is asked for and show it."""
        from forest.view.disc_picture import draw_disc

        app = self._app
        app.state.disc_image = ""
        if app.chosen is None:
            return
        try:
            height = float(app.state.disc_height)
            disc = app.source.disc(app.chosen, height, app.year)
        except InputError as error:
            app.state.disc_said = str(error)
            return
        except (TypeError, ValueError):
            app.state.disc_said = "the height is no number"
            return
        picture = BytesIO()
        groups = {species.name: species.group for species in app.source.scenario.species_list}
        draw_disc(disc, picture, conifer=groups[disc.species] == "conifer")
        coded = base64.b64encode(picture.getvalue()).decode("ascii")
        app.state.disc_image = f"data:image/png;base64,{coded}"
        app.state.disc_said = f"{len(disc.years)} rings, {disc.years[0]} to {disc.years[-1]}"
