"""Measure and print everything: `python -m tests.benchmarks [--quick] [--out FILE]`.

Each stand and run has a process of its own. The kernels must be compiled (`python -m forest.warm`);
only the cold start compiles them anew, in a folder of its own.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from tests.benchmarks import (
    bark,
    bark_maps,
    bending,
    costs,
    flow,
    frames,
    machine,
    parametric,
    report,
    runs,
    scenes,
    stands,
    surfaces,
    viewer,
)


class Extent(NamedTuple):
    """How much is measured."""

    across: tuple[int, ...]  # tiles along each edge of the stands, of about 40,000 metamers each
    rounds: tuple[int, ...]  # of each stand
    bending: tuple[int, int]  # tiles along each edge and rounds of the stand that bends
    run: tuple[str, ...]  # changes to the hectare
    frame_trees: int  # of the stand view
    scene_across: int  # tiles along each edge of the scene
    viewer_years: int  # of the hectare that is shown
    repeats: int  # of the paper's tree and of the warm start


FULL = Extent(
    across=(2, 5, 17),
    rounds=(9, 5, 3),
    bending=(5, 3),
    run=(),
    frame_trees=10_000,
    scene_across=8,
    viewer_years=25,
    repeats=3,
)
QUICK = Extent(
    across=(1, 3),
    rounds=(5, 3),
    bending=(3, 3),
    run=("plot.size_m=[24, 24]", "years=30"),
    frame_trees=2_000,
    scene_across=3,
    viewer_years=10,
    repeats=1,
)


def measure(extent: Extent) -> dict[str, Any]:
    """Measure everything and give it as a dict that JSON can hold."""
    result: dict[str, Any] = {"machine": machine.describe()}
    others = machine.Others()
    with tempfile.TemporaryDirectory() as folder:
        tile = str(Path(folder) / "tile.npz")
        _say("growing a tile", machine.alone, stands.keep_tile, tile)
        result["stands"] = [
            _say(f"{n} x {n} tiles", machine.alone, costs.measure_stand, tile, n, rounds)
            for n, rounds in zip(extent.across, extent.rounds, strict=True)
        ]
        result["scene"] = _say(
            "a scene", machine.alone, scenes.measure_scene, tile, extent.scene_across
        )
        _say("growing a tile that bends", machine.alone, stands.keep_tile, tile, "mechanics={}")
        result["bending"] = _say(
            "mechanics", machine.alone, bending.measure_bending, tile, *extent.bending
        )
    result["exponent"] = {
        threads: costs.exponent(result["stands"], threads)
        for threads in result["stands"][0]["threads"]
    }
    result["paper_tree"] = _say(
        "the paper's tree", machine.alone, runs.grow_paper_tree, extent.repeats
    )
    result["run"] = _say("a run", machine.alone, runs.run_hectare, extent.run)
    result["parametric"] = _say(
        "parametric trees", machine.alone, parametric.measure_parametric, extent.repeats
    )
    result["frames"] = _say(
        f"a view of {extent.frame_trees:,} trees",
        machine.alone,
        frames.measure_frames,
        extent.frame_trees,
        extent.repeats,
    )
    result["surfaces"] = _say("surfaces", machine.alone, surfaces.measure_surfaces, extent.repeats)
    result["bark_maps"] = _say("4K set", machine.alone, bark_maps.measure_maps, extent.repeats)
    result["bark"] = _say("fracture bark", machine.alone, bark.measure_bark, extent.repeats)
    result["flow"] = _say("bark flow", machine.alone, flow.measure_flow, extent.repeats)
    result["viewer"] = _say(
        "a hectare in the viewer", machine.alone, viewer.measure_viewer, extent.viewer_years
    )
    result["starts"] = _say("cold and warm start", runs.time_starts, extent.repeats)
    result["others_share"] = others.share()
    result["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
    return result


def _say(what: str, function: Callable[..., Any], *arguments: Any) -> Any:
    print(f"bench: {what} ... ", end="", flush=True, file=sys.stderr)
    start = time.perf_counter()
    found = function(*arguments)
    print(f"{time.perf_counter() - start:.1f} s", flush=True, file=sys.stderr)
    return found


def main() -> None:
    """Measure, print the table and write the JSON."""
    words = argparse.ArgumentParser(prog="python -m tests.benchmarks")
    words.add_argument("--quick", action="store_true", help="under two minutes")
    words.add_argument("--out", type=Path, default=Path("out/bench.json"))
    given = words.parse_args()
    result = measure(QUICK if given.quick else FULL)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps(result, indent=1))
    report.show(result)
    print(f"written to {given.out}")


if __name__ == "__main__":
    main()
