"""From outlines and textures to pixels: one pass over the rows of a picture.

Every row of points is outlined (`outlines`), then each point takes its height and colour from the
epidermis or the inside of its fracture, from stains, folds and lichen.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest.surface.bark.outlines import CHUNKS, outline_row

_TURN = 2.0 * np.pi
_HEIGHT = 3
_ROUGHNESS = 4
_GOLDEN = 0.6180339887498949  # spreads fractures over the inside's tile


class Rows(NamedTuple):
    """What changes along the axis: one entry per row of the picture."""

    v: NDArray[np.float64]  # m
    girth: NDArray[np.float64]  # m
    old_skin: NDArray[np.float64]  # share of the old epidermis, 0 to 1
    old_inside: NDArray[np.float64]
    grime: NDArray[np.float64]  # how much the deepest places are darkened
    stain: NDArray[np.float64]  # how much large patches differ in brightness
    depth: NDArray[np.float64]  # of wide fractures, m
    lichen: NDArray[np.float64]  # share of the surface that lichen covers


class Surfaces(NamedTuple):
    """The textures, and how often each is laid around and per metre along the axis.

    Pixels are (rows, columns, 5): red, green, blue, height (m), roughness.
    """

    skin: NDArray[np.float32]
    skin_old: NDArray[np.float32]
    inside: NDArray[np.float32]
    inside_old: NDArray[np.float32]
    around: NDArray[np.float64]  # (2,) skins: tiles per turn of epidermis
    across: NDArray[np.float64]  # (2,) insides: tiles per metre
    along: NDArray[np.float64]  # (4,) tiles per metre of axis
    soft: float  # depth over which epidermis gives way to the inside, m


class Extras(NamedTuple):
    """Options: lichen and folds (section 7)."""

    patches: NDArray[np.float32]  # (n, n) noise that repeats, sorted into 0 to 1
    patch_around: float  # tiles of it per turn
    patch_along: float  # per metre
    lichen: NDArray[np.float64]  # red, green, blue, thickness (m), turn it prefers, how much
    folds: NDArray[np.float64]  # (k, 5): turn, v, reach (m), height (m), steepness


class Canvas(NamedTuple):
    """What is painted; rows from the top down."""

    colour: NDArray[np.uint8]  # (rows, columns, 3)
    height: NDArray[np.float32]  # m
    roughness: NDArray[np.uint8]


class Work(NamedTuple):
    """Working space of the chunks."""

    line: NDArray[np.float64]
    rows: NDArray[np.float32]  # (chunks, 4, columns)
    fracture: NDArray[np.int32]  # (chunks, columns)
    pixel: NDArray[np.float64]  # (chunks, 2, 5)


@driver
def paint_all(
    first: Any, step: Any, outlines: Any, relief: Any, rows: Any, surfaces: Any, extras: Any,
    under: Any, work: Any, canvas: Any,
) -> None:  # fmt: skip
    """Paint the rows of a picture; `under` is the surface of an older bark that tore (or empty)."""
    for chunk in range(first, CHUNKS, step):
        part = work.rows[chunk]
        for row in range(chunk, len(rows.v), CHUNKS):
            outline_row(
                outlines, relief, row, rows.v[row], 0.0, work.line[chunk],
                part[0], part[1], part[2], part[3], work.fracture[chunk],
            )  # fmt: skip
            _paint_row(
                row, rows, surfaces, extras, under, part, work.fracture[chunk], work.pixel[chunk],
                canvas,
            )  # fmt: skip


@njit
def sample(pixels: Any, u: Any, v: Any, weight: Any, out: Any) -> None:
    """Add a tile's colour, height and roughness at (u, v) tiles, bilinearly."""
    rows, columns = pixels.shape[0], pixels.shape[1]
    x = u * columns - 0.5
    y = v * rows - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    s, t = x - x0, y - y0
    j, k = np.int64(x0) % columns, np.int64(y0) % rows
    j1 = j + 1 if j + 1 < columns else 0
    k1 = k + 1 if k + 1 < rows else 0
    a, b = weight * (1.0 - s) * (1.0 - t), weight * s * (1.0 - t)
    c, d = weight * (1.0 - s) * t, weight * s * t
    for i in range(5):
        out[i] += (
            a * pixels[k, j, i]
            + b * pixels[k, j1, i]
            + c * pixels[k1, j, i]
            + d * pixels[k1, j1, i]
        )


@njit
def _two(
    young: Any, old: Any, share: Any, u: Any, u_old: Any, v: Any, v_old: Any, out: Any
) -> None:
    """Blend the young and the old texture."""
    for i in range(5):
        out[i] = 0.0
    if share < 1.0:
        sample(young, u, v, 1.0 - share, out)
    if share > 0.0:
        sample(old, u_old, v_old, share, out)


@njit
def _lichen_at(extras: Any, turn: Any, v: Any, cover: Any) -> Any:
    """How thick lichen grows at a point, 0 to 1: patches, mostly on one side of the stem."""
    n = len(extras.patches)
    side = 1.0 + extras.lichen[5] * np.cos(_TURN * (turn - extras.lichen[4]))
    u = turn * extras.patch_around * n
    w = v * extras.patch_along * n
    coarse = extras.patches[np.int64(np.floor(w)) % n, np.int64(np.floor(u)) % n]
    fine = extras.patches[np.int64(np.floor(5.0 * w)) % n, np.int64(np.floor(5.0 * u)) % n]
    beyond = 0.7 * coarse + 0.3 * fine - (1.0 - min(1.0, cover * side))
    return min(1.0, max(0.0, beyond / 0.05))


@njit
def _fold_at(extras: Any, turn: Any, v: Any, girth: Any) -> Any:
    """Height of the folds below branches: wrinkles along hyperbolas that hang from the crotch.

    Where folds of several branches meet, the strongest is seen; they do not pile up.
    """
    most = 0.0
    for k in range(len(extras.folds)):
        at, top, reach, height, steep = extras.folds[k]
        sideways = turn - at
        sideways = (sideways - np.floor(sideways + 0.5)) * girth
        down = top - v
        far = (sideways * sideways + down * down) / (reach * reach)
        if far > 9.0:
            continue
        # All points at the same `way` lie on one hyperbola with its apex that far below the crotch.
        apart = steep * sideways
        inner = (down + reach) * (down + reach) - apart * apart
        way = np.sqrt(max(inner, 0.0)) - reach
        ridge = np.exp(-0.5 * (way / (0.12 * reach)) ** 2)
        wrinkle = 0.35 * np.cos(_TURN * way / (0.3 * reach))
        one = height * np.exp(-far) * (ridge + wrinkle)
        if abs(one) > abs(most):
            most = one
    return most


@njit
def _paint_row(
    row: Any, rows: Any, surfaces: Any, extras: Any, under: Any, part: Any, fracture: Any,
    pixel: Any, canvas: Any,
) -> None:  # fmt: skip
    n = len(fracture)
    v, girth = rows.v[row], rows.girth[row]
    skin, inner = pixel[0], pixel[1]
    for x in range(n):
        deep, inside, e, across = part[0, x], part[1, x], np.float64(part[2, x]), part[3, x]
        torn = 0.0
        if fracture[x] >= 0:
            torn = min(1.0, inside / surfaces.soft)
            torn = torn * torn * (3.0 - 2.0 * torn)
        for i in range(5):
            skin[i] = 0.0
        if torn < 1.0 or len(under) > 0:
            if len(under) > 0:
                sample(under[row : row + 1], e, 0.5, 1.0, skin)
            else:
                _two(
                    surfaces.skin, surfaces.skin_old, rows.old_skin[row], e * surfaces.around[0],
                    e * surfaces.around[1], v * surfaces.along[0], v * surfaces.along[1], skin,
                )  # fmt: skip
        if torn > 0.0:
            shift = _GOLDEN * fracture[x]
            _two(
                surfaces.inside, surfaces.inside_old, rows.old_inside[row],
                across * surfaces.across[0] + shift, across * surfaces.across[1] + shift,
                v * surfaces.along[2] + shift, v * surfaces.along[3] + shift, inner,
            )  # fmt: skip
            if len(under) > 0:  # it lies in the surface of the older bark, and is no brighter
                inner[_HEIGHT] += skin[_HEIGHT]
                for i in range(3):
                    inner[i] = min(inner[i], skin[i])
            for i in range(5):
                skin[i] += torn * (inner[i] - skin[i])
        turn = (x + 0.5) / n
        shade = 1.0
        if rows.depth[row] > 0.0 and deep > 0.0:
            shade -= rows.grime[row] * min(1.0, deep / rows.depth[row])
        if rows.stain[row] > 0.0:
            size = len(extras.patches)
            k = np.int64(np.floor(v * extras.patch_along * size)) % size
            j = np.int64(np.floor((turn * extras.patch_around + 0.37) * size)) % size
            shade *= 1.0 + rows.stain[row] * (2.0 * extras.patches[k, j] - 1.0)
        height = skin[_HEIGHT] - deep
        if len(extras.folds) > 0:
            fold = _fold_at(extras, turn, v, girth)
            height += fold
        growth = 0.0
        if rows.lichen[row] > 0.0:
            hidden = min(1.0, max(0.0, deep) / (0.3 * rows.depth[row] + 1e-6))
            growth = _lichen_at(extras, turn, v, rows.lichen[row]) * (1.0 - hidden)
            height += growth * extras.lichen[3]
        for i in range(3):
            value = skin[i] * shade
            value += growth * 0.85 * (extras.lichen[i] - value)
            canvas.colour[row, x, i] = np.uint8(255.0 * min(1.0, max(0.0, value)) + 0.5)
        canvas.height[row, x] = height
        rough = skin[_ROUGHNESS] + growth * (0.97 - skin[_ROUGHNESS])
        canvas.roughness[row, x] = np.uint8(255.0 * min(1.0, max(0.0, rough)) + 0.5)


def work_for(line: NDArray[np.float64], columns: int) -> Work:
    """Make the working space."""
    return Work(
        line,
        np.empty((CHUNKS, 4, columns), np.float32),
        np.empty((CHUNKS, columns), np.int32),
        np.empty((CHUNKS, 2, 5)),
    )
