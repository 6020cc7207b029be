"""Binary .ply: metres, z up, with what is known of each point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forest.surface.mesh import Mesh

_TYPES = {"f": ("float", "<f4"), "i": ("int", "<i4")}


def write_ply(mesh: Mesh, draft: Path) -> None:
    """Write a mesh with its normals and `Mesh.data`.

    Points are those of the mesh, so that what is closed stays closed; a point has then no single
    texture coordinate, and none is written.
    """
    normals = mesh.normals()
    columns: dict[str, tuple[str, str, NDArray[np.generic]]]
    columns = {name: ("double", "<f8", mesh.points[:, k]) for k, name in enumerate("xyz")}
    columns |= {f"n{name}": ("float", "<f4", normals[:, k]) for k, name in enumerate("xyz")}
    columns |= {name: (*_TYPES[v.dtype.kind], v) for name, v in mesh.data.items()}
    rows = np.empty(len(mesh.points), [(name, kind) for name, (_, kind, _) in columns.items()])
    for name, (_, _, values) in columns.items():
        rows[name] = values
    faces = np.empty(len(mesh.triangles), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.triangles
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment metres, z up",
        f"element vertex {len(rows)}",
        *(f"property {word} {name}" for name, (word, _, _) in columns.items()),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    with draft.open("wb") as file:
        file.write(("\n".join(header) + "\n").encode("ascii"))
        rows.tofile(file)
        faces.tofile(file)
