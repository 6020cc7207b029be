"""Tools that work on branches of a live stand: prune and bend."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.trees.skeleton import Skeleton
from forest.view.working_plane import WorkingPlane
from forest.viewer.desk import Desk
from forest.viewer.drawing import draw_segments
from forest.viewer.live_tools import LiveTool
from forest.viewer.picking import Hit

_LIT = "#f0900f"


def branch_of(shape: Skeleton, serial: int) -> NDArray[np.bool_]:
    """Tell which metamers of a tree a metamer carries, itself among them."""
    held = shape.serial == serial
    for k, parent in enumerate(shape.parent):  # parents stand before their children
        if parent >= 0 and held[parent]:
            held[k] = True
    return np.asarray(held, np.bool_)


class BranchTool(LiveTool):
    """What prune, bend and brush share: a metamer that was met, on a tree shown with branches."""

    on_branches = True

    def met(self, hit: Hit) -> tuple[Skeleton, int] | None:
        """Give the tree and the metamer; a tree that shows no branches shows them from now on."""
        if hit.tree_id is None:
            return None
        if hit.serial is None:
            self.app.choose(hit.tree_id)
            self.state.tab = "work"
            return None
        return self.desk.source.skeleton(hit.tree_id, self.desk.source.now), hit.serial


class PruneTool(BranchTool):
    """Prune by click."""

    name = "prune"
    label = "Prune"
    icon = "mdi-content-cut"
    hint = "Click a branch: it lights up. Click it again to cut it there."

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self._lit: tuple[int, int] | None = None
        self.state.update({"prune_lit": "", "prune_said": ""})
        self.app.server.controller.trigger("prune_lit")(lambda: self.app.tried(self._cut))

    def click(self, hit: Hit) -> None:
        """Light a branch; cut it if it is lit."""
        met = self.met(hit)
        if met is None:
            self.put_down()
            self.app.push()
            return
        shape, serial = met
        if self._lit is not None and self._lit[0] == shape.tree_id:
            lit = branch_of(shape, self._lit[1])
            if lit[shape.serial == serial].any():
                self._cut()
                return
        self._light(shape, serial)

    def _light(self, shape: Skeleton, serial: int) -> None:
        self._lit = (shape.tree_id, serial)
        held = branch_of(shape, serial)
        self.state.prune_lit = (
            f"Tree {shape.tree_id}, metamer {serial}: {int(held.sum())} metamers would go."
        )
        draw_segments(self.app.stage, "lit", shape.start[held], shape.end[held], _LIT, 5)
        self.app.push()

    def _cut(self) -> None:
        if self._lit is None:
            return
        tree_id, serial = self._lit
        self.put_down()
        self.desk.act(kind="prune", tree_id=tree_id, metamer=serial)

    def put_down(self) -> None:
        """Let nothing be lit."""
        self._lit, self.state.prune_lit = None, ""
        self.app.stage.put("lit", None)

    def build(self, v: Any, html: Any) -> None:
        """Say what is lit."""
        with html.Div(v_if=("prune_lit",)):
            html.Div("{{ prune_lit }}", id="prune-lit")
            v.VBtn(
                "Cut it", variant="tonal", size="small", click="trigger('prune_lit')", id="cut-it"
            )


class BendTool(BranchTool):
    """Bend by drag."""

    name = "bend"
    label = "Bend"
    icon = "mdi-vector-curve"
    hint = "Drag a branch to where it shall go. Alt and a drag turn the view."
    drags = True

    def __init__(self, desk: Desk) -> None:
        super().__init__(desk)
        self._held: tuple[int, int, WorkingPlane] | None = None
        self._to: list[float] = []

    def click(self, hit: Hit) -> None:
        """A drag that went nowhere bends nothing."""
        self.put_down()
        self.app.push()

    def drag(self, start: Hit, now: Hit, *, done: bool) -> None:
        """Follow the pointer in the plane of the metamer, parallel to the screen."""
        if now is start:
            met = self.met(start)
            self._held = None
            if met is not None:
                plane = WorkingPlane.at(*met, self.app.stage.looks)
                self._held = (met[0].tree_id, met[1], plane)
            return
        if self._held is None:
            return
        tree_id, serial, plane = self._held
        self._to = [round(float(x), 4) for x in plane.meet(now.ray.origin, now.ray.direction)]
        if not done:
            self.app.soon(self._draw_bent)
            return
        to = self._to
        self.put_down()
        self.desk.act(kind="bend", tree_id=tree_id, metamer=serial, to_m=to)

    def _draw_bent(self) -> None:
        if self._held is None:
            return
        tree_id, serial, _ = self._held
        try:
            with self.desk.source.at_rest() as session:
                shape = session.bent(tree_id, serial, self._to)
        except InputError as error:
            self.state.tool_hint = str(error)
            return
        self.state.tool_hint = self.hint
        before = self.desk.source.skeleton(tree_id, self.desk.source.now)
        moved = np.any(shape.end != before.end, axis=1)
        draw_segments(self.app.stage, "lit", shape.start[moved], shape.end[moved], _LIT, 4)
        self.app.push()

    def put_down(self) -> None:
        """Let nothing be held."""
        self._held = None
        self.app.stage.put("lit", None)
