"""Small random trees for tests of what is drawn."""

from __future__ import annotations

import numpy as np

from forest.trees.skeleton import Skeleton, number_axes


def bush(seed: int, n: int) -> Skeleton:
    """Make a tree of `n` internodes at random; some have no length, some turn back."""
    rng = np.random.default_rng(seed)
    parent = np.array([-1] + [int(rng.integers(0, i)) for i in range(1, n)], np.int32)
    main = np.zeros(n, np.bool_)
    taken: set[int] = set()
    order = np.zeros(n, np.int32)
    for i in range(1, n):
        p = int(parent[i])
        main[i] = p not in taken and rng.random() < 0.7
        if main[i]:
            taken.add(p)
        order[i] = order[p] + (not main[i])
    step = rng.choice([0.0, 0.3, 1.0], (n, 1), p=[0.1, 0.4, 0.5]) * rng.integers(-1, 2, (n, 3))
    end = np.zeros((n, 3))
    start = np.zeros((n, 3))
    for i in range(n):
        if i > 0:
            start[i] = end[parent[i]]
        end[i] = start[i] + step[i]
    return Skeleton(
        parent=parent,
        start=start,
        end=end,
        radius=rng.uniform(0.01, 0.1, n),
        axis=number_axes(parent, main),
        order=order,
        birth_year=np.full(n, 2000, np.int32),
        leafy=rng.random(n) < 0.5,
        serial=rng.permutation(n).astype(np.int32),
        species="fagus_sylvatica",
    )
