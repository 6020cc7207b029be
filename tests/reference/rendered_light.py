"""A picture of a stand ray by ray, straight from Hart & Baker 2003, section 4.1 (photosynthesis).

Every pixel is a ray through space, and every shape is tried against it in three dimensions.
"""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np

from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees


def list_shapes(metamers: Metamers, trees: Trees, leaf_area: list[float], exponent: list[float]):
    """List leaves (k, place, side) and limbs (k, base, tip, radius), in order of drawing."""
    shapes = []
    for tree in range(len(trees.tree_id)):
        foot = np.array([trees.x[tree], trees.y[tree], 0.0])
        start = trees.start[tree]
        for k in range(start, start + trees.size[tree]):
            buds = sum(1 for bit in (TERMINAL, LATERAL) if metamers.state[k] & bit)
            tip = foot + metamers.tip[k].astype(float)
            parent = metamers.parent[k]
            base = foot + metamers.tip[start + parent].astype(float) if parent >= 0 else foot
            species = trees.species[tree]
            if buds:
                shapes.append(("leaf", k, tip, math.sqrt(buds * leaf_area[species])))
            radius = np.float32(0.5 * float(metamers.pipe[k]) ** (1.0 / exponent[species]))
            shapes.append(("limb", k, base, tip, float(radius)))
    return shapes


def height_on_ray(shape, ground: np.ndarray, toward: np.ndarray) -> float | None:
    """Find where a ray meets a shape: its height, or None."""
    if shape[0] == "leaf":
        _, _, place, side = shape
        at = ground + toward * place[2] / toward[2]
        inside = all(-side / 2 <= at[axis] - place[axis] < side / 2 for axis in (0, 1))
        return float(place[2]) if inside else None
    if shape[0] == "limb":
        _, _, base, tip, radius = shape
        along = tip - base
        # Where, seen along the ray, the axis is nearest to the ray.
        across = along - toward * (along @ toward)
        off = (ground - base) - toward * ((ground - base) @ toward)
        if across @ across <= 1e-12 * (along @ along):
            t = 1.0 if tip[2] >= base[2] else 0.0
        else:
            t = min(max((off @ across) / (across @ across), 0.0), 1.0)
        distance = np.linalg.norm(off - t * across)
        return float((1 - t) * base[2] + t * tip[2]) if distance <= radius else None
    _, corner, edge = shape
    low, high = -math.inf, math.inf
    for axis in range(3):
        if toward[axis] == 0:
            if not corner[axis] <= ground[axis] < corner[axis] + edge:
                return None
            continue
        ends = sorted((corner[axis] + e - ground[axis]) / toward[axis] for e in (0.0, edge))
        low, high = max(low, ends[0]), min(high, ends[1])
    return float(toward[2] * high) if low <= high else None


def rendered_light(
    metamers: Metamers,
    trees: Trees,
    *,
    leaf_area: list[float],
    exponent: list[float],
    voxels: list[tuple[int, int, int]],
    voxel_m: float,
    toward: np.ndarray,
    pixel: tuple[float, float],
    shift: tuple[float, float],
    turns: tuple[int, int] | None,
) -> tuple[dict[int, float], dict[tuple[int, int], tuple[str, int]]]:
    """Give the part of each leaf that is seen, by metamer, and what is seen in each pixel.

    That is its kind and its metamer, or -1 for a voxel. `turns` are the pixels of a torus along x
    and y, or None on an open plot.
    """
    shapes = list_shapes(metamers, trees, leaf_area, exponent)
    shapes += [("voxel", np.array(v) * voxel_m, voxel_m) for v in voxels]
    slope = toward[:2] / toward[2]
    nearest: dict[tuple[int, int], tuple[np.float32, int]] = {}
    covered = defaultdict(list)
    for number, shape in enumerate(shapes):
        for spot in _candidates(shape, slope, pixel, shift):
            ground = np.array([(spot[a] + shift[a]) * pixel[a] for a in (0, 1)] + [0.0])
            height = height_on_ray(shape, ground, toward)
            if height is None:
                continue
            on_torus = spot if turns is None else (spot[0] % turns[0], spot[1] % turns[1])
            covered[number].append(on_torus)
            if on_torus not in nearest or np.float32(height) > nearest[on_torus][0]:
                nearest[on_torus] = (np.float32(height), number)
    light = {}
    for number, shape in enumerate(shapes):
        if shape[0] != "leaf":
            continue
        _, k, place, _ = shape
        if covered[number]:
            seen = sum(1 for spot in covered[number] if nearest[spot][1] == number)
            light[k] = seen / len(covered[number])
            continue
        u = [place[a] - place[2] * slope[a] for a in (0, 1)]
        spot = tuple(math.floor(u[a] / pixel[a] - shift[a] + 0.5) for a in (0, 1))
        if turns is not None:
            spot = (spot[0] % turns[0], spot[1] % turns[1])
        above = nearest.get(spot, (np.float32(-np.inf), 0))[0]
        light[k] = 1.0 if above <= np.float32(place[2]) else 0.0
    kinds = [(shape[0], -1 if shape[0] == "voxel" else shape[1]) for shape in shapes]
    return light, {spot: kinds[number] for spot, (_, number) in nearest.items()}


def _candidates(shape, slope: np.ndarray, pixel, shift):
    """List the pixels around a shape's image, more than it can cover."""
    if shape[0] == "leaf":
        points, pad = [shape[2]], shape[3]
    elif shape[0] == "limb":
        points, pad = [shape[2], shape[3]], shape[4]
    else:
        points = [shape[1] + shape[2] * np.array([i, j, k]) for i, j, k in np.ndindex(2, 2, 2)]
        pad = 0.0
    pads = pad * (1.0 + np.abs(slope))
    image = np.array([p[:2] - p[2] * slope for p in points])
    low = (image.min(axis=0) - pads) / pixel - shift
    high = (image.max(axis=0) + pads) / pixel - shift
    for j in range(math.floor(low[1]), math.ceil(high[1]) + 1):
        for i in range(math.floor(low[0]), math.ceil(high[0]) + 1):
            yield (i, j)
