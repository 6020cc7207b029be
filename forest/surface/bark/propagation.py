"""How fractures run from strip to strip, and the order of events in a step (3.2.4, figure 8)."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import njit
from forest.random import STREAM_BARK, uniforms
from forest.surface.bark.fracture import contrast, nearest_fracture, settle, tear, worst_piece
from forest.surface.bark.rings import overload, rest_of, turn_of, x_of

_UP = np.int64(1)
_DOWN = np.int64(-1)
_STRAY = np.int64(2)  # what a draw is for: four ids to an axis


@njit
def _record_of(rings: Any, node: Any) -> Any:
    """Find the record of a tear: a strip's places rise."""
    s = np.int64(rings.tear_strip[node])
    lo = rings.base[s]
    hi = lo + rings.records[s]
    place = rings.tear_place[node]
    while hi - lo > 1:
        middle = (lo + hi) // 2
        if rings.place[middle] <= place:
            lo = middle
        else:
            hi = middle
    return lo


@njit
def _piece_at(rings: Any, s: Any, x: Any) -> Any:
    """Find the record at or before x m around the girth, and x within its turn."""
    lo = rings.base[s]
    hi = lo + rings.records[s]
    begin = rings.left[lo]
    x = begin + (x - begin) - np.floor((x - begin) / rings.girth[s]) * rings.girth[s]
    while hi - lo > 1:
        middle = (lo + hi) // 2
        if rings.left[middle] <= x:
            lo = middle
        else:
            hi = middle
    return lo, x


@njit
def _next_strip(rings: Any, crossings: Any, s: Any, runs: Any, turn: Any) -> Any:
    """Where a fracture at the end of strip s would go on: strip, angle, direction; or -1.

    A passage to another axis goes before the neighbour on the same one: the fracture stops at
    the branch and goes on along it (5.3).
    """
    row = 0
    above = len(crossings.strip)
    while row < above:  # the first row of the strip
        middle = (row + above) // 2
        if crossings.strip[middle] < s:
            row = middle + 1
        else:
            above = middle
    for row in range(above, len(crossings.strip)):
        if crossings.strip[row] != s:
            break
        off = turn - crossings.angle[row]
        off -= np.floor(off + 0.5)
        if crossings.runs[row] == runs and abs(off) <= crossings.half[row]:
            at = crossings.enters[row] + crossings.scale[row] * off
            return np.int64(crossings.to[row]), at, np.int64(crossings.goes[row])
    target = rings.up[s] if runs > 0 else rings.down[s]
    return np.int64(target), turn, runs


@njit
def _mean_width(rings: Any, fracture: Any) -> Any:
    return rings.area[fracture] / rings.reach[fracture]


@njit
def _around(rings: Any, s: Any, x: Any) -> Any:
    """Find the fracture nearest to x in strip s: record (-1 for none), side, distance in m.

    `side` is where it lies: -1 to the left of x, +1 to the right, 0 when x is inside it.
    """
    i, x = _piece_at(rings, s, x)
    if rings.tear[i] >= 0 and x < rings.left[i] + rings.open[i]:
        return i, np.int64(0), 0.0
    best = np.int64(-1)
    side = np.int64(0)
    nearest = np.inf
    for way in (_DOWN, _UP):
        j, turns = nearest_fracture(rings, s, i, way)
        if j < 0:
            break
        left = rings.left[j] + turns * rings.girth[s]
        gap = x - left - rings.open[j] if way < 0 else left - x
        if gap < nearest:
            nearest = gap
            best = j
            side = way
    return best, side, nearest


@njit
def _bend(rings: Any, physics: Any, s: Any, to: Any, runs: Any, x: Any) -> Any:
    """By what part of a turn the course follows the edge of the nearest fracture (3.2.4).

    Lines of equal strain run along a fracture's edges. Its influence is all or nothing: within
    `influence` times its mean width. Without one the course is straight along the axis.
    """
    j, side, gap = _around(rings, to, x)
    if j < 0 or side == 0:
        return 0.0
    node = np.int64(rings.tear[j])
    if gap >= physics.influence * _mean_width(rings, np.int64(rings.tear_fracture[node])):
        return 0.0
    back = np.int64(rings.tear_down[node] if runs > 0 else rings.tear_up[node])
    if back < 0 or rings.tear_strip[back] != s:
        return 0.0
    k = _record_of(rings, back)
    there = rings.left[j]
    here = rings.left[k]
    if side < 0:  # it lies to the left: its right edge faces the course
        there += rings.open[j]
        here += rings.open[k]
    bend = turn_of(rings.edges[to], rings.girth[to], there)
    bend -= turn_of(rings.edges[s], rings.girth[s], here)
    return bend - np.floor(bend + 0.5)


@njit
def _stray(rings: Any, physics: Any, seed: Any, fracture: Any, to: Any) -> Any:
    """Slope by which a fracture leaves its course; the same within a row of grains."""
    row = np.int64(np.floor(rings.along[to] / physics.grain_along_m))
    origin = np.int64(rings.origin[fracture])
    number = np.int64(rings.tear_place[origin] / physics.least_piece_m)
    strip = np.int64(rings.tear_strip[origin])
    where = np.int64(np.floor(rings.along[strip] / physics.grain_along_m))
    name = 4 * np.int64(rings.axis[to]) + _STRAY
    drawn, _, _, _ = uniforms(seed, STREAM_BARK, name, row + 65536 * where, number)
    return physics.stray * (2.0 * drawn - 1.0)


@njit
def _step(
    rings: Any, physics: Any, seed: Any, crossings: Any, node: Any, runs: Any, time: Any
) -> Any:
    """Try to break the strip next to a fracture's end. Returns the tear (-1) and its direction."""
    s = np.int64(rings.tear_strip[node])
    fracture = np.int64(rings.tear_fracture[node])
    i = _record_of(rings, node)
    x = rings.left[i] + 0.5 * rings.open[i]
    turn = turn_of(rings.edges[s], rings.girth[s], x)
    to, turn, goes = _next_strip(rings, crossings, s, runs, turn)
    none = np.int64(-1)
    if to < 0:
        return none, goes
    if rings.axis[to] == rings.axis[s]:
        straight = x_of(rings.edges[to], turn)
        turn += _bend(rings, physics, s, to, runs, straight)
        run = 0.5 * (rings.width[to] + rings.width[s])
        turn += _stray(rings, physics, seed, fracture, to) * run / rings.girth[to]
    x = x_of(rings.edges[to], turn)
    near, side, gap = _around(rings, to, x)
    if near >= 0:
        other = np.int64(rings.tear_fracture[rings.tear[near]])
        if side == 0 or gap < physics.stand_off * _mean_width(rings, other):
            return none, goes
    k, x = _piece_at(rings, to, x)
    part = (x - rings.left[k] - rings.open[k]) / rings.piece[k]
    place = rings.place[k] + part * rest_of(rings, to, k)
    grain = rings.cell[to] + np.int64(place / physics.grain_m)
    needed = physics.arrest * contrast(rings, physics, min(grain, rings.cell[to + 1] - 1))
    if rings.reach[fracture] >= physics.flaw_m and not overload(rings, to, k) >= needed:
        return none, goes
    for way in (_DOWN, _UP):
        j, turns = nearest_fracture(rings, to, k, way)
        if j >= 0:
            apart = abs(rings.place[j] + turns * rings.length[to] - place)
            if apart < physics.least_piece_m:
                return none, goes
    return tear(rings, to, k, place, fracture, time), goes


@njit
def run_on(
    rings: Any, physics: Any, seed: Any, crossings: Any, fracture: Any, end: Any, time: Any
) -> None:
    """Let the upper (+1) or lower (-1) end of a fracture run on from strip to strip.

    It can while its length over its width exceeds the Inglis threshold, and the next strip bears
    at least the `arrest` share of what would break it unaided.
    """
    upper = end > 0
    node = np.int64(rings.last[fracture] if upper else rings.first[fracture])
    ahead = rings.tear_up[node] if upper else rings.tear_down[node]
    behind = rings.tear_down[node] if upper else rings.tear_up[node]
    runs = end
    if ahead >= 0 and behind < 0 and rings.first[fracture] != rings.last[fracture]:
        runs = -runs  # it came over a passage that turned it round
    run = 0.0
    while True:
        reach = rings.reach[fracture]
        opened = rings.area[fracture]
        stops = run > physics.run_m or not reach * reach > physics.inglis * opened
        if reach >= physics.flaw_m and stops:
            return
        new, goes = _step(rings, physics, seed, crossings, node, runs, time)
        if new < 0:
            return
        if runs > 0:
            rings.tear_up[node] = new
        else:
            rings.tear_down[node] = new
        if goes > 0:
            rings.tear_down[new] = node
        else:
            rings.tear_up[new] = node
        if upper:
            rings.last[fracture] = new
        else:
            rings.first[fracture] = new
        to = np.int64(rings.tear_strip[new])
        rings.reach[fracture] += rings.width[to]
        run += rings.width[to]
        settle(rings, physics, to)
        node = np.int64(new)
        runs = goes


@njit
def begin_fracture(
    rings: Any,
    physics: Any,
    seed: Any,
    crossings: Any,
    s: Any,
    i: Any,
    place: Any,
    time: Any,
) -> Any:
    """Tear the piece behind record i open at a place and let the fracture run both ways."""
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
    settle(rings, physics, s)
    run_on(rings, physics, seed, crossings, fracture, _UP, time)
    run_on(rings, physics, seed, crossings, fracture, _DOWN, time)
    return fracture


@njit
def tear_all(rings: Any, physics: Any, seed: Any, crossings: Any, order: Any, time: Any) -> None:
    """Let everything break that must, after the strips were stretched.

    Fractures that are there run on first: their ends bear the most. Then strips break, the most
    strained first (in nature fractures are not simultaneous, 3.2.3), and each fracture runs on
    at once, so that it relieves its neighbours before their turn comes.
    """
    for f in range(rings.totals[1]):
        rings.area[f] = 0.0
    for s in range(len(rings.records)):
        for i in range(rings.base[s], rings.base[s] + rings.records[s]):
            if rings.tear[i] >= 0:
                f = rings.tear_fracture[rings.tear[i]]
                rings.area[f] += rings.open[i] * rings.width[s]
    for f in range(rings.totals[1]):
        if not physics.ends:
            break
        run_on(rings, physics, seed, crossings, f, _UP, time)
        run_on(rings, physics, seed, crossings, f, _DOWN, time)
    for s in order:
        while True:
            i = worst_piece(rings, physics, s)
            if i < 0:
                break
            begin_fracture(rings, physics, seed, crossings, s, i, rings.weak[i], time)
