"""Shadow propagation bud by bud, straight from Palubicki et al. 2009, section 4.1, Figure 5."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from forest.trees.metamers import LATERAL, TERMINAL, Metamers
from forest.trees.table import Trees

Voxel = tuple[int, int, int]


def living_buds(metamers: Metamers, trees: Trees, voxel_m: float) -> list[tuple[int, int, Voxel]]:
    """List (metamer, species, voxel) of every living bud; two buds of a node stand twice."""
    buds = []
    for tree in range(len(trees.tree_id)):
        for k in range(trees.start[tree], trees.start[tree] + trees.size[tree]):
            place = (trees.base_offset[tree] + metamers.tip[k]) / np.float32(voxel_m)
            voxel = tuple(
                int(b) + math.floor(p) for b, p in zip(trees.base_voxel[tree], place, strict=True)
            )
            for bit in (TERMINAL, LATERAL):
                if metamers.state[k] & bit:
                    buds.append((k, int(trees.species[tree]), voxel))
    return buds


def wrapped(voxel: Voxel, shape: tuple[int, int], periodic: bool) -> Voxel:
    """Bring a voxel into the plot if it is a torus."""
    if not periodic:
        return voxel
    return voxel[0] % shape[0], voxel[1] % shape[1], voxel[2]


def shadow_field(
    sources: list[tuple[Voxel, float]],
    weights: list[float],
    shape: tuple[int, int],
    periodic: bool,
) -> Counter[Voxel]:
    """Lay the pyramid of every source, voxel by voxel; weights[q] is the shadow of layer q."""
    shadow: Counter[Voxel] = Counter()
    for (i, j, k), strength in sources:
        for q, weight in enumerate(weights):
            for dy in range(-q, q + 1):
                for dx in range(-q, q + 1):
                    voxel = wrapped((i + dx, j + dy, k - q), shape, periodic)
                    shadow[voxel] += strength * weight
    return shadow


def node_light(
    metamers: Metamers,
    trees: Trees,
    *,
    voxel_m: float,
    shape: tuple[int, int],
    periodic: bool,
    factor: list[float],
    a: float,
    b: float,
    q_max: int,
    full_light: float,
) -> dict[int, float]:
    """Q = max(C - s + a, 0) of every node with a living bud, by metamer; 4.1."""
    buds = living_buds(metamers, trees, voxel_m)
    weights = [a * b**-q for q in range(q_max + 1)]
    shadow = shadow_field([(v, factor[s]) for _, s, v in buds], weights, shape, periodic)
    return {
        k: max(full_light - shadow[wrapped(v, shape, periodic)] + a * factor[s], 0.0)
        for k, s, v in buds
    }


def best_gradient(shadow: Counter[Voxel], voxel: Voxel, shape: tuple[int, int], periodic: bool):
    """Unit vector against the gradient of the shadow by central differences; zero if flat."""
    slope = []
    for axis in range(3):
        ends = []
        for step in (-1, 1):
            other = list(voxel)
            other[axis] += step
            ends.append(shadow[wrapped(tuple(other), shape, periodic)])
        slope.append(ends[0] - ends[1])
    length = math.sqrt(sum(s * s for s in slope))
    return [s / length if length else 0.0 for s in slope]


def least_shadowed(
    shadow: Counter[Voxel],
    voxel: Voxel,
    heading: np.ndarray,
    *,
    reach: float,
    angle_deg: float,
    shape: tuple[int, int],
    periodic: bool,
):
    """Unit vector to the least shadowed voxel above ground in the cone; reach in voxels."""
    n = math.ceil(reach)
    seen = []
    for dz in range(-n, n + 1):
        for dy in range(-n, n + 1):
            for dx in range(-n, n + 1):
                length = math.sqrt(dx * dx + dy * dy + dz * dz)
                if length == 0 or length > reach or voxel[2] + dz < 0:
                    continue
                cosine = float(np.dot(heading, (dx, dy, dz))) / length
                if cosine < math.cos(math.radians(angle_deg) / 2):
                    continue
                at = wrapped((voxel[0] + dx, voxel[1] + dy, voxel[2] + dz), shape, periodic)
                seen.append((shadow[at], length, (dz, dy, dx)))
    here = shadow[wrapped(voxel, shape, periodic)]
    if all(s == here for s, _, _ in seen):
        return [0.0, 0.0, 0.0]
    _, length, (dz, dy, dx) = min(seen)
    return [dx / length, dy / length, dz / length]
