"""Draw docs/gallery/detail.png, a tree as it is drawn at seven ranges: `python analysis/detail.py`.

A beech is grown for it (half a minute), without its leaves above and with them below.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

import forest  # noqa: E402
from forest.species import load_species  # noqa: E402
from forest.surface import Description, Primitives, Sight, describe, fractions  # noqa: E402
from forest.surface.description import LEAF_ITEM  # noqa: E402
from forest.trees.leaves import leaves_of  # noqa: E402
from forest.view.looks import look_of  # noqa: E402
from forest.view.scene import import_pyvista  # noqa: E402

RANGES_M = (5, 30, 60, 120, 240, 600, 1200)
SPECIES = "fagus_sylvatica"

STAND = """
years = 30
plot = { size_m = [6, 6] }
environment = { shadow = {}, canopy = {} }
species = { fagus_sylvatica = {} }
planting = { kind = "regular", spacing_m = [6, 6] }
"""


def add(plotter: Any, primitives: Primitives, colours: Any, **looks: Any) -> None:
    """Put primitives into a plotter in colours (n, 3), shares of red, green, blue."""
    pv = import_pyvista()
    n, corners = primitives.vertices.shape[:2]
    if not n:
        return
    mesh = pv.PolyData()
    mesh.points = primitives.vertices.reshape(-1, 3)
    cells = np.column_stack((np.full(n, corners), np.arange(n * corners).reshape(n, corners)))
    setattr(mesh, {1: "verts", 2: "lines", 3: "faces"}[corners], cells.ravel())
    mesh.cell_data["rgb"] = (255 * colours).astype(np.uint8)
    plotter.add_mesh(mesh, scalars="rgb", rgb=True, **looks)


def draw(tree: Description, height: float, to: Path) -> None:
    """Draw the tree at all ranges, each magnified to the same size."""
    look = look_of(SPECIES)
    plotter = import_pyvista().Plotter(
        off_screen=True, shape=(2, len(RANGES_M)), window_size=(1540, 500), border=False
    )
    for row, season in enumerate(("winter", "summer")):
        for column, range_m in enumerate(RANGES_M):
            plotter.subplot(row, column)
            plotter.set_background("white")
            shares = fractions(range_m, Sight(season=season), evergreen=False)
            for primitives in tree.drawn(shares):
                leafy = (primitives.item == LEAF_ITEM)[:, None]
                shaded = primitives.vertices.shape[1] == 3
                looks = {"lighting": shaded, "line_width": 1, "point_size": 1.5}
                add(plotter, primitives, np.where(leafy, look.leaf, look.bark), **looks)
            middle = np.array([0.0, 0.0, 0.5 * height])
            plotter.camera_position = [middle - np.array([0.0, 60.0, -6.0]), middle, (0, 0, 1)]
            plotter.enable_parallel_projection()
            plotter.camera.parallel_scale = 0.6 * height
            plotter.add_text(f"{range_m} m", font_size=8, color="black")
    plotter.screenshot(to)
    plotter.close()


def main() -> None:
    """Grow the tree and draw it."""
    stand = forest.Stand(forest.Scenario.from_toml(STAND))
    for _ in range(stand.scenario.years):
        stand.step()
    tree = stand.skeleton(int(stand.trees.tree_id[0]))
    place = np.array([*tree.start[0, :2], 0.0])
    leaves = leaves_of(tree, load_species(SPECIES))
    upright = leaves._replace(position=leaves.position - place)
    tree.start[:] -= place
    tree.end[:] -= place
    to = ROOT / "docs" / "gallery" / "detail.png"
    draw(describe(tree, upright), float(tree.end[:, 2].max()), to)


if __name__ == "__main__":
    main()
