"""What is too thin for cells: twigs as rings of a few sides, from where they leave thicker wood."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.surface.blend.cones import merge
from forest.surface.blend.field import Blend, value
from forest.trees.skeleton import Skeleton

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

#: A twig grows from the blended surface, or from the ground (others: index of their host).
BLENDED, GROUND = -1, -2
#: A twig has this many sides where its radius exceeds this part of a cell.
_SIDES = ((1.5, 8), (1.0, 6), (0.5, 5), (0.25, 4), (0.0, 3))
_TOLERANCE = 0.1
_OUT = 0.6  # a twig's first ring stands so many radii off the surface
_OUT_ALONG = 0.2  # and where it goes on from a limb's end
_CLOSE = 0.25  # rings nearer than this part of their radius are one


class Lines(NamedTuple):
    """Polylines of the twigs; a twig is the thin part of one axis."""

    first: _Ints  # (twigs + 1,) first point of each
    point: _Floats  # (p, 3)
    radius: _Floats  # (p,)
    along: _Floats  # (p,) from the base of the twig, m
    internode: _Ints  # (p,) that ends there


class Twigs(NamedTuple):
    """Rings of the twigs, each twig's from base to tip; a host stands before what grows on it."""

    host: _Ints  # (twigs,) index of a twig, BLENDED or GROUND
    sides: _Ints  # (twigs,)
    exit: _Floats  # (twigs, 3) where it leaves its host's surface
    first: _Ints  # (twigs + 1,) first ring of each
    centre: _Floats  # (r, 3)
    across: _Floats  # (r, 2, 3) unit vectors of the ring's plane
    radius: _Floats  # (r,) of the wood
    along: _Floats  # (r,) distance from the base of the axis, m
    internode: _Ints  # (r,)


def _lines(skeleton: Skeleton, kept: NDArray[np.bool_]) -> Lines:
    """Lay out the axes' thin parts, in the order of their first internodes."""
    thin = np.flatnonzero(~kept)
    order = thin[np.argsort(skeleton.axis[thin], kind="stable")]
    axis = skeleton.axis[order]
    heads = np.flatnonzero(np.concatenate(([True], axis[1:] != axis[:-1])))
    chains = np.split(order, heads[1:])
    chains.sort(key=lambda chain: int(chain[0]))
    count = np.array([len(chain) for chain in chains])
    first = np.concatenate(([0], np.cumsum(count + 1)))
    members = np.concatenate(chains)
    base = np.array([chain[0] for chain in chains])
    head = np.concatenate(([0], np.cumsum(count)[:-1]))
    point = np.insert(skeleton.end[members], head, skeleton.start[base], axis=0)
    internode = np.insert(members, head, base)
    radius = skeleton.radius[internode]
    between = np.ones(len(internode), np.bool_)
    between[first[:-1]] = between[first[1:] - 1] = False
    inner = np.flatnonzero(between)
    radius[inner] = 0.5 * (
        skeleton.radius[internode[inner]] + skeleton.radius[internode[inner + 1]]
    )
    step = np.concatenate(([0.0], np.linalg.norm(np.diff(point, axis=0), axis=1)))
    step[first[:-1]] = 0.0
    along = np.cumsum(step)
    along -= np.repeat(along[first[:-1]], count + 1)
    return Lines(first, point, radius, along, internode)


@njit
def _at(along: Any, low: Any, high: Any, s: Any) -> Any:
    """Find the piece of a polyline in which a distance along it falls, and where in it."""
    k = low
    while k < high - 2 and along[k + 1] < s:
        k += 1
    span = along[k + 1] - along[k]
    return k, min(max((s - along[k]) / span, 0.0), 1.0) if span > 0.0 else 0.0


@njit
def _leave(field: Any, lines: Any, low: Any, high: Any, out: Any, place: Any) -> Any:
    """How far along a twig its axis is `out` metres off the blended surface; -1 if nowhere.

    Also fills `place` with the point where it leaves the surface.
    """
    length = lines.along[high - 1]
    step = max(0.5 * lines.radius[low], length / 200.0)
    before, hint, crossed = 0.0, np.int64(0), False
    s = 0.0
    while True:
        k, t = _at(lines.along, low, high, s)
        p = lines.point[k] + t * (lines.point[k + 1] - lines.point[k])
        f, hint = value(field, p[0], p[1], p[2], hint)
        if f >= 0.0 and not crossed:
            place[:] = p
            crossed = True
        if f >= out:
            return 0.5 * (before + s)
        if s >= length:
            return -1.0
        before = s
        s = min(s + step, length)


@njit
def _start(field: Any, lines: Any, parent: Any, twig_of: Any, end_along: Any, host: Any,
           begin: Any, exit_: Any, base_along: Any, on_axis: Any) -> None:  # fmt: skip
    """Find each twig's host and where its first ring stands; a hidden twig gets begin -1."""
    for q in range(len(lines.first) - 1):
        low, high = lines.first[q], lines.first[q + 1]
        length = lines.along[high - 1]
        below = parent[lines.internode[low]]
        begin[q] = 0.0
        exit_[q] = lines.point[low]
        base_along[q] = 0.0
        if below < 0:
            host[q] = GROUND
        else:
            host[q] = twig_of[below]
            while host[q] >= 0 and begin[host[q]] < 0.0:
                host[q] = host[host[q]]
        if length <= 0.0:
            begin[q] = -1.0
        elif host[q] == BLENDED:
            goes_on = on_axis[q] >= 0.0
            base_along[q] = max(on_axis[q], 0.0)
            out = (_OUT_ALONG if goes_on else _OUT) * lines.radius[low]
            begin[q] = _leave(field, lines, low, high, out, exit_[q])
        elif host[q] >= 0:
            h = host[q]
            k, _ = _at(lines.along, lines.first[h], lines.first[h + 1], end_along[below])
            way = lines.point[k + 1] - lines.point[k]
            k2, t2 = _at(lines.along, low, high, min(2.0 * lines.radius[k], length))
            own = lines.point[k2] + t2 * (lines.point[k2 + 1] - lines.point[k2]) - lines.point[low]
            size = np.sqrt(np.sum(way * way) * np.sum(own * own))
            cosine = np.sum(way * own) / size if size > 0.0 else 0.0
            sine = np.sqrt(max(1.0 - cosine * cosine, 0.09))
            begin[q] = min((lines.radius[k] + _OUT * lines.radius[low]) / sine, 0.5 * length)
            k2, t2 = _at(lines.along, low, high, min(lines.radius[k] / sine, length))
            exit_[q] = lines.point[k2] + t2 * (lines.point[k2 + 1] - lines.point[k2])


@njit
def _lay_rings(lines: Any, begin: Any, floor: Any, first: Any, centre: Any, across: Any,
               radius: Any, along: Any, internode: Any, base: Any, turned: Any) -> Any:  # fmt: skip
    """Put rings where a twig bends or tapers."""
    r = np.int64(0)
    for q in range(len(begin)):
        first[q] = r
        if begin[q] < 0.0:
            continue
        low, high = lines.first[q], lines.first[q + 1]
        length = lines.along[high - 1]
        n = high - low
        keep = np.empty(n, np.bool_)
        merge(lines.point[low:high], np.maximum(lines.radius[low:high], floor), _TOLERANCE, keep)
        at = np.empty(n + 2)
        at[0] = begin[q]
        m = 1
        for k in range(n):
            if keep[k]:
                at[m] = lines.along[low + k]
                m += 1
        at[m] = length
        positions = np.sort(at[: m + 1])
        before = -np.inf
        for s in positions:
            k, t = _at(lines.along, low, high, s)
            wide = lines.radius[k] + t * (lines.radius[k + 1] - lines.radius[k])
            if s < begin[q] or (s < length and s > begin[q] and length - s < _CLOSE * wide):
                continue
            if s - before < _CLOSE * wide and s < length:
                continue
            if s == before:
                continue
            before = s
            centre[r] = lines.point[k] + t * (lines.point[k + 1] - lines.point[k])
            radius[r] = wide
            along[r] = base[q] + s
            internode[r] = lines.internode[k + 1]
            r += 1
        if r - first[q] < 2:
            r = first[q]
            begin[q] = -1.0
            continue
        _turn_rings(centre[first[q] : r], across[first[q] : r], turned[q])
    first[len(begin)] = r
    return r


@njit
def _turn_rings(centre: Any, across: Any, side: Any) -> None:
    """Carry a frame along the rings, each between the pieces that meet in it."""
    n = len(centre)
    a = side.copy()
    for k in range(n):
        way = centre[min(k + 1, n - 1)] - centre[max(k - 1, 0)]
        size = np.sqrt(np.sum(way * way))
        if size <= 0.0:
            way = centre[n - 1] - centre[0]
            size = max(np.sqrt(np.sum(way * way)), 1e-12)
        way = way / size
        a = a - np.sum(a * way) * way
        if np.sum(a * a) < 1e-6:
            least = np.argmin(np.abs(way))
            a = -way[least] * way
            a[least] += 1.0
        a = a / np.sqrt(np.sum(a * a))
        across[k, 0] = a
        across[k, 1, 0] = way[1] * a[2] - way[2] * a[1]
        across[k, 1, 1] = way[2] * a[0] - way[0] * a[2]
        across[k, 1, 2] = way[0] * a[1] - way[1] * a[0]


def twigs_of(skeleton: Skeleton, blend: Blend, side: _Floats, cell_m: float) -> Twigs:
    """Turn the thin parts of a tree into rings.

    Parameters
    ----------
    skeleton : Skeleton
        The tree.
    blend : Blend
        Its surface without them.
    side : float64 (n, 3)
        A direction across each internode, carried along the axes.
    cell_m : float
        The smallest cell, m; a thin twig has fewer sides.
    """
    kept = blend.limbs.kept
    if kept.all():
        none, empty = np.zeros(0, np.int64), np.zeros((0, 3))
        start = np.zeros(1, np.int64)
        return Twigs(none, none, empty, start, empty, np.zeros((0, 2, 3)), np.zeros(0), np.zeros(0),
                     none)  # fmt: skip
    lines = _lines(skeleton, kept)
    count = len(lines.first) - 1
    head = lines.first[:-1]
    twig_of = np.full(len(skeleton), BLENDED, np.int64)
    owner = np.repeat(np.arange(count), np.diff(lines.first))
    twig_of[lines.internode] = owner
    end_along = np.zeros(len(skeleton))
    end_along[lines.internode] = lines.along
    base = lines.internode[head]
    below = skeleton.parent[base]
    same = (below >= 0) & (skeleton.axis[np.maximum(below, 0)] == skeleton.axis[base])
    limbs = blend.limbs
    total = np.zeros(len(limbs.member_first) - 1)
    filled = np.flatnonzero(np.diff(limbs.member_first))
    total[filled] = limbs.member_end[limbs.member_first[filled + 1] - 1]
    on_axis = np.where(same & kept[np.maximum(below, 0)], total[skeleton.axis[base]], -1.0)
    host, begin = np.empty(count, np.int64), np.empty(count)
    place, base_along = np.empty((count, 3)), np.empty(count)
    _start(blend.kernel, lines, skeleton.parent, twig_of, end_along, host, begin, place,
           base_along, on_axis)  # fmt: skip
    room = len(lines.point) + 2 * count
    first = np.empty(count + 1, np.int64)
    centre, across = np.empty((room, 3)), np.empty((room, 2, 3))
    radius, along, internode = np.empty(room), np.empty(room), np.empty(room, np.int64)
    rings = _lay_rings(lines, begin, 0.3 * cell_m, first, centre, across,
                       radius, along, internode, base_along, side[base])  # fmt: skip
    seen = np.flatnonzero(np.diff(first) > 0)
    number = np.full(count, -1, np.int64)
    number[seen] = np.arange(len(seen))
    sides = np.full(count, _SIDES[-1][1], np.int64)
    for part, n in _SIDES[::-1]:
        sides[lines.radius[head] > part * cell_m] = n
    shown = _shown_host(host, number)[seen]
    return Twigs(
        shown, sides[seen], place[seen], np.append(first[:-1][seen], rings), centre[:rings],
        across[:rings], radius[:rings], along[:rings], internode[:rings],
    )  # fmt: skip


def _shown_host(host: _Ints, number: _Ints) -> _Ints:
    """Renumber hosts; what grew on a hidden twig grows on that one's host."""
    shown = host.copy()
    for q in range(len(host)):
        while shown[q] >= 0 and number[shown[q]] < 0:
            shown[q] = host[shown[q]]
    live = shown >= 0
    shown[live] = number[shown[live]]
    return shown
