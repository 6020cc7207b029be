"""Compile the kernels ahead of time: `python -m forest.warm`.

A few years of a tiny stand in each kind of environment and mode call every kernel that a run
calls, so that the runs that follow, and test processes that start at once, find them compiled.
"""

from __future__ import annotations

import time

from forest.parametric import grow
from forest.scenario import Scenario
from forest.stand import Stand

_YEARS = 3
_STAND = """
years = 10
plot = { size_m = [4, 4], boundary = "periodic" }
environment = { shadow = {}, canopy = {} }
planting = { kind = "random", density_ha = 2500 }
species = { generic_deciduous = {} }
"""
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
}


def main() -> None:
    """Grow the tiny stands and a shrub, and say how long each took."""
    stand = Scenario.from_toml(_STAND, where="forest.warm")
    for name, changes in _VARIANTS.items():
        start = time.perf_counter()
        print(f"kernels: {name} ... ", end="", flush=True)
        grown = Stand(stand.with_overrides(changes))
        for _ in range(_YEARS):
            grown.step()
        print(f"{time.perf_counter() - start:.1f} s", flush=True)
    start = time.perf_counter()
    print("kernels: parametric trees ... ", end="", flush=True)
    grow("lilac").swayed(1.0, 1.0)
    print(f"{time.perf_counter() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
