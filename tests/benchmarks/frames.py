"""What one picture's frame of many parametric trees costs, and the shadow maps before it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from forest._threads import most_threads, using_threads
from forest.parametric import grow
from forest.surface import Camera, Instances, Model, own_shadows, prepare, scene_shadow
from forest.surface.detail import SEASONS

_MODELS = 8
_PLACE_M2 = 100.0  # of a tree
_SUN = (-0.36, -0.48, 0.80)
_FOLIAGE = dict.fromkeys(SEASONS, (0.22, 0.42, 0.14))


def aspens(count: int, across_m: float) -> tuple[list[Model], Instances]:
    """Scatter aspens of eight kinds over a square, with scales from 0.8 to 1.2."""
    trees = [grow("quaking_aspen", seed) for seed in range(_MODELS)]
    models = [
        Model.of(
            tree.skeleton(), tree.leaves, evergreen=False, bark=(0.6, 0.6, 0.5), foliage=_FOLIAGE
        )
        for tree in trees
    ]
    rng = np.random.default_rng(1)
    place = np.column_stack((rng.uniform(0.0, across_m, (count, 2)), np.zeros(count)))
    scale = rng.uniform(0.8, 1.2, count)
    return models, Instances.of(rng.integers(0, _MODELS, count), place, scale)


def measure_frames(count: int, repeats: int) -> dict[str, Any]:
    """Time the frame of a stand as one sees it who stands at its edge.

    Returns
    -------
    dict
        Trees and how many are seen, primitives, seconds of the models' lists and own shadows and
        of the scene's map, and in `threads`, for each number of them, seconds of a frame with and
        without shade, of the processors for it, and of a million primitives.
    """
    across_m = float(np.sqrt(count * _PLACE_M2))
    models, stand = aspens(count, across_m)
    middle = 0.5 * across_m
    camera = Camera((middle, -5.0, 1.7), (middle, middle, 12.0), 1600, 1000, 60.0)
    frame = prepare(models, stand, camera, sun=_SUN)  # makes the lists and compiles
    own_shadows(models[:1], _SUN)
    fresh = [Model(m.description, m.evergreen, m.bark, m.foliage) for m in models]
    found: dict[str, Any] = {
        "trees": count,
        "seen": len(frame.seen),
        "primitives": len(frame.triangles) + len(frame.lines) + len(frame.points),
        "triangles": len(frame.triangles),
        "lists_s": _time(lambda: [(model.lists, model.sphere) for model in fresh], 1),
        "own_shadows_s": _time(lambda: own_shadows(models, _SUN), repeats),
        "threads": {},
    }
    own = own_shadows(models, _SUN)
    shadows = scene_shadow(models, stand, _SUN, own=own)
    found["scene_shadow_s"] = _time(lambda: scene_shadow(models, stand, _SUN, own=own), repeats)
    del frame
    prepare(models, stand, camera, sun=_SUN, shadows=shadows)
    for threads in sorted({1, most_threads()}):
        with using_threads(threads):
            plain = _time(lambda: prepare(models, stand, camera, sun=_SUN), repeats)
            shade = _time(
                lambda: prepare(models, stand, camera, sun=_SUN, shadows=shadows), repeats
            )
            busy = time.process_time()
            prepare(models, stand, camera, sun=_SUN, shadows=shadows)
            busy = time.process_time() - busy
        found["threads"][threads] = {
            "plain_s": plain,
            "shaded_s": shade,
            "shaded_cpu_s": busy,
            "million_s": 1e6 / found["primitives"] * shade,
            "million_cpu_s": 1e6 / found["primitives"] * busy,
        }
    return found


def _time(work: Callable[[], object], repeats: int) -> float:
    """Give the least time: what others do on the machine can only add to it."""
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        spent.append(time.perf_counter() - start)
    return min(spent)
