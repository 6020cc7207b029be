"""What the surface of a tree costs."""

from __future__ import annotations

import resource
import statistics
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from forest.surface.blend import CrossingWarning, blended
from forest.surface.tubes import tubes
from forest.trees.skeleton import Skeleton, number_axes

_METAMERS = 50_000
_CELL_M = 0.01


def grown(metamers: int = _METAMERS) -> Skeleton:
    """Make a tree of so many internodes that bends and branches at every third of them.

    Radii follow the pipe model with exponent 2.
    """
    rng = np.random.default_rng(1)
    parent = np.full(metamers, -1, np.int32)
    main = np.zeros(metamers, np.bool_)
    order = np.zeros(metamers, np.int32)
    way = np.zeros((metamers, 3))
    way[0] = (0.0, 0.0, 1.0)
    end = np.zeros((metamers, 3))
    end[0] = 0.05 * way[0]
    next_one, k = 0, 1
    while k < metamers:
        for goes_on in (True, False)[: 2 if next_one % 3 == 0 else 1]:
            if k == metamers:
                break
            parent[k], main[k] = next_one, goes_on
            order[k] = order[next_one] + (not goes_on)
            turn = way[next_one] + rng.normal(0.0, 0.05 if goes_on else 0.8, 3)
            way[k] = turn / np.linalg.norm(turn)
            end[k] = end[next_one] + 0.05 * way[k]
            k += 1
        next_one += 1
    pipes = np.ones(metamers)
    for i in range(metamers - 1, 0, -1):
        pipes[parent[i]] += pipes[i]
    start = end[parent]
    start[0] = 0.0
    return Skeleton(
        parent=parent,
        start=start,
        end=end,
        radius=0.001 * np.sqrt(pipes),
        axis=number_axes(parent, main),
        order=order,
        birth_year=np.full(metamers, 2000, np.int32),
        leafy=np.zeros(metamers, np.bool_),
        serial=np.arange(metamers, dtype=np.int32),
    )


def measure_surfaces(repeats: int) -> dict[str, Any]:
    """Time the surfaces of a tree of 50,000 internodes; kernels are compiled or loaded first.

    Returns
    -------
    dict
        Internodes; wall and processor seconds of its tubes and of its blended surface with cells of
        1 cm, their triangles, and the most memory that the process held, GiB.
    """
    tree = grown()
    mesh = tubes(tree)
    wall, cpu = _time(lambda: tubes(tree), 3 * repeats)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CrossingWarning)  # its limbs grow at random
        whole = blended(tree, cell_m=_CELL_M)
        blended_wall, blended_cpu = _time(lambda: blended(tree, cell_m=_CELL_M), repeats)
    return {
        "metamers": len(tree),
        "tubes_s": wall,
        "tubes_cpu_s": cpu,
        "tube_triangles": len(mesh.triangles),
        "blended_s": blended_wall,
        "blended_cpu_s": blended_cpu,
        "blended_triangles": len(whole.triangles),
        "blended_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
    }


def _time(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Give the medians of wall and processor time, s."""
    spent = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))
    walls, cpus = zip(*spent, strict=True)
    return statistics.median(walls), statistics.median(cpus)
