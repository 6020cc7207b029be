"""Published critical winds of Norway spruce, at the edge of a stand and within it.

Gardiner et al. 2000, HWIND and GALES: mean wind at the canopy's top at which trees break or
overturn, far within the stand and at a fresh edge behind an open gap of ten tree heights. Crowns
are those of ForestGALES' regressions for the species on dbh and height.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from forest.mechanics.fetch import expose, lay_ways
from forest.mechanics.momentum import LAYERS, Crowns, canopies, layer_of
from forest.mechanics.overthrow import critical_speeds
from forest.mechanics.shelter import Plot
from forest.mechanics.stems import Stem
from forest.species import load_species

SPRUCE = load_species("picea_abies")
LEAF_AREA_INDEX = 7.0
LEAF_MASS_KG_M2 = 0.4  # fresh needles and twigs per area of needles


class Spruces(NamedTuple):
    """A stand of equal trees in rows, and its critical winds, m/s."""

    height_m: float
    dbh_m: float
    per_ha: float
    inside: tuple[float, float]  # breaks, uproots
    edge: tuple[float, float]


STANDS = [
    Spruces(20.0, 0.20, 1890.0, (20.4, 22.4), (9.6, 10.6)),
    Spruces(25.0, 0.32, 816.0, (26.1, 24.5), (13.7, 12.8)),
]


def _tree(of: Spruces) -> tuple[Stem, np.ndarray, np.ndarray]:
    """A stem of 100 stations that tapers as r ~ x^0.6, its tips, and the crown that it shows."""
    n = 100
    length = of.height_m / n
    top = (np.arange(n) + 1.0) * length
    middle = top - 0.5 * length
    wood = of.dbh_m * (1.0 - SPRUCE.mensuration.bark_factor)
    radius = 0.5 * wood * ((of.height_m - middle) / (of.height_m - 1.3)) ** 0.6
    depth = 0.4206 + 0.4368 * of.height_m
    width = 0.5824 + 11.5 * of.dbh_m
    section = width * length * np.clip((of.height_m - middle) / depth, 0.0, 1.0)
    section[middle < of.height_m - depth] = 0.0  # a triangle
    leaves = LEAF_AREA_INDEX * 1e4 / of.per_ha * section / section.sum()
    shown = section * (1.0 - np.exp(-0.5 * leaves / np.maximum(section, 1e-9)))
    stem = Stem(
        np.arange(n, dtype=np.int32),
        np.full(n, length),
        radius,
        1e9 * SPRUCE.mechanics.modulus_mature_gpa * 0.25 * np.pi * radius**4,
        SPRUCE.mechanics.green_density_kg_m3 * np.pi * radius**2 * length,
        LEAF_MASS_KG_M2 * leaves,
        np.zeros(n),
        np.zeros(n),
        leaves,
        middle,
    )
    tip = np.zeros((n, 3), np.float32)
    tip[:, 2] = top
    return stem, tip, shown


def _critical(of: Spruces, tree: int, *, periodic: bool) -> np.ndarray:
    """Critical winds of a tree in the middle row: its number from the windward side."""
    spacing = 100.0 / np.sqrt(of.per_ha)
    n = int(12.0 * of.height_m / spacing)
    place = (np.arange(n) + 0.5) * spacing
    x, y = (a.ravel() for a in np.meshgrid(place, place))
    ways = lay_ways(x, y, of.height_m, 0.0, Plot(n * spacing, n * spacing, periodic))
    found = expose(np.full(n * n, of.height_m), np.ones(n * n, np.bool_), ways)
    stem, tip, shown = _tree(of)
    scratch = np.zeros((5, len(shown) + 1))
    scratch[0, :-1] = shown
    drag, thick = np.zeros((n * n, LAYERS)), of.height_m / LAYERS
    for area, height in zip(shown, stem.leaf_height, strict=True):
        drag[:, layer_of(height, thick)] += SPRUCE.mechanics.drag_coefficient * area
    density = canopies(np.ones(n * n, np.bool_), Crowns(thick, drag, drag), ways)
    row = n // 2 * n + tree
    exposed = (found.edge[row], found.gusts[row])
    wind = (1.0, 0.0, of.height_m, thick, density[row], exposed)
    return np.array(
        critical_speeds(
            stem,
            tip,
            scratch,
            np.zeros((3, LAYERS)),
            wind,
            SPRUCE.mechanics.drag_coefficient,
            1e6 * SPRUCE.mechanics.rupture_mpa,
            SPRUCE.anchorage.turning_moment_nm_kg,
        )
    )


@pytest.mark.parametrize("of", STANDS, ids=["20 m", "25 m"])
def test_critical_winds_of_spruce(of: Spruces) -> None:
    inside = _critical(of, 5, periodic=True)
    edge = _critical(of, 0, periodic=False)
    np.testing.assert_allclose(inside, of.inside, rtol=0.12)
    np.testing.assert_allclose(edge, of.edge, rtol=0.12)
    assert ((edge / inside > 0.4) & (edge / inside < 0.6)).all()


def test_slender_trees_break_and_stocky_ones_overturn() -> None:
    slender = _critical(STANDS[0], 5, periodic=True)
    stocky = _critical(STANDS[1], 5, periodic=True)
    assert slender[0] < slender[1]
    assert stocky[1] < stocky[0]


def test_an_edge_matters_for_a_few_tree_heights() -> None:
    """Damage concentrates in the first 100 m: beyond five heights the stand is as its inside."""
    of = STANDS[0]
    spacing = 100.0 / np.sqrt(of.per_ha)
    trees = [int(heights * of.height_m / spacing) for heights in (0.0, 0.5, 1.0, 2.0, 5.0)]
    breaks = [_critical(of, tree, periodic=False)[0] for tree in trees]
    assert (np.diff(breaks) > 0.0).all()
    assert breaks[-1] == pytest.approx(_critical(of, 5, periodic=True)[0], rel=0.01)
