"""Growing a parametric tree, level by level (Weber & Penn 1995, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from forest._threads import in_threads
from forest.errors import InputError
from forest.parametric.alone import grow_alone, probe_alone, scratch
from forest.parametric.bearing import bear_leaves, count_children, spring
from forest.parametric.stems import (
    OF_SELF,
    Hand,
    Origins,
    Pending,
    Sections,
    Shoots,
    Whole,
    draw,
    grow_level,
    sections_of,
)
from forest.parametric.stretching import courses, stretched
from forest.parametric.tree import Joints, Nodes, ParametricTree, Stems
from forest.species.parametric import Parameters, load_parameters, pack
from forest.trees.leaves import Leaves

#: The most stems of a tree, its most cross sections, and its most leaves.
MOST_STEMS, MOST_NODES, MOST_LEAVES = 2_000_000, 8_000_000, 20_000_000

_SMALLEST = 0.1  # of Scale: a tree drawn smaller is drawn again
_TRUNK_KEY = 1

Readings = Literal["corrected", "paper"]

#: How a driver's chunks are run: in all threads, or in this one.
_Run = Callable[..., None]


def grow(
    parameters: Parameters | str | Path,
    seed: int = 0,
    *,
    readings: Readings = "corrected",
    quality: float = 1.0,
) -> ParametricTree:
    """Grow one tree.

    Parameters
    ----------
    parameters : Parameters, or name of a shipped species, or path of a TOML file
        What to grow.
    seed : int
        Each seed is another tree of the species; 0 to 2**64 - 1.
    readings : "corrected" or "paper"
        Whether what is printed wrong in the paper is put right (docs/parametric.md lists it).
    quality : float
        Factor on the number of leaves; their area in all stays the same (4.5).

    Returns
    -------
    ParametricTree

    Raises
    ------
    InputError
        If the species or seed is not right, or the tree would have more than `MOST_STEMS` stems,
        `MOST_NODES` cross sections or `MOST_LEAVES` leaves.
    """
    return _grow(parameters, seed, readings, quality, in_threads)


def _grow(
    parameters: Parameters | str | Path, seed: int, readings: str, quality: float, run: _Run
) -> ParametricTree:
    if not isinstance(parameters, Parameters):
        parameters = load_parameters(parameters)
    if not 0 <= seed < 2**64:
        raise InputError(f"seed {seed} is not allowed", expected="0 to 2**64 - 1")
    if readings not in ("corrected", "paper"):
        raise InputError(f"unknown readings '{readings}'", expected="corrected or paper")
    if not 0.0 < quality <= 100.0:
        raise InputError(f"quality {quality:g} is not allowed", expected="above 0, at most 100")
    tree, levels = pack(parameters)
    printed = readings == "paper"
    own = np.uint64(seed)
    scale = _draw_scale(parameters, own)
    u = draw(own, np.uint64(0), OF_SELF)
    factor = parameters.trunk_scale + (2.0 * u[0] - 1.0) * parameters.trunk_scale_variation
    whole = Whole(own, scale, factor, printed)
    origins = _trunk(parameters, scale, factor if printed else 1.0, u[1])
    grown = Grown([], [])
    while True:
        number, before = len(grown.levels), grown.size()
        grown.add(before, *_level(number, tree, levels, whole, origins, before, run))
        if number + 1 == parameters.depth or not len(grown.levels[-1][0].key):
            break
        shoots, sections = grown.levels[-1]
        rows = np.empty(len(shoots.key), np.int64)
        most = abs(float(levels[number + 1]["branches"]))
        count = count_children(number, tree, levels, scale, most, False, shoots, rows)
        _refuse(count, MOST_STEMS, "stems", number + 1)
        if not count:
            break
        origins = _origins(count)
        run(spring, number, tree, levels, whole, shoots, sections, before, rows, origins, scratch())
    leaves, leaf_node = _bear(parameters, quality, tree, levels, whole, grown, run)
    return _assemble(parameters, seed, scale, grown, leaves, leaf_node, u[2])


def grow_many(
    parameters: Parameters | str | Path, seeds: Sequence[int], *, readings: Readings = "corrected"
) -> list[ParametricTree]:
    """Grow a tree for each seed, in all threads; as `grow` does one after the other."""
    if not isinstance(parameters, Parameters):
        parameters = load_parameters(parameters)
    trees: list[Any] = [None] * len(seeds)

    def work(first: int, step: int) -> None:
        for k in range(first, len(seeds), step):
            trees[k] = _grow(parameters, seeds[k], readings, 1.0, _in_this_thread)

    in_threads(work)
    return trees


def _in_this_thread(kernel: Callable[..., object], *args: object) -> None:
    kernel(0, 1, *args)


def _draw_scale(parameters: Parameters, seed: Any) -> float:
    """Draw Scale ± ScaleV, again if the tree would be next to nothing."""
    attempt = 1
    while True:
        u = draw(seed, np.uint64(0), OF_SELF + attempt)[0]
        scale = parameters.scale + (2.0 * u - 1.0) * parameters.scale_variation
        if scale >= _SMALLEST * parameters.scale:
            return float(scale)
        attempt += 1


def _origins(n: int) -> Origins:
    return Origins(
        position=np.empty((n, 3)),
        heading=np.empty((n, 3)),
        side=np.empty((n, 3)),
        length=np.empty(n),
        longest=np.empty(n),
        parent_length=np.empty(n),
        parent_radius=np.empty(n),
        limit=np.empty(n),
        offset=np.empty(n),
        parent=np.empty(n, np.int32),
        node=np.empty(n, np.int32),
        key=np.empty(n, np.uint64),
    )


def _trunk(parameters: Parameters, scale: float, factor: float, u: float) -> Origins:
    level = parameters.level[0]
    length = scale * (level.length + (2.0 * u - 1.0) * level.length_variation)
    origins = _origins(1)
    origins.position[0], origins.heading[0], origins.side[0] = 0.0, (0, 0, 1), (1, 0, 0)
    origins.length[0] = origins.longest[0] = origins.parent_length[0] = length
    origins.parent_radius[0] = length * parameters.ratio * factor
    origins.limit[0], origins.offset[0] = np.inf, 0.0
    origins.parent[0] = origins.node[0] = -1
    origins.key[0] = _TRUNK_KEY
    return origins


class Grown(NamedTuple):
    """The levels so far, each a view of the end of arrays with room for those below it."""

    levels: list[tuple[Shoots, Sections]]
    rooms: list[tuple[Shoots, Sections]]

    def size(self) -> tuple[int, int]:
        """Count the stems and nodes of all levels."""
        return sum(len(s.key) for s, _ in self.levels), sum(len(c.z) for _, c in self.levels)

    def add(self, before: tuple[int, int], shoots: Shoots, sections: Sections) -> None:
        """Take the arrays of the next level; their first `before` rows are room."""
        self.rooms.append((shoots, sections))
        self.levels.append(
            (
                Shoots(*(a[before[0] :] for a in shoots)),
                Sections(*(a[before[1] :] for a in sections)),
            )
        )

    def whole(self) -> tuple[Shoots, Sections]:
        """Put all levels one after the other; the last, by far the largest, stays where it is."""
        shoots, sections = self.rooms[-1]
        n = m = 0
        for own_shoots, own_sections in self.levels[:-1]:
            for to, column in zip(shoots, own_shoots, strict=True):
                to[n : n + len(column)] = column
            for to, column in zip(sections, own_sections, strict=True):
                to[m : m + len(column)] = column
            n, m = n + len(own_shoots.key), m + len(own_sections.z)
        return shoots, sections


def _level(
    number: int,
    tree: Any,
    levels: Any,
    whole: Whole,
    origins: Origins,
    before: tuple[int, int],
    run: _Run,
) -> tuple[Shoots, Sections]:
    """Grow a level behind `before` rows of room, in arrays that double until it fits."""
    level = levels[number]
    res = int(level["segments"])
    per = int(sections_of(level, tree[0], number))
    splits = level["splits"] + (tree[0]["base_splits"] if number == 0 else 0)
    n = len(origins.key) + (16 + len(origins.key) if splits > 0 else 0)
    while True:
        m = n * (res * per + 1)
        shoots, sections, pending = _space(before, n, m)
        own = (
            Shoots(*(a[before[0] :] for a in shoots)),
            Sections(*(a[before[1] :] for a in sections)),
            pending,
        )
        if splits > 0:
            hand = Hand(False, *own, np.empty(12), np.empty(6))
            stems, nodes = grow_level(number, tree, levels, whole, origins, before, hand)
        else:
            stems = _alone(run, number, tree, levels, whole, origins, before, own)
            nodes = stems * (res * per + 1)
        if stems >= 0:
            break
        n *= 2
        _refuse(before[0] + n, MOST_STEMS, "stems", number)
        _refuse(before[1] + n * (res * per + 1), 4 * MOST_NODES, "cross sections", number)
    _refuse(before[1] + nodes, MOST_NODES, "cross sections", number)
    stems, nodes = before[0] + stems, before[1] + nodes
    return Shoots(*(a[:stems] for a in shoots)), Sections(*(a[:nodes] for a in sections))


def _alone(
    run: _Run,
    number: int,
    tree: Any,
    levels: Any,
    whole: Whole,
    origins: Origins,
    before: tuple[int, int],
    own: tuple[Any, ...],
) -> int:
    """Grow a level without splits; gives the number of stems."""
    length, own = np.empty(len(origins.key)), (*own, scratch())
    run(probe_alone, number, tree, levels, whole, origins, before, own, length)
    kept = length > 0.0
    row: Any = np.cumsum(kept) - kept
    run(grow_alone, number, tree, levels, whole, origins, before, own, length, row)
    return int(kept.sum())


def _space(before: tuple[int, int], n: int, m: int) -> tuple[Shoots, Sections, Pending]:
    """Make arrays for n stems and m nodes, with room before them."""
    pending = Pending(
        np.empty((n, 12)), np.empty((n, 6)), np.empty((n, 3), np.int32), np.empty(n, np.uint64)
    )
    n, m = n + before[0], m + before[1]
    shoots = Shoots(
        np.empty(n, np.int32), np.empty(n, np.bool_), np.empty(n), np.empty(n),
        np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n), np.empty(n, np.int32),
        np.empty(n, np.uint64), np.empty(n, np.int32), np.empty(n), np.empty(n),
    )  # fmt: skip
    sections = Sections(
        np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3)), np.empty(m),
        np.empty(m, np.int32), np.empty(m),
    )  # fmt: skip
    return shoots, sections, pending


def _refuse(count: int, most: int, what: str, number: int) -> None:
    if count > most:
        raise InputError(
            f"level {number} brings the tree to more than {most:,} {what}",
            expected="fewer branches, splits or segments",
        )


def _bear(
    parameters: Parameters,
    quality: float,
    tree: Any,
    levels: Any,
    whole: Whole,
    grown: Grown,
    run: _Run,
) -> tuple[Leaves, Any]:
    """Put leaves on the stems of the last level; a tree that lacks it has none."""
    number = parameters.depth - 1
    most = abs(parameters.leaves) * quality
    n = 0
    if len(grown.levels) == parameters.depth and most > 0.0:
        shoots, sections = grown.levels[-1]
        rows = np.empty(len(shoots.key), np.int64)
        n = count_children(number, tree, levels, whole.scale, most, True, shoots, rows)
        _refuse(n, MOST_LEAVES, "leaves", number + 1)
    stem, node = np.empty(n, np.int32), np.empty(n, np.int32)
    place = [np.empty((n, 3), np.float32) for _ in range(3)]
    if n:
        total = grown.size()
        below = (total[0] - len(shoots.key), total[1] - len(sections.z))
        out = (*place, stem, node)
        run(
            bear_leaves,
            number,
            tree,
            levels,
            whole,
            shoots,
            sections,
            below,
            most,
            rows,
            out,
            scratch(),
        )
    length = parameters.leaf_scale / np.sqrt(quality)
    leaves = Leaves(
        place[0],
        place[1],
        place[2],
        np.broadcast_to(length, n),
        np.broadcast_to(length * parameters.leaf_scale_x, n),
        np.broadcast_to(np.int8(parameters.leaf_shape), n),
        stem,
    )
    return leaves, node


def _assemble(
    parameters: Parameters,
    seed: int,
    scale: float,
    grown: Grown,
    leaves: Leaves,
    leaf_node: Any,
    u: float,
) -> ParametricTree:
    shoots, sections = grown.whole()
    stems = [len(s.key) for s, _ in grown.levels]
    nodes_before = np.cumsum([0, *(len(c.z) for _, c in grown.levels)], dtype=np.int32)[:-1]
    segments = [parameters.of_level(k).segments for k in range(len(stems))]
    stretch = parameters.z_scale + (2.0 * u - 1.0) * parameters.z_scale_variation
    first = shoots.first + np.repeat(nodes_before, stems)
    length, offset = shoots.length, shoots.offset
    if stretch != 1.0:
        sections, leaves = stretched(sections, leaves, stretch)
        length, offset = courses(shoots, sections, first)
    return ParametricTree(
        parameters=parameters,
        seed=seed,
        scale=scale,
        stems=Stems(
            np.repeat(np.arange(len(stems), dtype=np.int32), stems),
            shoots.parent,
            shoots.clone,
            length,
            shoots.radius,
            first,
            shoots.nodes,
            offset,
        ),
        nodes=Nodes(*sections),
        leaves=leaves,
        joints=Joints(
            shoots.node,
            np.repeat(np.array(segments, np.int32), stems),
            shoots.start,
            shoots.key,
            leaf_node,
        ),
    )
