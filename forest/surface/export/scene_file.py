"""Scenes as files for other programs: .glb, .vtm and .vtp."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from forest.errors import InputError, nearest
from forest.record.export import whole_file
from forest.surface.scene import Scene

#: Suffixes that `write_scene` knows.
SCENE_SUFFIXES = (".glb", ".vtm", ".vtp")

_Say = Callable[[str], object]


def write_scene(
    scene: Scene,
    to: str | Path,
    *,
    instanced: bool = False,
    overwrite: bool = False,
    say: _Say = lambda line: None,
) -> Path:
    """Write a scene to a file.

    Parameters
    ----------
    scene : Scene
    to : path
        The file; its suffix, one of `SCENE_SUFFIXES`, names the format. A ``.glb`` (y up) keeps
        each shape once, so that its size follows from the shapes. VTK's files (z up) have no
        instances: a ``.vtm`` has a block for the wood and one for the leaves of each species, in
        a folder of its name beside it, a ``.vtp`` all in one.
    instanced : bool
        Of a ``.glb``: leaves as a card and many transforms (`EXT_mesh_gpu_instancing`).
    overwrite : bool
        Whether to replace a file.
    say : callable
        Is told, in a line, how far it is.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the suffix is another one, the file exists, or it needs more memory than there is.
    OutputError
        If it cannot be written. Nothing half-written is left behind.
    """
    to = Path(to)
    suffix = to.suffix.lower()
    if suffix not in SCENE_SUFFIXES:
        hint = nearest(suffix, SCENE_SUFFIXES)
        raise InputError(f"unknown format '{to.suffix}', {hint}", where=str(to))
    if instanced and suffix != ".glb":
        raise InputError("instanced leaves are for .glb files", where=str(to))
    if suffix == ".glb":
        from forest.surface.export.scene_glb import write_scene_glb

        with whole_file(to, overwrite=overwrite) as draft:
            write_scene_glb(scene, draft, instanced=instanced, say=say)
        return to
    from forest.surface.export.scene_vtk import check_memory, write_scene_vtm, write_scene_vtp

    check_memory(scene, to)
    with whole_file(to, overwrite=overwrite) as draft:
        if suffix == ".vtp":
            write_scene_vtp(scene, draft, say)
        else:
            write_scene_vtm(scene, draft, say)
    return to
