"""What the meshes of a whole stand cost, and its file."""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path
from typing import Any

from forest.surface.export.scene_file import write_scene
from forest.view.scenery import scene_of
from tests.benchmarks.stands import lay_tiles, load


def measure_scene(path: str, across: int) -> dict[str, Any]:
    """Time the scene of a stand of tiles at stand detail, and its glTF file.

    Returns
    -------
    dict
        Hectares, trees, shapes, triangles of the shapes and as they stand, megabytes of the file,
        seconds and seconds of the processor of both, and the peak of memory in GB.
    """
    stand = lay_tiles(load(Path(path)), across).restore()
    width, depth = stand.scenario.plot.size_m
    with tempfile.TemporaryDirectory() as folder:
        to = Path(folder) / "stand.glb"
        write_scene(scene_of(stand, detail="far"), to)  # compiles
        wall, busy = time.perf_counter(), time.process_time()
        scene = scene_of(stand)
        write_scene(scene, to, overwrite=True)
        wall, busy = time.perf_counter() - wall, time.process_time() - busy
        size = to.stat().st_size
    return {
        "hectares": width * depth / 1e4,
        "trees": len(scene.instances.model),
        "shapes": len(scene.shapes),
        "triangles": sum(scene.triangles),
        "standing_triangles": sum(scene.standing_triangles),
        "megabytes": size / 1e6,
        "seconds": wall,
        "cpu_s": busy,
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
    }
