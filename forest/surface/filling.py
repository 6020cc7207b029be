"""Writing the primitives of many trees, in threads.

A job is a list of one model at some of its instances. The limits of the loop over the list are
those of `forest.surface.detail.drawn`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.surface.detail import LAST_LEVEL
from forest.surface.instances import Elements
from forest.surface.shadow import ShadowMap, shaded_by_others

#: Steps of sunlight of `Look.table`.
SHADES = 256

#: A stem's shade is the mean over so many points, up to so far from its middle along it, m.
STEM_POINTS, STEM_REACH_M = 5, 1.0

_JOB = 200_000  # primitives of a job; fixed, so that nothing depends on the number of threads


class Light(NamedTuple):
    """What all primitives share."""

    sun: NDArray[np.float64]
    haze_colour: NDArray[np.float64]
    map: ShadowMap
    has_map: bool


class Look(NamedTuple):
    """How a list's elements look.

    Attributes
    ----------
    leaf, long : bool
        Whether they are leaves, and whether stems so long that their shade is a mean.
    table : float64 (t, SHADES, 3)
        Colours by tone and sunlight.
    tone : uint8 (e,)
        Each element's.
    shaded : float32 (e,)
        What the tree itself takes of its sun, 0 to 1.
    """

    leaf: bool
    long: bool
    table: NDArray[np.float64]
    tone: NDArray[np.uint8]
    shaded: NDArray[np.float32]


def is_long(item: int) -> bool:
    """Whether the shade of a list's elements is a mean along them: trunk and main branches."""
    return item < LAST_LEVEL


class Trees(NamedTuple):
    """Instances of one model, an entry each."""

    row: NDArray[np.int64]
    place: NDArray[np.float64]
    scale: NDArray[np.float64]
    share: NDArray[np.float64]  # of the list's elements that is drawn
    clear: NDArray[np.float64]  # share of the colour that the haze leaves
    pixels: NDArray[np.float64]  # of a metre of the model
    start: NDArray[np.int64]  # of the first primitive in the frame
    number: NDArray[np.int64]  # of primitives


class Job(NamedTuple):
    """Some instances of one list, about `_JOB` primitives."""

    part: Elements
    look: Look
    trees: Trees
    size: int


class _Arrays(NamedTuple):
    """What kernels read of `Elements`."""

    vertices: NDArray[np.float32]
    facing: NDArray[np.float32]
    along: NDArray[np.float32]
    first: NDArray[np.int32]
    middle: NDArray[np.float32]
    width_m: NDArray[np.float32]


class Out(NamedTuple):
    """What kernels write of a `Frame`, for one kind of primitives."""

    vertices: NDArray[np.float32]
    colour: NDArray[np.uint8]
    width: NDArray[np.float32]  # empty for triangles


def count(part: Elements, share: NDArray[np.float64]) -> NDArray[np.int64]:
    """Count the primitives that are drawn of a list at each share."""
    found = np.empty(len(share), np.int64)
    _count(part.first, np.int64(part.mass), np.ascontiguousarray(share), found)
    return found


def cut(trees: Trees) -> list[tuple[Trees, int]]:
    """Cut instances into runs of about `_JOB` primitives, with the number in each."""
    if not len(trees.row):
        return []
    piece = (np.cumsum(trees.number) - trees.number) // _JOB
    starts = np.flatnonzero(np.diff(piece, prepend=-1))
    ends = np.append(starts[1:], len(piece))
    sizes = np.add.reduceat(trees.number, starts)
    return [
        (Trees._make(column[a:b] for column in trees), int(size))
        for a, b, size in zip(starts, ends, sizes, strict=True)
    ]


def fill(
    jobs: list[Job], totals: dict[int, int], light: Light
) -> tuple[
    dict[int, NDArray[np.float32]], dict[int, NDArray[np.uint8]], dict[int, NDArray[np.float32]]
]:
    """Give vertices, colours and widths by the number of corners, of so many primitives each."""
    vertices = {k: np.empty((n, 3 * k), np.float32) for k, n in totals.items()}
    colour = {k: np.empty((n, 3), np.uint8) for k, n in totals.items()}
    width = {k: np.empty(n if k < 3 else 0, np.float32) for k, n in totals.items()}
    jobs = sorted(
        jobs, key=lambda job: -job.size
    )  # the largest first, so that threads end together

    def work(first: int, step: int) -> None:
        for job in jobs[first::step]:
            part, k = job.part, job.part.corners
            arrays = _Arrays(
                part.vertices, part.facing, part.along, part.first, part.middle, part.width_m
            )
            out = Out(vertices[k], colour[k], width[k])
            _fill(arrays, np.int64(part.mass), job.look, job.trees, light, out)

    in_threads(work)
    return vertices, colour, width


@njit
def _limits(total: Any, share: Any, mass: Any) -> Any:
    """Give how many elements of each mass are drawn, and of how many masses one more.

    These are the limits of the loop of `forest.surface.detail.drawn`.
    """
    if share >= 1.0:
        return mass, np.int64(0)
    if share <= 0.0:
        return np.int64(0), np.int64(0)
    number = share * mass
    whole = np.int64(number)
    return whole, np.int64(np.ceil(total / mass * (number - whole)))


@njit
def _count(first: Any, mass: Any, share: Any, count: Any) -> None:
    """Count the primitives that are drawn of a list at each share."""
    total = len(first) - 1
    for j in range(len(share)):
        whole, more = _limits(total, share[j], mass)
        found = np.int64(0)
        if whole > 0 or more > 0:
            for m in range((total + mass - 1) // mass):
                start = m * mass
                found += first[min(start + whole + (m < more), total)] - first[start]
        count[j] = found


@driver
def _sunlight(part: Any, sun: Any, p: Any, leaf: Any) -> Any:
    """Give the share of sunlight that a surface takes.

    Light goes through leaves. A line takes the mean of all sides of its branch.
    """
    facing = part.facing
    along = facing[p, 0] * sun[0] + facing[p, 1] * sun[1] + facing[p, 2] * sun[2]
    if leaf:
        return min(abs(along), 1.0)
    if part.vertices.shape[1] == 6:
        return np.sqrt(max(1.0 - along * along, 0.0)) / np.pi
    return min(max(along, 0.0), 1.0)


@driver
def _fill(part: Any, mass: Any, look: Any, trees: Any, light: Any, out: Any) -> None:
    """Write the primitives of one list for some instances."""
    total = len(part.first) - 1
    for j in range(len(trees.row)):
        whole, more = _limits(total, trees.share[j], mass)
        at = trees.start[j]
        for m in range((total + mass - 1) // mass):
            start = m * mass
            for e in range(start, min(start + whole + (m < more), total)):
                sun = 1.0 - look.shaded[e]
                if light.has_map and sun > 0.0:
                    sun *= 1.0 - _others_shade(part, look, trees, light, j, e)
                for p in range(part.first[e], part.first[e + 1]):
                    _place(part, trees, j, p, out, at)
                    _paint(part, look, trees, light, sun, look.tone[e], j, p, out, at)
                    if len(out.width):
                        out.width[at] = part.width_m[e] * trees.pixels[j]
                    at += 1


@driver
def _others_shade(part: Any, look: Any, trees: Any, light: Any, j: Any, e: Any) -> Any:
    """Give the share of an element of tree `j` that lies in other trees' shade."""
    scale = trees.scale[j]
    x = trees.place[j, 0] + scale * part.middle[e, 0]
    y = trees.place[j, 1] + scale * part.middle[e, 1]
    z = trees.place[j, 2] + scale * part.middle[e, 2]
    points = STEM_POINTS if look.long else 1
    dark = 0
    for k in range(points):
        way = STEM_REACH_M * (2 * k - points + 1) / max(points - 1, 1)
        dark += shaded_by_others(
            light.map,
            trees.row[j],
            x + way * part.along[e, 0],
            y + way * part.along[e, 1],
            z + way * part.along[e, 2],
        )
    return dark / points


@driver
def _place(part: Any, trees: Any, j: Any, p: Any, out: Any, at: Any) -> None:
    """Put the corners of primitive `p` where tree `j` stands."""
    scale = trees.scale[j]
    x, y, z = trees.place[j, 0], trees.place[j, 1], trees.place[j, 2]
    for k in range(0, part.vertices.shape[1], 3):
        out.vertices[at, k] = x + scale * part.vertices[p, k]
        out.vertices[at, k + 1] = y + scale * part.vertices[p, k + 1]
        out.vertices[at, k + 2] = z + scale * part.vertices[p, k + 2]


@driver
def _paint(
    part: Any,
    look: Any,
    trees: Any,
    light: Any,
    sun: Any,
    tone: Any,
    j: Any,
    p: Any,
    out: Any,
    at: Any,
) -> None:
    """Colour a primitive: by its share of the sun, then by the haze."""
    shade = 0
    if sun > 0.0:
        shade = int(sun * _sunlight(part, light.sun, p, look.leaf) * (SHADES - 1) + 0.5)
    clear = trees.clear[j]
    for c in range(3):
        colour = clear * look.table[tone, shade, c] + (1.0 - clear) * 255.0 * light.haze_colour[c]
        out.colour[at, c] = np.uint8(colour + 0.5)
