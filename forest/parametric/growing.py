"""Growing a parametric tree, level by level (Weber & Penn 1995, section 4)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from forest._threads import in_threads
from forest.errors import InputError
from forest.parametric.bearing import bear_leaves, count_children, spring
from forest.parametric.stems import (
    OF_SELF,
    Origins,
    Pending,
    Sections,
    Shoots,
    Whole,
    draw,
    grow_level,
)
from forest.parametric.tree import Joints, Nodes, ParametricTree, Stems
from forest.species.parametric import Parameters, load_parameters, pack
from forest.trees.leaves import Leaves

#: The most stems of a tree, its most cross sections, and its most leaves.
MOST_STEMS, MOST_NODES, MOST_LEAVES = 2_000_000, 8_000_000, 20_000_000

_SMALLEST = 0.1  # of Scale: a tree drawn smaller is drawn again
_TRUNK_KEY = 1

Readings = Literal["corrected", "paper"]


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
    grown: list[tuple[Shoots, Sections]] = []
    stems = nodes = 0
    number = 0
    while len(origins.key):
        shoots, sections = _level(number, tree, levels, whole, origins, (stems, nodes))
        grown.append((shoots, sections))
        if number + 1 == parameters.depth:
            break
        most = float(levels[number + 1]["branches"])
        count = count_children(number, tree, levels, scale, most, False, shoots)
        _refuse(count, MOST_STEMS, "stems", number + 1)
        origins = _origins(count)
        spring(number, tree, levels, whole, shoots, sections, (stems, nodes), origins)
        stems, nodes = stems + len(shoots.key), nodes + len(sections.z)
        number += 1
    leaves, leaf_node = _bear(parameters, quality, tree, levels, whole, grown)
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
            trees[k] = grow(parameters, seeds[k], readings=readings)

    in_threads(work)
    return trees


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


def _level(
    number: int, tree: Any, levels: Any, whole: Whole, origins: Origins, before: tuple[int, int]
) -> tuple[Shoots, Sections]:
    """Grow a level in arrays that double until it fits."""
    level = levels[number]
    res = int(level["segments"])
    wanted = 32 if level["taper"] > 2.0 or (number == 0 and tree[0]["flare"] > 0.0) else 8
    per = -(-(wanted if wanted == 32 or level["taper"] > 1.0 else 1) // res)
    splits = level["splits"] + (tree[0]["base_splits"] if number == 0 else 0)
    n = len(origins.key) + (16 + len(origins.key) if splits > 0 else 0)
    while True:
        m = n * (res * per + 1) + 1
        shoots = Shoots(
            np.empty(n, np.int32), np.empty(n, np.bool_), np.empty(n), np.empty(n),
            np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n), np.empty(n, np.int32),
            np.empty(n, np.uint64), np.empty(n, np.int32), np.empty(n), np.empty(n),
        )  # fmt: skip
        sections = Sections(
            np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3)), np.empty(m),
            np.empty(m, np.int32), np.empty(m),
        )  # fmt: skip
        pending = Pending(
            np.empty((n, 12)), np.empty((n, 6)), np.empty((n, 3), np.int32), np.empty(n, np.uint64)
        )
        stems, nodes = grow_level(
            number, tree, levels, whole, origins, before, shoots, sections, pending
        )
        if stems >= 0:
            break
        n *= 2
        _refuse(before[0] + n, MOST_STEMS, "stems", number)
        _refuse(before[1] + n * (res * per + 1), 4 * MOST_NODES, "cross sections", number)
    _refuse(before[1] + nodes, MOST_NODES, "cross sections", number)
    return Shoots(*(a[:stems] for a in shoots)), Sections(*(a[:nodes] for a in sections))


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
    grown: list[tuple[Shoots, Sections]],
) -> tuple[Leaves, Any]:
    """Put leaves on the stems of the last level; a tree that lacks it has none."""
    number = parameters.depth - 1
    most = abs(parameters.leaves) * quality
    n = 0
    if len(grown) == parameters.depth and most > 0.0:
        shoots, sections = grown[-1]
        n = count_children(number, tree, levels, whole.scale, most, True, shoots)
        _refuse(n, MOST_LEAVES, "leaves", number + 1)
    out = (np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)))
    out_of = (np.empty(n, np.int32), np.empty(n, np.int32))
    if n:
        below = (sum(len(s.key) for s, _ in grown[:-1]), sum(len(c.z) for _, c in grown[:-1]))
        bear_leaves(number, tree, levels, whole, shoots, sections, below, most, (*out, *out_of))
    length = parameters.leaf_scale / np.sqrt(quality)
    leaves = Leaves(
        *out,
        np.full(n, length),
        np.full(n, length * parameters.leaf_scale_x),
        np.full(n, parameters.leaf_shape, np.int8),
        out_of[0],
    )
    return leaves, out_of[1]


def _assemble(
    parameters: Parameters,
    seed: int,
    scale: float,
    grown: list[tuple[Shoots, Sections]],
    leaves: Leaves,
    leaf_node: Any,
    u: float,
) -> ParametricTree:
    shoots = Shoots(*(np.concatenate(c) for c in zip(*(s for s, _ in grown), strict=True)))
    sections = Sections(*(np.concatenate(c) for c in zip(*(c for _, c in grown), strict=True)))
    stems = [len(s.key) for s, _ in grown]
    nodes_before = np.cumsum([0, *(len(c.z) for _, c in grown)])[:-1]
    segments = [parameters.of_level(k).segments for k in range(len(grown))]
    stretch = parameters.z_scale + (2.0 * u - 1.0) * parameters.z_scale_variation
    if stretch != 1.0:
        sections, leaves = _stretched(sections, leaves, stretch)
    return ParametricTree(
        parameters=parameters,
        seed=seed,
        scale=scale,
        stems=Stems(
            np.repeat(np.arange(len(grown), dtype=np.int32), stems),
            shoots.parent,
            shoots.clone,
            shoots.length,
            shoots.radius,
            (shoots.first + np.repeat(nodes_before, stems)).astype(np.int32),
            shoots.nodes,
            shoots.offset,
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


def _stretched(sections: Sections, leaves: Leaves, factor: float) -> tuple[Sections, Leaves]:
    """Stretch the finished tree along z (ZScale); leaves keep their shape."""
    along = np.array([1.0, 1.0, factor])
    heading = sections.heading * along
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    side = sections.side - heading * np.sum(sections.side * heading, axis=1, keepdims=True)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    sections = sections._replace(position=sections.position * along, heading=heading, side=side)
    return sections, leaves._replace(position=leaves.position * along)
