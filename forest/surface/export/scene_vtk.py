"""A scene as VTK's PolyData: every tree with triangles and leaves of its own."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.export.scene_glb import card_corners
from forest.surface.mesh import Mesh
from forest.surface.scene import Scene
from forest.trees.leaves import OUTLINES, Leaves

#: Memory that a triangle of wood and a leaf take while they are written, bytes.
_PER_TRIANGLE, _PER_LEAF = 130, 330

_Say = Callable[[str], object]
_Piece = tuple[NDArray[np.float64], NDArray[np.int64]]


def check_memory(scene: Scene, to: Path) -> None:
    """Refuse a scene that needs more memory than the machine has."""
    wood, cards = scene.standing_triangles
    need = _PER_TRIANGLE * wood + _PER_LEAF * cards // 2
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if need > 0.8 * there:
        what = f"needs about {need / 1e9:.1f} GB of memory, of {there / 1e9:.1f} GB"
        expected = "a farther detail, no leaves, or a .glb, which keeps each shape once"
        raise InputError(what, where=str(to), expected=expected)


def blocks(scene: Scene, say: _Say = lambda line: None) -> Iterator[tuple[str, Any]]:
    """Give the ground, and the wood and the leaves of each species, by name.

    Yields
    ------
    (str, pyvista.PolyData)
        Its cells carry `tree_id`, `dbh_cm`, `leaf` (1 on leaves) and `rgb`. A leaf is one cell, a
        polygon from its petiole around.
    """
    if scene.ground is not None:
        mesh = scene.ground.mesh
        none = np.zeros(len(mesh.triangles), np.int64) - 1
        yield "ground", _polydata([wood_cells(mesh)], none, scene, [(0, scene.ground.colour)])
    names = scene.census.species
    kinds = list(dict.fromkeys(names.tolist()))
    for number, name in enumerate(kinds, start=1):
        trees = np.flatnonzero(names == name)
        for leaf, what in enumerate(("wood", "leaves")):
            pieces, owner, colours = _gathered(scene, trees, bool(leaf))
            if pieces:
                yield f"{what} of {name}", _polydata(pieces, owner, scene, colours, leaf)
        say(f"{number} of {len(kinds)} species")


def write_scene_vtp(scene: Scene, draft: Path, say: _Say) -> None:
    """Write all in one PolyData."""
    first, *others = (block for _, block in blocks(scene, say))
    first.append_polydata(*others).save(draft)


def write_scene_vtm(scene: Scene, draft: Path, say: _Say) -> None:
    """Write a table of blocks, and the blocks into a folder of its name beside it."""
    import pyvista

    pyvista.MultiBlock(dict(blocks(scene, say))).save(draft)


def wood_cells(mesh: Mesh) -> _Piece:
    """Give a mesh's points and its triangles, each after its number of corners."""
    return mesh.points, np.column_stack((np.full(len(mesh.triangles), 3), mesh.triangles)).ravel()


def leaf_cells(leaves: Leaves) -> Iterator[_Piece]:
    """Give the same of leaves, for each outline that occurs."""
    for code in np.unique(leaves.shape).tolist():
        here = leaves.shape == code
        outline = OUTLINES[code] * (1.0, -1.0)  # anticlockwise from above
        corners = card_corners(Leaves._make(column[here] for column in leaves), outline)
        n, k = corners.shape[:2]
        cells = np.column_stack((np.full(n, k), np.arange(n * k).reshape(n, k))).ravel()
        yield corners.reshape(-1, 3), cells


def _gathered(
    scene: Scene, trees: NDArray[np.int64], leaf: bool
) -> tuple[list[_Piece], NDArray[np.int64], list[tuple[int, tuple[float, float, float]]]]:
    """Give the pieces of some trees in their places, the tree of each cell, and their colours."""
    pieces, owners, colours = [], [], []
    for shape in np.unique(scene.instances.model[trees]).tolist():
        made = scene.shapes[shape]
        own = list(leaf_cells(made.leaves)) if leaf else [wood_cells(made.wood)]
        cells = len(made.leaves.shape) if leaf else len(made.wood.triangles)
        for k in trees[scene.instances.model[trees] == shape].tolist():
            scale, place = scene.instances.scale[k], scene.instances.place[k]
            pieces += [(points * scale + place, faces) for points, faces in own]
            owners.append(np.full(cells, k))
            colours.append((cells, made.foliage if leaf else made.bark))
    return pieces, np.concatenate(owners), colours


def _polydata(
    pieces: list[_Piece],
    owner: NDArray[np.int64],
    scene: Scene,
    colours: list[tuple[int, tuple[float, float, float]]],
    leaf: int = 0,
) -> Any:
    import pyvista

    faces, first = [], 0
    for points, cells in pieces:
        corners = cells.reshape(-1, int(cells[0]) + 1) + first
        corners[:, 0] = cells[0]
        faces.append(corners.ravel())
        first += len(points)
    made = pyvista.PolyData(
        np.concatenate([points for points, _ in pieces], dtype=np.float32), np.concatenate(faces)
    )
    nobody = owner < 0
    made.cell_data["tree_id"] = np.where(nobody, 0, scene.census.tree_id[owner]).astype(np.int32)
    dbh = np.where(nobody, np.nan, scene.census.dbh_cm[owner])
    made.cell_data["dbh_cm"] = dbh.astype(np.float32)
    made.field_data["origin_m"] = np.array(scene.origin_m)
    made.cell_data["leaf"] = np.full(len(owner), leaf, np.uint8)
    rgb = [(255.0 * np.array(colour)).round().astype(np.uint8) for _, colour in colours]
    many = [cells or len(owner) for cells, _ in colours]
    made.cell_data["rgb"] = np.repeat(np.array(rgb), many, axis=0)
    return made
