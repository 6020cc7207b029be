"""The neutral shape of a tree, whoever made it: simulator, generator or file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forest.trees.metamers import LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import Trees


@dataclass(frozen=True)
class Skeleton:
    """One tree as a list of cylinders, each parent before its children.

    Attributes
    ----------
    parent : int32 (n,)
        Index of the parent; -1 for the base.
    start, end : float64 (n, 3)
        Ends of the axis of each internode, m, z up, in the plot's coordinates.
    radius : float64 (n,)
        Radius under bark, m.
    axis : int32 (n,)
        Number of the axis; 0 is the trunk. Consecutive metamers of an axis share it.
    order : int32 (n,)
        Branching order; 0 on the trunk.
    birth_year : int32 (n,)
        Calendar year in which each was made.
    leafy : bool (n,)
        Whether a living leaf-bearing site stands at its upper end.
    serial : int32 (n,)
        Lasting numbers of the metamers.
    tree_id : int
        Number of the tree.
    species : str
        Name of the species.
    """

    parent: NDArray[np.int32]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    radius: NDArray[np.float64]
    axis: NDArray[np.int32]
    order: NDArray[np.int32]
    birth_year: NDArray[np.int32]
    leafy: NDArray[np.bool_]
    serial: NDArray[np.int32]
    tree_id: int = 0
    species: str = ""

    def __len__(self) -> int:
        """Count the internodes."""
        return len(self.parent)

    @property
    def length(self) -> NDArray[np.float64]:
        """Length of each internode, m."""
        return np.asarray(np.linalg.norm(self.end - self.start, axis=1), dtype=np.float64)


def number_axes(parent: NDArray[np.int32], main: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Number the axes in order of their first metamer; the base starts axis 0.

    `main` tells which metamers continue their parent's axis.
    """
    starts = ~main
    starts[:1] = True
    index = np.arange(len(parent))
    first = np.where(starts, index, parent)
    while True:  # doubles the reach each time
        further = first[first]
        if np.array_equal(further, first):
            break
        first = further
    number = np.cumsum(starts) - 1
    return np.asarray(number[first], dtype=np.int32)


def skeleton_of(
    metamers: Metamers,
    trees: Trees,
    row: int,
    *,
    species: str,
    pipe_exponent: float,
    start_year: int,
) -> Skeleton:
    """Take one tree's shape out of the arena.

    Parameters
    ----------
    metamers, trees : Metamers, Trees
        The arena and the tree table.
    row : int
        The tree's row in the table.
    species : str
        Name of its species.
    pipe_exponent : float
        n of its pipe model: diameter = pipe^(1/n).
    start_year : int
        Calendar year of step 0, the one before the first, from which `birth` is counted.
    """
    here = slice(int(trees.start[row]), int(trees.start[row]) + int(trees.size[row]))
    parent = metamers.parent[here].copy()
    state = metamers.state[here]
    base = np.array([trees.x[row], trees.y[row], 0.0])
    end = base + metamers.tip[here].astype(np.float64)
    start = end[parent]
    start[parent < 0] = base
    return Skeleton(
        parent=parent,
        start=start,
        end=end,
        radius=0.5 * metamers.pipe[here].astype(np.float64) ** (1.0 / pipe_exponent),
        axis=number_axes(parent, (state & MAIN) != 0),
        order=metamers.order[here].astype(np.int32),
        birth_year=start_year + metamers.birth[here].astype(np.int32),
        leafy=(state & (TERMINAL | LATERAL)) != 0,
        serial=metamers.serial[here].copy(),
        tree_id=int(trees.tree_id[row]),
        species=species,
    )
