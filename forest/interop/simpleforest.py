"""SimpleForest's cylinder file: comma-separated, numbers from 0, the base's parent is -1."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forest.interop.cylinders import Cylinders, Numbers, assemble, children, write_rows
from forest.record.export import whole_file
from forest.trees.skeleton import Skeleton

COLUMNS = (
    "ID",
    "parentID",
    *("startX", "startY", "startZ"),
    *("endX", "endY", "endZ"),
    "radius",
    "length",
    "growthLength",
    "averagePointDistance",
    "segmentID",
    "parentSegmentID",
    "branchOrder",
    "reverseBranchOrder",
    "branchID",
)

_POINTS = ("startX", "startY", "startZ", "endX", "endY", "endZ")
_READ = ("ID", "parentID", *_POINTS, "radius", "branchOrder", "branchID")


def write_simpleforest(skeleton: Skeleton, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write a tree as a SimpleForest cylinder file.

    A row per internode; its `ID` is its index in the skeleton. `growthLength` is the length of an
    internode and all that it bears, a segment reaches from one branching (or start of an axis) to
    the next, and `reverseBranchOrder` is 1 in the last segments and one more than its highest
    child's in each below (Hackenberg et al. 2015). No points were fitted: the
    `averagePointDistance` is 0.

    Parameters
    ----------
    skeleton : Skeleton
        The tree.
    path : path
        The file.
    overwrite : bool
        Whether to replace a file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the file exists.
    OutputError
        If it cannot be written. Nothing half-written is left behind.
    """
    segment, parent_segment, reverse_order = _segments(skeleton)
    columns = (
        np.arange(len(skeleton)),
        skeleton.parent,
        *skeleton.start.T,
        *skeleton.end.T,
        skeleton.radius,
        skeleton.length,
        _growth_length(skeleton),
        np.zeros(len(skeleton)),
        segment,
        parent_segment[segment],
        skeleton.order,
        reverse_order[segment],
        skeleton.axis,
    )
    with whole_file(path, overwrite=overwrite) as draft:
        write_rows(draft, COLUMNS, columns, ",")
    return Path(path)


def read_simpleforest(path: str | Path, *, tree_id: int = 0, species: str = "") -> Skeleton:
    """Read a tree from a SimpleForest cylinder file.

    Parameters
    ----------
    path : path
        The file. It must have the columns ID, parentID, start, end, radius, branchOrder and
        branchID; others do not matter, nor does the order of rows and columns.
    tree_id, species : int, str
        What the tree is to be called.

    Returns
    -------
    Skeleton
        Parents before children. Its `serial` is the file's ID; `birth_year` is
        `forest.interop.cylinders.UNKNOWN_YEAR`, and no internode is leafy.

    Raises
    ------
    InputError
        If a column is missing, or with the line of what is wrong: a value that is no number, a
        parent that is missing, parents that run in a circle, a second base.
    """
    numbers = Numbers(path, ",", dict.fromkeys(_READ, 1))
    points = np.stack([numbers.numbers(name) for name in _POINTS], axis=1)
    cylinders = Cylinders(
        name=numbers.integers("ID"),
        parent=numbers.integers("parentID"),
        branch=numbers.integers("branchID"),
        order=numbers.integers("branchOrder"),
        start=points[:, :3],
        end=points[:, 3:],
        radius=numbers.numbers("radius"),
        line=numbers.line,
    )
    return assemble(cylinders, numbers, base_parent=-1, tree_id=tree_id, species=species)


def _growth_length(skeleton: Skeleton) -> NDArray[np.float64]:
    """Sum the length of each internode and all that it bears, m."""
    total = skeleton.length.tolist()
    parent = skeleton.parent.tolist()
    for i in range(len(parent) - 1, 0, -1):
        total[parent[i]] += total[i]
    return np.array(total)


def _segments(
    skeleton: Skeleton,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Number the segments: of each internode, then each segment's parent and reverse order."""
    parent, axis = skeleton.parent, skeleton.axis
    starts = (parent < 0) | (axis != axis[parent]) | (children(skeleton)[parent] > 1)
    number = np.cumsum(starts) - 1
    segment: list[int] = []
    for i, (p, first) in enumerate(zip(parent.tolist(), starts.tolist(), strict=True)):
        segment.append(int(number[i]) if first else segment[p])
    of_internode = np.array(segment, dtype=np.int64)
    first_parent = parent[starts]
    parent_segment = np.where(first_parent >= 0, of_internode[first_parent], -1)
    reverse = [1] * len(parent_segment)
    for s in range(len(reverse) - 1, 0, -1):
        reverse[parent_segment[s]] = max(reverse[parent_segment[s]], reverse[s] + 1)
    return of_internode, parent_segment, np.array(reverse, dtype=np.int64)
