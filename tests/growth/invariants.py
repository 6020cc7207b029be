"""What holds for every arena, whatever grew in it."""

from __future__ import annotations

import numpy as np

from forest.trees.metamers import BRANCHED, CONTINUED, LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import Trees


def assert_valid(arena: Metamers, trees: Trees) -> None:
    """Check the arena's contract tree by tree, and that no two extents overlap."""
    used = trees.room > 0
    by_place = np.argsort(trees.start[used], kind="stable")
    start, room = trees.start[used][by_place], trees.room[used][by_place]
    assert (start[:-1] + room[:-1] <= start[1:]).all(), "extents overlap"
    assert (trees.size <= trees.room).all(), "a tree is larger than its extent"
    for row in range(len(trees.tree_id)):
        _check_tree(arena, trees, row)


def _check_tree(arena: Metamers, trees: Trees, row: int) -> None:
    n = int(trees.size[row])
    here = slice(int(trees.start[row]), int(trees.start[row]) + n)
    m = Metamers(*(field[here] for field in arena))
    for name in ("tip", "bud", "length", "pipe", "sapwood", "light", "resource"):
        assert np.isfinite(getattr(m, name)).all(), name
    assert (m.length > 0).all()
    assert (m.sapwood <= m.pipe).all()
    assert (m.sapwood >= 0).all()
    assert (m.pipe > 0).all()
    assert np.allclose(np.linalg.norm(m.bud, axis=1), 1.0, atol=1e-5)
    assert (np.diff(m.serial) > 0).all(), "serials do not rise"
    assert m.serial[-1] < trees.next_serial[row]
    assert m.parent[0] == -1
    assert (m.parent[1:] >= 0).all()
    assert (m.parent[1:] < np.arange(1, n)).all(), "a child stands before its parent"
    main = (m.state & MAIN) != 0
    main[0] = False
    followers = np.bincount(m.parent[1:][main[1:]], minlength=n)
    branches = np.bincount(m.parent[1:][~main[1:]], minlength=n)
    assert (followers == ((m.state & CONTINUED) != 0)).all()
    assert (branches == ((m.state & BRANCHED) != 0)).all()
    assert not (m.state & TERMINAL).astype(bool)[followers > 0].any(), "terminal bud inside an axis"
    assert not (m.state & LATERAL).astype(bool)[branches > 0].any(), "a lateral bud on a branch"
    below = m.parent[1:]
    assert (m.order[1:] == m.order[below].astype(int) + ~main[1:]).all()
    assert (m.birth[1:] >= m.birth[below]).all(), "older than what bears it"
    span = np.linalg.norm(m.tip[1:] - m.tip[below], axis=1)
    assert np.allclose(span, m.length[1:], rtol=1e-4, atol=1e-6)
