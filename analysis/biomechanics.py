"""Taylor-Hell 2005 in numbers and pictures: `python analysis/biomechanics.py`.

Tilted seedlings, Figs 3, 5, 8 and 9, and two of the tree forms of Halle and Oldeman that bending
makes. Names as arguments do these alone: `python analysis/biomechanics.py fruit_tree troll`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from analysis.bent_form import (  # noqa: E402
    base_lean_deg,
    curvature,
    grow,
    inflections,
    lean_with_age,
    load,
    s_share,
    thick_side,
    tip_height_m,
    upper_share,
)
from analysis.tree_form import form_of  # noqa: E402
from forest.trees.skeleton import Skeleton  # noqa: E402
from forest.view.tree_picture import draw_trees  # noqa: E402

TO = ROOT / "docs" / "gallery"
SEEDLING_YEARS = (5, 10, 20)
#: The second architecture of Fig. 3: the scenario's tree with other curves.
DECURRENT = (
    ".architecture.internode_factor_by_order=[[0.0, 0.6], [1.0, 1.0], [2.0, 0.8]]",
    ".architecture.shoots_by_height_in_year=[[0.0, 1.2], [1.0, 2.0]]",
    ".architecture.shoots_by_order=[]",
)
FRUIT_KG = (0.0, 0.02, 0.1)


class Seedling(NamedTuple):
    """A tilted seedling in some year.

    Attributes
    ----------
    year : int
        Years since it was planted.
    species : str
        Its species.
    lean_deg : float
        Angle to the vertical of the line from the ground to the stem's top.
    base_lean_deg : float
        The same of the stem's oldest 0.6 m.
    eccentricity, thick_side_deg : float
        Of the ring at the ground; azimuth, the seedlings having been tilted towards 0.
    tree : Skeleton
        Its shape.
    """

    year: int
    species: str
    lean_deg: float
    base_lean_deg: float
    eccentricity: float
    thick_side_deg: float
    tree: Skeleton


def tilted(righting: str, years: Sequence[int] = SEEDLING_YEARS) -> list[Seedling]:
    """Grow the tilted spruce and beech and measure both in each of these years."""
    overrides = [f'mechanics.righting="{righting}"', f"years={max(years)}"]
    seedlings = []
    for year, stand, _ in grow("tilted_seedling", overrides, years):
        for row, tree_id in enumerate(stand.rows.tree_id):
            tree = stand.skeleton(int(tree_id))
            lean = float(stand.measure().lean_deg[row])
            side = thick_side(stand, int(tree_id))
            seedlings.append(Seedling(year, tree.species, lean, base_lean_deg(tree), *side, tree))
    return seedlings


def fruit(mass_kg: float, years: int = 12) -> tuple[Skeleton, Skeleton]:
    """Grow the fruit tree and give its shapes in summer and in winter."""
    overrides = [f".mechanics.fruit_mass_kg={mass_kg}", f"years={years}"]
    (grown,) = grow("fruit_tree", overrides)
    return grown.tree, grown.stand.skeleton(1, season="winter")


def last(name: str, *overrides: str) -> Skeleton:
    """Give a scenario's tree in its last year."""
    (grown,) = grow(name, overrides)
    return grown.tree


def life(name: str, *overrides: str) -> list[Skeleton]:
    """Give a scenario's tree in every year."""
    years = range(1, load(name).years + 1)
    return [grown.tree for grown in grow(name, overrides, years)]


def _draw_tilted() -> None:
    trees, titles = [], []
    for righting in ("strain", "none", "beta"):
        for s in tilted(righting):
            print(
                f"righting {righting} | {s.species}, {s.year} years | lean {s.lean_deg:.1f}, "
                f"lowest 0.6 m {s.base_lean_deg:.1f}, eccentricity {s.eccentricity:.2f}, "
                f"thick side {s.thick_side_deg:.0f}",
                flush=True,
            )
            if righting == "strain" or (righting == "none" and s.year == SEEDLING_YEARS[-1]):
                trees.append(s.tree)
                titles.append(f"{s.year} years" + (", no righting" if righting == "none" else ""))
    for first, name in ((0, "tilted_spruce"), (1, "tilted_beech")):
        draw_trees(
            trees[first::2],
            titles[first::2],
            TO / f"{name}.png",
            same_scale=False,
            panel=(300, 420),
        )


def _draw_s_shape() -> None:
    trees = []
    for year, _, tree in grow("s_shaped_axis", (), (5, 7, 9)):
        rates = curvature(tree)
        print(
            f"s_shaped_axis | {year} years | bends by {rates[:5].mean():.3f} rad/m at its base, "
            f"{rates[-5:].mean():.3f} at its tip, changes sign at joints "
            f"{inflections(rates)} of {len(rates)}"
        )
        trees.append(replace(tree, radius=3.0 * tree.radius))
    draw_trees(trees, ["5 years", "7 years", "9 years"], TO / "s_shaped_axis.png", panel=(333, 260))


def _draw_fruit() -> None:
    trees, titles = [], []
    for mass in FRUIT_KG:
        summer, winter = fruit(mass)
        heights = tip_height_m(summer), tip_height_m(winter)
        print(f"fruit_tree | {mass} kg | tips at {heights[0]:.3f} m, in winter {heights[1]:.3f} m")
        trees += [summer, winter]
        titles += [f"{1000 * mass:.0f} g, summer", "winter"]
    draw_trees(trees[2:], titles[2:], TO / "fruit_tree.png", columns=2, panel=(500, 420))


def _draw_curves() -> None:
    trees = [last("curves"), last("curves", *DECURRENT)]
    for title, tree in zip(("excurrent", "decurrent"), trees, strict=True):
        form = form_of(tree)
        print(
            f"curves | {title} | {len(tree)} internodes, height {form.height_m:.1f} m, crown width "
            f"per height {form.width:.2f}, wood in the trunk {form.trunk_wood:.2f}"
        )
    draw_trees(trees, ["one set of curves", "another"], TO / "curves.png", panel=(500, 460))


def _draw_with_and_without() -> None:
    bent = last("with_biomechanics")
    straight = last("with_biomechanics", "mechanics.bending=false")
    for title, tree in (("without", straight), ("with", bent)):
        form = form_of(tree)
        print(
            f"with_biomechanics | {title} | {len(tree)} internodes, mean tip height "
            f"{tip_height_m(tree):.2f} m, crown width per height {form.width:.2f}, S-shaped "
            f"first-order axes {s_share(tree):.2f}"
        )
    titles = ["without biomechanics", "with"]
    draw_trees([straight, bent], titles, TO / "with_biomechanics.png", panel=(500, 460))


def _draw_champagnat() -> None:
    trees = life("champagnat")
    lean = lean_with_age(trees, range(9))
    print(
        f"champagnat | internodes lean by {lean[0]:.0f} degrees when they grow, by {lean[1]:.0f} "
        f"five years later; {upper_share(trees[-1]):.2f} of what leaning axes bear stands on their "
        "upper side"
    )
    titles = ["6 years", "8 years", "10 years"]
    draw_trees(trees[5::2], titles, TO / "champagnat.png", same_scale=False, panel=(333, 330))


def _draw_troll() -> None:
    trees = life("troll")
    fallen = life("troll", 'mechanics.righting="none"')
    for title, shapes in (("righting", trees), ("no righting", fallen)):
        lean = lean_with_age(shapes, [0])
        print(
            f"troll | {title} | the stem's internodes lean by {lean[0]:.0f} degrees when they "
            f"grow, by {lean[1]:.0f} five years later; height {form_of(shapes[-1]).height_m:.1f} m"
        )
    titles = ["5 years", "9 years", "14 years", "no righting"]
    shown = [trees[4], trees[8], trees[13], fallen[13]]
    draw_trees(shown, titles, TO / "troll.png", panel=(300, 420))


FIGURES = {
    "tilted_seedling": _draw_tilted,
    "curves": _draw_curves,
    "s_shaped_axis": _draw_s_shape,
    "fruit_tree": _draw_fruit,
    "with_biomechanics": _draw_with_and_without,
    "champagnat": _draw_champagnat,
    "troll": _draw_troll,
}


def main(names: list[str]) -> None:
    """Print and draw the figures of these names, or all."""
    for name in names or FIGURES:
        FIGURES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
