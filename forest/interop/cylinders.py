"""Cylinders of a measured tree: numbers of a text file, put together as a `Skeleton`."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, nearest
from forest.trees.skeleton import Skeleton, number_axes

#: The `birth_year` of a cylinder whose age nobody knows; no calendar year of a run comes near it.
UNKNOWN_YEAR = -(2**31)


class Cylinders(NamedTuple):
    """Cylinders in the order of a file.

    Attributes
    ----------
    name, parent : int64 (n,)
        The file's numbers of the cylinders, and of their parents.
    branch, order : int64 (n,)
        The file's number of the branch, and its branching order.
    start, end : float64 (n, 3)
        Ends of the axis, m.
    radius : float64 (n,)
        Radius, m.
    line : int64 (n,)
        Line of the file.
    """

    name: NDArray[np.int64]
    parent: NDArray[np.int64]
    branch: NDArray[np.int64]
    order: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    radius: NDArray[np.float64]
    line: NDArray[np.int64]


class Numbers:
    """The wanted columns of a text file, with the lines that they stand on.

    Parameters
    ----------
    path : path
        The file: a line of column names, then a line per row; blank lines do not count.
    separator : str
        What stands between two values.
    wanted : mapping of name to width
        The columns to read, and how many values each has: 1, or 3 for a point.

    Raises
    ------
    InputError
        If the file cannot be read, lacks a column, or has a line that is not as many numbers as
        the header announces.
    """

    def __init__(self, path: str | Path, separator: str, wanted: Mapping[str, int]) -> None:
        self._path = Path(path)
        self._wanted = wanted
        lines = enumerate(self._text().splitlines(), start=1)
        full = ((number, line.rstrip()) for number, line in lines if line.strip())
        number, header = next(full, (0, ""))
        if not header:
            raise InputError("is empty", where=str(path), expected=f"a header: {', '.join(wanted)}")
        places, width = self._places([word.strip() for word in header.split(separator)], number)
        values, at = array("d"), array("q")
        for number, line in full:
            words = line.split(separator)
            if len(words) != width:
                raise self.wrong(number, f"{len(words)} values", f"{width}, as the header says")
            try:
                values.extend([float(words[place]) for place in places])
            except ValueError:
                bad = next(words[p].strip() for p in places if not _is_number(words[p]))
                raise self.wrong(number, f"'{bad}' is not a number") from None
            at.append(number)
        self._values = np.array(values).reshape(-1, len(places))
        self.line = np.array(at, dtype=np.int64)
        if not len(self.line):
            raise InputError("holds no cylinders", where=str(path), expected="one on each line")
        self.refuse(~np.isfinite(self._values).all(axis=1), "a value is not finite")

    def numbers(self, column: str) -> NDArray[np.float64]:
        """Give a column, float64 (n,), or (n, 3) for a point."""
        names = list(self._wanted)
        first = sum(self._wanted[name] for name in names[: names.index(column)])
        width = self._wanted[column]
        return self._values[:, first] if width == 1 else self._values[:, first : first + width]

    def integers(self, column: str) -> NDArray[np.int64]:
        """Give a column of whole numbers, int64 (n,)."""
        values = self.numbers(column)
        strange = (values != np.round(values)) | (np.abs(values) >= 2**31)
        self.refuse(strange, f"'{column}' is no whole number")
        return values.astype(np.int64)

    def refuse(self, rows: NDArray[np.bool_], what: str, expected: str = "") -> None:
        """Refuse the file if any of the rows is marked, naming the first one's line."""
        if rows.any():
            raise self.wrong(int(self.line[np.argmax(rows)]), what, expected)

    def wrong(self, line: int, what: str, expected: str = "") -> InputError:
        """Make the error that names a line."""
        return InputError(what, where=f"{self._path}, line {line}", expected=expected)

    def _text(self) -> str:
        try:
            return self._path.read_text(encoding="utf-8-sig")
        except UnicodeDecodeError:
            raise InputError("is not a text file", where=str(self._path)) from None
        except OSError as error:
            reason = (error.strerror or "failed").lower()
            raise InputError(f"cannot be read: {reason}", where=str(self._path)) from error

    def _places(self, header: Sequence[str], line: int) -> tuple[list[int], int]:
        """Find the place of each wanted value in a line, and how many values a line has."""
        first: dict[str, int] = {}
        width = 0
        for name in header:
            first.setdefault(name, width)
            width += self._wanted.get(name, 1)
        for name in self._wanted:
            if name not in first:
                raise self.wrong(line, f"no column '{name}'; {nearest(name, first)}")
        return [first[n] + k for n, size in self._wanted.items() for k in range(size)], width


def assemble(
    cylinders: Cylinders, numbers: Numbers, *, base_parent: int, tree_id: int, species: str
) -> Skeleton:
    """Put cylinders together as a tree, each parent before its children.

    A cylinder continues its parent's axis if both have the same branch and order; of several that
    do, the thickest. Axes are numbered anew, in the order of their first cylinders.

    Parameters
    ----------
    cylinders : Cylinders
        As the file has them, in any order.
    numbers : Numbers
        The file, which names the line of what is wrong.
    base_parent : int
        What the file writes as the parent of the base.
    tree_id, species : int, str
        What the tree is to be called.

    Returns
    -------
    Skeleton
        Its `serial` is the file's number of the cylinder; `birth_year` is `UNKNOWN_YEAR`, and no
        cylinder is leafy.

    Raises
    ------
    InputError
        If a number is given twice, a parent is missing, there is not exactly one base, parents
        run in a circle, or a radius is negative.
    """
    numbers.refuse(cylinders.radius < 0.0, "the radius is negative")
    numbers.refuse(cylinders.order < 0, "the branch order is negative")
    parent = _parent_rows(cylinders, numbers, base_parent)
    depth = _depth(parent, numbers)
    if (parent >= np.arange(len(parent))).any():
        rows = np.argsort(depth, kind="stable")
        place = np.empty(len(rows), np.int64)
        place[rows] = np.arange(len(rows))
        parent = np.where(parent[rows] >= 0, place[parent[rows]], -1)
        sorted_columns: list[Any] = [column[rows] for column in cylinders]
        cylinders = Cylinders(*sorted_columns)
    parents = parent.astype(np.int32)
    n = len(parents)
    return Skeleton(
        parent=parents,
        start=cylinders.start,
        end=cylinders.end,
        radius=cylinders.radius,
        axis=number_axes(parents, _continues(parents, cylinders)),
        order=cylinders.order.astype(np.int32),
        birth_year=np.full(n, UNKNOWN_YEAR, np.int32),
        leafy=np.zeros(n, np.bool_),
        serial=cylinders.name.astype(np.int32),
        tree_id=tree_id,
        species=species,
    )


def children(skeleton: Skeleton) -> NDArray[np.int64]:
    """Count the children of each internode, int64 (n,)."""
    return np.bincount(skeleton.parent[skeleton.parent >= 0], minlength=len(skeleton))


def write_rows(
    to: Path,
    header: Sequence[str],
    columns: Sequence[NDArray[Any]],
    separator: str,
) -> None:
    """Write columns as text, whole numbers as such and lengths to the micrometre."""
    formats = ["%d" if np.issubdtype(c.dtype, np.integer) else "%.6f" for c in columns]
    np.savetxt(
        to,
        np.column_stack(columns),
        fmt=formats,
        delimiter=separator,
        header=separator.join(header),
        comments="",
    )


def _parent_rows(c: Cylinders, numbers: Numbers, base_parent: int) -> NDArray[np.int64]:
    """Find the row of each parent; -1 for the base."""
    by_name = np.argsort(c.name, kind="stable")
    names = c.name[by_name]
    twice = np.zeros(len(names), np.bool_)
    twice[by_name[1:]] = names[1:] == names[:-1]
    numbers.refuse(twice, "a cylinder of this number stands above")
    base = c.parent == base_parent
    if not base.any():
        raise numbers.wrong(
            int(c.line[0]), "no cylinder of the file is a base", f"one with parent {base_parent}"
        )
    second = base.copy()
    second[np.argmax(base)] = False
    numbers.refuse(second, "a second base", f"one cylinder with parent {base_parent}")
    place = np.minimum(np.searchsorted(names, c.parent), len(names) - 1)
    numbers.refuse((names[place] != c.parent) & ~base, "its parent is not in the file")
    return np.where(base, -1, by_name[place])


def _depth(parent: NDArray[np.int64], numbers: Numbers) -> NDArray[np.int64]:
    """Count the ancestors of each row; refuse parents that run in a circle."""
    depth = (parent >= 0).astype(np.int64)
    above = parent.copy()
    for _ in range(len(parent).bit_length()):  # the reach doubles each time
        further = np.where(above >= 0, above[above], -1)
        depth = depth + np.where(above >= 0, depth[above], 0)
        above = further
    circle = np.zeros(len(parent), np.bool_)
    circle[above[above >= 0]] = True
    numbers.refuse(circle, "its parents run in a circle", "a way down to the base")
    return depth


def _continues(parent: NDArray[np.int32], c: Cylinders) -> NDArray[np.bool_]:
    """Tell which cylinders continue their parent's axis."""
    same = (parent >= 0) & (c.branch == c.branch[parent]) & (c.order == c.order[parent])
    rows = np.flatnonzero(same)
    rows = rows[np.lexsort((rows, -c.radius[rows], parent[rows]))]
    _, thickest = np.unique(parent[rows], return_index=True)
    main = np.zeros(len(parent), np.bool_)
    main[rows[thickest]] = True
    return main


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
