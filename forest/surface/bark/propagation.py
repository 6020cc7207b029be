"""How fractures run from strip to strip (Lefebvre and Neyret 2002, 3.2.4)."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import njit
from forest.random import STREAM_BARK, uniforms
from forest.surface.bark.fracture import bears_at, nearest_fracture, settle, tear
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
def _area(rings: Any, fracture: Any, moment: Any) -> Any:
    """Area that a fracture has opened at a moment of the step, m2."""
    kept = rings.kept[fracture]
    return kept + moment * (rings.area[fracture] - kept)


@njit
def _mean_width(rings: Any, fracture: Any, moment: Any) -> Any:
    return _area(rings, fracture, moment) / rings.reach[fracture]


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
def _bend(rings: Any, physics: Any, s: Any, to: Any, runs: Any, x: Any, moment: Any) -> Any:
    """By what part of a turn the course follows the edge of the nearest fracture (3.2.4).

    Lines of equal strain run along a fracture's edges. Its influence is all or nothing: within
    `influence` times its mean width. Without one the course is straight along the axis.
    """
    j, side, gap = _around(rings, to, x)
    if j < 0 or side == 0:
        return 0.0
    node = np.int64(rings.tear[j])
    other = np.int64(rings.tear_fracture[node])
    if gap >= physics.influence * _mean_width(rings, other, moment):
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
def _end_of(rings: Any, fracture: Any, upper: Any) -> Any:
    """Find a fracture's upper (1) or lower (0) end: its tear, and which way it runs there."""
    node = np.int64(rings.last[fracture] if upper else rings.first[fracture])
    ahead = rings.tear_up[node] if upper else rings.tear_down[node]
    behind = rings.tear_down[node] if upper else rings.tear_up[node]
    runs = _UP if upper else _DOWN
    if ahead >= 0 and behind < 0 and rings.first[fracture] != rings.last[fracture]:
        runs = -runs  # it came over a passage that turned it round
    return node, runs


@njit
def _is_held(rings: Any, physics: Any, fracture: Any, upper: Any, moment: Any) -> Any:
    """Whether an end has run as far as it may in this step, or the Inglis ratio is too small."""
    reach = rings.reach[fracture]
    if reach < physics.flaw_m:
        return False
    ran = rings.ran[fracture, upper] > physics.run_m
    return ran or not reach * reach > physics.inglis * _area(rings, fracture, moment)


@njit
def ahead_of(
    rings: Any, physics: Any, seed: Any, crossings: Any, fracture: Any, upper: Any, moment: Any
) -> Any:
    """Find where an end of a fracture would run on, and how strongly it is drawn there.

    It can while its length over its width exceeds the Inglis threshold, and the next strip bears
    at least the `arrest` share of what would break it unaided. `moment` says how much of the
    step's strain is there: fractures are so wide by then.

    Returns the load (1 where it just runs, 0 where it is stopped, infinite for a flaw), record and
    strip, place on the epidermis, and which way it goes on from there.
    """
    node, runs = _end_of(rings, fracture, upper)
    none = (0.0, np.int64(-1), np.int64(-1), 0.0, runs)
    if _is_held(rings, physics, fracture, upper, moment):
        return none
    s = np.int64(rings.tear_strip[node])
    i = _record_of(rings, node)
    x = rings.left[i] + 0.5 * rings.open[i]
    turn = turn_of(rings.edges[s], rings.girth[s], x)
    to, turn, goes = _next_strip(rings, crossings, s, runs, turn)
    if to < 0:
        return none
    if rings.axis[to] == rings.axis[s]:
        straight = x_of(rings.edges[to], turn)
        turn += _bend(rings, physics, s, to, runs, straight, moment)
        run = 0.5 * (rings.width[to] + rings.width[s])
        turn += _stray(rings, physics, seed, fracture, to) * run / rings.girth[to]
    x = x_of(rings.edges[to], turn)
    near, side, gap = _around(rings, to, x)
    if near >= 0:
        other = np.int64(rings.tear_fracture[rings.tear[near]])
        if side == 0 or gap < physics.stand_off * _mean_width(rings, other, moment):
            return none
    k, x = _piece_at(rings, to, x)
    part = (x - rings.left[k] - rings.open[k]) / rings.piece[k]
    place = rings.place[k] + part * rest_of(rings, to, k)
    for way in (_DOWN, _UP):
        j, turns = nearest_fracture(rings, to, k, way)
        if j >= 0:
            apart = abs(rings.place[j] + turns * rings.length[to] - place)
            if apart < physics.least_piece_m:
                return none
    load = np.inf
    if rings.reach[fracture] >= physics.flaw_m and physics.arrest > 0.0:
        needed = physics.arrest * bears_at(rings, physics, to, k, place)
        load = overload(rings, to, k) / needed
    return load, k, to, place, goes


@njit
def run_on(
    rings: Any,
    physics: Any,
    fracture: Any,
    upper: Any,
    k: Any,
    to: Any,
    place: Any,
    goes: Any,
    time: Any,
) -> Any:
    """Let an end of a fracture tear the piece behind record k of strip `to`; whether it did."""
    node, runs = _end_of(rings, fracture, upper)
    new = tear(rings, to, k, place, fracture, time)
    if new < 0:
        return False
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
    rings.reach[fracture] += rings.width[to]
    rings.ran[fracture, upper] += rings.width[to]
    settle(rings, physics, to)
    return True
