"""Trees that bend beside what stands around them: an obstacle, a neighbour, the wind at an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.edge_trees import compare, grow, scenario
from forest.environment.obstacles import inside
from forest.stand import Stand
from forest.trees.metamers import LATERAL, TERMINAL
from tests.fixed import fixed

ABOVE_A_BOX = """
years = 9
plot = { size_m = [6, 6], boundary = "open" }
environment = { shadow = {} }
mechanics = { righting = "none" }
planting = { kind = "explicit", trees = [{ x_m = 2, y_m = 3, lean_deg = 30 }] }
[species.fagus_sylvatica.mechanics]
modulus_juvenile_gpa = 2
modulus_mature_gpa = 2
sag_limit_rad = 10
fruit_mass_kg = 0.003
[[obstacles]]
kind = "box"
min_m = [2.4, 0, 0]
max_m = [6, 6, 0.4]
"""

TWO_TREES = """
years = 13
plot = { size_m = [12, 12], boundary = "open" }
environment = { shadow = {}, canopy = {} }
mechanics = {}
species = { fagus_sylvatica = {} }
planting = { kind = "explicit", trees = [{ x_m = 5.2, y_m = 6 }, { x_m = 6.8, y_m = 6 }] }
"""


def _leafy(stand: Stand, row: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Places of a tree's metamers relative to its base, and which of them bear leaves."""
    m, start, size = stand.arena.metamers, int(stand.rows.start[row]), int(stand.rows.size[row])
    here = slice(start, start + size)
    return m.tip[here], (m.state[here] & (LATERAL | TERMINAL)) != 0


def test_what_bends_into_an_obstacle_dies() -> None:
    """Shoots stop before the box; what comes to lie in it has sunk there, and bears no leaves."""
    stand = Stand(fixed(ABOVE_A_BOX))
    around = stand.surroundings
    sunk = 0
    for _ in range(9):
        stand.step()
        tip, leafy = _leafy(stand, 0)
        held = np.array([inside(around.solid, stand.rows, 0, x, around.voxel_m) for x in tip])
        sunk += int(held.sum())
        assert not np.any(held & leafy)
    assert sunk > 0


def test_neighbours_show_in_crowns() -> None:
    """The leaves of two trees that stand close and bend lie away from the other."""
    away = []
    for seed in range(3):
        stand = Stand(fixed(TWO_TREES, f"seed={seed}"))
        for _ in range(13):
            stand.step()
        for row, side in ((0, -1.0), (1, 1.0)):
            tip, leafy = _leafy(stand, row)
            away.append(side * float(tip[leafy, 0].mean()))
    assert np.mean(away) > 0.05


def test_edge_trees_that_bend_are_thick_and_short() -> None:
    """Wind feeds back on growth where trees bend, too."""
    bend = ["mechanics.bending=true"]
    found, plain = (
        compare(grow(scenario("pinus_sylvestris", years=14, wind_growth=wind).with_overrides(bend)))
        for wind in (True, False)
    )
    assert found.slenderness["edge"] < 0.95 * plain.slenderness["edge"]
    assert found.slenderness["edge"] < found.slenderness["inside"]
