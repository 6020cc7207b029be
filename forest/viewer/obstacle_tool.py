"""The tool that puts up boxes, moves them and takes them away."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from forest.scenario.shaping import ChangeObstacle
from forest.view.bodies_scene import surface_of
from forest.viewer.desk import Desk
from forest.viewer.live_tools import LiveTool
from forest.viewer.picking import Hit, Ray
from forest.viewer.tool_options import as_number, number_field

if TYPE_CHECKING:
    from numpy.typing import NDArray

_UP = np.array([0.0, 0.0, 1.0])


def enters_box(ray: Ray, low: NDArray[np.float64], high: NDArray[np.float64]) -> float | None:
    """Give how far a ray goes until it meets a box, m; None if it misses it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack(((low - ray.origin) / ray.direction, (high - ray.origin) / ray.direction))
    near, far = np.nanmax(ends.min(axis=0)), np.nanmin(ends.max(axis=0))
    return float(near) if 0.0 < near <= far else None


class ObstacleTool(LiveTool):
    """Boxes by click and drag."""

    name = "obstacle"
    label = "Obstacle"
    icon = "mdi-wall"
    hint = "Click the ground to put up a box; drag one to move it."
    drags = True

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self.state.update({"box_width": 2.0, "box_depth": 0.3, "box_height": 2.0, "box_names": []})
        self._moved: str | None = None
        self._by = [0.0, 0.0, 0.0]
        desk.app.server.controller.trigger("remove_box")(
            lambda name: self.app.tried(lambda: self.desk.act(kind="obstacle", remove=str(name)))
        )

    def click(self, hit: Hit) -> None:
        """Put up a box where the line of sight meets the ground."""
        self._moved = None
        place = hit.ray.on_plane(np.zeros(3), _UP)
        if place is None or self._under(hit.ray) is not None:
            return
        width, depth, height = (
            as_number(self.state[f"box_{side}"], f"the {side}")
            for side in ("width", "depth", "height")
        )
        half = np.array([0.5 * width, 0.5 * depth, 0.0])
        low = [round(float(x), 3) for x in np.array([*place[:2], 0.0]) - half]
        high = [round(float(x), 3) for x in np.array([*place[:2], height]) + half]
        box = {"kind": "box", "name": self._new_name(), "min_m": low, "max_m": high}
        self.desk.act(kind="obstacle", add=box)

    def drag(self, start: Hit, now: Hit, *, done: bool) -> None:
        """Move the box that was met along the ground."""
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

    def _new_name(self) -> str:
        acts = self.desk.source.scenario.acts
        names = {each.name for each in self.desk.source.obstacles}
        names |= {act.target for act in acts if isinstance(act, ChangeObstacle)}
        number = 1
        while f"box {number}" in names:
            number += 1
        return f"box {number}"

    def build(self, v: Any, html: Any) -> None:
        """Make fields for the sizes, and a list of what stands."""
        for side, label in (("width", "Along x"), ("depth", "Along y"), ("height", "Height")):
            number_field(v, f"box_{side}", f"{label}, m", min=0.01, step=0.1)
        with html.Div(v_for="each in box_names", key="each", classes="d-flex align-center"):
            html.Span("{{ each }}", style="flex: 1; font-size: 13px;")
            v.VBtn(
                icon="mdi-delete-outline",
                size="x-small",
                variant="text",
                title="Take away",
                click="trigger('remove_box', [each])",
            )

    def refresh(self) -> None:
        """List the obstacles that have names."""
        self.state.box_names = [each.name for each in self.desk.source.obstacles if each.name]
