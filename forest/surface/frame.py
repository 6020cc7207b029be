"""A stand of many trees as one picture's triangles, lines and points.

Weber and Penn 1995, sections 5 and 6. Every tree that the camera may see is drawn in the detail of
its range (`forest.surface.detail`); colours are worked out here: sun, shade and haze.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest._jit import driver, njit
from forest._threads import in_threads
from forest.errors import InputError
from forest.surface.description import LEAF_ITEM
from forest.surface.detail import Sight, fractions
from forest.surface.instances import Colour, Elements, Instances, Model
from forest.surface.shadow import ModelShadow, SceneShadow, ShadowMap, shaded_by_others, unit

_JOB = 200_000  # primitives of a job; fixed, so that nothing depends on the number of threads
_SHADES = 256  # steps of sunlight
_LEAST_RANGE_M = 0.1

# As in the pictures of single trees: a warm sun, a bluish sky.
_SUN = np.array([1.02, 0.96, 0.80])
_SKY = np.array([0.52, 0.57, 0.64])
_GAMMA = 0.85

_NO_MAP = ShadowMap(
    np.zeros((3, 3)), np.zeros(2), 1.0, np.empty((0, 0), np.float32), np.empty((0, 0), np.int32)
)


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from.

    Attributes
    ----------
    eye, towards : float (3,)
        The eye, and a point in the middle of the picture, m. z is up.
    width, height : int
        Size of the picture, pixels.
    field_of_view_deg : float
        Its vertical angle, degree.

    Raises
    ------
    InputError
        If eye and point are the same, or a size or the angle is out of range.
    """

    eye: tuple[float, float, float]
    towards: tuple[float, float, float]
    width: int = 1000
    height: int = 1000
    field_of_view_deg: float = 60.0

    def __post_init__(self) -> None:
        """Check the user's numbers."""
        unit(np.subtract(self.towards, self.eye), "the way from camera.eye to camera.towards")
        for name, most in (("width", np.inf), ("height", np.inf), ("field_of_view_deg", 180.0)):
            value = getattr(self, name)
            if not 0.0 < value < most:
                raise InputError(f"camera.{name} is {value}", expected=f"above 0 and below {most}")

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors (3, 3): to the right, up and forward in the picture."""
        forward = unit(np.subtract(self.towards, self.eye), "camera.towards")
        right = np.cross(forward, (0.0, 0.0, 1.0))
        length = np.sqrt(np.sum(right**2))
        right = right / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
        return np.stack((right, np.cross(right, forward), forward))

    @property
    def pixels_per_slope(self) -> float:
        """Size in pixels of what is as large as it is far."""
        return float(0.5 * self.height / np.tan(np.radians(0.5 * self.field_of_view_deg)))

    def may_see(
        self, centre: NDArray[np.float64], radius: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Tell which spheres, of centres (n, 3) and radii (n,), reach into the picture's pyramid.

        One that touches it only near an edge may be taken for seen, none the other way round.
        """
        way = centre - np.asarray(self.eye)
        x, y, z = (_along(way, axis) for axis in self.axes)
        seen = z >= -radius
        tall = np.tan(np.radians(0.5 * self.field_of_view_deg))
        for place, slope in ((x, tall * self.width / self.height), (y, tall)):
            seen &= z * slope - np.abs(place) >= -radius * np.hypot(1.0, slope)
        return np.asarray(seen, np.bool_)


class Frame(NamedTuple):
    """What is drawn.

    Attributes
    ----------
    triangles : float32 (t, 3, 3)
        Corners, m.
    triangle_colour : uint8 (t, 3)
        Red, green, blue.
    lines : float32 (l, 2, 3)
    line_colour : uint8 (l, 3)
    points : float32 (p, 3)
    point_colour : uint8 (p, 3)
    line_width : float32 (l,)
        Diameter of the branch, pixels at its range.
    point_size : float32 (p,)
        Side of a square that covers as much as the leaf and those left out around it, pixels.
    seen : int64 (n,)
        The instances that the camera may see, rising.
    """

    triangles: NDArray[np.float32]
    triangle_colour: NDArray[np.uint8]
    lines: NDArray[np.float32]
    line_colour: NDArray[np.uint8]
    points: NDArray[np.float32]
    point_colour: NDArray[np.uint8]
    line_width: NDArray[np.float32]
    point_size: NDArray[np.float32]
    seen: NDArray[np.int64]


def prepare(
    models: Sequence[Model],
    instances: Instances,
    camera: Camera,
    *,
    season: str = "summer",
    quality: float = 1.0,
    sun: ArrayLike = (-0.36, -0.48, 0.80),
    haze: float | None = None,
    haze_colour: Colour = (0.76, 0.82, 0.88),
    shadows: SceneShadow | None = None,
) -> Frame:
    """Work out what is drawn of a stand.

    Parameters
    ----------
    models : sequence of Model
        Geometries.
    instances : Instances
        Where which of them stands. Coordinates become float32: keep their origin near the stand.
    camera : Camera
        Where it is seen from.
    season : str
        One of `forest.surface.detail.SEASONS`.
    quality : float
        See `forest.surface.Sight`.
    sun : array_like (3,)
        Direction towards the sun.
    haze : float, optional
        Range at which 1 - 1/e of a colour is the haze's, m; clear air unless given.
    haze_colour : tuple of float
        Red, green and blue, 0 to 1.
    shadows : SceneShadow, optional
        The shade of these trees under the same sun and in the same season, from
        `forest.surface.shadow.scene_shadow`. Without it all leaves are in the sun.

    Returns
    -------
    Frame
        In order of the lists, within these of the models, within these of the instances.

    Raises
    ------
    InputError
        If season, quality, sun or haze are out of range, or the shadows another scene's.

    Notes
    -----
    A tree is left out if a sphere around it lies outside of the picture. The range of a tree is
    that of its sphere's middle. All of its primitives have the same haze.
    """
    sight = Sight(season, quality, float(camera.height), camera.field_of_view_deg)
    light = _Light(
        unit(sun, "sun"),
        np.asarray(haze_colour, np.float64),
        _NO_MAP if shadows is None else shadows.map,
        shadows is not None,
    )
    if shadows is not None:
        _check_shadows(shadows, models, season, light.sun)
    centres = np.array([model.sphere[0] for model in models]).reshape(-1, 3)
    radii = np.array([model.sphere[1] for model in models])
    scale = instances.scale
    middle = instances.place + scale[:, None] * centres[instances.model]
    seen = np.flatnonzero(camera.may_see(middle, scale * radii[instances.model]))
    way = middle - np.asarray(camera.eye)
    range_m = np.sqrt(_along(way, way.T)) if len(way) else np.empty(0)
    clear = 1.0 - haze_share(range_m, haze)
    grow = camera.pixels_per_slope * scale / np.maximum(range_m, _LEAST_RANGE_M)

    jobs: list[_Job] = []
    totals = {3: 0, 2: 0, 1: 0}
    model_of_seen = instances.model[seen]
    for k, model in enumerate(models):
        rows = seen[model_of_seen == k]
        if not len(rows):
            continue
        shares = fractions(range_m[rows], sight, evergreen=model.evergreen)
        for part in model.lists:
            share = part.share(shares)
            count = np.empty(len(rows), np.int64)
            _count(part.first, np.int64(part.mass), share, count)
            some = np.flatnonzero(count)
            if not len(some):
                continue
            here, share, count = rows[some], share[some], count[some]
            start = totals[part.corners] + np.cumsum(count) - count
            totals[part.corners] += int(count.sum())
            width = grow[here] / np.sqrt(share) if part.item == LEAF_ITEM else grow[here]
            trees = _Trees(
                here, instances.place[here], scale[here], share, clear[here], width, start
            )
            look = _look(model, part, season, None if shadows is None else shadows.own[k])
            jobs += [
                _Job(part, look, _Trees(*(column[piece] for column in trees)), int(size))
                for piece, size in _pieces(count)
            ]
    return _fill_all(jobs, totals, light, seen)


def sunlit(colour: ArrayLike, share: ArrayLike) -> NDArray[np.float64]:
    """Light colours by the sky and by a share of the full sun.

    Parameters
    ----------
    colour : array_like (..., 3)
        Red, green and blue, 0 to 1.
    share : array_like (...)
        Sunlight, 0 to 1: the cosine of its angle of incidence, 0 in the shade.

    Returns
    -------
    float64 (..., 3)
        0 to 1. The eye sees shade brighter than the light is.
    """
    light = _SKY + np.asarray(share, np.float64)[..., None] * _SUN
    return np.clip(np.asarray(colour, np.float64) * light, 0.0, 1.0) ** _GAMMA


def haze_share(range_m: ArrayLike, haze: float | None) -> NDArray[np.float64]:
    """Give the share of haze in what is seen at a range: 1 - exp(-range / haze).

    Raises
    ------
    InputError
        If the haze is not above 0.
    """
    range_m = np.asarray(range_m, np.float64)
    if haze is None:
        return np.zeros_like(range_m)
    if not haze > 0.0:
        raise InputError(f"haze is {haze}", expected="metres above 0")
    return np.asarray(1.0 - np.exp(-range_m / haze), np.float64)


class _Light(NamedTuple):
    """What all primitives share."""

    sun: NDArray[np.float64]
    haze_colour: NDArray[np.float64]
    map: ShadowMap
    has_map: bool


class _Look(NamedTuple):
    """How a list's elements look: whether leaves, the colour by sunlight, own shadow's marks."""

    leaf: bool
    table: NDArray[np.float64]
    shaded: NDArray[np.bool_]


class _Trees(NamedTuple):
    """Instances of one model, an entry each."""

    row: NDArray[np.int64]
    place: NDArray[np.float64]
    scale: NDArray[np.float64]
    share: NDArray[np.float64]  # of the list's elements that is drawn
    clear: NDArray[np.float64]  # share of the colour that the haze leaves
    pixels: NDArray[np.float64]  # of a metre of the model
    start: NDArray[np.int64]  # of the first primitive in the frame


class _Job(NamedTuple):
    """Some instances of one list, about `_JOB` primitives."""

    part: Elements
    look: _Look
    trees: _Trees
    size: int


def _along(vectors: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give dot products; written out, since BLAS may sum in any order."""
    return np.asarray(
        vectors[:, 0] * axis[0] + vectors[:, 1] * axis[1] + vectors[:, 2] * axis[2], np.float64
    )


def _check_shadows(
    shadows: SceneShadow, models: Sequence[Model], season: str, sun: NDArray[np.float64]
) -> None:
    if len(shadows.own) != len(models):
        raise InputError(f"shadows of {len(shadows.own)} models", expected=f"{len(models)}")
    if (shadows.season == "winter") != (season == "winter"):
        raise InputError(f"shadows of {shadows.season}", expected=f"those of {season}")
    if not np.allclose(shadows.sun, sun, atol=1e-6):
        raise InputError(f"shadows of a sun at {shadows.sun}", expected=f"at {sun}")


def _look(model: Model, part: Elements, season: str, own: ModelShadow | None) -> _Look:
    leaf = part.item == LEAF_ITEM
    colour = model.foliage[season] if leaf else model.bark
    table = 255.0 * sunlit(np.asarray(colour), np.linspace(0.0, 1.0, _SHADES))
    shaded = np.zeros(len(part.first) - 1, np.bool_) if own is None else own.shaded[part.item]
    return _Look(leaf, table, shaded)


def _pieces(count: NDArray[np.int64]) -> list[tuple[slice, int]]:
    """Cut instances into runs of about `_JOB` primitives, with the number in each."""
    piece = (np.cumsum(count) - count) // _JOB
    starts = np.flatnonzero(np.diff(piece, prepend=-1))
    ends = np.append(starts[1:], len(count))
    sizes = np.add.reduceat(count, starts)
    return [(slice(a, b), int(n)) for a, b, n in zip(starts, ends, sizes, strict=True)]


def _fill_all(
    jobs: list[_Job], totals: dict[int, int], light: _Light, seen: NDArray[np.int64]
) -> Frame:
    """Fill a frame, the largest jobs first."""
    vertices = {k: np.empty((n, 3 * k), np.float32) for k, n in totals.items()}
    colour = {k: np.empty((n, 3), np.uint8) for k, n in totals.items()}
    width = {k: np.empty(n if k < 3 else 0, np.float32) for k, n in totals.items()}
    jobs = sorted(jobs, key=lambda job: -job.size)

    def work(first: int, step: int) -> None:
        for job in jobs[first::step]:
            part, k = job.part, job.part.corners
            arrays = _Arrays(part.vertices, part.facing, part.first, part.middle, part.width_m)
            out = _Out(vertices[k], colour[k], width[k])
            _fill(arrays, np.int64(part.mass), job.look, job.trees, light, out)

    in_threads(work)
    return Frame(
        triangles=vertices[3].reshape(-1, 3, 3),
        triangle_colour=colour[3],
        lines=vertices[2].reshape(-1, 2, 3),
        line_colour=colour[2],
        points=vertices[1],
        point_colour=colour[1],
        line_width=width[2],
        point_size=width[1],
        seen=seen,
    )


class _Arrays(NamedTuple):
    """What kernels read of `Elements`."""

    vertices: NDArray[np.float32]
    facing: NDArray[np.float32]
    first: NDArray[np.int32]
    middle: NDArray[np.float32]
    width_m: NDArray[np.float32]


class _Out(NamedTuple):
    """What kernels write of a `Frame`, for one kind of primitives."""

    vertices: NDArray[np.float32]
    colour: NDArray[np.uint8]
    width: NDArray[np.float32]  # empty for triangles


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
                dark = look.shaded[e] or (light.has_map and _others_shade(part, trees, light, j, e))
                for p in range(part.first[e], part.first[e + 1]):
                    _place(part, trees, j, p, out, at)
                    _paint(part, look, trees, light, dark, j, p, out, at)
                    if len(out.width):
                        out.width[at] = part.width_m[e] * trees.pixels[j]
                    at += 1


@driver
def _others_shade(part: Any, trees: Any, light: Any, j: Any, e: Any) -> Any:
    """Tell whether an element of tree `j` lies in another tree's shade."""
    scale = trees.scale[j]
    return shaded_by_others(
        light.map,
        trees.row[j],
        trees.place[j, 0] + scale * part.middle[e, 0],
        trees.place[j, 1] + scale * part.middle[e, 1],
        trees.place[j, 2] + scale * part.middle[e, 2],
    )


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
    part: Any, look: Any, trees: Any, light: Any, dark: Any, j: Any, p: Any, out: Any, at: Any
) -> None:
    """Colour a primitive: by the sun unless it is in the dark, then by the haze."""
    shade = 0
    if not dark:
        shade = int(_sunlight(part, light.sun, p, look.leaf) * (_SHADES - 1) + 0.5)
    clear = trees.clear[j]
    for c in range(3):
        colour = clear * look.table[shade, c] + (1.0 - clear) * 255.0 * light.haze_colour[c]
        out.colour[at, c] = np.uint8(colour + 0.5)
