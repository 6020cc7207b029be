"""Compile the kernels ahead of time: `python -m forest.warm`.

A few years of a tiny stand in each kind of environment and mode call every kernel that a run
calls, so that the runs that follow, and test processes that start at once, find them compiled.
"""

from __future__ import annotations

import time
import warnings

import numpy as np

from forest.parametric import ParametricTree, grow
from forest.scenario import Scenario
from forest.stand import Stand
from forest.surface import Camera, Instances, Model, prepare, scene_shadow
from forest.surface.bark import Material, StripGeometry, grow_bark
from forest.surface.blend import CrossingWarning, blended
from forest.surface.detail import SEASONS

_YEARS = 3
_STAND = """
years = 10
plot = { size_m = [4, 4], boundary = "periodic" }
environment = { shadow = {}, canopy = {} }
planting = { kind = "random", density_ha = 2500 }
species = { generic_deciduous = {} }
"""
_BEND = "{kind='bend', year=2002, tree_id=1, metamer=1, to_m=[2, 2, 0.3]}"
_VARIANTS = {
    "light, costs": [],
    "light, costs, obstacle, open": [
        "plot.boundary=open",
        "growth.bud_fate=balance",
        "environment.shadow.direction=least_shadow",
        'obstacles=[{ kind = "box", min_m = [0, 0, 0], max_m = [1, 1, 2] }]',
    ],
    "paper, priority": ["mode=paper", "growth.bud_fate=priority", "environment={shadow={}}"],
    "paper, balance": ["mode=paper", "growth.bud_fate=balance", "environment={shadow={}}"],
    "paper, markers": ["mode=paper", "environment={markers={}}"],
    "rendered light, open": [
        "plot.boundary=open",
        "environment={rendered={response='flat_above_20'}}",
        'obstacles=[{ kind = "box", min_m = [0, 0, 0], max_m = [1, 1, 2] }]',
    ],
    "light, costs, mechanics": ["mechanics={wind_m_s=10, wind_growth=true}"],
    "light, costs, storm": ["wind={storms=[{year=2002, speed_m_s=20}], from_height_m=0.1}"],
    "light, costs, stability": ["mechanics={bending=false}"],
    "light, costs, seedlings": ["regeneration={seed_rain={generic_deciduous=50}}"],
    "light and markers": ["environment={shadow={}, canopy={}, markers={}}"],
    "bends": [f"acts=[{_BEND}]"],
    "bends, mechanics": ["mechanics={wind_m_s=10, wind_growth=true}", f"acts=[{_BEND}]"],
    "strokes": [
        "environment={shadow={}, canopy={}, markers={}}",
        "acts=[{kind='stroke', year=2001, points_m=[[1, 1, 0.1], [1, 1, 1]], radius_m=0.3, "
        "markers_m3=500, tree_id=1, metamer=0}]",
    ],
}


def _view(tree: ParametricTree) -> None:
    """Prepare a picture's frame of one tree and the ground beneath it."""
    grey = (0.5, 0.5, 0.5)
    foliage = dict.fromkeys(SEASONS, grey)
    model = Model.of(tree.skeleton(), tree.leaves, evergreen=False, bark=grey, foliage=foliage)
    one = Instances.of([0], [[0.0, 0.0, 0.0]], [1.0])
    sun = (0.0, -0.6, 0.8)
    shadows = scene_shadow([model], one, sun)
    shadows.shaded([[0.0, 0.0, 0.0]])
    prepare([model], one, Camera((0, -60, 2), (0, 0, 2)), sun=sun, shadows=shadows)


def _tear() -> None:
    """Grow a little bark, and tear it by hand."""
    girth = np.array([0.1, 0.11])[:, None] * np.ones(3)
    grow_bark(StripGeometry.column(3, 0.02), girth, Material(threshold=2.0)).trigger(1, 0.05)


def _skin(tree: ParametricTree) -> None:
    """Give a tree its blended surface, in cells that leave twigs to tubes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CrossingWarning)
        blended(tree.skeleton())


def main() -> None:
    """Grow the tiny stands and a shrub, look at it, and say how long each took."""
    stand = Scenario.from_toml(_STAND, where="forest.warm")
    for name, changes in _VARIANTS.items():
        start = time.perf_counter()
        print(f"kernels: {name} ... ", end="", flush=True)
        grown = Stand(stand.with_overrides(changes))
        for _ in range(_YEARS):
            grown.step()
        print(f"{time.perf_counter() - start:.1f} s", flush=True)
    start = time.perf_counter()
    print("kernels: parametric trees, views, surfaces ... ", end="", flush=True)
    tree = grow("lilac")
    tree.swayed(1.0, 1.0)
    _view(tree)
    _skin(tree)
    print(f"{time.perf_counter() - start:.1f} s", flush=True)
    start = time.perf_counter()
    print("kernels: bark ... ", end="", flush=True)
    _tear()
    print(f"{time.perf_counter() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
