"""The tool that starts fractures in the bark of a live tree."""

from __future__ import annotations

from forest.errors import InputError
from forest.viewer.live_tools import LiveTool
from forest.viewer.picking import Hit


class CrackTool(LiveTool):
    """Crack the bark by click, where it is shown."""

    name = "crack"
    label = "Crack"
    icon = "mdi-flash-outline"
    hint = "Choose a sample tree, show its bark (Tree, Shape), and click the bark of the stem."

    def click(self, hit: Hit) -> None:
        """Start a fracture where the bark is clicked; without bark choose the tree."""
        from forest.surface.bark.cracks import place_on_stem

        point = self.app.surfaces.bark_at(hit.ray)
        tree_id = self.app.chosen
        if point is None or tree_id is None:
            if hit.tree_id is None or hit.tree_id == tree_id:
                raise InputError("there is no bark", expected="a click on bark that is shown")
            self.app.choose(hit.tree_id)
            return
        shape = self.desk.source.skeleton(tree_id, self.desk.source.now)
        height, azimuth = place_on_stem(shape, point)
        self.desk.act(
            kind="crack",
            tree_id=tree_id,
            height_m=round(height, 3),
            azimuth_deg=round(azimuth, 1),
        )
