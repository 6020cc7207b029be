"""What the surface of a tree costs."""

from __future__ import annotations

import resource
import statistics
import time
import warnings
from collections.abc import Callable
from typing import Any

from forest.scenario import Scenario
from forest.stand import Stand
from forest.surface.blend import CrossingWarning, blended
from forest.surface.tubes import tubes
from forest.trees.skeleton import Skeleton
from tests.benchmarks.stands import SCENARIOS

_METAMERS = 50_000
_CELL_M = 0.01


def grown(metamers: int = _METAMERS) -> Skeleton:
    """Grow the paper's tree, open and broadleaved, until it has so many internodes."""
    stand = Stand(Scenario.load(SCENARIOS / "paper_tree.toml"))
    while True:
        stand.step()
        tree = stand.skeleton(int(stand.rows.tree_id[0]))
        if len(tree) >= metamers:
            return tree


def measure_surfaces(repeats: int) -> dict[str, Any]:
    """Time the surfaces of a grown tree of 50,000 internodes; kernels are compiled or loaded first.

    Returns
    -------
    dict
        Internodes and height, m; wall and processor seconds of its tubes and of its blended surface
        with cells of 1 cm, their triangles, and the most memory that the process held, GiB.
    """
    tree = grown()
    mesh = tubes(tree)
    wall, cpu = _time(lambda: tubes(tree), 3 * repeats)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CrossingWarning)  # twigs of a free crown touch
        whole = blended(tree, cell_m=_CELL_M)
        blended_wall, blended_cpu = _time(lambda: blended(tree, cell_m=_CELL_M), repeats)
    return {
        "metamers": len(tree),
        "height_m": float(tree.end[:, 2].max()),
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
