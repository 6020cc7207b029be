"""Make the map and the heights of `valley.toml`: `python scenarios/scenery/make_valley.py`.

A valley of 400 m: a brook with tall grass, meadows with single oaks, a row of poplars along a
track, lilacs at its fence, groves of aspen, and slopes of tupelo below and fir above.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter

HERE = Path(__file__).resolve().parent
CELLS, CELL_M = 200, 2.0
HIGHEST_M = 60.0
ASPEN, FIR, OAK, POPLAR, LILAC, TUPELO = (1 << bit for bit in range(6))
LAWN, MEADOW, TALL = (code << 14 for code in (1, 2, 3))


def noise(seed: int, width_cells: float) -> np.ndarray:
    """Give smooth noise of mean 0 and deviation 1."""
    field = gaussian_filter(np.random.default_rng(seed).normal(size=(CELLS, CELLS)), width_cells)
    return (field - field.mean()) / field.std()


def main() -> None:
    """Write both pictures; row 0 is the north edge."""
    north, east = np.mgrid[CELLS:0:-1, 0:CELLS] * CELL_M - [[[0.5 * CELL_M]], [[-0.5 * CELL_M]]]
    brook = 150.0 + 22.0 * np.sin(east / 55.0) + 8.0 * np.sin(east / 21.0)  # its northing
    away = np.abs(north - brook)
    slope = np.maximum(away - 45.0, 0.0)
    heights = 2.5 * (1.0 - np.exp(-away / 12.0)) + 0.02 * away + 0.0011 * slope**2
    heights = np.clip(
        heights + 1.2 * noise(1, 9.0) * np.clip(away / 40.0, 0.1, 1.0), 0.0, HIGHEST_M
    )

    bits = np.where(away < 5.0, TALL, MEADOW)
    track = np.abs(north - (62.0 + 0.16 * east)) < 2.5
    bits[track] = LAWN
    wooded = slope + 14.0 * noise(2, 6.0) > 28.0
    high = heights + 3.0 * noise(3, 5.0) > 14.0
    bits[wooded & ~high] |= TUPELO
    bits[wooded & high] |= FIR
    bits[wooded & (np.abs(heights - 14.0) < 5.0)] |= ASPEN
    grove = (noise(4, 7.0) > 1.25) & (away > 9.0) & ~wooded & ~track
    bits[grove] |= ASPEN
    bits[~wooded & ~grove & ~track & (away > 12.0)] |= OAK
    beside = np.abs(north - (68.0 + 0.16 * east)) < 1.5
    bits[beside & ~wooded] |= POPLAR
    fence = np.abs(north - (55.0 + 0.16 * east)) < 1.5
    bits[fence & ~wooded & (noise(5, 3.0) > 0.3)] |= LILAC
    bits[wooded] &= 0x3FFF  # no grass under the trees

    Image.fromarray(bits.astype(np.uint16)).save(HERE / "valley_features.png", optimize=True)
    grey = np.round(heights / HIGHEST_M * 65535.0).astype(np.uint16)
    Image.fromarray(grey).save(HERE / "valley_heights.png", optimize=True)


if __name__ == "__main__":
    main()
