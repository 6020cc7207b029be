"""Draw the figures of Palubicki et al. 2009 with this program: `python analysis/gallery.py`.

Pictures go to docs/gallery; the numbers of each tree are printed and written beside them. Names
of figures as arguments draw these alone: `python analysis/gallery.py figure_07 paper_tree`.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from analysis.tree_form import form_of, grow, runions  # noqa: E402
from forest.trees.skeleton import Skeleton  # noqa: E402
from forest.view.stand_picture import draw_stand  # noqa: E402
from forest.view.tree_picture import draw_tree, draw_trees  # noqa: E402

TO = ROOT / "docs" / "gallery"

#: Panels of each figure: title, overrides.
PANELS: dict[str, list[tuple[str, list[str]]]] = {
    "figure_06": [
        ("sylleptic", []),
        (
            "proleptic, sympodial",
            ['.architecture.ramification="proleptic"', '.architecture.axis="sympodial"'],
        ),
    ],
    "figure_07": [
        (f"lambda {bias:.2f}", [f".bud_fate.apical_bias={bias}"])
        for bias in (0.46, 0.48, 0.50, 0.52, 0.54)
    ],
    "figure_09": [
        (f"kappa {kappa}", [f".bud_fate.priority_kappa={kappa}"]) for kappa in (0.5, 0.35)
    ],
    "figure_10": [
        (title, [f".bud_fate.apical_control_until_age_years={years}"])
        for title, years in (
            ("ends early everywhere", [3.0]),
            ("main stem only, ends late", [14.0, 0.0]),
            ("kept in first-order axes", [3.0, 1000.0, 0.0]),
        )
    ],
    "figure_12": [
        (title, [f".shoots.tropism_weight={eta}", f".shoots.light_weight={xi}"])
        for title, eta, xi in (
            ("a: slightly up", 0.1, 0.1),
            ("b: slightly down", -0.1, 0.1),
            ("c: down, much light", -0.8, 1.0),
            ("d: down, little light", -0.8, 0.1),
        )
    ],
    "figure_13": [("constant", [".shoots.tropism_factor_by_age=[]"]), ("turns downward", [])],
    "figure_14": [("no shedding", [".shedding.light_per_internode=0.0"]), ("shedding", [])],
}


def _tell(name: str, title: str, tree: Skeleton) -> None:
    numbers = ", ".join(f"{key} {value:.3g}" for key, value in form_of(tree)._asdict().items())
    print(f"{name} | {title} | {numbers}", flush=True)


def _draw_panels(name: str) -> None:
    panels = PANELS[name]
    trees = [grow(name.removeprefix("figure_"), overrides)[0] for _, overrides in panels]
    for (title, _), tree in zip(panels, trees, strict=True):
        _tell(name, title, tree)
    columns = 2 if len(panels) == 4 else len(panels)
    draw_trees(
        trees,
        [title for title, _ in panels],
        TO / f"{name}.png",
        columns=columns,
        same_scale=name != "figure_06",
        panel=(1000 // columns, 420),
    )


def _draw_figure_11() -> None:
    for years in (5, 12, 20):
        trees = grow("11", [f"years={years}"])
        _tell("figure_11", f"left tree, {years} years", trees[0])
        draw_stand(
            trees, (30.0, 30.0), TO / f"figure_11_{years:02}.png", leaves=False, window=(700, 600)
        )


def _draw_figure_21() -> None:
    trees = [runions(), grow("21")[0]]
    titles = ["without buds", "with buds"]
    for title, tree in zip(titles, trees, strict=True):
        _tell("figure_21", title, tree)
    draw_trees(trees, titles, TO / "figure_21.png", panel=(500, 460))


def _draw_paper_tree() -> None:
    scenario = forest.Scenario.load(ROOT / "scenarios" / "paper_tree.toml")
    stand = forest.Stand(scenario)
    for _ in range(scenario.years):
        stand.step()
    tree = stand.skeleton(1)
    _tell("paper_tree", "one tree", tree)
    print({phase: round(seconds, 2) for phase, seconds in stand.seconds.items()})
    draw_tree(tree, TO / "paper_tree.png", window=(800, 800))


def main(names: list[str]) -> None:
    """Draw the figures of these names, or all."""
    TO.mkdir(parents=True, exist_ok=True)
    others = {
        "figure_11": _draw_figure_11,
        "figure_21": _draw_figure_21,
        "paper_tree": _draw_paper_tree,
    }
    for name in names or sorted([*PANELS, *others]):
        others.get(name, lambda name=name: _draw_panels(name))()


if __name__ == "__main__":
    main(sys.argv[1:])
