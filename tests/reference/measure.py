"""Mensuration the slow way: children lists, atan2 and one quantity at a time."""

from __future__ import annotations

import math

from forest.measure.trees import MeasureSpecies
from forest.trees.metamers import CONTINUED, LATERAL, MAIN, TERMINAL, Metamers
from forest.trees.table import Trees


def stem_of(m: Metamers, at: list[int]) -> list[int]:
    """List the metamers of the stem; `at` are the tree's places in the arena."""
    stem = []
    children = [j for j in range(len(at)) if m.parent[at[j]] == -1]
    while children:
        here = max(children, key=lambda j: float(m.pipe[at[j]]))
        stem.append(here)
        children = [j for j in range(len(at)) if m.parent[at[j]] == here]
        if m.state[at[here]] & CONTINUED:
            children = [j for j in children if m.state[at[j]] & MAIN]
    return stem


def measure_tree(
    m: Metamers, trees: Trees, species: MeasureSpecies, full_light: float, row: int
) -> dict[str, float]:
    """Measure one tree; keys as the fields of TreeMeasures."""
    n = int(trees.size[row])
    at = [int(trees.start[row]) + j for j in range(n)]
    s = MeasureSpecies(*(float(column[trees.species[row]]) for column in species))
    bark = 1.0 / (1.0 - s.bark_factor)
    diameter = [float(m.pipe[i]) ** (1.0 / s.pipe_exponent) for i in at]
    length = [float(m.length[i]) for i in at]
    tip = [tuple(float(c) for c in m.tip[i]) for i in at]
    sites = [bool(m.state[i] & TERMINAL) + bool(m.state[i] & LATERAL) for i in at]

    stem = stem_of(m, at)
    breast = [j for j in range(n) if m.serial[at[j]] == trees.breast_serial[row]]
    breast += [j for j in stem if tip[j][2] >= 1.3]
    reach = [0.0] * 8
    for j in range(n):
        if sites[j]:
            angle = math.atan2(tip[j][1], tip[j][0]) % (2 * math.pi)
            sector = min(int(angle / (math.pi / 4)), 7)
            reach[sector] = max(reach[sector], math.hypot(tip[j][0], tip[j][1]))
    corners = [
        (r * math.cos(k * math.pi / 4), r * math.sin(k * math.pi / 4)) for k, r in enumerate(reach)
    ]
    shoelace = sum(
        a[0] * b[1] - a[1] * b[0] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
    )

    volume = sold = along = 0.0
    for j in stem:
        section = math.pi / 4 * (diameter[j] * bark) ** 2
        volume += section * length[j]
        if diameter[j] * bark >= s.merchantable_top_m:
            sold += section * max(0.0, along + length[j] - max(along, s.stump_height_m))
        along += length[j]
    wood = sum(math.pi / 4 * d**2 * h for d, h in zip(diameter, length, strict=True))
    leaf_area = sum(sites) * s.leaf_area_m2
    top = tip[stem[-1]] if stem else (0.0, 0.0, 0.0)
    dbh = diameter[breast[0]] * bark if breast else math.nan
    light = sum(sites[j] * float(m.light[at[j]]) for j in range(n))
    return {
        "dbh_cm": 100 * dbh,
        "base_diameter_cm": 100 * diameter[0] * bark if n else 0.0,
        "height_m": max([0.0, *(t[2] for t in tip)]),
        "crown_base_m": min((tip[j][2] for j in range(n) if sites[j]), default=math.nan),
        "crown_radius_m": sum(reach) / 8,
        "crown_area_m2": shoelace / 2,
        "lean_deg": math.degrees(math.atan2(math.hypot(top[0], top[1]), top[2])),
        "basal_area_m2": math.pi / 4 * dbh**2 if breast else 0.0,
        "stem_volume_m3": volume,
        "merchantable_volume_m3": sold,
        "biomass_kg": wood * s.density_kg_m3 + leaf_area / s.sla_m2_kg,
        "leaf_area_m2": leaf_area,
        "light": light / sum(sites) / full_light if any(sites) else math.nan,
        "metamers": n,
        "buds": sum(sites),
        "breast_serial": int(m.serial[at[breast[0]]]) if breast else -1,
        "breast_metamer": breast[0] if breast else -1,
    }


def discs(m: Metamers, trees: Trees, heights: list[float], row: int) -> list[int]:
    """Find the metamers whose rings are told: last year's wood, or what reaches the height first;
    at last, the lowest of the stem that is as high as the lowest living site.
    """
    at = [int(trees.start[row]) + j for j in range(int(trees.size[row]))]
    stem = stem_of(m, at)
    z = [float(m.tip[i, 2]) for i in at]
    found = []
    for k, height in enumerate(heights):
        old = [j for j in stem if m.serial[at[j]] == trees.disc_serial[row, k]]
        found.append((old + [j for j in stem if z[j] >= height] + [-1])[0])
    sites = [z[j] for j in range(len(at)) if m.state[at[j]] & (TERMINAL | LATERAL)]
    above: list[int] = []
    for j in reversed(stem):
        if not sites or z[j] < min(sites):
            break
        above.append(j)
    return [*found, above[-1] if above else -1]
