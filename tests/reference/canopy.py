"""Beer-Lambert sweeps, ray step by ray step, in double precision."""

from __future__ import annotations

import math

import numpy as np


def relative_irradiance(
    depth: np.ndarray, directions: np.ndarray, weights: np.ndarray, periodic: bool
) -> tuple[np.ndarray, np.ndarray]:
    """T at the centres of the voxels [iz, iy, ix] and at the ground.

    A ray goes from the middle of a layer to the middle of the one above, in 1 or an even number
    of steps of at most one voxel sideways; `depth` is the optical depth of a vertical crossing.
    """
    nz, ny, nx = depth.shape
    total = np.zeros(depth.shape)
    ground = np.zeros((ny, nx))
    for (dx, dy, dz), weight in zip(directions, weights / weights.sum(), strict=True):
        reach = max(abs(dx), abs(dy)) / dz
        steps = 1 if reach <= 1 else 2 * math.ceil(reach / 2)
        middle = np.ones((ny, nx))
        for z in range(nz - 1, -1, -1):
            own = np.exp(-depth[z] / dz / 2)
            upper = np.exp(-depth[z + 1] / dz / 2) if z + 1 < nz else np.ones((ny, nx))
            light = middle
            if steps == 1:
                light = sideways(light * upper, dx / dz, dy / dz, periodic) * own
            for step in range(steps if steps > 1 else 0):
                through = (upper if step < steps / 2 else own) ** (2 / steps)
                light = sideways(light, dx / dz / steps, dy / dz / steps, periodic) * through
            middle = light
            total[z] += weight * middle
        ground += weight * middle * np.exp(-depth[0] / dz / 2)
    return total, ground


def sideways(light: np.ndarray, dx: float, dy: float, periodic: bool) -> np.ndarray:
    """Interpolate a layer's light at (x + dx, y + dy); outside an open grid it is 1."""
    ny, nx = light.shape
    out = np.zeros((ny, nx))
    left, back = math.floor(dx), math.floor(dy)
    for y in range(ny):
        for x in range(nx):
            for cy, wy in ((back, 1 - (dy - back)), (back + 1, dy - back)):
                for cx, wx in ((left, 1 - (dx - left)), (left + 1, dx - left)):
                    j, i = y + cy, x + cx
                    if periodic:
                        value = light[j % ny, i % nx]
                    else:
                        value = light[j, i] if 0 <= j < ny and 0 <= i < nx else 1.0
                    out[y, x] += wy * wx * value
    return out
