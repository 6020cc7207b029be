"""A stand of bud-level trees that grow, shade, crowd, thicken, die and seed in one shared space.

Names are loaded when they are first used, so that `import forest` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from forest.ensemble.landscape import Landscape, landscape
    from forest.ensemble.sweep import Sweep, open_sweep, sweep
    from forest.errors import InputError
    from forest.record.run import Run, open_run
    from forest.scenario import Scenario
    from forest.simulation import simulate
    from forest.species import Species, load_species
    from forest.stand import Stand
    from forest.trees.skeleton import Skeleton

__version__ = version("forest-stand")

_HOMES = {
    "InputError": "forest.errors",
    "Landscape": "forest.ensemble.landscape",
    "Run": "forest.record.run",
    "Scenario": "forest.scenario",
    "Skeleton": "forest.trees.skeleton",
    "Species": "forest.species",
    "Stand": "forest.stand",
    "Sweep": "forest.ensemble.sweep",
    "landscape": "forest.ensemble.landscape",
    "load_species": "forest.species",
    "open_run": "forest.record.run",
    "open_sweep": "forest.ensemble.sweep",
    "simulate": "forest.simulation",
    "sweep": "forest.ensemble.sweep",
}

__all__ = [
    "InputError",
    "Landscape",
    "Run",
    "Scenario",
    "Skeleton",
    "Species",
    "Stand",
    "Sweep",
    "landscape",
    "load_species",
    "open_run",
    "open_sweep",
    "simulate",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'forest' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
