"""What a parametric tree costs: single trees, many trees, a moment of wind."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

from forest._threads import most_threads, using_threads
from forest.parametric import grow, grow_many

_BATCH, _BATCHES = 200, 5  # a thousand trees, of which not all are held at once


def measure_parametric(repeats: int) -> dict[str, Any]:
    """Time trees; the kernels are compiled or loaded first.

    Returns
    -------
    dict
        Seconds of an aspen, a willow and an aspen's moment of wind, per leaf of the willow, and
        for a thousand aspens of different seeds in one and in all threads.
    """
    aspen = grow("quaking_aspen", 1)
    aspen.swayed(1.0, 5.0)
    willow = grow("weeping_willow", 1)
    found: dict[str, Any] = {
        "aspen_s": _time(lambda: grow("quaking_aspen", 2), 3 * repeats),
        "aspen_leaves": len(aspen.leaves.stem),
        "sway_s": _time(lambda: aspen.swayed(2.0, 5.0), 3 * repeats),
        "willow_s": _time(lambda: grow("weeping_willow", 1), repeats),
        "willow_leaves": len(willow.leaves.stem),
    }
    found["willow_leaf_s"] = found["willow_s"] / found["willow_leaves"]
    for threads in sorted({1, most_threads()}):
        with using_threads(threads):
            found[f"thousand_aspens_{threads}_s"] = _time(_grow_a_thousand, 1)
    return found


def _grow_a_thousand() -> None:
    for batch in range(_BATCHES):
        grow_many("quaking_aspen", range(batch * _BATCH, (batch + 1) * _BATCH))


def _time(work: Callable[[], object], repeats: int) -> float:
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        spent.append(time.perf_counter() - start)
    return statistics.median(spent)
