"""What waits for the next year, drawn into the view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from forest.scenario.model import Box
from forest.viewer.drawing import draw_boxes, draw_points, draw_rings
from forest.viewer.live_source import LiveSource
from forest.viewer.stage import Stage

_COLOURS = {
    "fell": "#c2341f",
    "thin": "#c2341f",
    "harvest": "#c2341f",
    "prune": "#d9822b",
    "bend": "#8a5fb0",
    "mark": "#2f6fb2",
    "plant": "#3f8f4f",
}
_MARKERS = "#b3471d"
_BOX = "#77808c"
_MOST_POINTS = 60_000


def draw_pending(stage: Stage, source: LiveSource) -> None:
    """Draw rings around trees that acts will touch, places of seedlings, and markers to come."""
    rings = []
    trees = source.living
    for x, y, radius, pending in zip(
        trees["x_m"], trees["y_m"], trees["crown_radius_m"], trees["pending"], strict=True
    ):
        kinds = str(pending).split(",") if pending else []
        for k, kind in enumerate(kinds):
            size = (max(float(np.nan_to_num(radius)), 0.15) + 0.15) * (1.0 + 0.35 * k)
            rings.append((float(x), float(y), size, _COLOURS.get(kind, _BOX)))
    for act in source.pending:
        if act["kind"] == "plant":
            places = zip(act.get("x_m", ()), act.get("y_m", ()), strict=True)
            rings += [(float(x), float(y), 0.2, _COLOURS["plant"]) for x, y in places]
    draw_rings(stage, "pending", rings)
    points = source.markers_to_come
    step = max(1, -(-len(points) // _MOST_POINTS))
    draw_points(stage, "markers to come", points[::step], _MARKERS, 3.0)


def draw_obstacles(
    stage: Stage, source: LiveSource, moved: Mapping[str, Sequence[float]] | None = None
) -> None:
    """Draw the boxes among the obstacles, some of them moved, by name, by so much (m)."""
    boxes = []
    for each in source.obstacles:
        if isinstance(each, Box):
            by = np.array((moved or {}).get(each.name, (0.0, 0.0, 0.0)))
            boxes.append((np.array(each.min_m) + by, np.array(each.max_m) + by, _BOX))
    draw_boxes(stage, "obstacles", boxes)
