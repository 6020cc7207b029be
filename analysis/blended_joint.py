"""Draw docs/gallery/blended_joint.png, a branching three ways: `python analysis/blended_joint.py`.

After Figs 3 and 4 of Hart & Baker 2003: plain cones, blended, and with reaction wood.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from forest.surface.blend import Blend, Reaction, blend_of, blended  # noqa: E402
from forest.surface.blend.cells import cells_near, lattice_of  # noqa: E402
from forest.surface.blend.joints import Joints  # noqa: E402
from forest.surface.blend.polygonise import march  # noqa: E402
from forest.surface.mesh import Mesh  # noqa: E402
from forest.trees.skeleton import Skeleton  # noqa: E402
from forest.view.scene import import_pyvista  # noqa: E402

CELL_M = 0.008
WOOD = "#b9a58c"


def branching(trunk_m: float = 0.1, limb_m: float = 0.06, angle_deg: float = 55.0) -> Skeleton:
    """Make a trunk of 2 m that tapers, and a limb from its middle."""
    angle = np.deg2rad(angle_deg)
    way = np.array([np.sin(angle), 0.0, np.cos(angle)])
    joint = np.array([0.0, 0.0, 1.0])
    return Skeleton(
        parent=np.array([-1, 0, 0, 2], np.int32),
        start=np.array([[0, 0, 0], joint, joint, joint + 0.6 * way], np.float64),
        end=np.array([joint, [0, 0, 2], joint + 0.6 * way, joint + 1.2 * way], np.float64),
        radius=np.array([trunk_m, 0.9 * trunk_m, limb_m, 0.7 * limb_m]),
        axis=np.array([0, 0, 1, 1], np.int32),
        order=np.array([0, 0, 1, 1], np.int32),
        birth_year=np.zeros(4, np.int32),
        leafy=np.zeros(4, np.bool_),
        serial=np.arange(4, dtype=np.int32),
    )


def plain(skeleton: Skeleton, cell_m: float) -> Mesh:
    """Make the surface of the cones alone, without blends."""
    blend = blend_of(skeleton, flare=None)
    none = Joints(
        np.zeros((0, 3)),
        np.zeros(0),
        np.zeros(0),
        np.zeros(0),
        np.zeros((0, 2), np.int64),
        np.zeros((0, 2), np.int64),
        np.zeros(1, np.int64),
    )
    blend = Blend.of(replace(blend.limbs, joints=none))
    lattice = lattice_of(blend.limbs.cones, cell_m)
    points, triangles = march(blend, lattice, cells_near(blend, lattice))
    return Mesh(points, triangles, np.zeros((len(triangles), 3, 2)))


def main() -> None:
    """Draw the three, from the side and from below the limb."""
    pv = import_pyvista()
    skeleton = branching()
    wood = Reaction(np.array([0.0, 0.5]), np.array([0.0, 0.035]), below=True)
    meshes = [
        plain(skeleton, CELL_M),
        blended(skeleton, cell_m=CELL_M, flare=None),
        blended(skeleton, cell_m=CELL_M, flare=None, reaction=wood),
    ]
    plotter = pv.Plotter(off_screen=True, shape=(1, 3), window_size=(1500, 620), border=False)
    for k, mesh in enumerate(meshes):
        plotter.subplot(0, k)
        faces = np.column_stack((np.full(len(mesh.triangles), 3), mesh.triangles))
        plotter.add_mesh(
            pv.PolyData(mesh.points, faces),
            color=WOOD,
            specular=0.2,
            specular_power=15,
            smooth_shading=True,
        )
        plotter.camera_position = [(0.75, -2.35, 1.15), (0.2, 0.0, 1.13), (0.0, 0.0, 1.0)]
        plotter.camera.view_angle = 26
    plotter.set_background("white")
    plotter.screenshot(str(ROOT / "docs" / "gallery" / "blended_joint.png"))
    plotter.close()


if __name__ == "__main__":
    main()
