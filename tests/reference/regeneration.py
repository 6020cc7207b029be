"""Regeneration, slowly: seeds tree by tree and image by image, seedlings one by one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from forest.random import STREAM_ROOM, STREAM_SEEDLING, uniforms


def density(kernel: str, distance_m: float, shape: float, r: float) -> float:
    """Seeds per m2 at a distance from their mother, of one seed."""
    if kernel == "2dt":
        u = distance_m**2
        return shape / (math.pi * u * (1 + r * r / u) ** (shape + 1))
    logs = math.log(r / distance_m)
    spread = math.exp(-(logs**2) / (2 * shape**2))
    return spread / ((2 * math.pi) ** 1.5 * shape * r**2)


def seeds_in_cell(
    kernel: tuple[str, float, float],
    size_m: tuple[float, float],
    cell: tuple[float, float, float, float],
    mother: tuple[float, float],
    images: int,
    parts: int = 8,
) -> float:
    """Share of a mother's seeds that fall into the cell (x, y, dx, dy), of her images as well."""
    x, y, dx, dy = cell
    total = 0.0
    for i in range(-images, images + 1):
        for j in range(-images, images + 1):
            for a in range(parts):
                for b in range(parts):
                    at_x = x + (a + 0.5) / parts * dx + i * size_m[0]
                    at_y = y + (b + 0.5) / parts * dy + j * size_m[1]
                    r = math.hypot(at_x - mother[0], at_y - mother[1])
                    total += density(*kernel, max(r, 1e-9)) * dx * dy / parts**2
    return total


def live_a_year(
    cohorts: dict[str, list[Any]],
    light: list[float],
    taken: list[float],
    transmission: np.ndarray,
    area: float,
    species: list[dict[str, float]],
    factor: list[float],
    seed: int,
    year: int,
) -> tuple[list[int], list[int]]:
    """Cohort by cohort, from each cell's tallest on; changes `cohorts`."""
    died, crowded = [], []
    cell_before, place, lai, full = -1, 0, 0.0, 0.0
    for k, cell in enumerate(cohorts["cell"]):
        if cell != cell_before:
            cell_before, place, lai, full = cell, 0, 0.0, taken[cell]
        s = species[cohorts["species"][k]]
        n, h = cohorts["n"][k], cohorts["height"][k]
        steps = np.arange(len(transmission)) / 64
        here = light[cell] * float(np.interp(lai, steps, transmission))
        lai += n * s["leaf_area_1m_m2"] * h**2 / area
        share = s["survival_max"] / (1 + (s["survival_light_half"] / max(here, 1e-9)) ** 4)
        draws = [
            uniforms(seed, STREAM_SEEDLING, cell, (place << 20) + i // 4, year)[i % 4]
            for i in range(n)
        ]
        alive = sum(draw < share for draw in draws)
        died.append(n - alive)
        if cohorts["sprout"][k]:
            most = s["sprout_height_m"]
        else:
            most = s["max_height_growth_m"] * h / (h + 0.15)
        c, least = s["growth_light_slope"], s["growth_light_least"]
        response = 0.0
        if here > least:
            response = (1 - math.exp(-c * (here - least))) / (1 - math.exp(-c * (1 - least)))
        which = cohorts["species"][k]
        grown = h + most * response * min(factor[which], 1.0)
        leaves = s["leaf_area_1m_m2"] * h**2
        gain = leaves * (s["light_use_kg_m2"] * here * factor[which] - s["leaf_cost_kg_m2"])
        kept = s["reserve_fraction"] * max(cohorts["reserve"][k] + gain, 0.0)
        holds = s["density_1m_m2"] * grown ** -s["density_exponent"] * area
        draw = uniforms(seed, STREAM_ROOM, cell, place, year)[0]
        stay = min(alive, math.floor(max(1 - full, 0) * holds + draw))
        crowded.append(alive - stay)
        full += stay / holds
        cohorts["n"][k], cohorts["height"][k] = stay, grown
        cohorts["reserve"][k] = kept
        cohorts["age"][k] += 1
        place += 1
    return died, crowded
