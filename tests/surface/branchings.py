"""Trees whose limbs meet at joints alone, for tests of the blended surface."""

from __future__ import annotations

import numpy as np

from forest.trees.skeleton import Skeleton, number_axes


def tree(parent: list[int], points: list[tuple[float, float, float]], radius: list[float],
         main: list[bool]) -> Skeleton:  # fmt: skip
    """Make a skeleton; the first of `points` is the base, then the end of each internode."""
    before = np.array(parent, np.int32)
    end = np.array(points[1:], np.float64)
    start = np.where(before[:, None] >= 0, end[before], np.array(points[0], np.float64))
    goes_on = np.array(main)
    order = np.zeros(len(before), np.int32)
    for i in range(len(before)):
        if before[i] >= 0:
            order[i] = order[before[i]] + (not goes_on[i])
    n = len(before)
    return Skeleton(
        parent=before,
        start=start,
        end=end,
        radius=np.array(radius, np.float64),
        axis=number_axes(before, goes_on),
        order=order,
        birth_year=2000 + np.arange(n, dtype=np.int32),
        leafy=np.ones(n, np.bool_),
        serial=np.arange(n, dtype=np.int32),
        tree_id=7,
    )


def stem(radius: float = 0.1, length: float = 1.0) -> Skeleton:
    """Make a single upright internode."""
    return tree([-1], [(0, 0, 0), (0, 0, length)], [radius], [True])


def branching(angle_deg: float = 45.0, thin: float = 0.06, half: float = 1.0) -> Skeleton:
    """Make a trunk, 20 cm thick and twice `half` long, and a limb from its middle."""
    a = np.deg2rad(angle_deg)
    limb = (1.2 * half * np.sin(a), 0.0, half + 1.2 * half * np.cos(a))
    points = [(0.0, 0.0, 0.0), (0.0, 0.0, half), (0.0, 0.0, 2.0 * half), limb]
    return tree([-1, 0, 0], points, [0.1, 0.1, thin], [True, True, False])


def random_tree(seed: int, limbs: int) -> Skeleton:
    """Make a trunk with limbs in turn around it, each with a twig; some are thin."""
    rng = np.random.default_rng(seed)
    parent, points, radius, main = [-1], [(0.0, 0.0, 0.0), (0.0, 0.0, 0.7)], [0.08], [True]
    trunk = 0
    for k in range(limbs):
        around = 2.4 * k + rng.uniform(-0.3, 0.3)
        lean = rng.uniform(0.6, 1.3)
        way = np.array([np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)])
        base = np.array(points[trunk + 1])
        thick = radius[trunk] * rng.uniform(0.15, 0.7)
        middle = base + 0.5 * way
        across = np.cross(way, (0.0, 0.0, 1.0))
        turned = way + 0.2 * across / np.linalg.norm(across)
        first = len(parent)
        parent += [trunk, first, first]
        points += [
            tuple(middle),
            tuple(middle + 0.4 * way),
            tuple(middle + 0.25 * turned + 0.1 * across),
        ]
        radius += [thick, 0.6 * thick, 0.3 * thick]
        main += [False, True, False]
        parent.append(trunk)
        points.append(tuple(base + np.array([0.0, 0.0, 0.5])))
        radius.append(0.85 * radius[trunk])
        main.append(True)
        trunk = len(parent) - 1
    return tree(parent, points, radius, main)
