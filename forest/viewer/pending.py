"""What waits for the next year, drawn into the view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.colors import to_rgb

from forest.view.bodies_scene import surface_of
from forest.viewer.drawing import draw_points, draw_rings, draw_surfaces
from forest.viewer.live_source import LiveSource
from forest.viewer.stage import Stage

_COLOURS = {
    "fell": "#c2341f",
    "thin": "#c2341f",
    "harvest": "#c2341f",
    "prune": "#d9822b",
    "bend": "#8a5fb0",
    "crack": "#7a5a3a",
    "mark": "#2f6fb2",
    "plant": "#3f8f4f",
}
_MARKERS = "#b3471d"
_LAID = "#d8a48c"  # of strokes that are laid: those that are free
_BOX = "#77808c"
_MOST_POINTS = 60_000


def draw_pending(stage: Stage, source: LiveSource) -> None:
    """Draw what acts will do: trees in a colour and with rings, seedlings, markers of strokes."""
    rings, tints = [], {}
    trees = source.living[source.living["pending"] != ""]
    columns = ("tree_id", "x_m", "y_m", "crown_radius_m", "pending")
    for tree_id, x, y, radius, pending in zip(*(trees[c] for c in columns), strict=True):
        kinds = str(pending).split(",")
        tints[int(tree_id)] = to_rgb(_COLOURS.get(kinds[-1], _BOX))
        for k, kind in enumerate(kinds):
            size = (max(float(np.nan_to_num(radius)), 0.15) + 0.15) * (1.0 + 0.35 * k)
            rings.append((float(x), float(y), size, _COLOURS.get(kind, _BOX)))
    for act in source.pending:
        if act["kind"] == "plant":
            places = zip(act.get("x_m", ()), act.get("y_m", ()), strict=True)
            rings += [(float(x), float(y), 0.2, _COLOURS["plant"]) for x, y in places]
    stage.tints = tints
    draw_rings(stage, "pending", rings)
    for name, points, colour in (
        ("markers to come", source.markers_to_come, _MARKERS),
        ("markers laid", source.markers_laid, _LAID),
    ):
        step = max(1, -(-len(points) // _MOST_POINTS))
        draw_points(stage, name, points[::step], colour, 3.0)


def draw_obstacles(
    stage: Stage, source: LiveSource, moved: Mapping[str, Sequence[float]] | None = None
) -> None:
    """Draw the obstacles, some of them moved, by name, by so much (m)."""
    surfaces = []
    for each in source.obstacles:
        by = (moved or {}).get(each.name, (0.0, 0.0, 0.0))
        surfaces.append(surface_of(each).translate(by))
    draw_surfaces(stage, "obstacles", surfaces, _BOX)
