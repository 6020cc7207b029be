"""Tubes along a tree's axes: generalized cylinders without twist, closed at both ends."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError
from forest.surface.frames import carry_frames
from forest.surface.mesh import POINT_DATA, Mesh
from forest.surface.tube_kernels import SHORTEST, Nodes, close, lay, sections, thin, unfold
from forest.trees.skeleton import Skeleton

#: Thinner wood is drawn with this radius, m: tips may taper to nothing.
LEAST_RADIUS_M = 1e-4

#: Numbers of sides that a tube may have; so few that most rings match their neighbours.
_SIDES = np.array([3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256])
_SIDES_OF_A_LOBE = 12


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
    sections(nodes, carry_frames(skeleton)[1], size[0], size[1])
    waves = np.where(skeleton.order[nodes.internode] < lobed_orders, lobes[0], 0)
    sides = _number_of_sides(nodes.radius, tolerance_m, most_sides)
    sides = np.maximum(sides, _SIDES_OF_A_LOBE * waves)
    axis = np.repeat(np.arange(len(nodes.first) - 1), np.diff(nodes.first))
    ring = np.cumsum(sides) - sides + 2 * axis + 1  # a centre before and after each axis
    corners, of_node = _corners(nodes, size, ring, sides, (waves, lobes[1]))
    bands = np.delete(sides[:-1] + sides[1:], nodes.first[1:-1] - 1)
    faces = int(bands.sum() + sides[nodes.first[:-1]].sum() + sides[nodes.first[1:] - 1].sum())
    triangles, uv = np.empty((faces, 3), np.int32), np.empty((faces, 3, 2))
    close(nodes, ring, sides, triangles, uv)
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
    axes, k = lay(
        skeleton.parent,
        skeleton.start,
        skeleton.end,
        radius,
        skeleton.axis,
        max(tolerance, SHORTEST),
        nodes,
    )
    return _part(nodes, nodes.first[: axes + 1], slice(0, k))


def _thinned(nodes: Nodes, tolerance: float) -> Nodes:
    keep = np.zeros(len(nodes.place), np.bool_)
    thin(nodes.first, nodes.place, nodes.radius, tolerance, keep)
    unfold(nodes.first, nodes.place, nodes.radius, keep)
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
