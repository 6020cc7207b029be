"""Pictures of the flow of particles over bark: a branching, bark as spots and ribbons, a wound.

python analysis/bark_flow.py --to docs/gallery
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from forest.surface.blend.field import Blend  # noqa: E402
from forest.surface.blend.limbs import limbs_of  # noqa: E402
from forest.surface.flow import (  # noqa: E402
    Flow,
    Loops,
    Near,
    angle_to_limb,
    features,
    flow,
    grain,
    heal,
    prune,
)
from forest.surface.mesh import Mesh  # noqa: E402
from forest.trees.skeleton import Skeleton  # noqa: E402
from forest.view.scene import import_pyvista  # noqa: E402

#: Presets and ages, years, of the picture of bark.
SHOWN = (
    ("quaking_aspen", 25.0),
    ("quaking_aspen", 70.0),
    ("silver_birch", 40.0),
    ("juniper", 60.0),
    ("maple", 80.0),
    ("oak", 100.0),
)
_WOOD = "#a9987f"
_GRAIN = "#5c4a33"
_CHAIN = ("#c0392b", "#1f5fa8", "#2e8b57")
_FACE = "#e0c48c"


def limbs(*shapes: tuple[int, int, Any, Any, float, float]) -> Skeleton:
    """Make a tree of straight limbs of 8 internodes.

    Of each: the axis and internode that it grows from, start, end, and radii at both.
    """
    n = 8
    count = len(shapes)
    t = np.linspace(0.0, 1.0, n + 1)[:, None]
    lines = [(1.0 - t) * np.asarray(s[2]) + t * np.asarray(s[3]) for s in shapes]
    share = (np.arange(n) + 0.5) / n
    parent = np.arange(-1, count * n - 1)
    for k, shape in enumerate(shapes):
        parent[k * n] = -1 if shape[0] < 0 else shape[0] * n + shape[1]
    zero = np.zeros(count * n, np.int32)
    return Skeleton(
        parent=parent.astype(np.int32),
        start=np.concatenate([line[:-1] for line in lines]),
        end=np.concatenate([line[1:] for line in lines]),
        radius=np.concatenate([s[4] + share * (s[5] - s[4]) for s in shapes]),
        axis=np.repeat(np.arange(count, dtype=np.int32), n),
        order=np.repeat(np.array([s[0] >= 0 for s in shapes], np.int32), n),
        birth_year=zero,
        leafy=zero.astype(np.bool_),
        serial=np.arange(count * n, dtype=np.int32),
    )


def polydata(mesh: Mesh) -> Any:
    """Turn a mesh into pyvista's."""
    faces = np.column_stack((np.full(len(mesh.triangles), 3), mesh.triangles))
    return import_pyvista().PolyData(mesh.points, faces.ravel())


def contour(surface: Any, low: np.ndarray, high: np.ndarray, cell: float) -> Any:
    """Polygonise a surface within a box."""
    pv = import_pyvista()
    size = np.ceil((high - low) / cell).astype(int) + 1
    grid = pv.ImageData(dimensions=size, spacing=(cell,) * 3, origin=low)
    grid["value"] = surface.value(np.asarray(grid.points, np.float64))
    found = grid.contour([0.0], "value")
    return found.compute_normals(auto_orient_normals=True)


def lit(plotter: Any) -> None:
    """Light from the left, and a little from the right."""
    pv = import_pyvista()
    plotter.remove_all_lights()
    plotter.add_light(pv.Light(position=(2, -6, 4), intensity=1.05))
    plotter.add_light(pv.Light(position=(6, 4, 1), intensity=0.3))
    plotter.set_background("white")


def draw_chain(plotter: Any, chain: Loops) -> None:
    """Draw each loop with its particles."""
    pv = import_pyvista()
    for k, part in enumerate(np.split(chain.place, chain.first[1:-1])):
        line = pv.lines_from_points(part, close=True)
        colour = _CHAIN[k % len(_CHAIN)]
        plotter.add_mesh(line, color=colour, line_width=5, render_lines_as_tubes=True)
        plotter.add_mesh(
            pv.PolyData(part), color=colour, point_size=11, render_points_as_spheres=True
        )


def branching(to: Path) -> None:
    """Draw the chain before and after relinking, and the trails."""
    skeleton = limbs(
        (-1, 0, (0, 0, 0), (0, 0, 8.0), 1.0, 0.9),
        (0, 2, (0, 0, 3.0), (4.24, 0, 7.24), 0.6, 0.45),
    )
    blend = Blend.of(limbs_of(skeleton))
    found: Flow = flow(blend, show_every_s=0.05)
    after = next(k for k, chain in enumerate(found.chains) if len(chain) == 2)
    wood = contour(blend, np.array([-1.3, -1.3, 0.0]), np.array([5.2, 1.3, 9.0]), 0.05)
    pv = import_pyvista()
    plotter = pv.Plotter(off_screen=True, shape=(1, 3), window_size=(2100, 1000), border=False)
    for k, chain in enumerate((found.chains[after - 1], found.chains[after + 6])):
        plotter.subplot(0, k)
        lit(plotter)
        plotter.add_mesh(wood, color=_WOOD, specular=0.0, smooth_shading=True)
        draw_chain(plotter, chain)
        _look(plotter, (4.6, -9.5, 11.5), (1.0, 0.0, 4.0), 1.15)
    plotter.subplot(0, 2)
    lit(plotter)
    plotter.add_mesh(wood, color=_WOOD, specular=0.0, smooth_shading=True)
    for way in found.trails.polylines(least_points=3):
        plotter.add_mesh(pv.lines_from_points(way), color=_GRAIN, line_width=3)
    _look(plotter, (3.2, -13.0, 5.0), (1.2, 0.0, 4.2), 1.15)
    plotter.screenshot(to / "bark_flow.png")
    plotter.close()
    on = blend.limb(found.trails.place)
    here = found.trails.place[(on.axis == 1) & (on.along > 3.2) & (on.along < 5.6)]
    angle = np.abs(angle_to_limb(grain(here, found.trails, blend), here, blend))
    print(
        f"relinked {found.relinked} time, {len(found.trails)} particles; grain off the branch: "
        f"median {np.median(angle):.1f} degrees, 90 % below {np.percentile(angle, 90):.1f}"
    )


def _look(plotter: Any, eye: tuple[float, ...], at: tuple[float, ...], zoom: float) -> None:
    plotter.camera_position = [eye, at, (0, 0, 1)]
    plotter.camera.zoom(zoom)


def bark(to: Path) -> None:
    """Draw spots and ribbons on a piece of trunk."""
    pole = limbs((-1, 0, (0, 0, 0), (0.03, 0, 2.4), 0.15, 0.14))
    near = Near(np.array([0.0, 0.0, 1.2]), 0.6)
    pv = import_pyvista()
    plotter = pv.Plotter(
        off_screen=True, shape=(1, len(SHOWN)), window_size=(2100, 800), border=False
    )
    for k, (name, age) in enumerate(SHOWN):
        found = features(pole, name, age=age, near=near, spiral_deg=8.0 * (name == "juniper"))
        plotter.subplot(0, k)
        lit(plotter)
        for piece, mesh in found.pieces.items():
            plotter.add_mesh(polydata(mesh), color=found.colours[piece], specular=0.0, ambient=0.2)
        _look(plotter, (2.2, -0.8, 1.2), (0.0, 0.0, 1.2), 2.6)
    plotter.screenshot(to / "flow_bark.png")
    plotter.close()


def wound(to: Path) -> None:
    """Draw how a stub is overgrown."""
    tree = limbs(
        (-1, 0, (0, 0, 0), (0, 0, 1.0), 0.15, 0.15),
        (0, 3, (0, 0, 0.5), (0.6, 0, 0.7), 0.045, 0.045),
    )
    rest, cut = prune(tree, 1, stub_m=0.19)
    years = heal(rest, cut, np.full(20, 0.004))
    shown = (0, 2, 4, 10, 20)
    pv = import_pyvista()
    plotter = pv.Plotter(
        off_screen=True, shape=(1, len(shown)), window_size=(2000, 640), border=False
    )
    low = cut.middle - np.array([0.45, 0.26, 0.2])
    high = cut.middle + np.array([0.12, 0.26, 0.2])
    eye, back = np.array([0.75, -0.75, 0.3]), np.array([0.06, 0.0, 0.0])
    for k, number in enumerate(shown):
        year = years[number]
        print(
            f"year {number}: open {1e4 * year.open_m2:.1f} cm2, roughness {year.roughness_deg:.0f}"
        )
        plotter.subplot(0, k)
        lit(plotter)
        skin = contour(year.surface, low, high, 0.0025)
        face = year.surface.on_open_face(np.asarray(skin.points, np.float64))
        skin["open"] = face.astype(float)
        plotter.add_mesh(
            skin,
            scalars="open",
            cmap=[_WOOD, _FACE],
            clim=(0, 1),
            show_scalar_bar=False,
            specular=0.0,
            smooth_shading=True,
        )
        for open_now, colour in ((False, "#3c5a3a"), (True, "#a23b2a")):
            dots = year.cover.place[year.open == open_now]
            inside = np.all((dots > low + 0.02) & (dots < high - 0.02), axis=1)
            if inside.any():
                plotter.add_mesh(
                    pv.PolyData(dots[inside]),
                    color=colour,
                    point_size=6,
                    render_points_as_spheres=True,
                )
        _look(plotter, tuple(cut.middle + eye), tuple(cut.middle - back), 1.9)
    plotter.screenshot(to / "flow_healing.png")
    plotter.close()


def main() -> None:
    """Draw all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", type=Path, default=Path())
    parser.add_argument("--only", choices=("branching", "bark", "wound"))
    asked = parser.parse_args()
    for picture in (branching, bark, wound):
        if asked.only in (None, picture.__name__):
            picture(asked.to)


if __name__ == "__main__":
    main()
