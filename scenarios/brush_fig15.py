"""A tree made with the procedural brush, after Fig. 15 of Palubicki et al. 2009.

`python scenarios/brush_fig15.py` sketches a stem with a light stroke, brushes a branch from one of
its buds while all other buds are dormant, and fills a crown with heavy strokes. It prints what
became of the markers of each stroke, draws the five stages and writes the scenario that grows the
same tree.
"""

from __future__ import annotations

from collections.abc import Sequence

import common
from brushing import Session

from forest.view.brush_picture import Panel, draw_brushed

#: Light pressure: the stem, a single stroke of eight years.
STEM = [
    [6.00, 6.0, 0.1],
    [5.93, 6.0, 0.7],
    [6.02, 6.0, 1.3],
    [6.22, 6.0, 1.9],
    [6.25, 6.0, 2.5],
    [6.10, 6.0, 3.1],
]
#: Medium pressure: a branch that begins at a bud of the stem near this place.
FORK = (6.0, 6.0, 1.25)
BRANCH = [[5.70, 5.9, 1.60], [5.30, 5.8, 1.75], [4.85, 5.75, 1.95], [4.45, 5.7, 2.30]]
#: Heavy pressure: the crown, in two strokes.
UPPER = [[5.55, 6.0, 3.15], [6.10, 6.0, 3.65], [6.85, 6.0, 3.30]]
LOWER = [[4.30, 5.7, 2.55], [4.75, 5.8, 2.60]]
RIGHT = [[6.75, 6.1, 2.35], [7.30, 6.1, 2.45]]


def paint(session: Session) -> list[Panel]:
    """Make the tree; give the stages as panels."""
    markers = session.stroke(STEM, 0.13, steps=8)
    tree = session.grow(11)
    panels = [Panel("a: the stem, sketched", [tree], markers)]

    serial = int(tree.serial.max()) + 1
    bud = session.nearest(FORK)
    markers = session.stroke(
        BRANCH, 0.2, tree_id=1, metamer=bud, bud="lateral", from_metamer=bud, steps=6, hold_steps=3
    )
    tree = session.grow(9)
    panels.append(Panel("b: one branch, brushed", [tree], markers, serial))

    markers = session.stroke(UPPER, 0.75)
    panels.append(Panel("c: a cloud for the crown", [tree], markers))
    session.grow(3)
    session.stroke(LOWER, 0.55)
    session.stroke(RIGHT, 0.5)
    panels.append(Panel("d: and two more", [session.stand.skeleton(1)], session.free))
    tree = session.grow(14)
    panels.append(Panel("e: the tree", [tree], leaves=False))
    return panels


def main(words: Sequence[str] | None = None) -> None:
    """Brush, print and draw."""
    given = common.command_line(__doc__, "brush_fig15").parse_args(words)
    with common.one_line_errors(), common.threads(given.threads):
        session = Session(given.seed)
        panels = paint(session)
        given.out.mkdir(parents=True, exist_ok=True)
        common.report(session.stand.strokes, given.out / "brush_fig15.csv", "markers by stroke")
        session.save(given.out / "brush_fig15.toml")
        draw_brushed(panels, given.out / "brush_fig15.png", panel=(300, 420))


if __name__ == "__main__":
    main()
