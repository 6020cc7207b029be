"""What a height map tells a renderer: normals and occlusion."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver
from forest._threads import in_threads

_CHUNKS = 32
_RADII_M = (0.002, 0.006, 0.018)  # at which occlusion looks around
_WEIGHTS = (0.9, 1.2, 1.2)

_Heights = NDArray[np.float32]


def normals(
    height: _Heights, across_m: NDArray[np.float64], along_m: float, *, wraps_along: bool
) -> NDArray[np.uint8]:
    """Give the normal map of a height map, as OpenGL and glTF want it: red right, green up.

    Parameters
    ----------
    height : float32 (rows, columns)
        m, top row first. Columns close on themselves.
    across_m : float64 (rows,)
        Width of a pixel in each row, m.
    along_m : float
        Height of a pixel, m.
    wraps_along : bool
        The top row is followed by the bottom row.

    Returns
    -------
    uint8 (rows, columns, 3)
        A component c, -1 to 1, is stored as 127.5 (c + 1), rounded.
    """
    out = np.empty((*height.shape, 3), np.uint8)
    in_threads(_fill_normals, height, across_m, float(along_m), bool(wraps_along), out)
    return out


@driver
def _fill_normals(
    first: Any, step: Any, height: Any, across: Any, along: Any, wraps: Any, out: Any
) -> None:
    rows, columns = height.shape
    for chunk in range(first, _CHUNKS, step):
        for y in range(chunk, rows, _CHUNKS):
            up, down = y - 1, y + 1
            span = 2.0 * along
            if wraps:
                up, down = up % rows, down % rows
            elif up < 0 or down >= rows:
                up, down = max(up, 0), min(down, rows - 1)
                span = along * max(down - up, 1)
            for x in range(columns):
                right = height[y, x + 1 if x + 1 < columns else 0]
                left = height[y, x - 1 if x > 0 else columns - 1]
                nx = -(right - left) / (2.0 * across[y])
                ny = -(height[up, x] - height[down, x]) / span
                scale = 127.5 / np.sqrt(nx * nx + ny * ny + 1.0)
                out[y, x, 0] = np.uint8(127.5 + nx * scale + 0.5)
                out[y, x, 1] = np.uint8(127.5 + ny * scale + 0.5)
                out[y, x, 2] = np.uint8(127.5 + scale + 0.5)


def occlusion(
    height: _Heights, across_m: NDArray[np.float64], along_m: float, *, wraps_along: bool
) -> NDArray[np.uint8]:
    """Estimate how much of the sky each point sees: by how much its surroundings stand above it.

    The means over squares of three sizes are compared with the point; a pit as deep as the square
    is wide sees about a third. Parameters are as in `normals`.

    Returns
    -------
    uint8 (rows, columns)
        255 open, 0 shut in.
    """
    shadow = np.zeros(height.shape, np.float32)
    rows, columns = height.shape
    between = np.empty_like(height)
    mean = np.empty_like(height)
    sums = np.empty((_CHUNKS, columns // _CHUNKS + 1))
    for radius, weight in zip(_RADII_M, _WEIGHTS, strict=True):
        wide = int(np.clip(round(radius / float(np.mean(across_m))), 1, (columns - 1) // 2))
        high = int(np.clip(round(radius / along_m), 1, (rows - 1) // 2))
        in_threads(_blur_rows, height, wide, between)
        in_threads(_blur_columns, between, high, bool(wraps_along), sums, mean)
        in_threads(_add_shadow, height, mean, weight / radius, shadow)
    out = np.empty(height.shape, np.uint8)
    in_threads(_fill_open, shadow, out)
    return out


@driver
def _blur_rows(first: Any, step: Any, height: Any, half: Any, out: Any) -> None:
    rows, columns = height.shape
    for chunk in range(first, _CHUNKS, step):
        for y in range(chunk, rows, _CHUNKS):
            total = 0.0
            for x in range(-half, half + 1):
                total += height[y, x % columns]
            gone, new = (columns - half) % columns, (half + 1) % columns
            for x in range(columns):
                out[y, x] = total / (2 * half + 1)
                total += np.float64(height[y, new]) - np.float64(height[y, gone])
                gone = gone + 1 if gone + 1 < columns else 0
                new = new + 1 if new + 1 < columns else 0


@driver
def _blur_columns(
    first: Any, step: Any, height: Any, half: Any, wraps: Any, sums: Any, out: Any
) -> None:
    rows, columns = height.shape
    for chunk in range(first, _CHUNKS, step):
        low, high = chunk * columns // _CHUNKS, (chunk + 1) * columns // _CHUNKS
        total = sums[chunk]
        for x in range(low, high):
            total[x - low] = 0.0
        for y in range(-half, half + 1):
            k = y % rows if wraps else min(max(y, 0), rows - 1)
            for x in range(low, high):
                total[x - low] += height[k, x]
        for y in range(rows):
            new = (y + half + 1) % rows if wraps else min(y + half + 1, rows - 1)
            gone = (y - half) % rows if wraps else max(y - half, 0)
            for x in range(low, high):
                out[y, x] = total[x - low] / (2 * half + 1)
                total[x - low] += np.float64(height[new, x]) - np.float64(height[gone, x])


@driver
def _add_shadow(first: Any, step: Any, height: Any, mean: Any, weight: Any, shadow: Any) -> None:
    rows, columns = height.shape
    for chunk in range(first, _CHUNKS, step):
        for y in range(chunk, rows, _CHUNKS):
            for x in range(columns):
                shadow[y, x] += np.float32(weight * max(0.0, mean[y, x] - height[y, x]))


@driver
def _fill_open(first: Any, step: Any, shadow: Any, out: Any) -> None:
    rows, columns = shadow.shape
    for chunk in range(first, _CHUNKS, step):
        for y in range(chunk, rows, _CHUNKS):
            for x in range(columns):
                out[y, x] = np.uint8(255.0 / (1.0 + shadow[y, x]) + 0.5)
