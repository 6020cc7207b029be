"""The kernels of tubes: nodes along axes, which of them stand, cross sections, and faces."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit

SHORTEST = 1e-9  # m; nodes no farther apart are one
_LONGEST_RUN = 200  # nodes that one piece may pass over
_WIDEST_MITRE = 2.0
_TURNED_BACK = 1e-9  # of 1 + cosine between two pieces that lie on each other


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
            while b < last and b - a < _LONGEST_RUN and _near(place, radius, a, b + 1, tolerance):
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
    return (after - before) / max(1.0 + cosine, _TURNED_BACK)


@njit
def _heading(a: Any, b: Any) -> Any:
    return (b - a) / max(_distance(a, b), SHORTEST)


@njit
def unfold(first: Any, place: Any, radius: Any, keep: Any) -> None:
    """Leave out nodes whose cross section would cut its neighbour's: sharp bends of thick wood."""
    for c in range(len(first) - 1):
        last = first[c + 1] - 1
        folded = True
        while folded:
            folded = False
            w, a = -1, first[c]
            while a < last:
                b = a + 1
                while not keep[b]:
                    b += 1
                here = _heading(place[a], place[b])
                low, high = np.zeros(3), np.zeros(3)
                if w >= 0:
                    low = radius[a] * _turn(_heading(place[w], place[a]), here)
                if b < last:
                    d = b + 1
                    while not keep[d]:
                        d += 1
                    high = radius[b] * _turn(here, _heading(place[b], place[d]))
                both = low + high
                both -= np.sum(both * here) * here
                if np.sqrt(np.sum(both**2)) < _distance(place[a], place[b]):
                    w, a = a, b
                    continue
                folded = True
                if np.sum(low**2) > np.sum(high**2):
                    keep[a] = False
                    a = w  # and look again at what is below
                    w = a - 1
                    while w >= first[c] and not keep[w]:
                        w -= 1
                    if w < first[c]:
                        w = -1
                else:
                    keep[b] = False


@njit
def sections(nodes: Any, skeleton_side: Any, side: Any, across: Any) -> None:
    """Span each cross section by two vectors, square to the axis or halving its bend.

    In the plane of the bend they are longer, as a mitre is, so that the tube keeps its girth.
    """
    for c in range(len(nodes.first) - 1):
        begin, last = nodes.first[c], nodes.first[c + 1] - 1
        for k in range(begin, last + 1):
            lower, upper = max(k - 1, begin), min(k + 1, last)
            before = _heading(nodes.place[lower], nodes.place[k]) if k > begin else np.zeros(3)
            after = _heading(nodes.place[k], nodes.place[upper]) if k < last else before
            if k == begin:
                before = after
            middle = before + after
            length = np.sqrt(np.sum(middle**2))
            middle = middle / length if length > _TURNED_BACK else after
            s = skeleton_side[nodes.internode[k]]
            s = s - np.sum(s * middle) * middle
            if np.sum(s**2) < 1e-6:
                least = np.argmin(np.abs(middle))
                s = -middle[least] * middle
                s[least] += 1.0
            s = s / np.sqrt(np.sum(s**2))
            t = np.cross(middle, s)
            bend = after - before
            sharp = np.sqrt(np.sum(bend**2))
            if sharp > _TURNED_BACK:
                bend = bend / sharp
                longer = min(2.0 / max(length, _TURNED_BACK), _WIDEST_MITRE) - 1.0
                s = s + longer * np.sum(s * bend) * bend
                t = t + longer * np.sum(t * bend) * bend
            side[k], across[k] = s, t


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
