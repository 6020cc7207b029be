"""What a set of maps for a trunk costs: textures, maps and files."""

from __future__ import annotations

import statistics
import tempfile
import time
from typing import Any

import numpy as np

from forest.surface.bark import Bark, StripGeometry, grow_bark, shrinking
from forest.surface.bark.maps import bark_maps
from forest.surface.bark.presets import Preset

_STRIPS, _STRIP_M = 300, 0.02


def trunk(preset: Preset) -> Bark:
    """Bark of six metres of an oak's trunk."""
    girth = np.linspace(1.6, 1.0, _STRIPS)
    table = shrinking(girth, preset.remains(girth))
    return grow_bark(StripGeometry.column(_STRIPS, _STRIP_M), table, preset.material(1.3), 3)


def measure_maps(repeats: int, size: int = 4096) -> dict[str, Any]:
    """Time a set of maps: wall and CPU seconds to make it from the bark, and to write it."""
    preset = Preset.load("oak")
    bark = trunk(preset)
    bark_maps(bark, preset, 64)
    times: dict[str, list[float]] = {"maps_s": [], "maps_cpu_s": [], "save_s": [], "save_cpu_s": []}
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        maps = bark_maps(bark, preset, size)
        times["maps_s"].append(time.perf_counter() - wall)
        times["maps_cpu_s"].append(time.process_time() - cpu)
        wall, cpu = time.perf_counter(), time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            maps.save(folder)
        times["save_s"].append(time.perf_counter() - wall)
        times["save_cpu_s"].append(time.process_time() - cpu)
    return {"size": size, **{key: statistics.median(found) for key, found in times.items()}}
