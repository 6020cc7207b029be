"""A live stand in the viewer: its desk, its tools, its panel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from forest.viewer.bark_tool import CrackTool
from forest.viewer.branch_tools import BendTool, PruneTool
from forest.viewer.brush_tool import BrushTool
from forest.viewer.desk import Desk
from forest.viewer.fell_tool import FellTool
from forest.viewer.live_tools import LiveTool, MarkTool, PlantTool
from forest.viewer.obstacle_tool import ObstacleTool
from forest.viewer.work_panel import WorkPanel

if TYPE_CHECKING:
    from forest.viewer.app import App

_TOOLS = (
    *(FellTool, MarkTool, PruneTool, BendTool, CrackTool),
    *(PlantTool, ObstacleTool, BrushTool),
)


class LivePart:
    """What the app of a live stand has beside that of a run file.

    Attributes
    ----------
    desk : Desk
        Of the app, once `panel` has been called with it.
    """

    desk: Desk

    def panel(self, app: App) -> WorkPanel:
        """Give an app its desk, its tools and their panel."""
        self.desk = Desk(app)
        tools: tuple[LiveTool, ...] = tuple(make(self.desk) for make in _TOOLS)
        for tool in tools:
            app.add_tool(tool)
        app.state.tab = "work"

        def take(**_: object) -> None:
            for tool in tools:
                tool.put_down()
                if tool.name == app.state.tool:
                    app.state.tab = "work"
                    if tool.on_branches and not app.state.branches:
                        app.state.branches = True
            app.push()

        def come_near(**_: object) -> None:
            if app.chosen is None or not self.desk.source.come_near(app.chosen):
                return
            app.state.branches_known = True
            app.soon(app.come_closer)

        def lay_down() -> None:
            for tool in tools:
                tool.put_down()

        self.desk.changed.append(lay_down)
        app.state.change("tool")(take)
        app.state.change("chosen")(come_near)
        self.desk.draw()
        return WorkPanel(self.desk, tools)
