"""Meshes as files for other programs: .glb, .obj with .mtl, .ply and .vtp."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from forest.errors import InputError, nearest
from forest.record.export import whole_file
from forest.surface.export.parts import LEAF_COLOUR, WOOD, Material, Part, leaf_parts, linear
from forest.surface.mesh import Mesh

#: Suffixes that `write_mesh` knows.
SUFFIXES = (".glb", ".obj", ".ply", ".vtp")

__all__ = [
    "LEAF_COLOUR",
    "SUFFIXES",
    "WOOD",
    "Material",
    "Part",
    "leaf_parts",
    "linear",
    "write_mesh",
]


def write_mesh(
    what: Mesh | Sequence[Part],
    to: str | Path,
    *,
    materials: Material = WOOD,
    overwrite: bool = False,
) -> Path:
    """Write meshes to a file.

    Parameters
    ----------
    what : Mesh or sequence of Part
        One mesh, or several with materials of their own; those without triangles are left out.
    to : path
        The file; its suffix, one of `SUFFIXES`, names the format. ``.glb`` and ``.obj`` have y
        up, materials and texture coordinates; ``.ply`` and ``.vtp`` have z up and keep points
        that are shared, so that closed surfaces stay closed. Beside an ``.obj`` go its ``.mtl``
        and images, under names of its own.
    materials : Material
        Of the one mesh.
    overwrite : bool
        Whether to replace files.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the suffix is another one, the file exists, there is no triangle, or an image cannot
        be read.
    OutputError
        If it cannot be written. Nothing half-written is left behind.
    """
    to = Path(to)
    suffix = to.suffix.lower()
    if suffix not in SUFFIXES:
        hint = nearest(suffix, SUFFIXES)
        raise InputError(f"unknown format '{to.suffix}', {hint}", where=str(to))
    parts = [Part(what, materials)] if isinstance(what, Mesh) else what
    parts = [part for part in parts if len(part.mesh.triangles)]
    if not parts:
        raise InputError("nothing to write", where=str(to), expected="a mesh with triangles")
    with whole_file(to, overwrite=overwrite) as draft:
        if suffix == ".glb":
            from forest.surface.export.glb import write_glb

            write_glb(parts, draft)
        elif suffix == ".obj":
            from forest.surface.export.obj import write_obj

            write_obj(parts, draft)
        elif suffix == ".ply":
            from forest.surface.export.ply import write_ply

            write_ply(Mesh.together([part.placed() for part in parts]), draft)
        else:
            from forest.surface.export.vtp import write_vtp

            write_vtp(parts, draft)
    return to
