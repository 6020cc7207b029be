"""Tubes along a tree's axes: generalized cylinders without twist, closed at both ends."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import njit
from forest.errors import InputError
from forest.surface.frames import carry_frames
from forest.surface.mesh import POINT_DATA, Mesh
from forest.trees.skeleton import Skeleton

#: Thinner wood is drawn with this radius, m: tips may taper to nothing.
LEAST_RADIUS_M = 1e-4

#: Numbers of sides that a tube may have; so few that most rings match their neighbours.
_SIDES = np.array([3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256])
_SIDES_OF_A_LOBE = 12
_SHORTEST = 1e-9  # m; nodes no farther apart are one
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


# --------------------------------------------------------------------------------- kernels


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
def _lay(parent: Any, start: Any, end: Any, radius: Any, axis: Any, near: Any, nodes: Any) -> Any:
    """Lay out the nodes of all axes; gives how many axes and nodes there are."""
    following = np.full(len(parent), -1)
    heads = np.ones(len(parent), np.bool_)
    for i in range(len(parent)):
        p = parent[i]
        if p >= 0 and axis[p] == axis[i] and following[p] < 0:
            following[p] = i
            heads[i] = False
    axes = k = np.int64(0)
    for head in np.flatnonzero(heads):
        begin, p = k, parent[head]
        if p >= 0:  # from inside its parent
            foot = _foot(start[p], end[p], start[head])
            if _distance(foot, start[head]) > near:
                k = _put(nodes, begin, k, foot, radius[head], head)
        k = _put(nodes, begin, k, start[head], radius[head], head)
        i = head
        while i >= 0:
            j = following[i]
            thick = radius[i] if j < 0 else 0.5 * (radius[i] + radius[j])
            k = _put(nodes, begin, k, end[i], thick, i)
            i = j
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
    if k > begin and step <= _SHORTEST:
        nodes.radius[k - 1] = radius
        return k
    nodes.place[k] = place
    nodes.radius[k] = radius
    nodes.along[k] = nodes.along[k - 1] + step if k > begin else 0.0
    nodes.internode[k] = internode
    return k + 1


@njit
def _thin(first: Any, place: Any, radius: Any, tolerance: Any, keep: Any) -> None:
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
    if square <= _SHORTEST**2:
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
    return (b - a) / max(_distance(a, b), _SHORTEST)


@njit
def _unfold(first: Any, place: Any, radius: Any, keep: Any) -> None:
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
def _sections(nodes: Any, skeleton_side: Any, side: Any, across: Any) -> None:
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
def _close(nodes: Any, ring: Any, sides: Any, triangles: Any, uv: Any) -> None:
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


# ----------------------------------------------------------------------------- what it means


def tubes(
    skeleton: Skeleton,
    *,
    tolerance_m: float = 0.001,
    most_sides: int = 48,
    lobes: tuple[int, float] = (0, 0.0),
    lobed_orders: int = 1,
) -> Mesh:
    """Lay a tube along each axis of a tree.

    An axis is a chain of cones through the upper ends of its internodes. At a node that two of
    them share the radius is their mean, at the tip the last one's own. The cross section is
    carried along without twist and halves each bend; it is a regular polygon of the area of the
    circle, so that thin branches of three sides keep their volume. A branch starts at its parent's
    axis, inside the parent; the tubes are closed one by one and overlap there.

    Parameters
    ----------
    skeleton : Skeleton
        Any tree: simulated, parametric or measured.
    tolerance_m : float
        How far a chord may cut into the circle that the polygon stands for, which gives the number
        of sides of each cross section, and how far a node that is left out may lie from the cone
        between its neighbours (offset of the axis and difference in radius together), m. Where
        the axis bends, rings stand closer. With 0 nodes are left out only where cross sections
        would cut each other, in sharp bends of thick wood.
    most_sides : int
        Sides of the thickest wood, 3 or more.
    lobes : (int, float)
        Lobes and LobeDepth of a parametric tree's trunk (Weber and Penn 1995, section 4.4).
    lobed_orders : int
        Orders of axes that have lobes: 1 for the trunk's alone.

    Returns
    -------
    Mesh
        A closed tube for each axis that has a length; u starts at the cross section's side. The
        arrays of a point are those of the internode that ends there, `radius_m` that of the node,
        not of the lobe. Radii below `LEAST_RADIUS_M` are raised to it.

    Raises
    ------
    InputError
        If the skeleton is empty, a place or a radius is no number or a radius is below 0, no axis
        has a length, or a parameter is out of its range.
    """
    _check(skeleton, tolerance_m, most_sides)
    nodes = _laid(skeleton, tolerance_m)
    if len(nodes.first) < 2:
        raise InputError(f"tree {skeleton.tree_id} has no axis of any length", expected="a tree")
    nodes = _thinned(nodes, tolerance_m)
    size = np.empty((2, len(nodes.place), 3))
    _sections(nodes, carry_frames(skeleton)[1], size[0], size[1])
    waves = np.where(skeleton.order[nodes.internode] < lobed_orders, lobes[0], 0)
    sides = _number_of_sides(nodes.radius, tolerance_m, most_sides)
    sides = np.maximum(sides, _SIDES_OF_A_LOBE * waves)
    axis = np.repeat(np.arange(len(nodes.first) - 1), np.diff(nodes.first))
    ring = np.cumsum(sides) - sides + 2 * axis + 1  # a centre before and after each axis
    corners, of_node = _corners(nodes, size, ring, sides, (waves, lobes[1]))
    bands = np.delete(sides[:-1] + sides[1:], nodes.first[1:-1] - 1)
    faces = int(bands.sum() + sides[nodes.first[:-1]].sum() + sides[nodes.first[1:] - 1].sum())
    triangles, uv = np.empty((faces, 3), np.int32), np.empty((faces, 3, 2))
    _close(nodes, ring, sides, triangles, uv)
    return Mesh(corners, triangles, uv, _data(skeleton, nodes, of_node))


def _check(skeleton: Skeleton, tolerance_m: float, most_sides: int) -> None:
    where = f"tree {skeleton.tree_id}"
    if not len(skeleton):
        raise InputError("has no internodes", where=where, expected="a tree with wood")
    if not (np.isfinite(skeleton.start).all() and np.isfinite(skeleton.end).all()):
        raise InputError("an end of an internode is no number", where=where, expected="metres")
    bad = np.flatnonzero(~((skeleton.radius >= 0.0) & np.isfinite(skeleton.radius)))
    if len(bad):
        what = f"the radius of internode {bad[0]} (serial {skeleton.serial[bad[0]]}) is "
        what += f"{skeleton.radius[bad[0]]} m, and {len(bad)} in all are such"
        raise InputError(what, where=where, expected="0 or more")
    if not 0.0 <= tolerance_m < np.inf:
        raise InputError(f"tolerance_m is {tolerance_m}", expected="0 or more")
    if most_sides < 3:
        raise InputError(f"most_sides is {most_sides}", expected="3 or more")


def _laid(skeleton: Skeleton, tolerance: float) -> Nodes:
    """Give the nodes of all axes, none left out."""
    most = 3 * len(skeleton) + 1  # each internode's end, and an axis' start and foot
    nodes = Nodes(
        np.empty(most, np.int64),
        np.empty((most, 3)),
        np.empty(most),
        np.empty(most),
        np.empty(most, np.int64),
    )
    radius = np.maximum(skeleton.radius, LEAST_RADIUS_M)
    axes, k = _lay(
        skeleton.parent,
        skeleton.start,
        skeleton.end,
        radius,
        skeleton.axis,
        max(tolerance, _SHORTEST),
        nodes,
    )
    return _part(nodes, nodes.first[: axes + 1], slice(0, k))


def _thinned(nodes: Nodes, tolerance: float) -> Nodes:
    keep = np.zeros(len(nodes.place), np.bool_)
    _thin(nodes.first, nodes.place, nodes.radius, tolerance, keep)
    _unfold(nodes.first, nodes.place, nodes.radius, keep)
    first = np.concatenate(([0], np.cumsum(keep)))[nodes.first]
    return _part(nodes, first, keep)


def _part(nodes: Nodes, first: NDArray[np.int64], chosen: slice | NDArray[np.bool_]) -> Nodes:
    _, place, radius, along, internode = nodes
    return Nodes(first, place[chosen], radius[chosen], along[chosen], internode[chosen])


def _number_of_sides(radius: NDArray[np.float64], tolerance: float, most: int) -> NDArray[np.int64]:
    """Give the least number of sides whose chords cut no deeper into the circle."""
    share = np.minimum(tolerance / radius, 1.5)
    fewest = np.pi / np.arccos(np.clip(1.0 - share, -1.0, 1.0 - 1e-9))
    rung = np.minimum(np.searchsorted(_SIDES, fewest - 1e-9), len(_SIDES) - 1)
    return np.asarray(np.minimum(_SIDES[rung], most), np.int64)


def _corners(
    nodes: Nodes,
    size: NDArray[np.float64],
    ring: NDArray[np.int64],
    sides: NDArray[np.int64],
    lobes: tuple[NDArray[np.int64], float],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give all points, and the node of each: an axis' foot, its rings, its head."""
    begin, last = nodes.first[:-1], nodes.first[1:] - 1
    count = int(sides.sum()) + 2 * len(begin)
    of_node = np.empty(count, np.int64)
    on_ring = np.repeat(ring - (np.cumsum(sides) - sides), sides) + np.arange(int(sides.sum()))
    of_node[on_ring] = k = np.repeat(np.arange(len(sides)), sides)
    of_node[ring[begin] - 1] = begin
    of_node[ring[last] + sides[last]] = last
    points = nodes.place[of_node]
    angle = 2.0 * np.pi * (on_ring - ring[k]) / sides[k]
    arc = 2.0 * np.pi / sides
    reach = (nodes.radius * np.sqrt(arc / np.sin(arc)))[k]  # the polygon has the circle's area
    reach = reach * (1.0 + np.where(lobes[0][k] > 0, lobes[1] * np.sin(lobes[0][k] * angle), 0.0))
    points[on_ring] += (reach * np.cos(angle))[:, None] * size[0, k]
    points[on_ring] += (reach * np.sin(angle))[:, None] * size[1, k]
    return points, of_node


def _data(
    skeleton: Skeleton, nodes: Nodes, of_node: NDArray[np.int64]
) -> dict[str, NDArray[np.generic]]:
    internode = nodes.internode[of_node]
    known: dict[str, NDArray[Any]] = {
        "radius_m": nodes.radius[of_node],
        "order": skeleton.order[internode],
        "birth_year": skeleton.birth_year[internode],
        "tree_id": np.full(len(of_node), skeleton.tree_id),
        "axis": skeleton.axis[internode],
    }
    return {name: known[name].astype(kind) for name, kind in POINT_DATA.items()}
