"""Light for pictures: how much sun and sky reach a point between the leaves.

A picture's own light, coarse and quick; the light that trees grow by is the environment's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, shift

#: Direction to the sun of every picture (unit vector): from the left and behind the camera.
SUN = np.array([-0.36, -0.48, 0.80])

_CELL_M = 0.6
_MAX_CELLS = 4_000_000
_SUN_DEPTH = 0.25  # optical depth of one m2 of leaf per m2 of ground, direct light
_SKY_DEPTH = 0.16  # the same for light from the sky, which comes from all sides


class LightVolume:
    """Sun and sky light on a grid around the leaves.

    Parameters
    ----------
    leaves : float64 (n, 3)
        Places of the leaves, m.
    area : float64 (n,)
        Their areas, m2.
    bounds : (lower, upper) of float64 (3,)
        The box that the picture shows, m.
    """

    def __init__(
        self,
        leaves: NDArray[np.float64],
        area: NDArray[np.float64],
        bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    ) -> None:
        lower, upper = bounds
        extent = np.maximum(upper - lower, 0.1)
        cell = max(
            min(_CELL_M, float(extent.max()) / 24), float(np.prod(extent) / _MAX_CELLS) ** (1 / 3)
        )
        self.cell = cell
        self.lower = lower - cell
        shape = np.ceil(extent / cell).astype(int) + 3
        index = ((leaves - self.lower) / cell).astype(int)
        flat = np.ravel_multi_index(tuple(index.T), tuple(shape), mode="clip")
        lai = np.bincount(flat, area, int(np.prod(shape))).reshape(shape) / cell**2
        self.sun = self._sweep(np.exp(-_SUN_DEPTH / SUN[2] * lai), SUN[:2] / SUN[2])
        self.sky = self._sweep(np.exp(-_SKY_DEPTH * lai), np.zeros(2))

    @staticmethod
    def _sweep(passed: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
        """Carry light from the top layer down; each cell is lit as after half of itself."""
        light = np.empty_like(passed)
        coming = np.ones(passed.shape[:2])
        for layer in range(passed.shape[2] - 1, -1, -1):
            light[:, :, layer] = coming * np.sqrt(passed[:, :, layer])
            coming = coming * passed[:, :, layer]
            if slope.any():
                coming = shift(coming, -slope, order=1, mode="constant", cval=1.0)
        return light

    def at(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the shares of sun and of sky light, 0 to 1, at points (n, 3)."""
        where = ((points - self.lower) / self.cell - 0.5).T
        sun = map_coordinates(self.sun, where, order=1, mode="nearest")
        sky = map_coordinates(self.sky, where, order=1, mode="nearest")
        return sun, sky


def shade(
    colour: NDArray[np.float64], sun: NDArray[np.float64], sky: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """Light colours (n, 3) by warm sun and bluish sky, and give them as bytes."""
    warm = np.array([1.02, 0.96, 0.80])
    cool = np.array([0.40, 0.45, 0.52])
    lit = colour * (sun[:, None] * warm + sky[:, None] * cool + 0.12)
    # Screens are not linear: the eye sees shade brighter than the light is.
    return np.asarray(255.0 * np.clip(lit, 0.0, 1.0) ** 0.85, np.uint8)
