"""Wavefront .obj with its .mtl and images beside it: metres, y up."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from forest.surface.export.glb import Y_UP
from forest.surface.export.parts import Material, Part, encoded, mime_type

_STATEMENTS = {"colour": "map_Kd", "normal": "norm", "rough": "map_Pr"}
_SUFFIXES = {"image/png": ".png", "image/jpeg": ".jpg"}


def write_obj(parts: Sequence[Part], to: Path) -> None:
    """Write parts as objects, with points that several faces share and corners of texture.

    Parameters
    ----------
    parts : sequence of Part
        Meshes with triangles.
    to : path
        The .obj file; the .mtl file and the images go beside it, named after it.
    """
    _write_materials(parts, to)
    points, corners = 1, 1
    with to.open("w", encoding="ascii", newline="\n") as file:
        file.write(f"# metres, y up\nmtllib {_material_file(to).name}\n")
        for part in parts:
            mesh = part.placed()
            split = mesh.split_at_seams()
            uv = split.uv / part.material.tile_m
            file.write(f"o {part.name}\nusemtl {part.material.name}\n")
            file.writelines(_lines("v %.6f %.6f %.6f\n", mesh.points @ Y_UP.T))
            file.writelines(_lines("vt %.5f %.5f\n", uv))
            file.writelines(_lines("vn %.4f %.4f %.4f\n", mesh.normals() @ Y_UP.T))
            one, two = mesh.triangles + points, split.triangles + corners
            both = np.stack((one, two, one), axis=2).reshape(-1, 9)
            file.writelines(_lines("f %d/%d/%d %d/%d/%d %d/%d/%d\n", both))
            points += len(mesh.points)
            corners += len(split.source)


def _lines(form: str, rows: np.ndarray) -> Iterator[str]:
    return (form % tuple(row) for row in rows.tolist())


def _material_file(to: Path) -> Path:
    return to.with_suffix(".mtl")


def _write_materials(parts: Sequence[Part], to: Path) -> None:
    materials = {part.material.name: part.material for part in parts}
    text = "".join(_described(material, to) for material in materials.values())
    _material_file(to).write_text(text, encoding="utf-8", newline="\n")


def _described(material: Material, to: Path) -> str:
    """Write a material's images, and give its lines of the .mtl file."""
    colour = " ".join(f"{c:.4f}" for c in material.colour)
    lines = [
        f"newmtl {material.name}",
        f"Kd {colour}",
        f"Pr {material.roughness:.4f}",
        f"Pm {material.metallic:.4f}",
        "illum 1",
    ]
    for what, image in material.images.items():
        content = encoded(image)
        name = f"{to.stem}_{material.name}_{what}{_SUFFIXES[mime_type(content)]}"
        to.with_name(name).write_bytes(content)
        lines.append(f"{_STATEMENTS[what]} {name}")
        if what == "colour" and material.cut_out:
            lines.append(f"map_d -imfchan m {name}")
    return "\n".join(lines) + "\n\n"
