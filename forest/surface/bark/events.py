"""The order in which bark tears within a step (Lefebvre and Neyret 2002, 3.1, 3.2.3, figure 8).

In nature fractures do not come at once: bark yields by one small event after another, and is at
equilibrium between them. An event is a new fracture, or the end of one that runs into the next
strip. The load of each is its strain over what it needs. While the girth grows, the strain of all
rises together, so the most loaded yields first; it relieves its strip, and the next most loaded
follows. So what tears hangs on the growth, and hardly on how finely the growth is cut into steps.

What may yield waits in a queue, the most loaded first; of two as loaded, the one that is numbered
lower. Loads mostly fall, and then are found anew when they are due. But a strip that tears lets its
bark slide, so that an end in it or next to it may face a weaker piece; and its fractures get
narrower, so that ends held by their width may run again. All these are looked at anew at once.
Widths of other fractures, which turn an end and hold it off, are those of when it is looked at.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.surface.bark.fracture import settle, tear, worst_piece
from forest.surface.bark.propagation import ahead_of, end_of, is_held, run_on

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


class _Queue(NamedTuple):
    """What may yield: 2 f + upper for an end of fracture f, - 1 - s for a fracture in strip s.

    `waiting` holds (- load, what) as a heap; `due` the - load under which each waits (inf: it does
    not), by what + the number of strips. What waits otherwise was put in anew since.
    """

    waiting: list[tuple[float, np.int64]]
    due: NDArray[np.float64]
    held: NDArray[np.bool_]  # ends held by their width or run
    order: NDArray[np.int64]  # passages by the strip they lead to
    to: NDArray[np.int32]  # that strip, in this order


@njit
def _empty_queue(rings: Any, crossings: Any) -> Any:
    waiting = [(0.0, np.int64(0)) for _ in range(0)]
    due = np.full(len(rings.records) + 2 * len(rings.origin), np.inf)
    held = np.zeros(2 * len(rings.origin), np.bool_)
    order = np.argsort(crossings.to, kind="mergesort")
    return _Queue(waiting, due, held, order, crossings.to[order])


@njit
def _put(rings: Any, queue: Any, what: Any, load: Any) -> None:
    """Let something wait under a load; infinite where it is to be found when it is due."""
    k = len(rings.records) + what
    if queue.due[k] != -load:
        queue.due[k] = -load
        heappush(queue.waiting, (-load, what))


@njit
def _put_ends(rings: Any, queue: Any, fracture: Any) -> None:
    """Put both ends of a fracture first into the queue."""
    for upper in range(2):
        _put(rings, queue, np.int64(2 * fracture + upper), np.inf)


@njit
def _renew_end(rings: Any, physics: Any, queue: Any, what: Any, moment: Any) -> None:
    """Put an end first into the queue, or mark it as held."""
    queue.held[what] = is_held(rings, physics, what // 2, what % 2, moment)
    if not queue.held[what]:
        _put(rings, queue, what, np.inf)


@njit
def _renew_ends_in(rings: Any, physics: Any, queue: Any, s: Any, way: Any, moment: Any) -> None:
    """Look anew at the ends that lie in a strip and run one way (0: both)."""
    for i in range(rings.base[s], rings.base[s] + rings.records[s]):
        node = rings.tear[i]
        if node >= 0:
            fracture = np.int64(rings.tear_fracture[node])
            for upper, end in enumerate((rings.first[fracture], rings.last[fracture])):
                if node == end and (way == 0 or end_of(rings, fracture, upper)[1] == way):
                    _renew_end(rings, physics, queue, 2 * fracture + upper, moment)


@njit
def _look_again(rings: Any, physics: Any, crossings: Any, queue: Any, s: Any, moment: Any) -> None:
    """Look anew at all ends whose load may have risen when strip s tore."""
    both = np.int64(0)
    _renew_ends_in(rings, physics, queue, s, both, moment)
    for near, way in ((rings.up[s], np.int64(-1)), (rings.down[s], np.int64(1))):
        if near >= 0:
            _renew_ends_in(rings, physics, queue, np.int64(near), way, moment)
    last = np.int64(-1)
    for row in range(np.searchsorted(queue.to, s), len(queue.to)):
        if queue.to[row] != s:
            break
        near = np.int64(crossings.strip[queue.order[row]])
        if near != last:
            _renew_ends_in(rings, physics, queue, near, both, moment)
        last = near
    for i in range(rings.base[s], rings.base[s] + rings.records[s]):
        if rings.tear[i] >= 0:
            fracture = np.int64(rings.tear_fracture[rings.tear[i]])
            for what in range(2 * fracture, 2 * fracture + 2):
                if queue.held[what]:
                    _renew_end(rings, physics, queue, what, moment)


@njit
def _yield_all(
    rings: Any, physics: Any, seed: Any, crossings: Any, queue: Any, moment: Any, time: Any
) -> None:
    """Let events happen until nothing yields any more, the most loaded first.

    What bears its load n times over yielded when 1 / n of the strain was there: that is the
    moment.
    """
    strips = len(rings.records)
    while len(queue.waiting) > 0:
        waited, what = heappop(queue.waiting)
        if waited != queue.due[strips + what]:
            continue
        queue.due[strips + what] = np.inf
        s = np.int64(-1)
        if what < 0:
            i, load = worst_piece(rings, physics, -1 - what)
            if load <= _YIELDS:
                continue
        else:
            fracture = what // 2
            upper = what % 2
            load, k, to, place, goes = ahead_of(
                rings, physics, seed, crossings, fracture, upper, moment
            )
            if load < 1.0:
                queue.held[what] = is_held(rings, physics, fracture, upper, moment)
                continue
        if len(queue.waiting) > 0 and (-load, what) > queue.waiting[0]:
            _put(rings, queue, what, load)
            continue
        moment = max(moment, 1.0 / load)
        if what < 0:
            s = -1 - what
            fracture = _new_fracture(rings, physics, s, i, rings.weak[i], time)
            tore = fracture >= 0
        else:
            s = to
            tore = run_on(rings, physics, fracture, upper, k, to, place, goes, time)
        if tore:
            _put_ends(rings, queue, fracture)  # longer, the other end may run as well
            _look_again(rings, physics, crossings, queue, s, moment)
        if what < 0:
            _put(rings, queue, what, load)


@njit
def begin_fracture(
    rings: Any, physics: Any, seed: Any, crossings: Any, s: Any, i: Any, place: Any, time: Any
) -> Any:
    """Tear the piece behind record i open at a place and let the fracture run both ways."""
    fracture = _new_fracture(rings, physics, s, i, place, time)
    if fracture >= 0:
        queue = _empty_queue(rings, crossings)
        _put_ends(rings, queue, fracture)
        _yield_all(rings, physics, seed, crossings, queue, 1.0, time)
    return fracture


@njit
def tear_all(rings: Any, physics: Any, seed: Any, crossings: Any, time: Any) -> None:
    """Let everything break and run on that must, after the strips were stretched."""
    for f in range(rings.totals[1]):
        rings.area[f] = 0.0
        rings.kept[f] = 0.0
    queue = _empty_queue(rings, crossings)
    for s in range(len(rings.records)):
        for i in range(rings.base[s], rings.base[s] + rings.records[s]):
            if rings.tear[i] >= 0:
                f = rings.tear_fracture[rings.tear[i]]
                rings.area[f] += rings.open[i] * rings.width[s]
                rings.kept[f] += rings.rest[i] * rings.width[s]
        _put(rings, queue, np.int64(-1 - s), np.inf)
    for f in range(rings.totals[1]):
        if physics.begins:
            rings.ran[f, 0] = 0.0
            rings.ran[f, 1] = 0.0
        _put_ends(rings, queue, f)
    _yield_all(rings, physics, seed, crossings, queue, 0.0, time)
