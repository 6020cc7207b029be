"""The tool that puts up boxes and meshes, moves them and takes them away."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from forest.errors import InputError
from forest.scenario.files import MESH_SUFFIXES
from forest.scenario.shaping import ChangeObstacle
from forest.view.bodies_scene import surface_of
from forest.viewer.desk import Desk
from forest.viewer.fields import as_number, choice_field, choices, number_field, text_field
from forest.viewer.live_tools import LiveTool
from forest.viewer.picking import Hit, Ray

if TYPE_CHECKING:
    from numpy.typing import NDArray

_KINDS = {"box": "A box", "mesh": "A mesh"}
_UP = np.array([0.0, 0.0, 1.0])


def enters_box(ray: Ray, low: NDArray[np.float64], high: NDArray[np.float64]) -> float | None:
    """Give how far a ray goes until it meets a box, m; None if it misses it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack(((low - ray.origin) / ray.direction, (high - ray.origin) / ray.direction))
    near, far = np.nanmax(ends.min(axis=0)), np.nanmin(ends.max(axis=0))
    return float(near) if 0.0 < near <= far else None


class ObstacleTool(LiveTool):
    """Obstacles by click and drag."""

    name = "obstacle"
    label = "Obstacle"
    icon = "mdi-wall"
    hint = "Click the ground to put up an obstacle; drag one to move it."
    drags = True

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.state.update(
            {
                "obstacle_kind": "box",
                "box_width": 2.0,
                "box_depth": 0.3,
                "box_height": 2.0,
                "mesh_file": "",
                "obstacle_names": [],
            }
        )
        self._moved: str | None = None
        self._by = [0.0, 0.0, 0.0]
        desk.app.server.controller.trigger("remove_obstacle")(
            lambda name: self.app.tried(lambda: self.desk.act(kind="obstacle", remove=str(name)))
        )

    def click(self, hit: Hit) -> None:
        """Put up a box or a mesh where the line of sight meets the ground."""
        self._moved = None
        place = hit.ray.on_plane(np.zeros(3), _UP)
        if place is None or self._under(hit.ray) is not None:
            return
        new = self._mesh_at(place) if self.state.obstacle_kind == "mesh" else self._box_at(place)
        self.desk.act(kind="obstacle", add=new)

    def _box_at(self, place: NDArray[np.float64]) -> dict[str, Any]:
        width, depth, height = (
            as_number(self.state[f"box_{side}"], f"the {side}")
            for side in ("width", "depth", "height")
        )
        half = np.array([0.5 * width, 0.5 * depth, 0.0])
        low = [round(float(x), 3) for x in np.array([*place[:2], 0.0]) - half]
        high = [round(float(x), 3) for x in np.array([*place[:2], height]) + half]
        return {"kind": "box", "name": self._new_name("box"), "min_m": low, "max_m": high}

    def _mesh_at(self, place: NDArray[np.float64]) -> dict[str, Any]:
        file = str(self.state.mesh_file).strip()
        if not file:
            raise InputError("no mesh is named", expected="the path of its file")
        at = [*(round(float(x), 3) for x in place[:2]), 0.0]
        return {"kind": "mesh", "name": self._new_name("mesh"), "file": file, "at_m": at}

    def drag(self, start: Hit, now: Hit, *, done: bool) -> None:
        """Move the obstacle that was met along the ground."""
        if now is start:
            self._moved = self._under(start.ray)
            return
        here, there = (hit.ray.on_plane(np.zeros(3), _UP) for hit in (start, now))
        if self._moved is None or here is None or there is None:
            return
        self._by = [round(float(there[k] - here[k]), 3) for k in (0, 1)] + [0.0]
        name = self._moved
        if not done:
            self.app.soon(self._draw_moved)
            return
        self._moved = None
        try:
            self.desk.act(kind="obstacle", move=name, by_m=self._by)
        finally:
            self.desk.draw()
            self.app.push()

    def _draw_moved(self) -> None:
        if self._moved is not None:
            self.desk.draw({self._moved: self._by})
            self.app.push()

    def _under(self, ray: Ray) -> str | None:
        """Name the first obstacle with a name whose bounding box a ray meets."""
        found = []
        for each in self.desk.source.obstacles:
            low, high = np.array(surface_of(each).bounds).reshape(3, 2).T
            way = enters_box(ray, low, high)
            if way is not None and each.name:
                found.append((way, each.name))
        return min(found)[1] if found else None

    def _new_name(self, kind: str) -> str:
        acts = self.desk.source.scenario.acts
        names = {each.name for each in self.desk.source.obstacles}
        names |= {act.target for act in acts if isinstance(act, ChangeObstacle)}
        number = 1
        while f"{kind} {number}" in names:
            number += 1
        return f"{kind} {number}"

    def build(self, v: Any, html: Any) -> None:
        """Make fields for the sizes, and a list of what stands."""
        choice_field(v, "obstacle_kind", "Put up", ("obstacle_kinds", choices(_KINDS)))
        with html.Div(v_if=("obstacle_kind === 'box'",)):
            for side, label in (("width", "Along x"), ("depth", "Along y"), ("height", "Height")):
                number_field(v, f"box_{side}", f"{label}, m", min=0.01, step=0.1)
        with html.Div(v_if=("obstacle_kind === 'mesh'",)):
            text_field(v, "mesh_file", "Its file on this machine", classes="mb-1")
            kinds = ", ".join(MESH_SUFFIXES)
            html.Div(f"A closed surface in m ({kinds}); its origin is put there.", classes="quiet")
        with html.Div(v_for="each in obstacle_names", key="each", classes="d-flex align-center"):
            html.Span("{{ each }}", style="flex: 1; font-size: 13px;")
            v.VBtn(
                icon="mdi-delete-outline",
                size="x-small",
                variant="text",
                title="Take away",
                click="trigger('remove_obstacle', [each])",
            )

    def refresh(self) -> None:
        """List the obstacles that have names."""
        self.state.obstacle_names = [each.name for each in self.desk.source.obstacles if each.name]
