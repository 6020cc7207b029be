"""The order in which bark tears within a step (Lefebvre and Neyret 2002, 3.1, 3.2.3, figure 8).

In nature fractures do not come at once: bark yields by one small event after another, and is at
equilibrium between them. An event is a new fracture, or the end of one that runs into the next
strip. The load of each is its strain over what it needs. While the girth grows, the strain of all
rises together, so the most loaded yields first; it relieves its strip, and the next most loaded
follows. So what tears hangs on the growth, and hardly on how finely the growth is cut into steps.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Any

import numpy as np

from forest._jit import njit
from forest.surface.bark.fracture import settle, tear, worst_piece
from forest.surface.bark.propagation import ahead_of, run_on

_YIELDS = 1.0 + 1e-9  # growth ratios carry rounding


@njit
def _new_fracture(rings: Any, physics: Any, s: Any, i: Any, place: Any, time: Any) -> Any:
    """Tear the piece behind record i of strip s open at a place; the fracture, or -1."""
    fracture = rings.totals[1]
    node = tear(rings, s, i, place, fracture, time)
    if node < 0:
        rings.tough[i] = np.inf
        return np.int64(-1)
    rings.totals[1] += 1
    rings.origin[fracture] = node
    rings.first[fracture] = node
    rings.last[fracture] = node
    rings.reach[fracture] = rings.width[s]
    rings.area[fracture] = 0.0
    rings.kept[fracture] = 0.0
    rings.ran[fracture, 0] = 0.0
    rings.ran[fracture, 1] = 0.0
    settle(rings, physics, s)
    return fracture


@njit
def _add_ends(queue: Any, fracture: Any) -> None:
    """Put both ends of a fracture first into the queue: their load is found when they are due."""
    for upper in range(2):
        heappush(queue, (-np.inf, np.int64(2 * fracture + upper)))


@njit
def _yield_all(
    rings: Any, physics: Any, seed: Any, crossings: Any, queue: Any, moment: Any, time: Any
) -> None:
    """Let events happen until nothing yields any more, the most loaded first.

    The queue holds (- load, what): 2 f + upper for an end of fracture f, - 1 - s for the next
    fracture of strip s. Loads in it may be too high, since events relieve (but for an end whose
    bark slides until it faces a weaker piece, which then waits a little too long): each is found
    anew when it is due, and waits again if another is then more loaded. What bears its load n times
    over yielded when 1 / n of the strain was there: that is the moment.
    """
    while len(queue) > 0:
        _, what = heappop(queue)
        if what < 0:
            s = -1 - what
            i, load = worst_piece(rings, physics, s)
            if load <= _YIELDS:
                continue
            if len(queue) > 0 and -load > queue[0][0]:
                heappush(queue, (-load, what))
                continue
            moment = max(moment, 1.0 / load)
            fracture = _new_fracture(rings, physics, s, i, rings.weak[i], time)
            if fracture >= 0:
                _add_ends(queue, fracture)
            heappush(queue, (-load, what))
        else:
            fracture = what // 2
            upper = what % 2
            load, k, to, place, goes = ahead_of(
                rings, physics, seed, crossings, fracture, upper, moment
            )
            if load < 1.0:
                continue
            if len(queue) > 0 and -load > queue[0][0]:
                heappush(queue, (-load, what))
                continue
            moment = max(moment, 1.0 / load)
            if run_on(rings, physics, fracture, upper, k, to, place, goes, time):
                _add_ends(queue, fracture)  # longer, the other end may run as well


@njit
def begin_fracture(
    rings: Any, physics: Any, seed: Any, crossings: Any, s: Any, i: Any, place: Any, time: Any
) -> Any:
    """Tear the piece behind record i open at a place and let the fracture run both ways."""
    fracture = _new_fracture(rings, physics, s, i, place, time)
    if fracture >= 0:
        queue = [(0.0, np.int64(0)) for _ in range(0)]
        _add_ends(queue, fracture)
        _yield_all(rings, physics, seed, crossings, queue, 1.0, time)
    return fracture


@njit
def tear_all(rings: Any, physics: Any, seed: Any, crossings: Any, time: Any) -> None:
    """Let everything break and run on that must, after the strips were stretched."""
    for f in range(rings.totals[1]):
        rings.area[f] = 0.0
        rings.kept[f] = 0.0
    queue = [(0.0, np.int64(0)) for _ in range(0)]
    for s in range(len(rings.records)):
        for i in range(rings.base[s], rings.base[s] + rings.records[s]):
            if rings.tear[i] >= 0:
                f = rings.tear_fracture[rings.tear[i]]
                rings.area[f] += rings.open[i] * rings.width[s]
                rings.kept[f] += rings.rest[i] * rings.width[s]
        heappush(queue, (-np.inf, np.int64(-1 - s)))
    for f in range(rings.totals[1]):
        if physics.begins:
            rings.ran[f, 0] = 0.0
            rings.ran[f, 1] = 0.0
        _add_ends(queue, f)
    _yield_all(rings, physics, seed, crossings, queue, 0.0, time)
