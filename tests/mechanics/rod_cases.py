"""Rods of known shape: cantilevers, columns, random trees; and how to settle them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from forest.growth.dealing import deal
from forest.mechanics.equilibrium import MOST_PASSES, Bench, Settled, settle
from forest.mechanics.rods import Loads, Rods, allocate_rods, frame_new
from forest.trees.metamers import Metamers, allocate
from forest.trees.table import Trees, empty
from tests.builders import random_arena


class Case(NamedTuple):
    """Trees of rods, ready to settle."""

    arena: Metamers
    trees: Trees
    rods: Rods
    loads: Loads


def settled(case: Case, tolerance: float = 1e-10, most_passes: int = MOST_PASSES) -> Settled:
    """Settle all trees of a case."""
    shared = deal(case.trees.size)
    work = Bench().work(shared)
    return settle(*case[:2], shared, *case[2:], work, tolerance=tolerance, most_passes=most_passes)


def chain(
    n: int,
    *,
    elevation: float = 0.0,
    rigidity: float | NDArray[np.float64] = 1.0,
    twist_rigidity: float | NDArray[np.float64] | None = None,
    weight: float | NDArray[np.float64] = 0.0,
    end_load: float = 0.0,
) -> Case:
    """A straight rod of length 1 m in n segments, clamped at an angle above the horizontal x.

    Parameters
    ----------
    elevation : rad
    rigidity, twist_rigidity : E I and G J at the segments' middles, N m2
    weight : N per m at the segments' middles
    end_load : N at the tip
    """
    arena = allocate(n)
    trees = empty(1)
    trees.start[:] = 0
    trees.size[:] = n
    trees.species[:] = 0
    along = np.round([np.cos(elevation), 0.0, np.sin(elevation)], 15)  # upright is upright
    arena.parent[:] = np.arange(n) - 1
    arena.length[:] = 1.0 / n
    arena.tip[:] = np.arange(1, n + 1)[:, None] / n * along
    arena.bud[:] = along
    arena.birth[:] = 0
    case = _with_rods(arena, trees)
    case.rods.rigidity[:] = np.broadcast_to(np.asarray(rigidity), n)[:, None]
    if twist_rigidity is not None:
        case.rods.rigidity[:, 0] = twist_rigidity
    case.loads.weight[:, 0] = np.asarray(weight) / n
    case.loads.weight[-1, 1] = end_load
    return case


def _with_rods(arena: Metamers, trees: Trees) -> Case:
    """Make rods of an arena in which all metamers are of step 0; nothing loads them."""
    rods = allocate_rods(len(arena.parent))
    loads = Loads(
        np.zeros((len(arena.parent), 2), np.float32), np.zeros((len(arena.parent), 2), np.float32)
    )
    frame_new(arena, trees, deal(trees.size), rods, 0, np.zeros((1, 3)), np.ones((1, 3)))
    return Case(arena, trees, rods, loads)


def random_case(
    rng: Generator, n_trees: int = 1, n_per_tree: int = 12, *, sag: float = 1.0
) -> Case:
    """Random trees with elliptical sections, curved at rest, under random weights and wind.

    `sag` is the order of the bending of each metamer by its own and its parts' weight, rad.
    """
    arena, trees = random_arena(rng, n_trees, n_per_tree)
    trees.species[:] = 0
    arena.birth[:] = 0
    case = _with_rods(arena, trees)
    n = len(arena.parent)
    case.rods.rest[:] = rng.normal(size=(n, 3)) * 0.5
    case.rods.curvature[:] = rng.normal(size=(n, 3)) * 0.5
    case.loads.weight[:] = rng.uniform(0.0, 1.0, (n, 2))
    case.loads.wind[:] = rng.normal(size=(n, 2)) * 0.3
    for row in range(n_trees):
        s = int(trees.start[row])
        carried = np.zeros(trees.size[row])
        for i in range(trees.size[row] - 1, -1, -1):
            carried[i] += case.loads.weight[s + i].sum()
            if i > 0:
                carried[arena.parent[s + i]] += carried[i]
        stiff = 0.2 * carried * np.sqrt(carried) * 0.2 / sag
        e = s + trees.size[row]
        case.rods.rigidity[s:e] = stiff[:, None] * rng.uniform(0.5, 2.0, (len(stiff), 3))
    return case


def tips(case: Case, row: int = 0) -> NDArray[np.float32]:
    """Tips of one tree, m."""
    s = int(case.trees.start[row])
    return case.arena.tip[s : s + int(case.trees.size[row])]


def tip_slope(case: Case) -> float:
    """Slope of a chain's end below the horizontal, rad: of the last segment and half its turn."""
    tip = case.arena.tip.astype(np.float64)
    last = tip[-1] - tip[-2] if len(tip) > 1 else tip[-1]
    half = 0.5 * np.linalg.norm(case.rods.curvature[-1]) * case.arena.length[-1]
    return float(np.arctan2(-last[2], last[0]) + half)
