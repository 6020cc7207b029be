"""The neutral shape of a tree, whoever made it: simulator, generator or file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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
