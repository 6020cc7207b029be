"""Trees at the edge of an open stand in the wind: thicker, shorter, with crowns to one side.

`python analysis/edge_trees.py` grows a small open stand with and without the wind's feedback,
prints what sets its edge apart, and draws docs/gallery/edge_trees.png.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import forest  # noqa: E402
from forest.trees.metamers import LATERAL, TERMINAL  # noqa: E402

FIGURE = ROOT / "docs" / "gallery" / "edge_trees.png"
SIDE_M = 16.0
SPACING_M = 2.0
WIND_M_S = 15.0
ZONES = ("edge", "second", "inside")


@dataclass(frozen=True)
class Edge:
    """What sets the edge of a stand apart: means by zone, and the lean of its crowns.

    Attributes
    ----------
    height_m, dbh_cm, slenderness, stress : Series
        By zone: edge (the outer row), second, inside. Slenderness is H/D; stress is that at the
        stem's foot in the wind, MPa.
    leaning_out : float
        How far the centre of the crowns of the edge (without corners) lies outwards from the stem,
        in crown radii.
    leaning_inside : float
        The same of the trees inside, towards the nearest edge.
    """

    height_m: pd.Series
    dbh_cm: pd.Series
    slenderness: pd.Series
    stress: pd.Series
    leaning_out: float
    leaning_inside: float


def scenario(species: str, *, years: int, wind_growth: bool) -> forest.Scenario:
    """Plant 64 trees in rows on an open plot, in the usual wind."""
    return forest.Scenario.from_toml(f"""
        years = {years}
        plot = {{ size_m = [{SIDE_M}, {SIDE_M}], boundary = "open" }}
        environment = {{ shadow = {{}}, canopy = {{}} }}
        species = {{ {species} = {{}} }}
        planting = {{ kind = "regular", spacing_m = [{SPACING_M}, {SPACING_M}] }}
        [mechanics]
        bending = false
        wind_m_s = {WIND_M_S}
        wind_growth = {str(wind_growth).lower()}
    """)


def grow(of: forest.Scenario) -> pd.DataFrame:
    """Grow a scenario; give the trees of its last year with stability and place of the crown."""
    stand = forest.Stand(of)
    for _ in range(of.years):
        record = stand.step()
    trees = pd.DataFrame(record.tables["trees"])
    stability = pd.DataFrame(record.tables["stability"])
    trees["base_moment_nm"] = stability["base_moment_nm"]
    metamers = stand.arena.metamers
    centres = []
    for tree_id in trees["tree_id"]:
        row = stand.row_of(int(tree_id))
        here = slice(int(stand.rows.start[row]), int(stand.rows.start[row] + stand.rows.size[row]))
        state = metamers.state[here]
        leaves = ((state & TERMINAL) != 0) * 1 + ((state & LATERAL) != 0)
        centres.append(leaves @ metamers.tip[here, :2] / leaves.sum())
    trees[["crown_x_m", "crown_y_m"]] = np.array(centres, float)
    return trees


def zones(trees: pd.DataFrame) -> pd.Series:
    """Name each tree's zone by its row: edge, second or inside."""
    to_edge = np.minimum(
        np.minimum(trees["x_m"], SIDE_M - trees["x_m"]),
        np.minimum(trees["y_m"], SIDE_M - trees["y_m"]),
    )
    return pd.cut(to_edge, [0, SPACING_M, 2 * SPACING_M, np.inf], labels=list(ZONES))


def compare(trees: pd.DataFrame) -> Edge:
    """Compare the zones of a stand that `grow` gave."""
    zone = zones(trees)
    trees = trees.assign(
        slenderness=100.0 * trees["height_m"] / trees["dbh_cm"],
        stress=32e-6 * trees["base_moment_nm"] / (np.pi * (trees["base_diameter_cm"] / 100) ** 3),
    )
    means = trees.groupby(zone, observed=False)[["height_m", "dbh_cm", "slenderness", "stress"]]
    mean = means.mean()
    # Outwards is along the axis whose border is nearer; at corners it is neither.
    aside = np.column_stack((trees["x_m"], trees["y_m"])) - 0.5 * SIDE_M
    far = np.abs(aside)
    outward = np.where(far >= far.max(axis=1, keepdims=True), np.sign(aside), 0.0)
    crown = trees[["crown_x_m", "crown_y_m"]].to_numpy()
    lean = pd.Series((crown * outward).sum(axis=1) / trees["crown_radius_m"], trees.index)
    one_sided = np.isclose(far[:, 0], far[:, 1])
    return Edge(
        mean["height_m"],
        mean["dbh_cm"],
        mean["slenderness"],
        mean["stress"],
        float(lean[(zone == "edge") & ~one_sided].mean()),
        float(lean[(zone == "inside") & ~one_sided].mean()),
    )


def _print(name: str, found: Edge) -> None:
    print(f"{name}\n  zone     height m   dbh cm   H/D   stress at the foot MPa")
    for zone in ZONES:
        print(
            f"  {zone:<8} {found.height_m[zone]:8.1f} {found.dbh_cm[zone]:8.1f} "
            f"{found.slenderness[zone]:5.0f} {found.stress[zone]:8.1f}"
        )
    print(
        f"  crowns lie outwards by {found.leaning_out:.2f} radii at the edge, "
        f"{found.leaning_inside:.2f} inside"
    )


def _draw(stands: dict[str, pd.DataFrame], to: Path) -> None:
    """Draw each stand from above: crowns by slenderness, and where their centres lie."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(stands), figsize=(5.2 * len(stands), 5), sharey=True)
    for axis, (name, trees) in zip(axes, stands.items(), strict=True):
        slenderness = 100.0 * trees["height_m"] / trees["dbh_cm"]
        marks = axis.scatter(
            trees["x_m"],
            trees["y_m"],
            s=1.1 * trees["dbh_cm"] ** 2,
            c=slenderness,
            cmap="viridis",
            vmin=40,
            vmax=100,
        )
        axis.quiver(
            trees["x_m"],
            trees["y_m"],
            trees["crown_x_m"],
            trees["crown_y_m"],
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.005,
        )
        view = (-2.0, SIDE_M + 2.0)
        axis.set(title=name, xlabel="x, m", aspect="equal", xlim=view, ylim=view)
    axes[0].set_ylabel("y, m")
    figure.colorbar(marks, ax=list(axes), label="slenderness H/D")
    figure.savefig(to, dpi=110, bbox_inches="tight")


def main() -> None:
    """Grow, print and draw."""
    for species in ("pinus_sylvestris", "picea_abies"):
        stands = {
            name: grow(scenario(species, years=30, wind_growth=fed_back))
            for name, fed_back in (("growth knows no wind", False), ("wind growth", True))
        }
        for name, trees in stands.items():
            _print(f"{species}, {name}", compare(trees))
        if species == "pinus_sylvestris":
            _draw(stands, FIGURE)
            print(f"wrote {FIGURE.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
