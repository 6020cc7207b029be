"""Boxes and meshes that block growth and cast shade, as a mask of near-field voxels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.environment.canopy import CanopyField
from forest.errors import InputError

#: Voxels that all obstacles together may be made of, and those of the mask that holds them.
_MOST_SOLID = 20_000_000
_MOST_MASK = 500_000_000


@dataclass(frozen=True)
class Box:
    """An upright box.

    Attributes
    ----------
    min_m, max_m : (float, float, float)
        Opposite corners, m.
    """

    min_m: tuple[float, float, float]
    max_m: tuple[float, float, float]


@dataclass(frozen=True)
class Mesh:
    """A closed surface in a file that pyvista reads, in metres.

    Attributes
    ----------
    file : Path
        STL, OBJ, PLY or VTP file.
    at_m : (float, float, float)
        Where the file's origin stands, m.
    """

    file: Path
    at_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Solid(NamedTuple):
    """Which near-field voxels are solid.

    Attributes
    ----------
    mask : uint8 (nz, ny, nx)
        1 where the voxel's centre lies inside an obstacle. One voxel stands for no obstacle.
    origin : int32 (3,)
        Voxel (ix, iy, iz) of the mask's first voxel.
    periodic : int
        1 on a torus.
    shape : int64 (2,)
        Voxels of the plot along x and y, at which a torus wraps.
    """

    mask: NDArray[np.uint8]
    origin: NDArray[np.int32]
    periodic: int
    shape: NDArray[np.int64]


@njit
def solid_at(solid: Any, ix: Any, iy: Any, iz: Any) -> Any:
    """Tell whether a near-field voxel lies inside an obstacle."""
    mask = solid.mask
    if mask.size == 1:
        return False
    nz, ny, nx = mask.shape
    z = iz - solid.origin[2]
    if z < 0 or z >= nz:
        return False
    y = iy - solid.origin[1]
    x = ix - solid.origin[0]
    if solid.periodic:
        y %= solid.shape[1]
        x %= solid.shape[0]
    if y < 0 or y >= ny or x < 0 or x >= nx:
        return False
    return mask[z, y, x] != 0


@njit
def inside(solid: Any, trees: Any, row: Any, place: Any, voxel_m: Any) -> Any:
    """Tell whether a place, relative to the base of the tree in a row, lies inside an obstacle."""
    if solid.mask.size == 1:
        return False
    x = np.float64(trees.base_offset[row, 0]) + np.float64(place[0])
    y = np.float64(trees.base_offset[row, 1]) + np.float64(place[1])
    z = np.float64(trees.base_offset[row, 2]) + np.float64(place[2])
    return solid_at(
        solid,
        trees.base_voxel[row, 0] + np.int32(np.floor(x / voxel_m)),
        trees.base_voxel[row, 1] + np.int32(np.floor(y / voxel_m)),
        trees.base_voxel[row, 2] + np.int32(np.floor(z / voxel_m)),
    )


def solid_places(
    solid: Solid, base_voxel: NDArray[Any], places: NDArray[np.float64], voxel_m: float
) -> NDArray[np.bool_]:
    """Tell which places lie inside an obstacle.

    Parameters
    ----------
    solid : Solid
    base_voxel : int (3,)
        Voxel in whose corner the places have their origin.
    places : float64 (n, 3)
        Relative to that corner, m.
    voxel_m : float

    Returns
    -------
    bool (n,)
    """
    if solid.mask.size == 1:
        return np.zeros(len(places), np.bool_)
    voxel = np.asarray(base_voxel, np.int64) + np.floor(places / voxel_m).astype(np.int64)
    at = voxel - solid.origin
    if solid.periodic:
        at[:, :2] %= solid.shape
    here = ((at >= 0) & (at < solid.mask.shape[::-1])).all(axis=1)
    found = np.zeros(len(places), np.bool_)
    x, y, z = at[here].T
    found[here] = solid.mask[z, y, x] != 0
    return found


def no_solid() -> Solid:
    """Give the mask of a plot without obstacles."""
    return Solid(np.zeros((1, 1, 1), np.uint8), np.zeros(3, np.int32), 0, np.ones(2, np.int64))


def voxelise(
    obstacles: Sequence[Box | Mesh], shape: tuple[int, int], *, periodic: bool, voxel_m: float
) -> Solid:
    """Mark the voxels that obstacles fill.

    A voxel is solid if its centre lies inside; a box fills at least one voxel along each axis.
    What lies below the ground is left out; what leaves a periodic plot comes in on its other side.

    Parameters
    ----------
    obstacles : sequence of Box or Mesh
    shape : (int, int)
        Voxels of the plot along x and y.
    periodic : bool
    voxel_m : float
        Edge of a voxel, m.

    Raises
    ------
    InputError
        If a mesh cannot be read, is not closed, or holds no voxel; if obstacles are too large or
        too far away for the voxels' size.
    """
    parts = []
    left = _MOST_SOLID
    for o in obstacles:
        surface = None if isinstance(o, Box) else _closed_surface(o)
        axes = _box_axes(o, voxel_m) if isinstance(o, Box) else _bounding_axes(surface, voxel_m)
        left -= math.prod(len(axis) for axis in axes)
        if left < 0:
            raise _too_large(voxel_m)
        voxels = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        parts.append(voxels if isinstance(o, Box) else _within(o, surface, voxels, voxel_m))
    voxels = np.concatenate(parts) if parts else np.zeros((0, 3), np.int64)
    voxels = voxels[voxels[:, 2] >= 0]
    if len(voxels) == 0:
        return no_solid()
    nx, ny = shape
    if periodic:
        voxels[:, 0] %= nx
        voxels[:, 1] %= ny
        low = np.zeros(3, np.int64)
        high = np.array([nx, ny, voxels[:, 2].max() + 2])
    else:
        low = voxels.min(axis=0)
        # One layer more than needed, since a mask of one voxel stands for no obstacle.
        high = voxels.max(axis=0) + np.array([1, 1, 2])
    # The far field spans the plot and all obstacles.
    spanned = np.maximum(high, [nx, ny, 1]) - np.minimum(low, 0)
    if math.prod(int(n) for n in spanned) > _MOST_MASK:
        raise _too_large(voxel_m)
    mask = np.zeros(tuple((high - low)[::-1]), np.uint8)
    x, y, z = (voxels - low).T
    mask[z, y, x] = 1
    return Solid(mask, low.astype(np.int32), int(periodic), np.array(shape, np.int64))


def _too_large(voxel_m: float) -> InputError:
    return InputError(
        f"too large or too far away for voxels of {voxel_m:g} m",
        where="obstacles",
        expected=f"at most {_MOST_SOLID:,} voxels, within {_MOST_MASK:,} around the plot",
    )


def _box_axes(box: Box, voxel_m: float) -> list[NDArray[np.int64]]:
    """List the voxels that a box fills along each axis."""
    axes = []
    for low, high in zip(box.min_m, box.max_m, strict=True):
        first = int(np.rint(low / voxel_m))
        last = int(np.rint(high / voxel_m))
        if last <= first:
            first = int(np.floor((low + high) / 2 / voxel_m))
            last = first + 1
        axes.append(np.arange(first, last, dtype=np.int64))
    return axes


def _closed_surface(mesh: Mesh) -> Any:
    import pyvista

    try:
        surface = pyvista.read(mesh.file).triangulate()
    except (OSError, ValueError, AttributeError) as error:
        raise InputError(
            "cannot read this mesh", where=str(mesh.file), expected="an STL, OBJ, PLY or VTP file"
        ) from error
    if surface.n_points == 0 or surface.n_open_edges > 0:
        raise InputError(
            "the mesh is not closed", where=str(mesh.file), expected="a watertight surface"
        )
    return surface.translate(mesh.at_m) if any(mesh.at_m) else surface


def _bounding_axes(surface: Any, voxel_m: float) -> list[NDArray[np.int64]]:
    """List the voxels that a surface may fill along each axis."""
    bounds = np.asarray(surface.bounds).reshape(3, 2) / voxel_m
    # More than all obstacles may hold is as good as endless.
    first = np.clip(np.floor(bounds[:, 0]), -_MOST_SOLID, _MOST_SOLID).astype(np.int64)
    last = np.clip(np.ceil(bounds[:, 1]), -_MOST_SOLID, _MOST_SOLID).astype(np.int64)
    return [np.arange(a, b, dtype=np.int64) for a, b in zip(first, last, strict=True)]


def _within(
    mesh: Mesh, surface: Any, voxels: NDArray[np.int64], voxel_m: float
) -> NDArray[np.int64]:
    """Keep the voxels whose centres a surface encloses."""
    import pyvista

    centres = pyvista.PolyData((voxels + 0.5) * voxel_m)
    inside = np.asarray(centres.select_interior_points(surface)["selected_points"], bool)
    if not inside.any():
        raise InputError(
            "the mesh is smaller than a voxel", where=str(mesh.file), expected="metres as unit"
        )
    return np.asarray(voxels[inside], np.int64)


def solid_voxels(solid: Solid) -> NDArray[np.int64]:
    """List the solid voxels as (ix, iy, iz), int64 (n, 3)."""
    return np.asarray(np.argwhere(solid.mask)[:, ::-1] + solid.origin, np.int64)


def coarse_depth(voxels: NDArray[np.int64], far: CanopyField) -> NDArray[np.float32] | None:
    """Give the optical depth of obstacles on the far field's grid, or None without any.

    A coarse voxel lets the share through that is not solid; depth 80 stands for none at all.
    """
    if len(voxels) == 0 or far.ratio == 0:
        return None
    solid = np.zeros(far.leaf.shape, np.int64)
    x, y, z = voxels.T // far.ratio
    np.add.at(solid, (z, y - far.origin[1], x - far.origin[0]), 1)
    free = 1.0 - solid / far.ratio**3
    return (-np.log(np.maximum(free, np.exp(-80.0)))).astype(np.float32)
