"""Draw the discs and the board of docs/gallery: `python analysis/discs.py`.

One stand of spruces that bend is grown for them (half a minute).
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

import forest  # noqa: E402
from analysis.common import fewer_colours  # noqa: E402
from forest.dendro.disc import Disc  # noqa: E402
from forest.dendro.life import StemLife  # noqa: E402
from forest.view.disc_picture import draw_disc, draw_section  # noqa: E402

TO = ROOT / "docs" / "gallery"

STAND = """
title = "spruces that bend"
years = 60
start_year = 1960
plot = { size_m = [14, 14], boundary = "periodic" }
environment = { shadow = {}, canopy = {} }
mechanics = { bending = %s }
climate = { noise_sd = 0.25 }
species = { picea_abies = {} }
planting = { kind = "random", density_ha = 500 }
output = { sample_trees = { ids = [1, 2, 3, 4, 5, 6, 7, 8, 9] } }
"""


def offset(disc: Disc) -> float:
    """Say how far off centre the pith is, per radius."""
    return float((disc.centres[-1] ** 2).sum() ** 0.5) / disc.radius


def along_pith(stem: StemLife) -> tuple[np.ndarray, np.ndarray, float]:
    """Fit a plane to a stem's pith up to 7 m: a point, the normal, how far off the pith is, m."""
    pith = stem.end[stem.end[:, 2] < 7.0]
    middle = pith.mean(axis=0)
    normal = np.linalg.svd(pith - middle)[2][2]
    return middle, normal, float(np.abs((pith - middle) @ normal).max())


def main() -> None:
    """Grow the stands and draw."""
    with tempfile.TemporaryDirectory() as folder:
        bending = forest.Scenario.from_toml(STAND % "true")
        with forest.simulate(bending, Path(folder) / "bending.h5") as run:
            living = [i for i in run.samples if run.sample_years(i)[-1] == run.years[-1]]
            heights = [0.5 + 0.1 * k for k in range(60)]
            discs = [run.disc(i, h) for i in living for h in heights]
            best = max((d for d in discs if len(d.knots) == 1), key=offset)
            draw_disc(best, TO / "disc.png")
            fewer_colours(TO / "disc.png")
            print(f"tree {best.tree_id} at {best.height_m:g} m: {offset(best):.2f} off centre")
        upright = forest.Scenario.from_toml(STAND % "false")
        with forest.simulate(upright, Path(folder) / "upright.h5") as run:
            fits = {i: along_pith(run.stem(i)) for i in run.samples}
            straightest = min(fits, key=lambda i: fits[i][2])
            middle, normal, _ = fits[straightest]
            board = run.section(straightest, middle, normal)
            draw_section(board, TO / "board.png", widen=8.0, length_m=6.0)
            fewer_colours(TO / "board.png")


if __name__ == "__main__":
    main()
