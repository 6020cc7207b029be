"""Raw strips of fracture bark over a growing girth, and how many fractures there are.

    python analysis/bark_strips.py --to docs/gallery/bark_strips.png

Four years of one trunk's bark, unrolled, and below it fractures around the girth for three ratios
of stiffness.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from forest.surface.bark import FRACTURE, Bark, Elements, Material, StripGeometry, grow_bark  # noqa: E402

STRIPS, WIDTH_M = 160, 0.01
FIRST_M, LAST_M, YEARS = 0.5, 1.1, 40
SHOWN = (5, 15, 25, 40)
SPACINGS_M = (0.025, 0.05, 0.1)
SKIN, TORN = (0.80, 0.76, 0.70), (0.16, 0.12, 0.10)


def trunk(spacing_m: float = 0.05) -> Bark:
    """Grow the bark of a trunk from 16 to 35 cm of diameter in rings of one width."""
    girth = np.linspace(FIRST_M, LAST_M, YEARS + 1)[:, None] * np.ones(STRIPS)
    material = Material(fracture_stiffness=1.0 / spacing_m)
    return grow_bark(StripGeometry.column(STRIPS, WIDTH_M), girth, material, 1, keep=True)


def unrolled(elements: Elements, girth: NDArray[np.float64], across: int = 600) -> Any:
    """Paint strips as rows of a picture, tip at the top, the seam at the left."""
    picture = np.full((len(girth), across, 3), 1.0)
    pixels = (np.arange(across) + 0.5) * (LAST_M / across) - 0.5 * LAST_M
    for strip, around in enumerate(girth):
        inside = np.abs(pixels) < 0.5 * around
        rows, _ = elements.at(strip, pixels[inside] + 0.5 * around)
        torn = elements.kind[rows] == FRACTURE
        picture[len(girth) - 1 - strip, inside] = np.where(torn[:, None], TORN, SKIN)
    return picture


def fractures_over_girth(bark: Bark) -> NDArray[np.float64]:
    """Give girth (m) and mean number of fractures around it, year by year."""
    rows = [
        (past.girth.mean(), np.sum(past.elements.kind == FRACTURE) / STRIPS)
        for past in bark.history
    ]
    return np.array(rows)


def draw(to: Path) -> None:
    """Draw the figure."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(10, 7.2), layout="constrained")
    grid = figure.add_gridspec(2, len(SHOWN), height_ratios=(3, 1.4))
    barks = {spacing: trunk(spacing) for spacing in SPACINGS_M}
    for k, year in enumerate(SHOWN):
        axes = figure.add_subplot(grid[0, k])
        past = barks[0.05].at_time(year)
        extent = (-0.5 * LAST_M, 0.5 * LAST_M, 0.0, STRIPS * WIDTH_M)
        axes.imshow(unrolled(past.elements, past.girth), extent=extent, interpolation="nearest")
        axes.set_title(f"year {year}, girth {past.girth[0]:.2f} m", fontsize=9)
        axes.set_xticks([])
        axes.set_yticks([0, 0.5, 1, 1.5] if k == 0 else [])
    axes = figure.add_subplot(grid[1, :])
    for spacing, bark in barks.items():
        girth, count = fractures_over_girth(bark).T
        axes.plot(girth, count, label=f"R / K_f = {spacing:g} m")
        print(f"R/K_f {spacing:g} m: {count[0]:.1f} to {count[-1]:.1f} fractures")
    axes.set_xlabel("girth, m")
    axes.set_ylabel("fractures around it")
    axes.legend(frameon=False)
    figure.savefig(to, dpi=110)


def main(words: Sequence[str] | None = None) -> None:
    """Take the words of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--to", type=Path, default=Path("bark_strips.png"))
    draw(parser.parse_args(words).to)


if __name__ == "__main__":
    main()
