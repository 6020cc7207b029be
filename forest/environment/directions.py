"""Where a bud sees the most light: the vector V of Palubicki et al. 2009, section 4.1."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.environment.light_grid import ShadowField, place_in, window_of
from forest.environment.obstacles import Solid, solid_at
from forest.environment.voxels import site_voxel
from forest.trees.buds import Shoots, bud_heading
from forest.trees.metamers import Metamers
from forest.trees.table import Trees

CHUNKS = 64


class Perception(NamedTuple):
    """The voxels around a bud, nearest first, and how far and wide each species looks.

    Attributes
    ----------
    offset : int64 (n, 3)
        Offsets (x, y, z) from the bud's voxel; ties in distance in the order z, y, x.
    unit : float32 (n, 3)
        Unit vectors to them.
    distance_m : float32 (n,)
        Distances to them, m.
    reach_m, cos_half_angle : float32 (species,)
        Perception distance r, and cosine of half the perception angle theta.
    """

    offset: NDArray[np.int64]
    unit: NDArray[np.float32]
    distance_m: NDArray[np.float32]
    reach_m: NDArray[np.float32]
    cos_half_angle: NDArray[np.float32]


def make_perception(
    distance_m: NDArray[np.float64], angle_deg: NDArray[np.float64], voxel_m: float
) -> Perception:
    """List the voxels that any species' buds perceive.

    The angle is the full opening of the cone. A bud always reaches its neighbouring voxels.
    """
    reach = np.maximum(distance_m, 1.75 * voxel_m)
    n = int(np.floor(reach.max(initial=voxel_m) / voxel_m))
    axis = np.arange(-n, n + 1)
    z, y, x = (g.ravel() for g in np.meshgrid(axis, axis, axis, indexing="ij"))
    squared = x * x + y * y + z * z
    order = np.argsort(squared, kind="stable")[1:]
    order = order[squared[order] * voxel_m**2 <= reach.max(initial=voxel_m) ** 2]
    offset = np.column_stack((x, y, z))[order]
    length = np.sqrt(squared[order])
    return Perception(
        np.ascontiguousarray(offset, np.int64),
        np.ascontiguousarray(offset / length[:, None], np.float32),
        (length * voxel_m).astype(np.float32),
        reach.astype(np.float32),
        np.cos(np.radians(angle_deg) / 2).astype(np.float32),
    )


class _Bud(NamedTuple):
    """A bud's near-field voxel and the units of shade it casts."""

    x: Any
    y: Any
    z: Any
    own: Any


@njit
def _own_layer(way: Any, n: Any) -> Any:
    """Tell in which layer of a bud's own pyramid of `n` layers a voxel lies; -1 if in none."""
    dx, dy, dz = way
    inside = dz <= 0 and -dz < n and abs(dx) <= -dz and abs(dy) <= -dz
    return -dz if inside else -1


@njit
def _shadow_at(shadow: Any, window: Any, x: Any, y: Any, z: Any) -> Any:
    z, y, x = place_in(window, x, y, z)
    return np.int64(shadow[z, y, x]) if z >= 0 else np.int64(0)


@njit
def _against_gradient(field: Any, bud: Any, out: Any) -> None:
    """Set a unit vector against the gradient of the shadow; zero where it is flat."""
    shadow = field.shadow
    window = window_of(field)
    x = _shadow_at(shadow, window, bud.x - 1, bud.y, bud.z)
    x -= _shadow_at(shadow, window, bud.x + 1, bud.y, bud.z)
    y = _shadow_at(shadow, window, bud.x, bud.y - 1, bud.z)
    y -= _shadow_at(shadow, window, bud.x, bud.y + 1, bud.z)
    z = _shadow_at(shadow, window, bud.x, bud.y, bud.z - 1)
    z -= _shadow_at(shadow, window, bud.x, bud.y, bud.z + 1)
    if len(field.weights) > 1:  # of the six, only the voxel below lies in the bud's own pyramid
        z -= np.int64(field.weights[1]) * bud.own
    squares = np.float64(x) ** 2 + np.float64(y) ** 2 + np.float64(z) ** 2
    length = np.sqrt(squares) if squares > 0.0 else 1.0
    out[0] = np.float32(x) / length
    out[1] = np.float32(y) / length
    out[2] = np.float32(z) / length


@njit
def _to_least_shadow(
    field: Any, solid: Any, around: Any, bud: Any, species: Any, heading: Any, out: Any
) -> None:
    """Set a unit vector to the least shadowed free voxel of the cone; zero if all are alike."""
    # Arrays are taken out of their tuples before the loop: each access would count references.
    shadow = field.shadow
    weights = field.weights
    window = window_of(field)
    offset = around.offset
    unit = around.unit
    distance = around.distance_m
    reach = around.reach_m[species]
    narrow = around.cos_half_angle[species]
    hx = heading[0]
    hy = heading[1]
    hz = heading[2]
    obstructed = solid.mask.size > 1
    z, y, x = place_in(window, bud.x, bud.y, bud.z)
    here = np.int64(0)
    if z >= 0:
        here = np.int64(shadow[z, y, x]) - np.int64(weights[0]) * bud.own
    least = np.int64(2**62)
    best = -1
    differs = False
    for k in range(len(distance)):
        if distance[k] > reach:
            break
        if unit[k, 0] * hx + unit[k, 1] * hy + unit[k, 2] * hz < narrow:
            continue
        way = (offset[k, 0], offset[k, 1], offset[k, 2])
        if bud.z + way[2] < 0:
            continue
        if obstructed and solid_at(solid, bud.x + way[0], bud.y + way[1], bud.z + way[2]):
            continue
        z, y, x = place_in(window, bud.x + way[0], bud.y + way[1], bud.z + way[2])
        found = np.int64(shadow[z, y, x]) if z >= 0 else np.int64(0)
        layer = _own_layer(way, len(weights))
        if layer >= 0:
            found -= np.int64(weights[layer]) * bud.own
        differs = differs or found != here
        if found < least:
            least = found
            best = k
    for axis in range(3):
        out[axis] = unit[best, axis] if differs else np.float32(0.0)


@njit
def _direct(
    first: Any,
    last: Any,
    metamers: Any,
    trees: Any,
    shoots: Any,
    field: Any,
    solid: Any,
    around: Any,
    shade_units: Any,
    voxel_m: Any,
    gradient: Any,
    out: Any,
) -> None:
    """Set the directions of the shoots `first` to `last`."""
    heading = np.empty(3, np.float32)
    row = np.searchsorted(shoots.first, first, side="right") - 1
    for k in range(first, last):
        while k >= shoots.first[row + 1]:
            row += 1
        i = np.int64(shoots.metamer[k])
        species = trees.species[row]
        tip = metamers.tip[trees.start[row] + i]
        bud = _Bud(
            site_voxel(trees.base_voxel[row, 0], trees.base_offset[row, 0], tip[0], voxel_m),
            site_voxel(trees.base_voxel[row, 1], trees.base_offset[row, 1], tip[1], voxel_m),
            site_voxel(trees.base_voxel[row, 2], trees.base_offset[row, 2], tip[2], voxel_m),
            np.int64(shade_units[species]),
        )
        if gradient:
            _against_gradient(field, bud, out[k])
        else:
            kind = np.int64(shoots.bud[k])
            heading[0], heading[1], heading[2] = bud_heading(metamers, trees.start[row], i, kind)
            _to_least_shadow(field, solid, around, bud, species, heading, out[k])


@driver
def _direct_chunks(
    first: Any,
    step: Any,
    metamers: Any,
    trees: Any,
    shoots: Any,
    field: Any,
    solid: Any,
    around: Any,
    shade_units: Any,
    voxel_m: Any,
    gradient: Any,
    out: Any,
) -> None:
    n = len(shoots.metamer)
    for chunk in range(first, CHUNKS, step):
        _direct(
            chunk * n // CHUNKS,
            (chunk + 1) * n // CHUNKS,
            metamers,
            trees,
            shoots,
            field,
            solid,
            around,
            shade_units,
            voxel_m,
            gradient,
            out,
        )


def preferred_directions(
    metamers: Metamers,
    trees: Trees,
    shoots: Shoots,
    field: ShadowField,
    solid: Solid,
    around: Perception,
    shade_units: NDArray[np.uint16],
    voxel_m: np.float32,
    *,
    mode: str,
) -> NDArray[np.float32]:
    """Give the direction of most light for each shooting bud.

    The bud's own pyramid is left out, as the bud's own shadow is in its light. What lies below
    the ground or in an obstacle is never chosen.

    Parameters
    ----------
    shoots : Shoots
        n buds.
    field : ShadowField
        The near field; its voxels have the edge `voxel_m`.
    shade_units : uint16 (species,)
        Shade that a bud of each species casts.
    mode : {"gradient", "least_shadow"}
        Against the gradient of the shadow (central differences), or to the centre of the least
        shadowed voxel in the perception volume (ties: the nearest, then in the order z, y, x).

    Returns
    -------
    float32 (n, 3)
        Unit vectors V; zero where all voxels are alike.

    References
    ----------
    Palubicki et al. 2009, section 4.1.
    """
    out = np.empty((len(shoots.metamer), 3), np.float32)
    in_threads(
        _direct_chunks,
        metamers,
        trees,
        shoots,
        field,
        solid,
        around,
        shade_units,
        voxel_m,
        mode == "gradient",
        out,
    )
    return out
