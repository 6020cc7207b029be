"""TreeQSM's cylinder text: tab-separated, numbers from 1, the base's parent is 0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from forest.interop.cylinders import Cylinders, Numbers, assemble, write_rows
from forest.record.export import whole_file
from forest.trees.skeleton import Skeleton

COLUMNS = (
    "radius (m)",
    "length (m)",
    "start_point",
    "axis_direction",
    "parent",
    "extension",
    "branch",
    "branch_order",
    "position_in_branch",
    "mad",
    "SurfCov",
    "added",
    "UnmodRadius (m)",
)

#: The columns that are read; the points have one name but three values.
_READ = {
    "radius (m)": 1,
    "length (m)": 1,
    "start_point": 3,
    "axis_direction": 3,
    "parent": 1,
    "branch": 1,
    "branch_order": 1,
}


def write_treeqsm(skeleton: Skeleton, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write a tree as TreeQSM writes `cylinder_NAME.txt`.

    A row per internode. Cylinders were not fitted to points: `mad` is 0, `SurfCov` is 1, none is
    `added`, and the unmodified radius is the radius.

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
    n = len(skeleton)
    length = skeleton.length
    direction = np.zeros((n, 3))
    direction[:, 2] = 1.0  # of an internode without length
    long = length > 0.0
    direction[long] = (skeleton.end - skeleton.start)[long] / length[long, None]
    columns = (
        skeleton.radius,
        length,
        *skeleton.start.T,
        *direction.T,
        skeleton.parent + 1,
        _extension(skeleton),
        skeleton.axis + 1,
        skeleton.order,
        _position(skeleton),
        np.zeros(n),
        np.ones(n),
        np.zeros(n, np.int32),
        skeleton.radius,
    )
    with whole_file(path, overwrite=overwrite) as draft:
        write_rows(draft, COLUMNS, columns, "\t")
    return Path(path)


def read_treeqsm(path: str | Path, *, tree_id: int = 0, species: str = "") -> Skeleton:
    """Read a tree from TreeQSM's `cylinder_NAME.txt`.

    Parameters
    ----------
    path : path
        The file. It must have the columns radius, length, start_point, axis_direction, parent,
        branch and branch_order.
    tree_id, species : int, str
        What the tree is to be called.

    Returns
    -------
    Skeleton
        Parents before children. Its `serial` is the row's number, from 1; `birth_year` is
        `forest.interop.cylinders.UNKNOWN_YEAR`, and no internode is leafy.

    Raises
    ------
    InputError
        If a column is missing, or with the line of what is wrong: a value that is no number, a
        parent that is missing, parents that run in a circle, a second base.
    """
    numbers = Numbers(path, "\t", _READ)
    length = numbers.numbers("length (m)")
    numbers.refuse(length < 0.0, "the length is negative")
    start = numbers.numbers("start_point")
    cylinders = Cylinders(
        name=np.arange(1, len(length) + 1),
        parent=numbers.integers("parent"),
        branch=numbers.integers("branch"),
        order=numbers.integers("branch_order"),
        start=start,
        end=start + length[:, None] * numbers.numbers("axis_direction"),
        radius=numbers.numbers("radius (m)"),
        line=numbers.line,
    )
    return assemble(cylinders, numbers, base_parent=0, tree_id=tree_id, species=species)


def _extension(skeleton: Skeleton) -> NDArray[np.int64]:
    """Give the number of the cylinder that continues each one's branch; 0 for none."""
    extension = np.zeros(len(skeleton), np.int64)
    on_axis = _on_axis(skeleton)
    extension[skeleton.parent[on_axis]] = np.flatnonzero(on_axis) + 1
    return extension


def _position(skeleton: Skeleton) -> NDArray[np.int64]:
    """Count each cylinder's place in its branch, from 1."""
    by_axis = np.argsort(skeleton.axis, kind="stable")
    axis = skeleton.axis[by_axis]
    first = np.searchsorted(axis, axis)
    position = np.empty(len(axis), np.int64)
    position[by_axis] = np.arange(len(axis)) - first + 1
    return position


def _on_axis(skeleton: Skeleton) -> NDArray[np.bool_]:
    parent = skeleton.parent
    same: NDArray[np.bool_] = (parent >= 0) & (skeleton.axis == skeleton.axis[parent])
    return same
