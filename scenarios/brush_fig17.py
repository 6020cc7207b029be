"""Ornamental trees made with symmetric brushes, after Fig. 17 of Palubicki et al. 2009.

`python scenarios/brush_fig17.py` brushes one half of a figure of scrolls with a mirror, and one
cell of a trellis with a tiling. The markers are symmetric to the last bit; the trees, which
organise themselves, are not quite. It prints how much of the markers was colonised, draws both and
writes their scenarios.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import common
import numpy as np
import pandas as pd
from brushing import TREE, Session

from forest.view.brush_picture import Panel, draw_brushed

X, Y = 6.0, 6.0
#: Width and height of a cell of the trellis, m, and its rows.
WIDE, HIGH, ROWS = 1.0, 1.0, 3
#: Radius of the brush: a line, not a cloud, m.
LINE = 0.08
#: A slender tree: internodes of 6 cm.
SLENDER: dict[str, Any] = {
    **TREE,
    "environment": {"markers": {"everywhere": False, "spacing_m": 0.06}},
    "species": {
        name: {
            **keys,
            "architecture": {"internode_length_m": 0.06, "max_metamers_per_shoot": 3},
            "shoots": {"light_weight": 1.0, "tropism_weight": 0.0},
        }
        for name, keys in TREE["species"].items()
    },
}


def scroll(
    x: float, z: float, radius: float, start: float, end: float, shrink: float
) -> list[list[float]]:
    """Give a spiral in the plane of the tree: from one angle (degrees) to another, narrowing."""
    turns = np.radians(np.linspace(start, end, 40))
    wide = radius * np.linspace(1.0, shrink, 40)
    points = np.column_stack((x + wide * np.cos(turns), np.full(40, Y), z + wide * np.sin(turns)))
    return [[float(v) for v in point] for point in points]


def bilateral(session: Session) -> None:
    """Brush scrolls, two on each side of a stem."""
    session.stroke([[X, Y, 0.05], [X, Y, 2.9]], LINE, steps=18)
    session.grow(20)
    mirror = {"x_m": X, "y_m": Y}
    for x, z, radius in ((0.75, 1.0, 0.75), (0.5, 2.2, 0.5)):
        path = scroll(X + x, z, radius, 180.0, -330.0, 0.2)
        session.stroke(path, LINE, steps=round(40 * radius), mirror=mirror)
    session.grow(34)


def trellis(session: Session) -> None:
    """Brush a trellis, row by row: one arm of a cell, mirrored and tiled, on a short stem."""
    session.stroke([[X, Y, 0.05], [X, Y, 0.45]], LINE, steps=3)
    session.grow(4)
    rise = np.linspace(0.0, 1.0, 13)
    aside = 0.25 * WIDE * (1.0 - np.cos(np.pi * rise))
    for row in range(ROWS):
        axis = X - 0.5 * WIDE * row  # of the leftmost cell; each row is one cell wider
        arm = [
            [float(axis + x), Y, float(0.35 + HIGH * (row + z))]
            for x, z in zip(aside, rise, strict=True)
        ]
        session.stroke(
            arm,
            LINE,
            steps=8,
            mirror={"x_m": axis, "y_m": Y},
            tiling={"shifts_m": [[WIDE, 0.0, 0.0]], "counts": [row + 1]},
        )
        session.grow(10)


def main(words: Sequence[str] | None = None) -> None:
    """Brush, print and draw."""
    given = common.command_line(__doc__, "brush_fig17").parse_args(words)
    with common.one_line_errors(), common.threads(given.threads):
        given.out.mkdir(parents=True, exist_ok=True)
        panels, tables = [], []
        for name, brush in (("bilateral", bilateral), ("tiling", trellis)):
            session = Session(given.seed, **SLENDER)
            brush(session)
            tables.append(session.stand.strokes.assign(form=name))
            session.save(given.out / f"brush_fig17_{name}.toml")
            panels.append(Panel(f"{name}: its markers", [], session.laid))
            panels.append(Panel(f"{name}: the tree", [session.stand.skeleton(1)]))
        common.report(pd.concat(tables), given.out / "brush_fig17.csv", "markers by stroke")
        draw_brushed(panels, given.out / "brush_fig17.png", panel=(330, 380), above_deg=2.0)


if __name__ == "__main__":
    main()
