"""Pictures of single trees, alone or side by side, on white."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from forest.trees.skeleton import Skeleton
from forest.view.scene import Scene, look_at, open_plotter, save

_LEAST_WIDTH = 0.0005  # radius of the thinnest wood drawn, as a share of the picture's height


def _box(tree: Skeleton) -> tuple[float, float, float]:
    """Give a tree's farthest reach from its base, its lowest and its highest height, m.

    Boxes lie about the stem base, so that trees of one scale stand on one line.
    """
    points = np.concatenate((tree.start, tree.end))
    reach = np.abs(points[:, :2] - tree.start[0, :2]).max()
    return float(reach), float(points[:, 2].min()), float(points[:, 2].max())


def draw_tree(
    skeleton: Skeleton,
    to: str | Path,
    *,
    leaves: bool = False,
    window: tuple[int, int] = (900, 1100),
) -> None:
    """Draw one tree on white and save the picture.

    Parameters
    ----------
    skeleton : Skeleton
        The tree; at least one internode.
    to : path
        PNG file to write.
    leaves : bool
        Whether to draw foliage.
    window : tuple of int
        Width and height of the picture, pixels.
    """
    draw_trees([skeleton], [""], to, leaves=leaves, panel=window)


def draw_trees(
    skeletons: Sequence[Skeleton],
    titles: Sequence[str],
    to: str | Path,
    *,
    leaves: bool = False,
    columns: int = 0,
    same_scale: bool = True,
    panel: tuple[int, int] = (420, 560),
) -> None:
    """Draw trees side by side on white and save the picture.

    Parameters
    ----------
    skeletons : sequence of Skeleton
        The trees, a panel each; at least one internode in each.
    titles : sequence of str
        A line of text above each; empty for none.
    to : path
        PNG file to write.
    leaves : bool
        Whether to draw foliage.
    columns : int
        Panels in a row; 0 for all in one row.
    same_scale : bool
        Whether a metre is as long in every panel (else each tree fills its own).
    panel : tuple of int
        Width and height of one panel, pixels.
    """
    columns = columns or len(skeletons)
    rows = -(-len(skeletons) // columns)
    bases = [tree.start[0] for tree in skeletons]
    boxes = [_box(tree) for tree in skeletons]
    if same_scale:
        whole = np.array(boxes)
        boxes = [(whole[:, 0].max(), whole[:, 1].min(), whole[:, 2].max())] * len(boxes)
    plotter = open_plotter((panel[0] * columns, panel[1] * rows), (rows, columns))
    for i, (tree, title) in enumerate(zip(skeletons, titles, strict=True)):
        plotter.subplot(*divmod(i, columns))
        plotter.set_background("white", all_renderers=False)
        reach, bottom, top = boxes[i]
        thin = _LEAST_WIDTH * max(2.0 * reach * panel[1] / panel[0], top - bottom)
        Scene([tree], leaves=leaves, least_radius_m=thin).add_to(plotter)
        if title:
            plotter.add_text(title, position="upper_edge", font_size=18, color="black")
        x, y, _ = bases[i]
        sides = [(x + a, y + b) for a in (-reach, reach) for b in (-reach, reach)]
        corners = np.array([(*side, z) for side in sides for z in (bottom, top)])
        look_at(plotter, corners, bearing_deg=-75.0, above_deg=4.0, aspect=panel[0] / panel[1])
    save(plotter, to)
