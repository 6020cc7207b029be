"""The tree table: rows are appended and kept, columns stay what they are."""

from __future__ import annotations

import numpy as np

from forest.trees.table import COLUMNS, append, empty, keep


def test_rows() -> None:
    first, second = empty(2), empty(3)
    first.tree_id[:] = [1, 2]
    second.tree_id[:] = [3, 4, 5]
    second.base_voxel[:] = [[1, 2, 3]] * 3
    both = append(first, second)
    left = keep(both, both.tree_id % 2 == 1)
    assert left.tree_id.tolist() == [1, 3, 5]
    assert left.base_voxel.tolist() == [[0, 0, 0], [1, 2, 3], [1, 2, 3]]
    for name, (dtype, _, _) in COLUMNS.items():
        column = getattr(left, name)
        assert column.dtype == np.dtype(dtype)
        assert column.flags.c_contiguous
        assert len(column) == 3
