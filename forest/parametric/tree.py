"""A parametric tree: stems, cross sections and leaves (Weber & Penn 1995)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.species.parametric import Parameters
from forest.trees.leaves import Leaves
from forest.trees.skeleton import Skeleton

#: The `birth_year` of wood whose age nobody knows; as in `forest.interop.cylinders`.
UNKNOWN_YEAR = -(2**31)


class Stems(NamedTuple):
    """Stems of one tree, a row each, level by level, each after its parent.

    Attributes
    ----------
    level : int32 (n,)
        0 is the trunk. A clone has the level of the stem that it split from.
    parent : int32 (n,)
        The stem that bears it, or that it split from; -1 for the trunk.
    is_clone : bool (n,)
        Whether it split from a stem of its own level.
    length : float64 (n,)
        Length of the whole course in the finished tree, after ZScale, m; a clone's is counted
        from the base of its first twin.
    radius : float64 (n,)
        Radius at the base of that course, m, before taper and flare.
    first, nodes : int32 (n,)
        Its first cross section, and their number.
    offset : float64 (n,)
        Where it leaves its parent, m along the parent's course in the finished tree.
    """

    level: NDArray[np.int32]
    parent: NDArray[np.int32]
    is_clone: NDArray[np.bool_]
    length: NDArray[np.float64]
    radius: NDArray[np.float64]
    first: NDArray[np.int32]
    nodes: NDArray[np.int32]
    offset: NDArray[np.float64]


class Nodes(NamedTuple):
    """Cross sections, stem by stem.

    Attributes
    ----------
    position : float64 (n, 3)
        Centre, m.
    heading, side : float64 (n, 3)
        Unit vectors along the stem and across it; lobes are counted from `side`.
    radius : float64 (n,)
        Radius with taper and flare, without lobes, m.
    stem : int32 (n,)
        The stem.
    z : float64 (n,)
        Place along the stem's course, 0 to 1; as it was before ZScale stretched the tree.
    """

    position: NDArray[np.float64]
    heading: NDArray[np.float64]
    side: NDArray[np.float64]
    radius: NDArray[np.float64]
    stem: NDArray[np.int32]
    z: NDArray[np.float64]


class Joints(NamedTuple):
    """How the tree hangs together, which a swaying tree needs.

    Attributes
    ----------
    node : int32 (stems,)
        The parent's last cross section below each stem; -1 for the trunk.
    segments, start : int32 (stems,)
        Segments of the course, and the one with which the stem begins.
    key : uint64 (stems,)
        Which random numbers are the stem's own.
    leaf_node : int32 (leaves,)
        The last cross section below each leaf.
    """

    node: NDArray[np.int32]
    segments: NDArray[np.int32]
    start: NDArray[np.int32]
    key: NDArray[np.uint64]
    leaf_node: NDArray[np.int32]


@dataclass(frozen=True)
class ParametricTree:
    """A tree made from parameters.

    Attributes
    ----------
    parameters : Parameters
        Its species.
    seed : int
        What it was grown with.
    scale : float
        Its size, scale_tree of the paper, m.
    stems, nodes, leaves : Stems, Nodes, Leaves
        Its parts; coordinates from the base of the trunk, z up.
    joints : Joints
        How they hang together.
    """

    parameters: Parameters
    seed: int
    scale: float
    stems: Stems
    nodes: Nodes
    leaves: Leaves
    joints: Joints

    def skeleton(self, *, tree_id: int = 0) -> Skeleton:
        """Give the tree as a `Skeleton`: an internode between two cross sections of a stem.

        Notes
        -----
        Its radius is the mean of both ends, its axis the stem; a clone starts an axis of its
        twin's order. An internode at whose end or along which leaves sit is leafy.
        """
        stem = self.nodes.stem
        inner = np.flatnonzero(np.diff(stem) == 0)  # lower end of each internode
        of = stem[inner]
        first = inner == self.stems.first[of]
        parent_stem = self.stems.parent[of]
        # The internode that ends at node k of stem s is number k - s - 1.
        below = self.joints.node[of] - parent_stem - self.stems.is_clone[of]
        parent = np.where(first, np.where(parent_stem < 0, -1, below), np.arange(len(inner)) - 1)
        leafy = np.zeros(len(inner), np.bool_)
        leafy[self.joints.leaf_node - self.leaves.stem] = True
        n = len(inner)
        return Skeleton(
            parent=parent.astype(np.int32),
            start=self.nodes.position[inner],
            end=self.nodes.position[inner + 1],
            radius=0.5 * (self.nodes.radius[inner] + self.nodes.radius[inner + 1]),
            axis=of,
            order=self.stems.level[of],
            birth_year=np.full(n, UNKNOWN_YEAR, np.int32),
            leafy=leafy,
            serial=np.arange(n, dtype=np.int32),
            tree_id=tree_id,
            species=self.parameters.name,
        )

    def swayed(
        self, time_s: float, wind_speed: float, gust: float = 0.0, *, time_scale: float = 1.0
    ) -> ParametricTree:
        """Give the tree at a moment of a wind; see `forest.parametric.sway.sway`."""
        return next(self.frames([time_s], wind_speed, gust, time_scale=time_scale))

    def frames(
        self,
        times_s: Iterable[float],
        wind_speed: float,
        gust: float = 0.0,
        *,
        time_scale: float = 1.0,
    ) -> Iterator[ParametricTree]:
        """Give the tree at moments of a wind, one by one; see `forest.parametric.sway.sway`."""
        from forest.parametric.sway import sway

        return sway(self, times_s, wind_speed, gust, time_scale=time_scale)
