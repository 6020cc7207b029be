"""The kernels of tubes: nodes along axes, which of them stand, cross sections, and faces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit

SHORTEST = 1e-9  # m; nodes no farther apart are one
LONGEST_RUN = 200  # nodes that one piece may pass over
WIDEST_MITRE = 2.0
NO_DIRECTION = 1e-12
TURNED_BACK = 1e-9  # of 1 + cosine between two pieces that lie on each other


class Nodes(NamedTuple):
    """The nodes of all axes, one axis after the other, each from its base to its tip.

    Attributes
    ----------
    first : int64 (axes + 1,)
        Where each axis begins.
    place : float64 (k, 3)
        Centres of the cross sections, m.
    radius, along : float64 (k,)
        Radius, and way from the axis' base, m.
    internode : int64 (k,)
        The one that ends there; at the base the axis' first.
    """

    first: NDArray[np.int64]
    place: NDArray[np.float64]
    radius: NDArray[np.float64]
    along: NDArray[np.float64]
    internode: NDArray[np.int64]


@njit
def _distance(a: Any, b: Any) -> Any:
    return np.sqrt(np.sum((a - b) ** 2))


@njit
def _foot(a: Any, b: Any, point: Any) -> Any:
    """Give the point of the piece from a to b that is nearest to `point`."""
    way = b - a
    square = np.sum(way**2)
    t = np.sum((point - a) * way) / square if square > 0.0 else 0.0
    return a + min(max(t, 0.0), 1.0) * way


@njit
def lay(parent: Any, start: Any, end: Any, radius: Any, axis: Any, near: Any, nodes: Any) -> Any:
    """Lay out the nodes of all axes; gives how many axes and nodes there are."""
    following = np.full(len(parent), -1)
    heads = np.ones(len(parent), np.bool_)
    for i in range(len(parent)):
        p = parent[i]
        if p >= 0 and axis[p] == axis[i] and following[p] < 0:
            following[p] = i
            heads[i] = False
    axes: Any = 0
    k: Any = 0
    for head in np.flatnonzero(heads):
        begin, p = k, parent[head]
        if p >= 0:  # from inside its parent
            foot = _foot(start[p], end[p], start[head])
            if _distance(foot, start[head]) > near:
                k = _put(nodes, begin, k, foot, radius[head], head)
        k = _put(nodes, begin, k, start[head], radius[head], head)
        here = head
        while here >= 0:
            above = following[here]
            thick = radius[here] if above < 0 else 0.5 * (radius[here] + radius[above])
            k = _put(nodes, begin, k, end[here], thick, here)
            here = above
        if k - begin < 2:  # an axis without length
            k = begin
        else:
            nodes.first[axes] = begin
            axes += 1
    nodes.first[axes] = k
    return axes, k


@njit
def _put(nodes: Any, begin: Any, k: Any, place: Any, radius: Any, internode: Any) -> Any:
    """Add a node to an axis; one that lies on the last takes its place."""
    step = _distance(place, nodes.place[k - 1]) if k > begin else 0.0
    if k > begin and step <= SHORTEST:
        nodes.radius[k - 1] = radius
        return k
    nodes.place[k] = place
    nodes.radius[k] = radius
    nodes.along[k] = nodes.along[k - 1] + step if k > begin else 0.0
    nodes.internode[k] = internode
    return k + 1


@njit
def thin(first: Any, place: Any, radius: Any, tolerance: Any, keep: Any) -> None:
    """Leave out nodes near a straight cone between two others, as many as can be at a time."""
    for c in range(len(first) - 1):
        a, last = first[c], first[c + 1] - 1
        keep[a] = True
        while a < last:
            b = a + 1
            while b < last and b - a < LONGEST_RUN and _near(place, radius, a, b + 1, tolerance):
                b += 1
            keep[b] = True
            a = b


@njit
def _near(place: Any, radius: Any, a: Any, b: Any, tolerance: Any) -> Any:
    """Tell whether all nodes between a and b are as near to the cone between them as allowed."""
    way = place[b] - place[a]
    square = np.sum(way**2)
    if square <= SHORTEST**2:
        return False
    for m in range(a + 1, b):
        t = min(max(np.sum((place[m] - place[a]) * way) / square, 0.0), 1.0)
        off = _distance(place[m], place[a] + t * way)
        off += abs(radius[m] - (1.0 - t) * radius[a] - t * radius[b])
        if off > tolerance:
            return False
    return True


@njit
def _turn(before: Any, after: Any) -> Any:
    """Give a vector towards the inner side of a bend, as long as the tangent of half its angle."""
    cosine = np.sum(before * after)
    return (after - before) / max(1.0 + cosine, TURNED_BACK)


@njit
def _heading(a: Any, b: Any) -> Any:
    return (b - a) / max(_distance(a, b), SHORTEST)


@njit
def unfold(first: Any, place: Any, radius: Any, keep: Any) -> None:
    """Leave out nodes whose cross section would cut its neighbour's: sharp bends of thick wood.

    One whose neighbours lie on each other stays, so that every piece has a length.
    """
    for c in range(len(first) - 1):
        begin, last = first[c], first[c + 1] - 1
        a = begin
        while a < last:
            b = _next(keep, a, 1)
            here = _heading(place[a], place[b])
            low, high = np.zeros(3), np.zeros(3)
            w, d = a, b
            if a > begin:
                w = _next(keep, a, -1)
                low = radius[a] * _turn(_heading(place[w], place[a]), here)
            if b < last:
                d = _next(keep, b, 1)
                high = radius[b] * _turn(here, _heading(place[b], place[d]))
            both = low + high
            both -= np.sum(both * here) * here
            folds = np.sqrt(np.sum(both**2)) >= _distance(place[a], place[b])
            lower = b == last or (a > begin and np.sum(low**2) > np.sum(high**2))
            apart = _distance(place[w], place[b]) if lower else _distance(place[a], place[d])
            if not folds or apart <= SHORTEST or (a == begin and b == last):
                a = b
            elif lower:
                keep[a] = False
                a = w
            else:
                keep[b] = False
                a = w  # what is below may now fold


@njit
def _next(keep: Any, k: Any, way: Any) -> Any:
    """Give the next node that stands."""
    k += way
    while not keep[k]:
        k += way
    return k


@njit
def sections(nodes: Any, skeleton_side: Any, side: Any, across: Any) -> None:
    """Span each cross section by two vectors, square to the axis or halving its bend.

    Both slide along the pieces of the axis, so that each piece is a prism or a cone: in the plane
    of a bend they are longer there, as a mitre is.
    """
    for c in range(len(nodes.first) - 1):
        begin, last = nodes.first[c], nodes.first[c + 1] - 1
        before = _heading(nodes.place[begin], nodes.place[begin + 1])
        s = _square(skeleton_side[nodes.internode[begin]], before)
        side[begin], across[begin] = s, np.cross(before, s)
        for k in range(begin + 1, last):
            after = _heading(nodes.place[k], nodes.place[k + 1])
            t = np.cross(before, s)
            bend = after - before
            sharp = np.sqrt(np.sum(bend**2))
            cosine = np.sum(before * after)
            side[k], across[k] = s, t
            if sharp > TURNED_BACK and cosine > TURNED_BACK - 1.0:
                inner = _square(bend, before)
                longer = min(np.sqrt(2.0 / (1.0 + cosine)), WIDEST_MITRE) * bend / sharp - inner
                side[k] += np.sum(s * inner) * longer
                across[k] += np.sum(t * inner) * longer
                s = s + np.sum(s * inner) * (_square(bend, after) - inner)
                s = _square(s, after)  # what rounding has left
            before = after
        side[last], across[last] = s, np.cross(before, s)


@njit
def _square(vector: Any, heading: Any) -> Any:
    """Give a unit vector at right angles to the heading, as near to the vector as can be."""
    found = vector - np.sum(vector * heading) * heading
    if np.sum(found**2) < NO_DIRECTION**2:
        least = np.argmin(np.abs(heading))
        found = -heading[least] * heading
        found[least] += 1.0
    return found / np.sqrt(np.sum(found**2))


@njit
def close(nodes: Any, ring: Any, sides: Any, triangles: Any, uv: Any) -> None:
    """Join the rings of each axis, and close its ends by fans around their centres."""
    m = 0
    for c in range(len(nodes.first) - 1):
        begin, last = nodes.first[c], nodes.first[c + 1] - 1
        m = _fan(nodes, ring, sides, begin, -1, m, triangles, uv)
        for k in range(begin, last):
            m = _band(nodes, ring, sides, k, m, triangles, uv)
        m = _fan(nodes, ring, sides, last, 1, m, triangles, uv)


@njit
def _band(nodes: Any, ring: Any, sides: Any, k: Any, m: Any, triangles: Any, uv: Any) -> Any:
    """Join two rings, of whatever sides, by going around both side by side."""
    low, high, n, o = ring[k], ring[k + 1], sides[k], sides[k + 1]
    u = 2.0 * np.pi * nodes.radius[k] / n
    w = 2.0 * np.pi * nodes.radius[k + 1] / o
    i, j = 0, 0
    while i < n or j < o:
        triangles[m] = (low + i % n, low + (i + 1) % n, high + j % o)
        uv[m, 0] = (u * i, nodes.along[k])
        uv[m, 2] = (w * j, nodes.along[k + 1])
        if j == o or (i < n and (i + 1) * o <= (j + 1) * n):
            uv[m, 1] = (u * (i + 1), nodes.along[k])
            i += 1
        else:
            triangles[m, 1] = high + (j + 1) % o
            uv[m, 1] = (w * (j + 1), nodes.along[k + 1])
            triangles[m, 2] = high + j % o
            j += 1
        m += 1
    return m


@njit
def _fan(
    nodes: Any, ring: Any, sides: Any, k: Any, way: Any, m: Any, triangles: Any, uv: Any
) -> Any:
    """Close an end; its v goes on from the rim to the centre."""
    n, radius = sides[k], nodes.radius[k]
    centre = ring[k] - 1 if way < 0 else ring[k] + n
    u = 2.0 * np.pi * radius / n
    for i in range(n):
        one, two = (i + 1, i) if way < 0 else (i, i + 1)
        triangles[m] = (centre, ring[k] + one % n, ring[k] + two % n)
        uv[m, 0] = (u * (i + 0.5), nodes.along[k] + way * radius)
        uv[m, 1] = (u * one, nodes.along[k])
        uv[m, 2] = (u * two, nodes.along[k])
        m += 1
    return m
