"""The procedural brush by hand (Palubicki et al. 2009, section 5): strokes that lay markers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.view.working_plane import WorkingPlane
from forest.viewer.branch_tools import BranchTool
from forest.viewer.desk import Desk
from forest.viewer.drawing import draw_brush
from forest.viewer.fields import as_number, choice_field, choices, number_field, switch
from forest.viewer.picking import Hit

_COLOUR = "#b3471d"
_WHEEL = 1.12  # by how much a notch of the wheel changes the radius
_LEAST_M, _MOST_M = 0.02, 50.0
_STEP = 0.3  # of the radius, between two points of the path
_NO_PEN = 0.5  # what browsers say of a mouse's button
_SYMMETRIES = {
    "none": "None",
    "mirror": "Mirror",
    "rotation": "All round",
    "tiling": "In a row",
}


class BrushTool(BranchTool):
    """Strokes by drag, in a plane parallel to the screen: through the metamer where they begin.

    A stroke that begins at none lies in the plane of the chosen tree's foot, or else of the ground
    where it begins.
    """

    name = "brush"
    label = "Brush"
    icon = "mdi-brush"
    hint = (
        "Draw from a branch or from the ground: shoots will follow. "
        "The wheel changes the radius; Alt and a drag turn the view."
    )
    drags = wheels = True

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        spec = desk.source.scenario.environment.markers
        self._has_markers = spec is not None
        self.state.update(
            {
                "brush_radius": 0.5,
                "brush_spacing": spec.spacing_m if spec is not None else 0.1,
                "brush_steps": 1,
                "brush_hold": 0,
                "brush_alone": False,
                "brush_symmetry": "none",
                "brush_azimuth": 0,
                "brush_times": 4,
                "brush_shift_x": 2,
                "brush_shift_y": 0,
                "brush_copies": 3,
                "brush_strokes": [],
            }
        )
        self._plane: WorkingPlane | None = None
        self._from: tuple[int, int] | None = None
        self._centre = np.zeros(3)
        self._path: list[list[float]] = []
        self._radius: list[float] = []

    def wheel(self, turns: float) -> None:
        """Change the radius."""
        radius = as_number(self.state.brush_radius, "the radius")
        radius *= _WHEEL if turns < 0 else 1.0 / _WHEEL
        self.state.brush_radius = round(min(max(radius, _LEAST_M), _MOST_M), 3)

    def click(self, hit: Hit) -> None:
        """A stroke of one point."""
        self.drag(hit, hit._replace(), done=True)

    def drag(self, start: Hit, now: Hit, *, done: bool) -> None:
        """Follow the pointer; at the end lay the stroke."""
        if now is start:
            self._begin(start)
            return
        if self._plane is None:
            return
        place = self._plane.meet(now.ray.origin, now.ray.direction)
        pressure = _NO_PEN if done or now.pressure <= 0.0 else now.pressure
        radius = as_number(self.state.brush_radius, "the radius") * pressure / _NO_PEN
        point = [round(float(x), 4) for x in place]
        far = not self._path or float(np.linalg.norm(place - self._path[-1])) >= _STEP * radius
        if far and np.isfinite(place).all():
            self._path.append(point)
            self._radius.append(round(max(radius, _LEAST_M), 4))
        if not done:
            self.app.soon(self._draw_stroke)
            return
        keys = self._stroke()
        self.put_down()
        self.desk.act(**keys)

    def _begin(self, start: Hit) -> None:
        self.put_down()
        if not self._has_markers:
            raise InputError(
                "no bud perceives markers", expected="a scenario with a table environment.markers"
            )
        looks = self.app.stage.looks
        met = self.met(start)
        if met is not None:
            shape, serial = met
            self._plane = WorkingPlane.at(shape, serial, looks)
            self._from, self._centre = (shape.tree_id, serial), shape.start[0]
        elif start.tree_id is None:
            self._centre = self._foot(start)
            self._plane, self._from = WorkingPlane(self._centre, looks), None

    def _foot(self, start: Hit) -> NDArray[np.float64]:
        """Where the plane of a stroke lies that begins at no branch.

        The foot of the chosen tree; else the ground under the pointer, or the middle of the plot.
        """
        trees = self.desk.source.living
        chosen = trees[trees["tree_id"].to_numpy() == self.app.chosen]
        if len(chosen):
            return np.array([float(chosen["x_m"].iloc[0]), float(chosen["y_m"].iloc[0]), 0.0])
        if start.point_m is not None:
            return start.point_m
        width, depth = self.desk.source.scenario.plot.size_m
        return np.array([0.5 * width, 0.5 * depth, 0.0])

    def _stroke(self) -> dict[str, Any]:
        """Give the act of the stroke that was drawn."""
        state = self.state
        same = len(set(self._radius)) == 1
        keys: dict[str, Any] = {
            "kind": "stroke",
            "points_m": self._path,
            "radius_m": self._radius[:1] if same else self._radius,
            "spacing_m": as_number(state.brush_spacing, "the spacing"),
            "steps": int(as_number(state.brush_steps, "the number of years")),
        }
        if self._from is not None:
            keys["tree_id"], keys["from_metamer"] = self._from
            if state.brush_alone:
                keys["metamer"] = keys["from_metamer"]
                keys["hold_steps"] = int(as_number(state.brush_hold, "the number of years"))
        x, y = (round(float(each), 4) for each in self._centre[:2])
        if state.brush_symmetry == "mirror":
            azimuth = as_number(state.brush_azimuth, "the azimuth")
            keys["mirror"] = {"x_m": x, "y_m": y, "normal_deg": azimuth}
        elif state.brush_symmetry == "rotation":
            times = int(as_number(state.brush_times, "the number of turns"))
            keys["rotation"] = {"x_m": x, "y_m": y, "times": times}
        elif state.brush_symmetry == "tiling":
            shift = [as_number(state[f"brush_shift_{axis}"], "the shift") for axis in "xy"]
            copies = int(as_number(state.brush_copies, "the number of copies"))
            keys["tiling"] = {"shifts_m": [[*shift, 0.0]], "counts": [copies]}
        return keys

    def _draw_stroke(self) -> None:
        if self._path:
            path, radius = np.array(self._path), np.array(self._radius)
            draw_brush(self.app.stage, "stroke", path, radius, _COLOUR)
            self.app.push()

    def put_down(self) -> None:
        """Let no stroke be drawn."""
        self._plane, self._path, self._radius = None, [], []
        self.app.stage.put("stroke", None)

    def build(self, v: Any, html: Any) -> None:
        """Make fields for the brush and its symmetry."""
        html.Div(
            "The scenario has no markers (environment.markers): a brush does nothing.",
            classes="quiet mb-3",
            v_if=(str(not self._has_markers).lower(),),
        )
        number_field(v, "brush_radius", "Radius, m", min=_LEAST_M, step=0.05)
        number_field(v, "brush_spacing", "Between markers, m", min=0.005, step=0.01)
        number_field(v, "brush_steps", "Years in which it moves", min=1)
        switch(v, "brush_alone", "Only the bud where it begins grows")
        with html.Div(v_if=("brush_alone",)):
            number_field(v, "brush_hold", "and so many years longer", min=0)
        choice_field(v, "brush_symmetry", "Symmetry", ("brush_symmetries", choices(_SYMMETRIES)))
        with html.Div(v_if=("brush_symmetry === 'mirror'",)):
            number_field(v, "brush_azimuth", "Across the mirror, ° from x", step=15)
        with html.Div(v_if=("brush_symmetry === 'rotation'",)):
            number_field(v, "brush_times", "Times", min=2)
        with html.Div(v_if=("brush_symmetry === 'tiling'",)):
            number_field(v, "brush_shift_x", "Shift along x, m", step=0.5)
            number_field(v, "brush_shift_y", "Shift along y, m", step=0.5)
            number_field(v, "brush_copies", "Copies", min=1)
        with html.Div(v_for="each in brush_strokes", key="each", classes="quiet"):
            html.Span("{{ each }}")

    def refresh(self) -> None:
        """Say how much of each stroke is colonised."""
        said = []
        for row in self.desk.source.strokes.itertuples():
            taken = f"{row.laid} markers, {row.colonised} colonised"
            said.append(f"Stroke {row.stroke} of {row.year}: {taken}")
        self.state.brush_strokes = said
