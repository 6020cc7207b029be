"""What mechanics costs a stand's year: its parts, its passes, and a year in which little changed.

Rendered light is timed on the same stand.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from forest._threads import using_threads
from forest.mechanics import year
from forest.mechanics.year import Mechanics
from tests.benchmarks.costs import thread_counts
from tests.benchmarks.stands import (
    ClockedStand,
    Saved,
    count_metamers,
    fingerprint,
    lay_tiles,
    load,
)

#: Part of a year's mechanics -> the functions of `forest.mechanics.year` that do it.
PARTS = {
    "frames": ("frame_new",),
    "wood": ("lay_wood",),
    "loads": ("hang", "bury_sites"),
    "settle": ("settle",),
}
_TIMED_YEARS = 2
_PICTURES = 4


class Parts:
    """Wall and processor seconds of the parts of mechanics so far."""

    def __init__(self) -> None:
        self.wall = dict.fromkeys((*PARTS, "stability"), 0.0)
        self.cpu = dict(self.wall)

    def around(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Give the function that also notes its time."""

        def timed(*arguments: Any, **options: Any) -> Any:
            wall, cpu = time.perf_counter(), time.process_time()
            result = function(*arguments, **options)
            self.cpu[part] += time.process_time() - cpu
            self.wall[part] += time.perf_counter() - wall
            return result

        return timed


@contextmanager
def _timed_parts() -> Iterator[Parts]:
    parts = Parts()
    with ExitStack() as stack:
        for part, names in PARTS.items():
            for name in names:
                timed = parts.around(part, getattr(year, name))
                stack.enter_context(patch.object(year, name, timed))
        timed = parts.around("stability", Mechanics.stability)
        stack.enter_context(patch.object(Mechanics, "stability", timed))
        yield parts


def measure_bending(tile_path: str, across: int, rounds: int) -> dict[str, Any]:
    """Time the year of a tiled stand that bends, and of the same stand without mechanics.

    Parameters
    ----------
    tile_path : str
        A tile that grew with mechanics.
    across : int
        Tiles along each edge.
    rounds : int
        Rounds, of which medians are taken.
    """
    saved = lay_tiles(load(Path(tile_path)), across)
    stiff = saved._replace(scenario=saved.scenario.model_copy(update={"mechanics": None}))
    pictures = f"environment={{rendered={{directions={_PICTURES}}}}}"
    rendered = saved._replace(scenario=saved.scenario.with_overrides([pictures]))
    years: dict[int, list[dict[str, Any]]] = {threads: [] for threads in thread_counts()}
    ends = set()
    for _ in range(rounds):
        for threads in thread_counts():
            with using_threads(threads):
                stand, timed = _grow(saved)
                timed["settled_again"] = _settle_again(stand)
                ends.add(fingerprint(stand))
                del stand
                timed["stiff_year"] = _year_without(stiff)
                timed["picture"] = _picture(rendered)
            years[threads].append(timed)
    first = years[thread_counts()[0]][0]
    return {
        "metamers": first["metamers"],
        "passes": first["passes"],
        "most_passes": first["most_passes"],
        "same_bits": len(ends) == 1,
        "threads": {str(threads): _medians(timed) for threads, timed in years.items()},
    }


def _grow(saved: Saved) -> tuple[ClockedStand, dict[str, Any]]:
    """Restore the stand, grow it, and give the times of the timed years in ns per metamer-year."""
    stand = saved.restore()
    stand.step()
    stand.forget_times()
    metamer_years = 0
    passes = []
    with _timed_parts() as parts:
        for _ in range(_TIMED_YEARS):
            stand.step()
            metamer_years += count_metamers(stand)[0]
            assert stand.mechanics is not None
            assert stand.mechanics.settled is not None
            passes.append(stand.mechanics.settled.passes)
    per_metamer = 1e9 / metamer_years
    return stand, {
        "metamers": count_metamers(stand)[0],
        "passes": float(np.mean(np.concatenate(passes))),
        "most_passes": int(np.max(np.concatenate(passes))),
        "wall": {part: seconds * per_metamer for part, seconds in parts.wall.items()},
        "cpu": {part: seconds * per_metamer for part, seconds in parts.cpu.items()},
        "bend": stand.seconds["bend"] * per_metamer,
        "bend_cpu": stand.cpu_seconds["bend"] * per_metamer,
        "year": sum(stand.seconds.values()) * per_metamer,
    }


def _settle_again(stand: ClockedStand) -> float:
    """Time a settling of trees that have just settled; ns per metamer."""
    mechanics = stand.mechanics
    assert mechanics is not None
    start = time.perf_counter()
    mechanics.settle(stand.arena, stand.rows)
    return 1e9 * (time.perf_counter() - start) / count_metamers(stand)[0]


def _year_without(stiff: Saved) -> float:
    """Time the same years without mechanics; ns per metamer-year."""
    stand = stiff.restore()
    stand.step()
    stand.forget_times()
    metamer_years = 0
    for _ in range(_TIMED_YEARS):
        stand.step()
        metamer_years += count_metamers(stand)[0]
    return 1e9 * sum(stand.seconds.values()) / metamer_years


def _picture(rendered: Saved) -> float:
    """Time an exposure to rendered light; ns per metamer and picture."""
    stand = rendered.restore()
    voxel_m = stand.surroundings.voxel_m
    for axis, place in enumerate((stand.rows.x, stand.rows.y)):
        voxel = np.floor(place / voxel_m)
        stand.rows.base_voxel[:, axis] = voxel
        stand.rows.base_offset[:, axis] = place - voxel * voxel_m
    for _ in range(2):  # the first one touches the memory
        start = time.perf_counter()
        stand.surroundings.expose(stand.arena.metamers, stand.rows, stand.steps + 1)
        seconds = time.perf_counter() - start
    return 1e9 * seconds / (_PICTURES * count_metamers(stand)[0])


def _medians(timed: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians over the rounds; the ratio is that of neighbouring years."""

    def median(key: str) -> float:
        return statistics.median(t[key] for t in timed)

    def parts(clock: str) -> dict[str, float]:
        return {part: statistics.median(t[clock][part] for t in timed) for part in timed[0][clock]}

    return {
        "wall_ns": parts("wall"),
        "cpu_ns": parts("cpu"),
        "bend_ns": median("bend"),
        "bend_cpu_ns": median("bend_cpu"),
        "year_ns": median("year"),
        "again_ns": median("settled_again"),
        "picture_ns": median("picture"),
        "year_ratio": statistics.median(t["year"] / t["stiff_year"] for t in timed),
    }
