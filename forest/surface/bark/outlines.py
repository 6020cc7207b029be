"""What lies at a point of the bark: the rows of a picture, straight from the outlines.

One row of points around the axis is crossed by a few dozen pieces of fractures. Each is evaluated
there once, and all points get: how deep they lie, how far inside a fracture, which epidermis or
which part of its inside it is. No triangulation stands between the outlines and the pixels.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.random import STREAM_DRESSING, uniforms
from forest.surface.bark.silhouettes import Silhouettes, find_interval, hermite

#: Rows are dealt out in so many chunks; nothing depends on the number of threads.
CHUNKS = 32
#: Modes of opening (figure 13): where a fracture's new surface appears.
OPENINGS = ("axis", "one side", "both sides")
_SAMPLES = 129  # of a depth profile
_OCTAVES = 3  # of torn borders


class Relief(NamedTuple):
    """How fractures sink in: the row of each column belongs to a height on the axis."""

    depth: NDArray[np.float64]  # (rows,) of wide fractures, m
    per_width: NDArray[np.float64]  # depth over opening of narrow ones
    shoulder: NDArray[np.float64]  # how far the edges of the epidermis sink (below 0: curl up), as
    # a share of the fracture's depth
    reach: NDArray[np.float64]  # how far into the epidermis that is felt, m
    fray: NDArray[np.float64]  # amplitude of torn borders, m; 0 smooth
    profile: NDArray[np.float64]  # (129,) depth from the border, 0, to the middle, 1
    opening: int  # index of `OPENINGS`
    fray_length: float  # of the largest waves of torn borders, m
    seed: int


class Fields(NamedTuple):
    """What lies at points of the bark: arrays (rows, columns), float32 but for `fracture`."""

    depth: NDArray[np.float32]  # below the uncracked surface, m; below 0 where edges curl up
    inside: NDArray[np.float32]  # distance from the fracture's border, m; 0 on epidermis
    epidermis: NDArray[np.float32]  # turn on the epidermis; inside a fracture, where it was torn
    across: NDArray[np.float32]  # inside: distance along the opened surface from where it opens, m
    fracture: NDArray[np.int32]  # row of `Fractures`; -1 on epidermis


class _Room(NamedTuple):
    """Working space of the chunks."""

    line: NDArray[np.float64]  # (chunks, pieces, 8)
    v: NDArray[np.float64]  # (rows,)
    offset: NDArray[np.float64]  # (rows,)


def profile_of(points: tuple[tuple[float, float], ...]) -> NDArray[np.float64]:
    """Sample a depth profile (figure 14): (share of the way to the middle, share of the depth)."""
    at, depth = np.array(points, np.float64).T
    return np.asarray(np.interp(np.linspace(0.0, 1.0, _SAMPLES), at, depth), np.float64)


def rows_of(length: float, count: int, low: float = 0.0) -> NDArray[np.float64]:
    """Give the heights of a picture's rows, top row first, m."""
    return np.asarray(low + (np.arange(count)[::-1] + 0.5) * (length / count), np.float64)


def fields(outlines: Silhouettes, relief: Relief, v: NDArray[np.float64], columns: int) -> Fields:
    """Evaluate rows of points around the axis.

    Parameters
    ----------
    outlines : Silhouettes
        The fractures.
    relief : Relief
        How they sink in, for each row.
    v : float64 (rows,)
        Heights of the rows, m.
    columns : int
        Points around the axis: point i lies at (i + 1/2) / columns turns.

    Returns
    -------
    Fields
    """
    out = _empty(len(v), columns)
    in_threads(_fill, outlines, relief, _Room(scratch(outlines), v, np.zeros(len(v))), out)
    return out


def fields_at(
    outlines: Silhouettes, relief: Relief, turn: NDArray[np.float64], v: NDArray[np.float64]
) -> Fields:
    """Evaluate single points: turns and heights (n,), the relief of each; fields are (n, 1)."""
    out = _empty(len(v), 1)
    # A row of one column has its point at half a turn.
    in_threads(_fill, outlines, relief, _Room(scratch(outlines), v, 0.5 - turn), out)
    return out


def _empty(rows: int, columns: int) -> Fields:
    depth, inside, epidermis, across = np.empty((4, rows, columns), np.float32)
    return Fields(depth, inside, epidermis, across, np.empty((rows, columns), np.int32))


def scratch(outlines: Silhouettes) -> NDArray[np.float64]:
    """Make the working space that `outline_row` needs, for each chunk."""
    most = int(np.max(np.diff(outlines.offsets), initial=0)) + 1
    return np.empty((CHUNKS, most, 8))


@driver
def _fill(first: Any, step: Any, outlines: Any, relief: Any, room: Any, out: Any) -> None:
    for chunk in range(first, CHUNKS, step):
        for row in range(chunk, len(room.v), CHUNKS):
            outline_row(
                outlines, relief, row, room.v[row], room.offset[row], room.line[chunk],
                out.depth[row], out.inside[row], out.epidermis[row], out.across[row],
                out.fracture[row],
            )  # fmt: skip


@njit
def depth_of(opening: Any, deepest: Any, per_width: Any) -> Any:
    """Depth of a fracture of some opening: in proportion, but no deeper than `deepest`."""
    if deepest <= 0.0:
        return 0.0
    return deepest * (1.0 - np.exp(-opening * per_width / deepest))


@njit
def _wave(relief: Any, fracture: Any, side: Any, v: Any, spacing: Any, periods: Any) -> Any:
    """Torn border: noise along it, within -1 to 1; repeats after `periods` (0: never)."""
    total = 0.0
    weight = 0.5
    for octave in range(_OCTAVES):
        at = v / spacing * 2.0**octave
        k = np.floor(at)
        t = at - k
        low = np.int64(k)
        high = low + 1
        around = periods << octave
        if around > 0:
            low %= around
            high %= around
        key = np.int64(2 * octave + side)
        a = uniforms(relief.seed, STREAM_DRESSING, fracture, low + 1000000, key)[0]
        b = uniforms(relief.seed, STREAM_DRESSING, fracture, high + 1000000, key)[0]
        total += weight * (2.0 * (a + (b - a) * t * t * (3.0 - 2.0 * t)) - 1.0)
        weight *= 0.5
    return total


@njit
def _gather(outlines: Any, relief: Any, row: Any, v: Any, offset: Any, line: Any) -> Any:
    """Evaluate the pieces that cross a row, in order of their left borders; count them.

    Columns: left and right border (turns), half-width (m), cosines of the borders' slants, turn on
    the epidermis, fracture, depth of the middle (m).
    """
    k, s = find_interval(outlines.knots, v)
    height = outlines.knots[k + 1] - outlines.knots[k]
    girth = outlines.girth[k] + s * (outlines.girth[k + 1] - outlines.girth[k])
    spacing = relief.fray_length
    periods = 0
    if outlines.cyclic:
        periods = max(1, int(np.round(outlines.length / spacing)))
        spacing = outlines.length / periods
    count = 0
    for i in range(outlines.offsets[k], outlines.offsets[k + 1]):
        centre, lean = hermite(outlines.centre[i], s)
        half, swell = hermite(outlines.half[i], s)
        if half <= 0.0:
            continue
        torn = outlines.epidermis[i, 0] + s * (outlines.epidermis[i, 1] - outlines.epidermis[i, 0])
        fracture = outlines.fracture[i]
        left, right = centre + offset - half, centre + offset + half
        if relief.fray[row] > 0.0:
            most = min(relief.fray[row] / girth, 0.8 * half)
            at = v - outlines.low
            left += most * _wave(relief, fracture, 0, at, spacing, periods)
            right += most * _wave(relief, fracture, 1, at, spacing, periods)
        back = np.floor(left)
        left -= back
        right -= back
        slant_left = (lean - swell) * girth / height
        slant_right = (lean + swell) * girth / height
        wide = 0.5 * (right - left) * girth
        at = count
        while at > 0 and line[at - 1, 0] > left:
            line[at] = line[at - 1]
            at -= 1
        line[at, 0] = left
        line[at, 1] = right
        line[at, 2] = wide
        line[at, 3] = 1.0 / np.sqrt(1.0 + slant_left * slant_left)
        line[at, 4] = 1.0 / np.sqrt(1.0 + slant_right * slant_right)
        line[at, 5] = torn - back
        line[at, 6] = fracture
        line[at, 7] = depth_of(2.0 * wide, relief.depth[row], relief.per_width[row])
        count += 1
    return count, girth, outlines.shift[k] + s * (outlines.shift[k + 1] - outlines.shift[k])


@njit
def outline_row(
    outlines: Any, relief: Any, row: Any, v: Any, offset: Any, line: Any,
    depth: Any, inside: Any, epidermis: Any, across: Any, fracture: Any,
) -> None:  # fmt: skip
    """Fill one row of the fields; the bark is turned by `offset` turns first."""
    n = len(depth)
    count, girth, shift = _gather(outlines, relief, row, v, offset, line)
    if count == 0:
        for x in range(n):
            depth[x] = 0.0
            inside[x] = 0.0
            across[x] = 0.0
            fracture[x] = -1
            epidermis[x] = (x + 0.5) / n + shift - offset
        return
    for x in range(n):
        fracture[x] = -1
    last = 0  # whose right border lies farthest: what is left of the gap
    for j in range(count):
        if line[j, 1] > line[last, 1]:
            last = j
        after = j + 1 if j + 1 < count else 0
        turn = 0.0 if j + 1 < count else 1.0
        _fill_gap(
            line[last], line[after], turn, girth, relief.shoulder[row], relief.reach[row],
            depth, inside, epidermis, across,
        )  # fmt: skip
    for j in range(count):
        _fill_fracture(
            line[j], girth, relief, relief.shoulder[row],
            depth, inside, epidermis, across, fracture,
        )  # fmt: skip


@njit
def _fill_gap(
    a: Any, b: Any, turn: Any, girth: Any, shoulder: Any, reach: Any,
    depth: Any, inside: Any, epidermis: Any, across: Any,
) -> None:  # fmt: skip
    """Epidermis between the right border of `a` and the left border of `b`, `turn` turns on."""
    n = len(depth)
    left, right = a[1], b[0] + turn
    if right <= left:
        return
    own, other = a[5], b[5] + turn
    for i in range(np.int64(np.ceil(left * n - 0.5)), np.int64(np.ceil(right * n - 0.5))):
        at = (i + 0.5) / n
        x = i % n
        sunk = 0.0
        if shoulder != 0.0:
            from_a = a[7] * np.exp(-(at - left) * girth * a[4] / reach)
            from_b = b[7] * np.exp(-(right - at) * girth * b[3] / reach)
            sunk = shoulder * max(from_a, from_b)
        depth[x] = sunk
        inside[x] = 0.0
        across[x] = 0.0
        epidermis[x] = own + (other - own) * (at - left) / (right - left) - (i // n)


@njit
def _fill_fracture(
    one: Any, girth: Any, relief: Any, shoulder: Any,
    depth: Any, inside: Any, epidermis: Any, across: Any, fracture: Any,
) -> None:  # fmt: skip
    """Inside of a fracture; where two overlap, the deeper one is seen."""
    n = len(depth)
    left, right, half = one[0], one[1], one[2]
    for i in range(np.int64(np.ceil(left * n - 0.5)), np.int64(np.ceil(right * n - 0.5))):
        at = (i + 0.5) / n
        x = i % n
        from_left = (at - left) * girth
        from_right = (right - at) * girth
        near = min(from_left, from_right)
        share = min(near / half, 1.0) * (len(relief.profile) - 1)
        k = min(int(share), len(relief.profile) - 2)
        way = relief.profile[k] + (share - k) * (relief.profile[k + 1] - relief.profile[k])
        edge = shoulder * one[7]
        deep = edge + (one[7] - edge) * way
        if fracture[x] >= 0 and deep <= depth[x]:
            continue
        depth[x] = deep
        inside[x] = near * (one[3] if from_left < from_right else one[4])
        fracture[x] = np.int32(one[6])
        epidermis[x] = one[5] - (i // n)
        if relief.opening == 0:  # new surface on the axis: what is old lies at the borders
            across[x] = from_left if from_left < from_right else -from_right
        elif relief.opening == 1:  # on the left side: what is old lies at the right border
            across[x] = from_right
        else:  # at both borders: what is old lies on the axis
            across[x] = 0.5 * (from_left - from_right)
