"""Where epidermis breaks, and how it is broken (Lefebvre and Neyret 2002, 3.2.3)."""

from __future__ import annotations

from typing import Any

import numpy as np

from forest._jit import driver, njit
from forest.random import STREAM_BARK, normals, uniforms
from forest.surface.bark.rings import CHUNKS, overload, rest_of, solve_strip
from forest.surface.bark.strips import GRAIN_M

# What a draw is for: four ids to an axis.
_PLACE = np.int64(0)
_SPOT = np.int64(1)
_FAR = np.inf
_MOST = 4.0  # standard deviations


@njit
def _weigh(rings: Any, physics: Any, seed: Any, weakness: Any, s: Any) -> None:
    """Draw how strong the grains of one strip are; neighbouring strips see much the same field.

    Strength is a normal number per grain around the girth and row of grains along the axis,
    faded from row to row; beside it stands the weakness map (samples around the epidermis).
    """
    lo = rings.cell[s]
    n = rings.cell[s + 1] - lo
    at = rings.along[s] / physics.grain_along_m
    row = np.int64(np.floor(at))
    part = at - row
    a = 1.0 - part
    name = 4 * np.int64(rings.axis[s])
    samples = len(weakness[s])
    for j in range(n):
        here, _ = normals(seed, STREAM_BARK, name + _PLACE, row, j)
        above, _ = normals(seed, STREAM_BARK, name + _PLACE, row + 1, j)
        shift, _, _, _ = uniforms(seed, STREAM_BARK, name + _SPOT, row, j)
        drawn = (a * here + part * above) / np.sqrt(a * a + part * part)
        begin = j * physics.grain_m
        spot = begin + (0.1 + 0.8 * shift) * min(physics.grain_m, rings.length[s] - begin)
        weak = 1.0  # without a map all is equally weak
        if samples > 0:
            weak = weakness[s, min(np.int64(spot / rings.length[s] * samples), samples - 1)]
        rings.spot[lo + j] = spot
        rings.drawn[lo + j] = min(max(drawn, -_MOST), _MOST)
        rings.weakness[lo + j] = weak


@driver
def weigh_all(first: Any, step: Any, rings: Any, physics: Any, seed: Any, weakness: Any) -> None:
    """Draw the strength of all grains."""
    n = len(rings.records)
    for chunk in range(first, CHUNKS, step):
        for s in range(chunk * n // CHUNKS, (chunk + 1) * n // CHUNKS):
            _weigh(rings, physics, seed, weakness, s)


@njit
def nearest_fracture(rings: Any, s: Any, i: Any, side: Any) -> Any:
    """Find the fracture next to the piece behind record i: to its left (-1) or right (+1).

    Returns its record (-1 without any) and by how much its place and x are to be shifted, since
    the search goes around the ring.
    """
    first = rings.base[s]
    n = rings.records[s]
    k = i - first if side < 0 else i - first + 1
    for _ in range(n):
        turns = k // n  # -1, 0 or 1
        j = first + k - turns * n
        if rings.tear[j] >= 0:
            return j, turns
        k += side
    return np.int64(-1), np.int64(0)


@njit
def room_to_break(rings: Any, physics: Any, s: Any, i: Any) -> Any:
    """From where to where the piece behind record i may break: not too near to a fracture."""
    least = physics.least_piece_m
    lo = rings.place[i]
    hi = lo + rest_of(rings, s, i)
    left, turns = nearest_fracture(rings, s, i, np.int64(-1))
    if left >= 0:
        lo = max(lo, rings.place[left] + turns * rings.length[s] + least)
        right, turns = nearest_fracture(rings, s, i, np.int64(1))
        hi = min(hi, rings.place[right] + turns * rings.length[s] - least)
    return lo, hi


@njit
def contrast(rings: Any, physics: Any, grain: Any) -> Any:
    """Factor on the strain that a grain bears, by the weakness map; 1 where that is 1."""
    return 1.0 + physics.weakness_contrast * (1.0 - rings.weakness[grain])


@njit
def seek_weakest(rings: Any, physics: Any, s: Any, i: Any) -> None:
    """Find the weakest place of the piece behind record i, and how much it bears.

    A piece is as strong as its weakest grain, so long ones break before short ones. Where all is
    equally strong, the place is the middle.
    """
    lo, hi = room_to_break(rings, physics, s, i)
    cells = rings.cell[s]
    middle = 0.5 * (lo + hi)
    rings.weak[i] = middle
    rings.tough[i] = _FAR
    best: Any = np.int64(-1)
    least = np.inf
    first: Any = cells + max(np.int64(lo / physics.grain_m), 0)
    last: Any = min(cells + np.int64(hi / physics.grain_m) + 1, rings.cell[s + 1])
    for k in range(first, last):
        if not lo < rings.spot[k] < hi:
            continue
        strength = physics.place_jitter * rings.drawn[k] - rings.weakness[k]
        nearer = best >= 0 and abs(rings.spot[k] - middle) < abs(rings.spot[best] - middle)
        if strength < least or (strength == least and nearer):
            least = strength
            best = k
    if best < 0:
        return
    rings.weak[i] = rings.spot[best]
    rings.tough[i] = np.exp(physics.threshold_jitter * rings.drawn[best])
    rings.tough[i] *= contrast(rings, physics, best)


@njit
def _renew(rings: Any, physics: Any, s: Any, i: Any) -> None:
    """Seek the weakest place of a piece anew if it has lost its own."""
    lo, hi = room_to_break(rings, physics, s, i)
    if not lo <= rings.weak[i] <= hi:
        seek_weakest(rings, physics, s, i)


@njit
def bears_at(rings: Any, physics: Any, s: Any, i: Any, place: Any) -> Any:
    """Factor on the strain that the piece behind record i bears before it breaks at a place.

    That of its weakest grain, and what the weakness map has at the place itself.
    """
    _renew(rings, physics, s, i)
    here = contrast(rings, physics, _grain(rings, physics, s, place))
    if not np.isfinite(rings.tough[i]):  # no room to break unaided
        return here
    weakest = _grain(rings, physics, s, rings.weak[i])
    return rings.tough[i] / contrast(rings, physics, weakest) * here


@njit
def _grain(rings: Any, physics: Any, s: Any, place: Any) -> Any:
    """Find the grain at a place on the epidermis."""
    return min(rings.cell[s] + np.int64(place / physics.grain_m), rings.cell[s + 1] - 1)


@njit
def worst_piece(rings: Any, physics: Any, s: Any) -> Any:
    """Find the piece of a strip most beyond its threshold: its record (-1 for none) and load."""
    worst: Any = np.int64(-1)
    most = 0.0
    floor = np.exp(-_MOST * physics.threshold_jitter)
    for i in range(rings.base[s], rings.base[s] + rings.records[s]):
        load = overload(rings, s, i)
        if load <= floor:
            continue
        _renew(rings, physics, s, i)
        if load / rings.tough[i] > most:
            most = load / rings.tough[i]
            worst = i
    return worst, most


@njit
def tear(rings: Any, s: Any, i: Any, place: Any, fracture: Any, time: Any) -> Any:
    """Break the piece behind record i at a place: a fracture between two pieces (figure 6).

    The parts' stiffnesses follow from their own lengths, which sum to that of the piece. Returns
    the tear, or -1 where there is nothing to part.
    """
    rest = rest_of(rings, s, i)
    if rest < 2.0 * GRAIN_M:
        return np.int64(-1)
    place = np.round(place / GRAIN_M) * GRAIN_M - rings.place[i]
    place = rings.place[i] + min(max(place, GRAIN_M), rest - GRAIN_M)
    part = (place - rings.place[i]) / rest
    end = rings.base[s] + rings.records[s]
    right = rings.left[i] + rings.open[i]
    following = rings.grip_left[i + 1] if i + 1 < end else rings.grip_left[rings.base[s]]
    if i + 1 == end:
        following += rings.girth[s]
    for j in range(end, i + 1, -1):
        _move(rings, j - 1, j)
    k = i + 1
    tears = rings.totals[0]
    rings.totals[0] += 1
    rings.records[s] += 1
    rings.place[k] = place
    rings.rest[k] = 0.0
    rings.open[k] = 0.0
    rings.left[k] = right + part * rings.piece[i]
    rings.piece[k] = (1.0 - part) * rings.piece[i]
    rings.piece[i] = part * rings.piece[i]
    rings.grip_left[k] = rings.grip_right[i] + part * (following - rings.grip_right[i])
    rings.grip_right[k] = rings.grip_left[k]
    rings.weak[i] = np.nan
    rings.weak[k] = np.nan
    rings.tough[k] = 1.0
    rings.tear[k] = tears
    rings.tear_strip[tears] = s
    rings.tear_place[tears] = place
    rings.tear_up[tears] = -1
    rings.tear_down[tears] = -1
    rings.tear_fracture[tears] = fracture
    rings.tear_born[tears] = time
    return tears


@njit
def _move(rings: Any, source: Any, to: Any) -> None:
    rings.place[to] = rings.place[source]
    rings.rest[to] = rings.rest[source]
    rings.open[to] = rings.open[source]
    rings.left[to] = rings.left[source]
    rings.piece[to] = rings.piece[source]
    rings.grip_left[to] = rings.grip_left[source]
    rings.grip_right[to] = rings.grip_right[source]
    rings.weak[to] = rings.weak[source]
    rings.tough[to] = rings.tough[source]
    rings.tear[to] = rings.tear[source]


@njit
def settle(rings: Any, physics: Any, s: Any) -> None:
    """Bring a strip to equilibrium, and keep account of its fractures' areas."""
    for sign in (-1.0, 1.0):
        if sign > 0.0:
            solve_strip(rings, physics, s)
        for i in range(rings.base[s], rings.base[s] + rings.records[s]):
            if rings.tear[i] >= 0:
                opened = rings.open[i] * rings.width[s]
                rings.area[rings.tear_fracture[rings.tear[i]]] += sign * opened
