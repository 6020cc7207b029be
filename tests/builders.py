"""Small random stands for property tests: valid by the arena's contract, otherwise arbitrary."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from forest.trees.metamers import (
    BRANCHED,
    CONTINUED,
    LATERAL,
    MAIN,
    TERMINAL,
    Arena,
    Metamers,
)
from forest.trees.table import Trees, empty


def random_arena(
    rng: Generator,
    n_trees: int = 3,
    n_per_tree: int = 20,
    *,
    size_m: tuple[float, float] = (4.0, 4.0),
    voxel_m: float = 0.25,
    internode_m: float = 0.2,
    n_species: int = 1,
    slack: int = 3,
) -> tuple[Metamers, Trees]:
    """Make trees at random places with 1 to `n_per_tree` metamers each.

    A parent stands before its children; a metamer has at most one child on its own axis (then
    it is CONTINUED, else it may bear a TERMINAL bud) and one lateral child (then it is BRANCHED,
    else it may bear a LATERAL bud). Extents are separated by `slack` unused metamers, which hold
    garbage. `n_per_tree` 0 gives trees without metamers.

    Returns
    -------
    metamers, trees : Metamers, Trees
    """
    sizes = rng.integers(1, n_per_tree + 1, n_trees) if n_per_tree > 0 else np.zeros(n_trees, int)
    metamers = Arena(int(sizes.sum()) + slack * (n_trees + 1) + 16).metamers
    for field in metamers:
        field[...] = 77
    trees = empty(n_trees)
    trees.tree_id[:] = np.sort(rng.choice(10 * n_trees + 1, n_trees, replace=False)) + 1
    trees.species[:] = rng.integers(0, n_species, n_trees)
    trees.x[:] = rng.uniform(0.0, size_m[0], n_trees)
    trees.y[:] = rng.uniform(0.0, size_m[1], n_trees)
    trees.base_voxel[:, 0] = np.floor(trees.x / voxel_m)
    trees.base_voxel[:, 1] = np.floor(trees.y / voxel_m)
    trees.base_offset[:, 0] = trees.x - trees.base_voxel[:, 0] * voxel_m
    trees.base_offset[:, 1] = trees.y - trees.base_voxel[:, 1] * voxel_m
    trees.vigour[:] = rng.uniform(0.8, 1.2, n_trees)
    trees.reserve[:] = rng.uniform(0.0, 1.0, n_trees)
    trees.breast_serial[:] = -1
    trees.mother_id[:] = 0
    start = slack
    for tree in range(n_trees):
        trees.start[tree] = start
        trees.size[tree] = sizes[tree]
        trees.room[tree] = sizes[tree] + slack
        trees.next_serial[tree] = sizes[tree] + 5
        _grow_tree(rng, metamers, start, int(sizes[tree]), internode_m)
        start += int(sizes[tree]) + slack
    return metamers, trees


def _grow_tree(rng: Generator, m: Metamers, start: int, n: int, internode_m: float) -> None:
    """Fill one extent with a random tree of `n` metamers."""
    end = slice(start, start + n)
    m.serial[end] = np.sort(rng.choice(n + 5, n, replace=False))
    m.state[end] = 0
    m.light[end] = rng.uniform(0.0, 1.0, n)
    m.resource[end] = rng.uniform(0.0, 1.0, (n, 2))
    m.deficit[end] = 0
    m.shoot_height[end] = rng.integers(0, 256, n)
    for i in range(n):
        k = start + i
        length = internode_m * rng.uniform(0.5, 1.5)
        direction = _unit(rng.normal((0.0, 0.0, 0.8)))
        m.bud[k] = _unit(rng.normal(size=3))
        m.length[k] = length
        if i == 0:
            m.parent[k] = -1
            m.order[k] = 0
            m.birth[k] = 0
            m.state[k] = MAIN
            m.tip[k] = length * direction
            continue
        parent, on_axis = _free_place(rng, m.state[start:k])
        p = start + parent
        m.parent[k] = parent
        m.order[k] = m.order[p] + (0 if on_axis else 1)
        m.birth[k] = m.birth[p] + rng.integers(0, 2)
        m.state[k] = MAIN if on_axis else 0
        m.state[p] |= CONTINUED if on_axis else BRANCHED
        m.tip[k] = m.tip[p] + np.float32(length) * direction.astype(np.float32)
    for k in range(start, start + n):
        if not m.state[k] & CONTINUED and rng.random() < 0.8:
            m.state[k] |= TERMINAL
        if not m.state[k] & BRANCHED and rng.random() < 0.6:
            m.state[k] |= LATERAL
    m.pipe[end] = 1e-5
    for k in range(start + n - 1, start, -1):
        m.pipe[start + m.parent[k]] += m.pipe[k]
    m.sapwood[end] = 0.7 * m.pipe[end]


def _free_place(rng: Generator, state: np.ndarray) -> tuple[int, bool]:
    """Choose a metamer that lacks a main or a lateral child; tell which it is to get."""
    places = [(i, True) for i in range(len(state)) if not state[i] & CONTINUED]
    places += [(i, False) for i in range(len(state)) if not state[i] & BRANCHED]
    return places[rng.integers(len(places))]


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)
