"""A frame of many trees and its shadow maps, said slowly: one tree, one element at a time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from forest.surface.camera import Camera
from forest.surface.description import LEAF_ITEM, Primitives
from forest.surface.detail import LAST_LEVEL, Sight, fractions
from forest.surface.instances import Instances, Model
from forest.surface.light import bark_step, bark_steps, sunlit
from forest.surface.shadow import SceneShadow, ShadowMap

Row = tuple[float, ...]


def sees(camera: Camera, centre: NDArray[np.float64], radius: float) -> bool:
    """Whether a sphere is not wholly beyond one of the five planes of the picture's pyramid."""
    right, up, forward = camera.axes
    tall = math.radians(camera.field_of_view_deg) / 2
    wide = math.atan(math.tan(tall) * camera.width / camera.height)
    inward = [
        forward,
        math.sin(wide) * forward + math.cos(wide) * right,
        math.sin(wide) * forward - math.cos(wide) * right,
        math.sin(tall) * forward + math.cos(tall) * up,
        math.sin(tall) * forward - math.cos(tall) * up,
    ]
    way = centre - np.array(camera.eye)
    return all(float(np.dot(way, normal)) >= -radius for normal in inward)


def cell_of(picture: ShadowMap, point: NDArray[np.float64]) -> tuple[int, int]:
    """Row and column of the map in which a point lies, maybe beyond it."""
    x, y = float(np.dot(picture.axes[0], point)), float(np.dot(picture.axes[1], point))
    return (
        math.floor((y - picture.corner[1]) / picture.cell_m),
        math.floor((x - picture.corner[0]) / picture.cell_m),
    )


def shaded_by_others(picture: ShadowMap, i: int, point: NDArray[np.float64]) -> bool:
    row, col = cell_of(picture, point)
    if not (0 <= row < picture.depth.shape[0] and 0 <= col < picture.depth.shape[1]):
        return False
    nearer = picture.depth[row, col] > float(np.dot(picture.axes[2], point)) + picture.cell_m
    return bool(nearer) and int(picture.owner[row, col]) != i


def sunlight(
    corners: NDArray[np.float64], normal: NDArray[np.float64] | None, sun: NDArray[np.float64]
) -> float:
    """Cosine of the sun on a leaf of a normal, a tube's triangle, or all sides of a line."""
    if normal is not None:
        return abs(float(np.dot(normal, sun)))
    across = corners[1] - corners[0]
    if len(corners) == 3:
        across = np.cross(across, corners[2] - corners[0])
    length = float(np.linalg.norm(across))
    along = float(np.dot(across, sun)) / length if length > 0.0 else 0.0
    if len(corners) == 2:
        return math.sqrt(max(1.0 - along**2, 0.0)) / math.pi
    return max(along, 0.0)


class Scene(NamedTuple):
    """What a frame is prepared from."""

    models: list[Model]
    instances: Instances
    camera: Camera
    season: str
    quality: float
    sun: NDArray[np.float64]
    haze: float | None
    haze_colour: tuple[float, float, float]
    shadows: SceneShadow | None


def frame(scene: Scene) -> tuple[list[Row], list[Row], list[Row]]:
    """Triangles, lines and points: coordinates, width in pixels, and colour before rounding."""
    camera = scene.camera
    sight = Sight(scene.season, scene.quality, camera.height, camera.field_of_view_deg)
    found: tuple[list[Row], list[Row], list[Row]] = ([], [], [])
    for i, k in enumerate(scene.instances.model):
        model, scale = scene.models[k], float(scene.instances.scale[i])
        middle = scene.instances.place[i] + scale * model.sphere[0]
        if not sees(camera, middle, scale * model.sphere[1]):
            continue
        distance = math.sqrt(sum((middle - np.array(camera.eye)) ** 2))
        shares = fractions(distance, sight, evergreen=model.evergreen)
        pixels = 0.5 * camera.height / math.tan(math.radians(camera.field_of_view_deg / 2))
        pixels *= scale / max(distance, 0.1)
        for kind, primitives in zip(found, model.description.drawn(shares), strict=True):
            for p in range(len(primitives.item)):
                leaf, width = width_of(model, primitives, p)
                if leaf:
                    width /= math.sqrt(float(shares.leaf_points))
                if primitives.vertices.shape[1] == 3:
                    width = 0.0
                corners = np.float64(np.float32(primitives.vertices[p]))
                there = np.float32(scene.instances.place[i] + scale * corners)
                colour = colour_of(scene, i, primitives, p, distance)
                kind.append((*there.ravel().tolist(), width * pixels, *colour))
    return found


def width_of(model: Model, primitives: Primitives, p: int) -> tuple[bool, float]:
    """Whether it is a leaf, and the side of its square or the diameter of the internode."""
    item, element = int(primitives.item[p]), int(primitives.element[p])
    if item == LEAF_ITEM:
        return True, math.sqrt(float(model.description.leaves.area[element]))
    stems = model.description.stems[item]
    number = stems.internode.tolist().index(element)
    return False, float(np.linalg.norm(stems.side[number], axis=1).sum())


def colour_of(
    scene: Scene, i: int, primitives: Primitives, p: int, distance: float
) -> tuple[float, float, float]:
    """Red, green and blue, 0 to 255: sun, shade, haze."""
    k = int(scene.instances.model[i])
    model = scene.models[k]
    item, element = int(primitives.item[p]), int(primitives.element[p])
    normal, points = None, [np.zeros(3)]
    if item == LEAF_ITEM:
        leaves, number, base = model.description.leaves, element, model.foliage[scene.season]
        normal = leaves.normal[element]
        middle = leaves.position[element] + leaves.length[element] / 2 * leaves.direction[element]
    else:
        stems = model.description.stems[item]
        number = stems.internode.tolist().index(element)
        middle = stems.centre[number].mean(axis=0)
        diameter = np.float32(np.linalg.norm(stems.side[number], axis=1).sum())
        red, green, blue = bark_steps(model.bark)[int(bark_step(diameter))]
        base = (float(red), float(green), float(blue))
        if item < LAST_LEVEL:
            points = along_stem(stems.centre[number])
    light = sunlight(primitives.vertices[p], normal, scene.sun)
    if scene.shadows is not None:
        there = scene.instances.place[i] + scene.instances.scale[i] * np.float32(middle)
        others = [shaded_by_others(scene.shadows.map, i, there + way) for way in points]
        light *= 1.0 - float(scene.shadows.own[k].shaded[item][number])
        light *= 1.0 - sum(others) / len(others)
    lit = sunlit(np.array(base), np.array(light))
    hazy = 0.0 if scene.haze is None else 1.0 - math.exp(-distance / scene.haze)
    red, green, blue = (
        255.0 * ((1.0 - hazy) * lit[c] + hazy * scene.haze_colour[c]) for c in range(3)
    )
    return red, green, blue


def along_stem(ends: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Ways to five points up to a metre along a stem, from its middle."""
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    unit = np.float32(way / length) if length > 0.0 else np.zeros(3)
    return [step * unit for step in (-1.0, -0.5, 0.0, 0.5, 1.0)]


def mean_along(marks: list[float], lengths: list[float], k: int, reach: float) -> float:
    """Mean of an axis' marks within a reach of the middle of internode `k`, weighed by length."""
    middle = sum(lengths[:k]) + lengths[k] / 2
    total, dark, at = 0.0, 0.0, 0.0
    for mark, length in zip(marks, lengths, strict=True):
        within = max(0.0, min(at + length, middle + reach) - max(at, middle - reach))
        total, dark, at = total + within, dark + within * mark, at + length
    return dark / total


def nearest_hit(triangles: NDArray[np.float64], x: float, y: float, grown: float) -> float:
    """Highest third coordinate at which the line over (x, y) meets triangles (t, 3, 3).

    Each is grown by a share of itself: what is hit at an edge depends on rounding.
    """
    best = -math.inf
    for a, b, c in triangles:
        sides = np.array([[b[0] - a[0], c[0] - a[0]], [b[1] - a[1], c[1] - a[1]]])
        if abs(np.linalg.det(sides)) < 1e-15:
            continue
        s, t = np.linalg.solve(sides, [x - a[0], y - a[1]])
        if min(s, t, 1.0 - s - t) >= -grown:
            best = max(best, float(a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2])))
    return best


def cast(scene: ShadowMap, own: list[ShadowMap], instances: Instances, row: int, col: int) -> float:
    """Depth that a cell of the scene's map shows, from the models' own maps."""
    x = scene.corner[0] + (col + 0.5) * scene.cell_m
    y = scene.corner[1] + (row + 0.5) * scene.cell_m
    best = -math.inf
    for k, place, scale in zip(*instances, strict=True):
        u, v, w = scene.axes @ place
        at_row = math.floor(((y - v) / scale - own[k].corner[1]) / own[k].cell_m)
        at_col = math.floor(((x - u) / scale - own[k].corner[0]) / own[k].cell_m)
        rows, cols = own[k].depth.shape
        if 0 <= at_row < rows and 0 <= at_col < cols:
            best = max(best, float(w + scale * own[k].depth[at_row, at_col]))
    return best
