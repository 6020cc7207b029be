"""Hart & Baker 2003, Fig. 1 in numbers and as a picture: `python analysis/hart_baker.py`.

A purely genetic tree, one with its centre of mass over its trunk and one shaped by light, of the
same age and architecture.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

import forest  # noqa: E402
from forest.trees.metamers import LATERAL, TERMINAL  # noqa: E402
from forest.trees.skeleton import Skeleton  # noqa: E402
from forest.view.tree_picture import draw_trees  # noqa: E402

KINDS = ("genetic", "balanced", "phototropic")
SEEDS = (1, 2, 3, 4, 5, 6, 7, 8)


class Grown(NamedTuple):
    """What of a tree is compared.

    Attributes
    ----------
    off_centre_m : float
        Distance of the centre of mass from the vertical through the stem base.
    light : float
        Light of all bud sites in the tree's last year.
    limbs : float
        Number of axes.
    mass_kg : float
        Mass of the wood.
    """

    off_centre_m: float
    light: float
    limbs: float
    mass_kg: float


def load(kind: str, seed: int = 1) -> forest.Scenario:
    """Read the scenario of one of the three trees."""
    path = ROOT / "scenarios" / "figures" / f"hart_baker_{kind}.toml"
    return forest.Scenario.load(path).with_overrides([f"seed={seed}"])


def grow(kind: str, seed: int = 1) -> forest.Stand:
    """Grow one of the three trees."""
    scenario = load(kind, seed)
    stand = forest.Stand(scenario)
    for _ in range(scenario.years):
        stand.step()
    return stand


def centre_of_mass(tree: Skeleton) -> NDArray[np.float64]:
    """Centre of mass of the wood relative to the stem base, m (eq. 12, by internodes)."""
    wood = tree.radius**2 * tree.length
    middle = 0.5 * (tree.start + tree.end) - tree.start[0]
    return np.asarray((wood[:, None] * middle).sum(axis=0) / wood.sum())


def off_centre(tree: Skeleton) -> float:
    """Distance of the centre of mass from the vertical through the stem base, m."""
    return float(np.hypot(*centre_of_mass(tree)[:2]))


def measure(stand: forest.Stand) -> Grown:
    """Measure the stand's first tree."""
    tree = stand.skeleton(1)
    row = stand.row_of(1)
    start = int(stand.rows.start[row])
    here = slice(start, start + len(tree))
    state = stand.arena.metamers.state[here]
    sites = ((state & TERMINAL) != 0).astype(int) + ((state & LATERAL) != 0)
    density = stand.species[0].wood.density_kg_m3
    return Grown(
        off_centre(tree),
        float((sites * stand.arena.metamers.light[here]).sum()),
        float(tree.axis.max() + 1),
        float(density * np.pi * (tree.radius**2 * tree.length).sum()),
    )


def figure_1(seeds: Sequence[int] = SEEDS) -> dict[str, list[Grown]]:
    """Grow and measure the three trees of each seed."""
    return {kind: [measure(grow(kind, seed)) for seed in seeds] for kind in KINDS}


def main() -> None:
    """Print the numbers as means over seeds, and draw the first seed's trees side by side."""
    for kind, trees in figure_1().items():
        mean = Grown(*(float(x) for x in np.mean(trees, axis=0)))
        print(kind, ", ".join(f"{name} {value:.3g}" for name, value in mean._asdict().items()))
    to = ROOT / "docs" / "gallery" / "hart_baker.png"
    draw_trees([grow(kind).skeleton(1) for kind in KINDS], KINDS, to, panel=(333, 420))
    print(to)


if __name__ == "__main__":
    main()
