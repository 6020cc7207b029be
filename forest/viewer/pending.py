"""What waits for the next year, drawn into the view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from forest.scenario.model import Box, Obstacle
from forest.view.scene import import_pyvista
from forest.viewer.drawing import draw_points, draw_rings, draw_surfaces
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
_LAID = "#d8a48c"  # of strokes that are laid: those that are free
_BOX = "#77808c"
_MOST_POINTS = 60_000


def draw_pending(stage: Stage, source: LiveSource) -> None:
    """Draw rings around trees that acts will touch, places of seedlings, and markers of strokes."""
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
    for name, points, colour in (
        ("markers to come", source.markers_to_come, _MARKERS),
        ("markers laid", source.markers_laid, _LAID),
    ):
        step = max(1, -(-len(points) // _MOST_POINTS))
        draw_points(stage, name, points[::step], colour, 3.0)


def surface_of(obstacle: Obstacle) -> Any:
    """Give the surface of an obstacle, a pyvista mesh."""
    pv = import_pyvista()
    if isinstance(obstacle, Box):
        low, high = obstacle.min_m, obstacle.max_m
        return pv.Box([x for pair in zip(low, high, strict=True) for x in pair])
    return pv.read(obstacle.file).translate(obstacle.at_m)


def draw_obstacles(
    stage: Stage, source: LiveSource, moved: Mapping[str, Sequence[float]] | None = None
) -> None:
    """Draw the obstacles, some of them moved, by name, by so much (m)."""
    surfaces = []
    for each in source.obstacles:
        by = (moved or {}).get(each.name, (0.0, 0.0, 0.0))
        surfaces.append(surface_of(each).translate(by))
    draw_surfaces(stage, "obstacles", surfaces, _BOX)
