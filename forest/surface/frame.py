"""A stand of many trees as one picture's triangles, lines and points.

Weber and Penn 1995, sections 5 and 6. Every tree that the camera may see is drawn in the detail of
its range (`forest.surface.detail`); colours are worked out here: sun, shade and haze.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forest.errors import InputError
from forest.surface.camera import Camera
from forest.surface.description import LEAF_ITEM
from forest.surface.detail import Sight, fractions
from forest.surface.directions import along, unit
from forest.surface.filling import SHADES, Job, Light, Look, Trees, count, cut, fill, is_long
from forest.surface.instances import Colour, Elements, Instances, Model
from forest.surface.light import bark_step, bark_steps, haze_share, sunlit
from forest.surface.shadow import NO_MAP, ModelShadow, SceneShadow

__all__ = ["Camera", "Frame", "haze_share", "prepare", "sunlit"]

#: Primitives of a frame at most: 4 GB of triangles, or 2 GB of points.
MOST_PRIMITIVES = 100_000_000

_LEAST_RANGE_M = 0.1


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
        In order of the models, within these of the lists, within these of the instances.

    Raises
    ------
    InputError
        If season, quality, sun or haze are out of range, the shadows another scene's, or there are
        more than `MOST_PRIMITIVES` to draw.

    Notes
    -----
    A tree is left out if a sphere around it lies outside of the picture. The range of a tree is
    that of its sphere's middle. All of its primitives have the same haze.
    """
    sight = Sight(season, quality, float(camera.height), camera.field_of_view_deg)
    direction = unit(sun, "sun")
    if shadows is None:
        light = Light(direction, np.asarray(haze_colour, np.float64), NO_MAP, False)
    else:
        _check_shadows(shadows, models, season, direction)
        light = Light(direction, np.asarray(haze_colour, np.float64), shadows.map, True)
    views = _views(models, instances, camera, haze)
    jobs: list[Job] = []
    totals = {3: 0, 2: 0, 1: 0}
    for k, model in enumerate(models):
        of_model = _some(views, instances.model[views.row] == k)
        shares = fractions(of_model.range_m, sight, evergreen=model.evergreen)
        for part in model.lists:
            look = _look(model, part, season, None if shadows is None else shadows.own[k])
            trees = _drawn(part, of_model, part.share(shares), totals)
            jobs += [Job(part, look, *piece) for piece in cut(trees)]
    _check_room(totals, len(views.row))
    vertices, colour, width = fill(jobs, totals, light)
    return Frame(
        triangles=vertices[3].reshape(-1, 3, 3),
        triangle_colour=colour[3],
        lines=vertices[2].reshape(-1, 2, 3),
        line_colour=colour[2],
        points=vertices[1],
        point_colour=colour[1],
        line_width=width[2],
        point_size=width[1],
        seen=views.row,
    )


class _Views(NamedTuple):
    """What the camera may see, an entry for each instance."""

    row: NDArray[np.int64]
    place: NDArray[np.float64]
    scale: NDArray[np.float64]
    range_m: NDArray[np.float64]
    clear: NDArray[np.float64]  # share of the colour that the haze leaves
    pixels: NDArray[np.float64]  # of a metre of the model


def _some(views: _Views, which: NDArray[np.bool_]) -> _Views:
    return _Views._make(column[which] for column in views)


def _views(
    models: Sequence[Model], instances: Instances, camera: Camera, haze: float | None
) -> _Views:
    """Find what the camera may see, and how far off it is."""
    centres = np.array([model.sphere[0] for model in models]).reshape(-1, 3)
    radii = np.array([model.sphere[1] for model in models])
    scale = instances.scale
    middle = instances.place + scale[:, None] * centres[instances.model]
    seen = np.flatnonzero(camera.may_see(middle, scale * radii[instances.model]))
    way = middle[seen] - np.asarray(camera.eye)
    range_m = np.sqrt(along(way, way.T))
    return _Views(
        seen,
        instances.place[seen],
        scale[seen],
        range_m,
        1.0 - haze_share(range_m, haze),
        camera.pixels_per_slope * scale[seen] / np.maximum(range_m, _LEAST_RANGE_M),
    )


def _drawn(
    part: Elements, views: _Views, share: NDArray[np.float64], totals: dict[int, int]
) -> Trees:
    """Give the instances of which something is drawn, and count it into the totals."""
    number = count(part, share)
    some = number > 0
    views, share, number = _some(views, some), share[some], number[some]
    start = totals[part.corners] + np.cumsum(number) - number
    totals[part.corners] += int(number.sum())
    pixels = views.pixels
    if part.item == LEAF_ITEM:
        pixels = pixels / np.sqrt(share)  # as large as all the leaves that it stands for
    return Trees(views.row, views.place, views.scale, share, views.clear, pixels, start, number)


def _check_room(totals: dict[int, int], trees: int) -> None:
    """Refuse what memory may not hold, before it is asked for."""
    number = sum(totals.values())
    if number > MOST_PRIMITIVES:
        raise InputError(
            f"{number:,} triangles, lines and points of {trees:,} trees in view",
            expected=f"at most {MOST_PRIMITIVES:,}: fewer trees or most_leaves, or a lower quality",
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


def _look(model: Model, part: Elements, season: str, own: ModelShadow | None) -> Look:
    leaf = part.item == LEAF_ITEM
    number = len(part.first) - 1
    if leaf:
        colours, tone = np.asarray(model.foliage[season])[None], np.zeros(number, np.uint8)
    else:
        colours, tone = bark_steps(model.bark), bark_step(part.width_m)
    table = 255.0 * sunlit(colours[:, None], np.linspace(0.0, 1.0, SHADES))
    shaded = np.zeros(number, np.float32) if own is None else own.shaded[part.item]
    return Look(leaf, is_long(part.item), table, tone, shaded)
