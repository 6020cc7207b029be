"""A tree beside a fence, left alone and brushed over it, after Fig. 16 of Palubicki et al. 2009.

`python scenarios/brush_fig16.py` grows two trees behind the same fence. The first is autonomous:
its markers fill an upright ellipsoid. The second follows strokes that lean it over the
fence. It prints how far their crowns lie from their stems, draws both, and writes the scenario of
the brushed one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import common
import numpy as np
import pandas as pd
from brushing import TREE, Session

from forest.trees.skeleton import Skeleton
from forest.view.brush_picture import Panel, draw_brushed

#: Posts and rails of the fence: lower and upper corner, m.
_FENCE_X = (6.8, 6.9)
FENCE = [
    *(((_FENCE_X[0], y, 0.0), (_FENCE_X[1], y + 0.1, 1.3)) for y in np.arange(3.0, 9.01, 1.0)),
    *(((_FENCE_X[0], 2.9, z), (_FENCE_X[1], 9.2, z + 0.1)) for z in (0.4, 0.8, 1.2)),
]
AUTONOMOUS_YEARS = 20
#: The room of the tree that is left alone.
ENVELOPE = {"shape": "ellipsoid", "center_m": [6.0, 6.0, 2.1], "size_m": [2.6, 2.6, 4.2]}
#: The stem leans, and crosses the fence above its top.
STEM = [[6.0, 6.0, 0.1], [6.05, 6.0, 0.8], [6.4, 6.0, 1.5], [7.0, 6.05, 2.1], [7.7, 6.1, 2.6]]
#: Crowns beyond the fence, hanging down to it, and a small one above the stem.
CROWNS = [
    ([[7.4, 5.5, 2.8], [8.1, 6.2, 2.9], [8.7, 6.4, 2.5]], [0.6, 0.7, 0.5]),
    ([[6.4, 6.0, 2.5], [6.9, 6.3, 3.0]], [0.3, 0.45]),
]


def obstacles() -> list[dict[str, Any]]:
    """Give the fence as obstacles of a scenario."""
    return [
        {"kind": "box", "min_m": [float(v) for v in low], "max_m": [float(v) for v in high]}
        for low, high in FENCE
    ]


def autonomous(seed: int | None) -> Skeleton:
    """Grow the tree that is left alone."""
    markers = {"spacing_m": TREE["environment"]["markers"]["spacing_m"], "envelope": [ENVELOPE]}
    session = Session(seed, obstacles=obstacles(), environment={"markers": markers})
    return session.grow(AUTONOMOUS_YEARS)


def brushed(session: Session) -> Skeleton:
    """Grow the tree that leans over the fence."""
    session.stroke(STEM, 0.16, steps=8)
    session.grow(11)
    for path, radius in CROWNS:
        session.stroke(path, radius)
    return session.grow(15)


def form(name: str, tree: Skeleton) -> dict[str, Any]:
    """Tell where a tree's twigs are, from its base."""
    away = tree.end - tree.start[0]
    beyond = tree.end[:, 0] > _FENCE_X[1]
    return {
        "tree": name,
        "internodes": len(tree),
        "height_m": away[:, 2].max(),
        "crown_from_stem_m": np.hypot(*away[:, :2].mean(axis=0)),
        "beyond_the_fence": beyond.mean(),
    }


def main(words: Sequence[str] | None = None) -> None:
    """Grow, brush, print and draw."""
    given = common.command_line(__doc__, "brush_fig16").parse_args(words)
    with common.one_line_errors(), common.threads(given.threads):
        session = Session(given.seed, obstacles=obstacles())
        trees = {"left alone": autonomous(given.seed), "brushed": brushed(session)}
        given.out.mkdir(parents=True, exist_ok=True)
        table = pd.DataFrame([form(name, tree) for name, tree in trees.items()])
        common.report(table, given.out / "brush_fig16.csv", "two trees beside a fence")
        session.save(given.out / "brush_fig16.toml")
        panels = [Panel(name, [tree], boxes=FENCE, leaves=True) for name, tree in trees.items()]
        draw_brushed(
            panels,
            given.out / "brush_fig16.png",
            bearing_deg=-62.0,
            above_deg=8.0,
            panel=(520, 460),
        )


if __name__ == "__main__":
    main()
