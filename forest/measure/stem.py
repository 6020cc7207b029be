"""The stem as the one truth: diameters, taper and volumes are all read from its internodes.

The stem is the path of `forest.measure.trees`: from the base up along the main continuation, and
where an axis has ended, along the branch at its last node. An internode is a cylinder, so the
diameter is a step function of the distance from the base along the stem, and every volume is an
exact integral of it. Stems of many trees lie one behind the other in `Stems`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.measure.bark import diameter_over_bark
from forest.measure.trees import MeasureSpecies
from forest.trees.metamers import CONTINUED, MAIN, Metamers
from forest.trees.skeleton import Skeleton
from forest.trees.table import Trees

_BINS = 32  # fixed, so that results do not depend on the number of threads
_QUARTER_PI = 0.25 * np.pi


@dataclass(frozen=True)
class Stems:
    """The stems of n trees, k internodes in all, each stem from its base to its top.

    Attributes
    ----------
    first : int64 (n + 1,)
        Stem t has the internodes `first[t]` to `first[t + 1] - 1`.
    metamer : int32 (k,)
        Index of each internode in its tree's extent or skeleton.
    end_m : float64 (k,)
        Distance of its upper end from the base, along the stem.
    reach_m : float64 (k,)
        Greatest height above the base that the stem has reached at its upper end.
    diameter_m : float64 (k,)
        Under bark.
    bark_factor : float64 (n,)
        Double bark thickness per diameter over bark.
    """

    first: NDArray[np.int64]
    metamer: NDArray[np.int32]
    end_m: NDArray[np.float64]
    reach_m: NDArray[np.float64]
    diameter_m: NDArray[np.float64]
    bark_factor: NDArray[np.float64]

    def __len__(self) -> int:
        """Count the stems."""
        return len(self.first) - 1

    @property
    def owner(self) -> NDArray[np.int64]:
        """Stem of each internode, (k,)."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    @property
    def start_m(self) -> NDArray[np.float64]:
        """Distance of each internode's lower end from the base, along the stem, (k,)."""
        start = np.concatenate(([0.0], self.end_m[:-1]))[: len(self.end_m)]
        start[self.first[:-1][np.diff(self.first) > 0]] = 0.0
        return start

    @property
    def length_m(self) -> NDArray[np.float64]:
        """Length of each stem along itself, (n,)."""
        return self._last(self.end_m)

    @property
    def height_m(self) -> NDArray[np.float64]:
        """Height of each stem above its base, (n,)."""
        return self._last(self.reach_m)

    def diameters(self, *, over_bark: bool = True) -> NDArray[np.float64]:
        """Give the diameter of each internode, m, (k,)."""
        if not over_bark:
            return self.diameter_m
        return diameter_over_bark(self.diameter_m, self.bark_factor[self.owner])

    def diameter_at(self, height_m: ArrayLike, *, over_bark: bool = True) -> NDArray[np.float64]:
        """Give the diameter of each stem where it first reaches a height above its base.

        Parameters
        ----------
        height_m : float or (n,)
            One height for all stems or one for each.
        over_bark : bool
            With or without bark.

        Returns
        -------
        float64 (n,)
            Diameters, m; NaN where a stem does not reach so high.
        """
        heights = np.broadcast_to(np.asarray(height_m, np.float64), len(self))
        return self._pick(self.reach_m, np.arange(len(self)), heights, over_bark)

    def diameter_along(
        self, stem: NDArray[np.int64], distance_m: NDArray[np.float64], *, over_bark: bool = True
    ) -> NDArray[np.float64]:
        """Give diameters, m, at distances from the base along the stems of these numbers.

        Where two internodes meet it is the lower one's; NaN beyond the top.
        """
        return self._pick(self.end_m, stem, distance_m, over_bark)

    def volume_below(
        self, stem: NDArray[np.int64], distance_m: NDArray[np.float64], *, over_bark: bool = True
    ) -> NDArray[np.float64]:
        """Integrate stems from the base up to distances along them; all of a stem beyond its top.

        Parameters
        ----------
        stem : int64 (q,)
            Numbers of stems.
        distance_m : float64 (q,)
            Distances from the base along them.

        Returns
        -------
        float64 (q,)
            Volumes, m3.
        """
        section = _QUARTER_PI * self.diameters(over_bark=over_bark) ** 2
        start = self.start_m
        upto = np.concatenate(([0.0], np.cumsum(section * (self.end_m - start))))
        at = self.first_reaching(self.end_m, stem, distance_m)
        inside = at < self.first[stem + 1]
        here = at[inside]
        volume = upto[at] - upto[self.first[stem]]
        volume[inside] += section[here] * np.maximum(distance_m[inside] - start[here], 0.0)
        return volume

    def volume(self, *, over_bark: bool = True) -> NDArray[np.float64]:
        """Sum each stem's internodes as cylinders, m3, (n,)."""
        cylinders = _QUARTER_PI * self.diameters(over_bark=over_bark) ** 2
        cylinders *= self.end_m - self.start_m
        return np.asarray(np.bincount(self.owner, cylinders, minlength=len(self)), np.float64)

    def first_reaching(
        self, ascending: NDArray[np.float64], stem: NDArray[np.int64], value: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        """Find the first internode of a stem at which a quantity is at least `value`.

        Binary search in all stems at once; `first[stem + 1]` where none is.

        Parameters
        ----------
        ascending : float64 (k,)
            A quantity that does not fall along a stem, as `end_m` or `reach_m`.
        stem : int64 (q,)
            Numbers of the stems to search.
        value : float64 (q,)
            Values to reach.
        """
        low = self.first[stem]
        high = self.first[stem + 1]
        while (low < high).any():
            middle = (low + high) // 2
            short = (low < high) & (ascending[np.minimum(middle, len(ascending) - 1)] < value)
            high = np.where(short | (low >= high), high, middle)
            low = np.where(short, middle + 1, low)
        return low

    def _pick(
        self,
        ascending: NDArray[np.float64],
        stem: NDArray[np.int64],
        value: NDArray[np.float64],
        over_bark: bool,
    ) -> NDArray[np.float64]:
        at = self.first_reaching(ascending, stem, value)
        found = at < self.first[stem + 1]
        diameter = np.full(len(at), np.nan)
        diameter[found] = self.diameter_m[at[found]]
        return diameter_over_bark(diameter, self.bark_factor[stem]) if over_bark else diameter

    def _last(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give each stem's value at its top; 0 for a stem without internodes."""
        if not len(values):
            return np.zeros(len(self))
        empty = np.diff(self.first) == 0
        return np.where(empty, 0.0, values[np.maximum(self.first[1:] - 1, 0)])


@njit
def _walk_stem(metamers: Any, begin: Any, size: Any, chosen: Any, at: Any) -> Any:
    """Write the stem's metamers to `chosen` from `at` on, in one forward scan; count them."""
    stem = -1
    goes_on = False
    count = 0
    for j in range(size):
        if metamers.parent[begin + j] != stem:
            continue
        state = metamers.state[begin + j]
        if not goes_on or (state & MAIN) != 0:
            stem = j
            goes_on = (state & CONTINUED) != 0
            chosen[at + count] = j
            count += 1
    return count


@driver
def _walk_stems(
    first: Any, step: Any, metamers: Any, trees: Any, place: Any, chosen: Any, count: Any
) -> None:
    for b in range(first, _BINS, step):
        for t in range(b, len(trees.start), _BINS):
            count[t] = _walk_stem(metamers, trees.start[t], trees.size[t], chosen, place[t])


def stems_of(metamers: Metamers, trees: Trees, species: MeasureSpecies) -> Stems:
    """Take the stems of all trees out of the arena.

    Parameters
    ----------
    metamers : Metamers
        The arena.
    trees : Trees
        The tree table; stem t belongs to row t.
    species : MeasureSpecies
        One entry per species of the scenario.
    """
    # Room for stems as long as their trees are large; of that memory little is touched.
    place = np.cumsum(trees.size, dtype=np.int64) - trees.size
    room = np.empty(int(trees.size.sum()), np.int32)
    count = np.zeros(len(trees.tree_id), np.int64)
    in_threads(_walk_stems, metamers, trees, place, room, count)
    first = np.concatenate(([0], np.cumsum(count)))
    chosen = room[np.repeat(place - first[:-1], count) + np.arange(first[-1])]
    here = np.repeat(trees.start, count) + chosen
    exponent = np.repeat(species.pipe_exponent[trees.species], count)
    return _stems(
        first,
        chosen,
        metamers.length[here].astype(np.float64),
        metamers.tip[here, 2].astype(np.float64),
        metamers.pipe[here].astype(np.float64) ** (1.0 / exponent),
        species.bark_factor[trees.species],
    )


def stems_of_skeletons(skeletons: Sequence[Skeleton], bark_factor: ArrayLike) -> Stems:
    """Take the stems of single trees out of their skeletons.

    Where an axis ends in several branches, as in a measured tree, the stem goes on along the
    thickest of them.

    Parameters
    ----------
    skeletons : sequence of n Skeleton
        The trees.
    bark_factor : float or (n,)
        Double bark thickness per diameter over bark.
    """
    paths = [stem_path(skeleton) for skeleton in skeletons]
    of = list(zip(skeletons, paths, strict=True))
    empty = [np.empty(0)]
    return _stems(
        np.cumsum([0, *map(len, paths)], dtype=np.int64),
        np.concatenate([np.empty(0, np.int32), *paths]),
        np.concatenate(empty + [s.length[path] for s, path in of]),
        np.concatenate(empty + [s.end[path, 2] - s.start[:1, 2] for s, path in of]),
        np.concatenate(empty + [2.0 * s.radius[path] for s, path in of]),
        np.broadcast_to(np.asarray(bark_factor, np.float64), len(paths)),
    )


def stem_path(skeleton: Skeleton) -> NDArray[np.int32]:
    """List the internodes of a skeleton's stem, from the base up; see `stems_of_skeletons`."""
    parent = skeleton.parent
    main = (parent >= 0) & (skeleton.axis == skeleton.axis[parent])
    # of the children of one parent, the best stands first
    by_rank = np.lexsort((-skeleton.radius, ~main, parent))
    parents, best = np.unique(parent[by_rank], return_index=True)
    following = dict(zip(parents.tolist(), by_rank[best].tolist(), strict=True))
    path = []
    here = following.get(-1)
    while here is not None:
        path.append(here)
        here = following.get(here)
    return np.array(path, np.int32)


def _stems(
    first: NDArray[np.int64],
    metamer: NDArray[np.int32],
    length: NDArray[np.float64],
    z: NDArray[np.float64],
    diameter: NDArray[np.float64],
    bark_factor: NDArray[np.float64],
) -> Stems:
    """Add up lengths and heights along each stem."""
    end = np.empty(len(length))
    reach = np.empty(len(length))
    _accumulate(first, length, z, end, reach)
    return Stems(first, metamer, end, reach, diameter, np.asarray(bark_factor, np.float64))


@njit
def _accumulate(first: Any, length: Any, z: Any, end: Any, reach: Any) -> None:
    """Give each internode's distance from the base and the height reached so far."""
    for t in range(len(first) - 1):
        along = 0.0
        highest = 0.0
        for i in range(first[t], first[t + 1]):
            along += length[i]
            highest = max(highest, z[i])
            end[i] = along
            reach[i] = highest
