"""Which trees are drawn with their branches: the chosen one, and those that the camera is near."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from forest.viewer.app import App

_MOST_METAMERS = 120_000  # of all trees that are drawn with branches unasked
_NEAR = 0.6  # height of a tree in the picture, of the picture's, from which it is near


def trees_in_detail(app: App) -> tuple[int, ...]:
    """List the trees that are drawn with branches, of those whose branches are known.

    All of them if that is switched on; none where crowns make way; else the chosen one, unless its
    card asks for the body, and those that fill much of the picture, the nearest first, as long as
    they are not too many.
    """
    known = app.source.with_branches(app.year)
    if app.state.branches or not known:
        return known
    if not app.stage.crowns:
        return ()
    chosen = app.chosen if app.state.shape != "body" else None
    trees = app.trees
    rows = np.flatnonzero(np.isin(trees["tree_id"].to_numpy(), known))
    height = np.nan_to_num(trees["height_m"].to_numpy(np.float64)[rows])
    middle = np.column_stack(
        (trees["x_m"].to_numpy(np.float64)[rows], trees["y_m"].to_numpy(np.float64)[rows], height)
    )
    middle[:, 2] *= 0.5
    filled = app.stage.filled_by(middle, height)
    metamers = np.nan_to_num(trees["metamers"].to_numpy(np.float64)[rows])
    ids = trees["tree_id"].to_numpy(np.int64)[rows]
    left = float(_MOST_METAMERS)
    found = []
    for k in np.lexsort((-filled, ids != chosen)):
        is_chosen = ids[k] == chosen
        left -= metamers[k]
        if is_chosen or (filled[k] >= _NEAR and left >= 0.0 and ids[k] != app.chosen):
            found.append(int(ids[k]))
    return tuple(sorted(found))
