"""VTK PolyData (.vtp): metres, z up, with what is known of each point."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from forest.surface.export.parts import Part
from forest.surface.mesh import Mesh


def polydata(mesh: Mesh) -> Any:
    """Give a mesh as `pyvista.PolyData`, with `Mesh.data` as arrays of its points."""
    import pyvista

    faces = np.column_stack((np.full(len(mesh.triangles), 3), mesh.triangles)).ravel()
    made = pyvista.PolyData(mesh.points, faces)
    for name, values in mesh.data.items():
        made.point_data[name] = values
    return made


def write_vtp(parts: Sequence[Part], draft: Path) -> None:
    """Write parts as one PolyData; its cells carry `leaf`, 1 on leaf cards and 0 on wood."""
    placed = [part.placed() for part in parts]
    leaf = [
        np.full(len(mesh.triangles), part.material.cut_out, np.uint8)
        for mesh, part in zip(placed, parts, strict=True)
    ]
    made = polydata(Mesh.together(placed))
    made.cell_data["leaf"] = np.concatenate(leaf)
    made.save(draft)
