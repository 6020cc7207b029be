"""The bark while it grows: rings of records, changed in place by the kernels.

A *record* is a vertex of epidermis that a spring may tie to the substrate, or a fracture (two
vertices); behind it lies a *piece* of epidermis up to the next record. The first record of a
ring is a vertex at place 0 and stays first, so a ring's places rise from record to record.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest.surface.bark.equilibrium import solve_ring

CHUNKS = 64  # of strips; fixed, so that results do not depend on the number of threads


class Rings(NamedTuple):
    """Strips, records (76 bytes), tears (32) and fractures (52) as columns that kernels change."""

    # one row per strip
    axis: NDArray[np.int32]
    along: NDArray[np.float64]
    width: NDArray[np.float64]
    up: NDArray[np.int32]
    down: NDArray[np.int32]
    factor: NDArray[np.float64]  # (strips, sectors) width around the girth
    length: NDArray[np.float64]  # L0
    girth: NDArray[np.float64]  # (strips) now
    edges: NDArray[
        np.float64
    ]  # (strips, sectors + 1) where the sectors of growth end, m from the seam
    limit: NDArray[np.float64]  # S - 1 in this step
    base: NDArray[np.int64]  # first record
    records: NDArray[np.int64]  # how many
    cell: NDArray[np.int64]  # (strips + 1) first grain
    # one row per grain of epidermis
    spot: NDArray[np.float32]  # where in it the weakest place is, m
    drawn: NDArray[np.float32]  # its strength, in standard deviations
    weakness: NDArray[np.float32]  # of the weakness map, 0 to 1
    # one row per record
    place: NDArray[np.float64]  # on the epidermis, m
    rest: NDArray[np.float64]  # the fracture's width at the start of the step
    open: NDArray[np.float64]  # its width now; 0 for a vertex
    left: NDArray[np.float64]  # x of its left edge
    piece: NDArray[np.float64]  # width of the epidermis behind it
    grip_left: NDArray[np.float64]  # place of its vertices on the substrate
    grip_right: NDArray[np.float64]
    weak: NDArray[np.float64]  # weakest place of the piece behind it; NaN before it was sought
    tough: NDArray[np.float64]  # factor on `limit` there
    tear: NDArray[np.int32]  # -1 for a vertex
    # one row per tear
    tear_strip: NDArray[np.int32]
    tear_place: NDArray[np.float64]
    tear_up: NDArray[np.int32]
    tear_down: NDArray[np.int32]
    tear_fracture: NDArray[np.int32]
    tear_born: NDArray[np.float64]
    # one row per fracture
    origin: NDArray[np.int32]
    first: NDArray[np.int32]
    last: NDArray[np.int32]
    reach: NDArray[np.float64]  # length along the axis, m
    area: NDArray[np.float64]  # m2
    kept: NDArray[np.float64]  # of which was open at the start of the step
    ran: NDArray[np.float64]  # (fractures, 2) by which the ends ran on in this step, m
    totals: NDArray[np.int64]  # (2) tears, fractures


def copied(rings: Rings) -> Rings:
    """Give rings that can be changed while the old ones stay."""
    columns: list[Any] = [column.copy() for column in rings]
    return Rings(*columns)


@njit
def _sector_of(edges: Any, x: Any) -> Any:
    """Find the sector in which x lies."""
    j = 0
    while j + 2 < len(edges) and edges[j + 1] <= x:
        j += 1
    return j


@njit
def turn_of(edges: Any, girth: Any, x: Any) -> Any:
    """Give the part of a turn at x m around the girth; every sector takes an equal part."""
    sectors = len(edges) - 1
    x = x - np.floor(x / girth) * girth
    j = _sector_of(edges, x)
    return min((j + (x - edges[j]) / (edges[j + 1] - edges[j])) / sectors, 1.0)


@njit
def x_of(edges: Any, turn: Any) -> Any:
    """Give the m around the girth of a part of a turn (taken modulo 1)."""
    sectors = len(edges) - 1
    at = (turn - np.floor(turn)) * sectors
    j: Any = min(np.int64(at), sectors - 1)
    return edges[j] + (at - j) * (edges[j + 1] - edges[j])


@njit
def _carried(old: Any, new: Any, x: Any) -> Any:
    """Where the substrate has taken a point: every sector stretches evenly."""
    sectors = len(old) - 1
    turns = np.floor(x / old[sectors])
    r = x - turns * old[sectors]
    j = _sector_of(old, r)
    part = (r - old[j]) / (old[j + 1] - old[j])
    return turns * new[sectors] + new[j] + part * (new[j + 1] - new[j])


@njit
def rest_of(rings: Any, s: Any, i: Any) -> Any:
    """Own length of the piece behind record i (row of the columns) of strip s."""
    end = rings.base[s] + rings.records[s]
    return (rings.place[i + 1] if i + 1 < end else rings.length[s]) - rings.place[i]


@njit
def fracture_stiffness(physics: Any, width: Any) -> Any:
    """K_f(l0), straight between the pairs of the curve."""
    at = physics.curve_at
    value = physics.curve_value
    last = len(at) - 1
    if width <= at[0]:
        return value[0]
    for j in range(last):
        if width < at[j + 1]:
            part = (width - at[j]) / (at[j + 1] - at[j])
            return value[j] + part * (value[j + 1] - value[j])
    return value[last]


@njit
def solve_strip(rings: Any, physics: Any, s: Any) -> None:
    """Bring one strip to equilibrium (3.2.2, 5.1): K = R w / l0 for pieces, K_f w for fractures."""
    first = rings.base[s]
    n = rings.records[s]
    girth = rings.girth[s]
    edges = rings.edges[s]
    factor = rings.factor[s]
    even = len(factor) == 1
    stiffness = np.empty(2 * n)
    rest = np.empty(2 * n)
    grip = np.zeros(2 * n)
    anchor = np.empty(2 * n)
    x = np.empty(2 * n)
    v = 0
    behind = rest_of(rings, s, first + n - 1)
    for i in range(first, first + n):
        piece = rest_of(rings, s, i)
        wide = factor[0]
        if not even:
            middle = rings.grip_right[i] + 0.5 * rings.piece[i]
            turn = turn_of(edges, girth, middle)
            wide = factor[min(np.int64(turn * len(factor)), len(factor) - 1)]
        anchor[v] = rings.grip_left[i]
        grip[v] += 0.5 * physics.attachment * behind
        if rings.tear[i] >= 0:
            stiffness[v] = fracture_stiffness(physics, rings.rest[i]) * wide
            rest[v] = rings.rest[i]
            v += 1
            anchor[v] = rings.grip_right[i]
        grip[v] += 0.5 * physics.attachment * piece
        stiffness[v] = physics.stiffness * wide / piece
        rest[v] = piece
        v += 1
        behind = piece
    solve_ring(stiffness[:v], rest[:v], grip[:v], anchor[:v], girth, x[:v])
    begin = x[0]
    v = 0
    for i in range(first, first + n):
        rings.left[i] = x[v]
        if rings.tear[i] >= 0:
            v += 1
            rings.open[i] = max(x[v] - x[v - 1], rings.rest[i])  # but for rounding never less
        at = x[v]
        v += 1
        following = x[v] if i + 1 < first + n else begin + girth
        rings.piece[i] = following - at


@njit
def _stretch(rings: Any, physics: Any, girth: Any, edges: Any, s: Any) -> None:
    """Let the substrate below one strip grow, and solve. What fractures had opened, they keep.

    The places where vertices are tied move with the substrate; before, they are reset to where
    the vertices had come to lie (long-term plasticity, 5.1). Both happen once a step, however
    finely it is cut: what yields in a step would else hang on the number of its parts.
    """
    for i in range(rings.base[s], rings.base[s] + rings.records[s]):
        if physics.begins:
            rings.rest[i] = rings.open[i]
            rings.grip_left[i] = rings.left[i]
            rings.grip_right[i] = rings.left[i] + rings.open[i]
        rings.grip_left[i] = _carried(rings.edges[s], edges[s], rings.grip_left[i])
        rings.grip_right[i] = _carried(rings.edges[s], edges[s], rings.grip_right[i])
    for j in range(len(edges[s])):
        rings.edges[s, j] = edges[s, j]
    rings.girth[s] = girth[s]
    solve_strip(rings, physics, s)


@njit
def overload(rings: Any, s: Any, i: Any) -> Any:
    """Strain of the piece behind a record over the step's base criterion S - 1 (3.2.3)."""
    limit = rings.limit[s]
    rest = rest_of(rings, s, i)
    if limit <= 0.0 or rest <= 0.0:
        return 0.0
    return (rings.piece[i] / rest - 1.0) / limit


@njit
def _stretch_chunk(rings: Any, physics: Any, girth: Any, edges: Any, lo: Any, hi: Any) -> None:
    for s in range(lo, hi):
        _stretch(rings, physics, girth, edges, s)


@driver
def stretch_all(first: Any, step: Any, rings: Any, physics: Any, girth: Any, edges: Any) -> None:
    """Let the substrate grow below all strips."""
    n = len(girth)
    for chunk in range(first, CHUNKS, step):
        lo = chunk * n // CHUNKS
        hi = (chunk + 1) * n // CHUNKS
        _stretch_chunk(rings, physics, girth, edges, lo, hi)
