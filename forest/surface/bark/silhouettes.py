"""Smooth outlines of fractures, out of the strips they were torn in (Lefebvre and Neyret 3.3).

A fracture's left and right border are cubic curves along the axis through the edges of its
elements; it ends in a point in the middle of the first strip that it did not tear. With borders
that run straight there, the area torn open is the same as on the strips. Two fractures that met
head on in neighbouring strips are one opening. Between fractures lies
epidermis, whose own coordinate runs on across each of them: none is lost, none is made.

Around the axis everything is in turns from the seam, along it in metres. Where fractures join,
their outlines overlap.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from forest._jit import njit
from forest.errors import InputError
from forest.surface.bark.strips import FRACTURE
from forest.surface.bark.viewed import BarkView

#: Ends face each other when their middles lie within so many of their mean widths.
_HEAD_ON = 1.0

_Floats = NDArray[np.float64]
_Indices = NDArray[np.int64]


class Silhouettes(NamedTuple):
    """The outlines of all fractures on one axis.

    Interval k lies between `knots[k]` and `knots[k + 1]`, the middles of two strips; the pieces of
    fractures in it are rows `offsets[k]:offsets[k + 1]` of the other columns. A value with a
    column for each end and each slope, as `centre`, is (value below, value above, slope below,
    slope above), the slopes per interval: a cubic Hermite curve.
    """

    knots: _Floats  # (intervals + 1) m along the axis
    girth: _Floats  # (intervals + 1) at the knots, m
    rest: _Floats  # (intervals + 1) the epidermis' own length L0 at the knots, m
    shift: _Floats  # (intervals + 1) epidermis turn less turn, where no fracture tells it
    offsets: _Indices  # (intervals + 1)
    centre: _Floats  # (pieces, 4) turns
    half: _Floats  # (pieces, 4) half the opening, turns
    epidermis: _Floats  # (pieces, 2) turn on the epidermis where it was torn, below and above
    fracture: NDArray[np.int32]  # (pieces,) row of `Fractures`: the first of those that are one
    low: float  # the stretch of axis that the strips cover, m
    length: float
    cyclic: bool  # the uppermost strip is followed by the lowest

    def row(self, v: float) -> tuple[int, float]:
        """Give the interval at `v` and the share of it that lies below."""
        k, share = find_interval(self.knots, v)
        return int(k), float(share)

    def at(self, values: _Floats, v: _Floats) -> _Floats:
        """Interpolate what is known at the knots (`girth`, `rest`)."""
        return np.interp(v, self.knots, values)


class _Nodes(NamedTuple):
    """The tears of an axis: one row each."""

    strip: _Indices  # place of the strip on the axis, from the base
    centre: _Floats  # turns, unwrapped along a fracture only in differences
    half: _Floats
    epidermis: _Floats  # near `centre`
    up: _Indices
    down: _Indices
    fracture: NDArray[np.int32]


class _Ring(NamedTuple):
    """The strips of an axis and their elements, in turns."""

    offsets: _Indices
    start: _Floats
    width: _Floats
    uv0: _Floats
    own: _Floats  # length on the epidermis


def silhouettes(bark: BarkView, axis: int = 0) -> Silhouettes:
    """Draw the outlines of all fractures on an axis.

    Parameters
    ----------
    bark : BarkView
        Torn or whole.
    axis : int
        Which axis.

    Returns
    -------
    Silhouettes

    Raises
    ------
    InputError
        The bark has no such axis.
    """
    rows = np.flatnonzero(bark.strips.axis == axis)
    if not len(rows):
        known = ", ".join(map(str, np.unique(bark.strips.axis)[:8]))
        raise InputError(f"no axis {axis}", where="bark", expected=f"one of {known}")
    strips = bark.strips
    n = len(rows)
    cyclic = bool(n > 1 and strips.neighbour_up[rows[-1]] == rows[0])
    along, width = strips.along[rows], strips.width[rows]
    low = float(along[0] - 0.5 * width[0])
    length = float(along[-1] + 0.5 * width[-1]) - low
    of_knot = np.concatenate(([n - 1 if cyclic else 0], np.arange(n), [0 if cyclic else n - 1]))
    below = along[-1] - length if cyclic else low - 0.5 * width[0]
    above = along[0] + length if cyclic else low + length + 0.5 * width[-1]
    knots = np.concatenate(([below], along, [above]))

    ring = _ring_of(bark, rows)
    nodes = _nodes_of(bark, rows, ring)
    shift = _shift_of(ring)
    pieces = _pieces(nodes, ring, knots, cyclic)
    order = np.argsort(pieces.interval, kind="stable")
    count = np.bincount(pieces.interval, minlength=n + 1)
    return Silhouettes(
        knots=knots,
        girth=strips.girth[rows][of_knot],
        rest=(strips.rest * bark.scale)[rows][of_knot],
        shift=shift[of_knot],
        offsets=np.concatenate(([0], np.cumsum(count))),
        centre=pieces.centre[order],
        half=pieces.half[order],
        epidermis=pieces.epidermis[order],
        fracture=pieces.fracture[order],
        low=low,
        length=length,
        cyclic=cyclic,
    )


def _ring_of(bark: BarkView, rows: _Indices) -> _Ring:
    elements, strips = bark.elements, bark.strips
    first, last = elements.offsets[rows], elements.offsets[rows + 1]
    counts = last - first
    taken = np.repeat(first, counts) + _counting(counts)
    girth = np.repeat(strips.girth[rows], counts)
    rest = np.repeat(strips.rest[rows], counts)
    epidermis = elements.kind[taken] != FRACTURE
    return _Ring(
        offsets=np.concatenate(([0], np.cumsum(counts))),
        start=elements.start[taken] / girth,
        width=elements.width[taken] / girth,
        uv0=elements.uv0[taken] / rest,
        own=np.where(epidermis, elements.rest[taken] / rest, 0.0),
    )


def _counting(counts: _Indices) -> _Indices:
    """0, 1, ... within each group of so many."""
    ends = np.cumsum(counts)
    return np.asarray(np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - counts, counts))


def _shift_of(ring: _Ring) -> _Floats:
    """How far the epidermis runs ahead of the turn: at each strip's first element."""
    first = ring.offsets[:-1]
    shift = ring.uv0[first] - ring.start[first]
    shift -= np.round(shift)
    # From strip to strip the nearer way around, so that rows between two strips interpolate.
    return np.asarray(np.unwrap(shift, period=1.0), np.float64)


def _nodes_of(bark: BarkView, rows: _Indices, ring: _Ring) -> _Nodes:
    """Gather the tears of the axis; links to other axes end here."""
    place = np.full(len(bark.strips.axis), -1, np.int64)
    place[rows] = np.arange(len(rows))
    first, last = bark.elements.offsets[rows], bark.elements.offsets[rows + 1]
    counts = last - first
    taken = np.repeat(first, counts) + _counting(counts)
    torn = bark.elements.tear[taken] >= 0
    tears = bark.elements.tear[taken[torn]].astype(np.int64)
    number = np.full(len(bark.tears.strip), -1, np.int64)
    number[tears] = np.arange(len(tears))
    strip = place[bark.tears.strip[tears]]
    half = 0.5 * ring.width[torn]
    centre = (ring.start[torn] + half) % 1.0
    epidermis = ring.uv0[torn]
    epidermis = epidermis - np.round(epidermis - centre)

    def linked(column: NDArray[np.int32]) -> _Indices:
        to = column[tears].astype(np.int64)
        return np.where(to >= 0, number[to], -1)

    return _Nodes(
        strip=strip,
        centre=centre,
        half=half,
        epidermis=epidermis,
        up=linked(bark.tears.up),
        down=linked(bark.tears.down),
        fracture=bark.tears.fracture[tears],
    )


class _Pieces(NamedTuple):
    interval: _Indices
    centre: _Floats
    half: _Floats
    epidermis: _Floats
    fracture: NDArray[np.int32]


def _pieces(nodes: _Nodes, ring: _Ring, knots: _Floats, cyclic: bool) -> _Pieces:
    """Cut the outlines into cubic pieces from strip to strip, with a pointed end at each tip."""
    n = len(knots) - 2
    upward = _neighbouring(nodes, nodes.up, 1, n, cyclic)
    downward = _neighbouring(nodes, nodes.down, -1, n, cyclic)
    _join_heads(nodes, upward, downward, n, cyclic)
    nodes = _as_openings(nodes, *_pairs(nodes, upward, downward))
    slope, swell = _slopes(nodes, upward, downward, knots)
    parts = [_between(nodes, slope, swell, knots, *_pairs(nodes, upward, downward))]
    met_above = np.zeros(len(nodes.strip), np.bool_)
    met_below = np.zeros(len(nodes.strip), np.bool_)
    low, high = _pairs(nodes, upward, downward)
    met_above[low] = True
    met_below[high] = True
    parts.append(_ends(nodes, slope, swell, ring, knots, np.flatnonzero(~met_above), 1, cyclic))
    parts.append(_ends(nodes, slope, swell, ring, knots, np.flatnonzero(~met_below), -1, cyclic))
    joined = _Pieces(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    if not cyclic:
        return joined
    # The interval below the lowest strip is the one above the uppermost.
    twin = joined.interval == n
    rows = np.concatenate((np.arange(len(twin)), np.flatnonzero(twin)))
    interval = joined.interval[rows]
    interval[len(twin) :] = 0
    return _Pieces(
        interval,
        joined.centre[rows],
        joined.half[rows],
        joined.epidermis[rows],
        joined.fracture[rows],
    )


def _neighbouring(nodes: _Nodes, link: _Indices, step: int, n: int, cyclic: bool) -> _Indices:
    """Keep the links that lead to the next strip of the same axis."""
    wanted = nodes.strip + step
    if cyclic:
        wanted %= n
    fits = (link >= 0) & (nodes.strip[link] == wanted)
    return np.where(fits, link, -1)


def _join_heads(nodes: _Nodes, upward: _Indices, downward: _Indices, n: int, cyclic: bool) -> None:
    """Link upper ends to lower ends that face them from the strip above, each to the nearest."""
    tops, bottoms = np.flatnonzero(upward < 0), np.flatnonzero(downward < 0)
    facing = nodes.strip[tops] + 1
    if cyclic:
        facing %= n
    strip_of = nodes.strip[bottoms]
    order = np.argsort(strip_of, kind="stable")
    low, high = (np.searchsorted(strip_of[order], facing, side=end) for end in ("left", "right"))
    counts = (high - low).astype(np.int64)
    i = np.repeat(tops, counts)
    j = bottoms[order[np.repeat(low, counts) + _counting(counts)]]
    apart = np.abs(_turned(nodes.centre[j] - nodes.centre[i]))
    near = (apart <= _HEAD_ON * (nodes.half[i] + nodes.half[j])) & (i != j)
    i, j, apart = i[near], j[near], apart[near]
    taken = np.argsort(apart, kind="stable")
    for k in taken:
        if upward[i[k]] < 0 and downward[j[k]] < 0:
            upward[i[k]] = j[k]
            downward[j[k]] = i[k]


def _as_openings(nodes: _Nodes, low: _Indices, high: _Indices) -> _Nodes:
    """Give fractures that are one opening one name, the lowest, for what is drawn by name."""
    n = len(nodes.strip)
    graph = coo_array((np.ones(len(low), np.bool_), (low, high)), (n, n))
    count, opening = connected_components(graph, directed=False)
    name = np.full(count, np.iinfo(np.int32).max, np.int32)
    np.minimum.at(name, opening, nodes.fracture)
    return nodes._replace(fracture=name[opening])


def _pairs(nodes: _Nodes, upward: _Indices, downward: _Indices) -> tuple[_Indices, _Indices]:
    """Every link of the skeleton once, as lower and upper node."""
    me = np.arange(len(nodes.strip))
    up, down = upward >= 0, downward >= 0
    pairs = np.concatenate(
        (
            np.column_stack((me[up], upward[up])),
            np.column_stack((downward[down], me[down])),
        )
    )
    if not len(pairs):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    low, high = np.unique(pairs, axis=0).T
    return low, high


def _turned(difference: _Floats) -> _Floats:
    """The shorter way around."""
    return difference - np.round(difference)


def _slopes(
    nodes: _Nodes, upward: _Indices, downward: _Indices, knots: _Floats
) -> tuple[_Floats, _Floats]:
    """How centre and half-width change along the axis at each node, turns/m.

    Widths follow Fritsch and Carlson (1980), so that no border overshoots the other; a tip beyond
    an end counts as a neighbour of width 0.
    """
    here = nodes.strip + 1
    above = knots[here + 1] - knots[here]
    below = knots[here] - knots[here - 1]
    up, down = upward >= 0, downward >= 0
    rise_up = np.where(up, _turned(nodes.centre[upward] - nodes.centre), 0.0) / above
    rise_down = np.where(down, _turned(nodes.centre - nodes.centre[downward]), 0.0) / below
    ways = np.maximum(up.astype(np.int64) + down, 1)
    slope = (rise_up + rise_down) / ways
    swell_up = (np.where(up, nodes.half[upward], 0.0) - nodes.half) / above
    swell_down = (nodes.half - np.where(down, nodes.half[downward], 0.0)) / below
    same = swell_up * swell_down > 0.0
    safe = np.where(same, swell_up + swell_down, 1.0)
    swell = np.where(same, 2.0 * swell_up * swell_down / safe, 0.0)
    return slope, swell


def _between(
    nodes: _Nodes, slope: _Floats, swell: _Floats, knots: _Floats, low: _Indices, high: _Indices
) -> _Pieces:
    """The pieces from one node to the next."""
    interval = nodes.strip[low] + 1
    height = knots[interval + 1] - knots[interval]
    far = nodes.centre[low] + _turned(nodes.centre[high] - nodes.centre[low])
    ahead = nodes.epidermis - nodes.centre  # within half a turn
    torn = far + ahead[low] + _turned(ahead[high] - ahead[low])
    return _Pieces(
        interval,
        np.column_stack((nodes.centre[low], far, slope[low] * height, slope[high] * height)),
        np.column_stack(
            (nodes.half[low], nodes.half[high], swell[low] * height, swell[high] * height)
        ),
        np.column_stack((nodes.epidermis[low], torn)),
        nodes.fracture[low],
    )


def _ends(
    nodes: _Nodes,
    slope: _Floats,
    swell: _Floats,
    ring: _Ring,
    knots: _Floats,
    ends: _Indices,
    way: int,
    cyclic: bool,
) -> _Pieces:
    """The pieces beyond the ends of fractures: a point, or at the axis' end an open edge."""
    n = len(knots) - 2
    interval = nodes.strip[ends] + (1 if way > 0 else 0)
    height = knots[interval + 1] - knots[interval]
    beyond = nodes.strip[ends] + way
    if cyclic:
        beyond %= n
        if way < 0:
            interval = np.where(interval == 0, n, interval)
    on_axis = (beyond >= 0) & (beyond < n)
    tip = nodes.centre[ends] + way * slope[ends] * height
    open_half = np.where(on_axis, 0.0, nodes.half[ends])
    torn = nodes.epidermis[ends].copy()
    _epidermis_at(ring, np.where(on_axis, beyond, -1), tip, torn)
    straight = slope[ends] * height
    flat = np.where(on_axis, swell[ends] * height, 0.0)
    none = np.zeros(len(ends))
    order = slice(None, None, way)

    def two(near: _Floats, far: _Floats) -> list[_Floats]:
        return [near, far][order]

    return _Pieces(
        interval,
        np.column_stack((*two(nodes.centre[ends], tip), straight, straight)),
        np.column_stack((*two(nodes.half[ends], open_half), *two(flat, none))),
        np.column_stack(two(nodes.epidermis[ends], torn)),
        nodes.fracture[ends],
    )


@njit
def _epidermis_at(ring: Any, strip: Any, turn: Any, torn: Any) -> None:
    """Write the turn on the epidermis found at a turn of a strip, the one nearest to `torn`."""
    for i in range(len(strip)):
        s = strip[i]
        if s < 0:
            continue
        first, last = ring.offsets[s], ring.offsets[s + 1]
        at = turn[i] - np.floor(turn[i] - ring.start[first])
        found = ring.uv0[first]
        for e in range(first, last):
            if at >= ring.start[e]:
                share = (at - ring.start[e]) / ring.width[e] if ring.width[e] > 0.0 else 0.0
                found = ring.uv0[e] + min(share, 1.0) * ring.own[e]
        torn[i] = found - np.round(found - torn[i])


@njit
def find_interval(knots: Any, v: Any) -> Any:
    """Find the interval at `v` and the share of it that lies below."""
    low, high = 0, len(knots) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if knots[middle] <= v:
            low = middle
        else:
            high = middle
    return low, (v - knots[low]) / (knots[low + 1] - knots[low])


@njit
def hermite(ends: Any, s: Any) -> Any:
    """Evaluate a cubic Hermite piece and its slope per interval."""
    a, b, p, q = ends[0], ends[1], ends[2], ends[3]
    c2 = 3.0 * (b - a) - 2.0 * p - q
    c3 = p + q - 2.0 * (b - a)
    return a + s * (p + s * (c2 + s * c3)), p + s * (2.0 * c2 + 3.0 * s * c3)
