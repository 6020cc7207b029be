"""What a year of a stand costs: by phase, on one thread and on two, and in memory."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from forest._threads import most_threads, using_threads
from tests.benchmarks import machine
from tests.benchmarks.stands import (
    ClockedStand,
    Saved,
    count_metamers,
    fingerprint,
    lay_tiles,
    load,
)
from tests.benchmarks.touching import PHASES, near_voxels, touch_seconds

_TIMED_YEARS = 2


def thread_counts() -> list[int]:
    """One thread and two, where there are two."""
    return [1, 2] if most_threads() > 1 else [1]


def measure_stand(tile_path: str, across: int, rounds: int) -> dict[str, Any]:
    """Time the year of a tiled stand.

    Each round restores the stand and grows it with one thread, then again with two: one year to
    touch the memory, then the years that are timed. So both do the same work, in turns, and
    must end in the same bits.

    Parameters
    ----------
    tile_path : str
        The tile, as `stands.save` wrote it.
    across : int
        Tiles along each edge.
    rounds : int
        Rounds, of which medians are taken.
    """
    tile = load(Path(tile_path))
    tile.restore().step()  # load the kernels before memory is measured
    bandwidth = {threads: machine.copy_bandwidth(threads) for threads in thread_counts()}
    saved = lay_tiles(tile, across)
    result = _describe(saved)
    years: dict[int, list[dict[str, Any]]] = {threads: [] for threads in thread_counts()}
    ends = set()
    for _ in range(rounds):
        for threads in thread_counts():
            with using_threads(threads):
                stand, timed = _grow(saved)
            years[threads].append(timed)
            ends.add(fingerprint(stand))
            del stand
    result["same_bits"] = len(ends) == 1
    result["memory"] = years[thread_counts()[-1]][-1]["memory"]
    result["threads"] = {
        str(threads): _medians(timed, bandwidth[threads]) for threads, timed in years.items()
    }
    if len(years) > 1:
        result["gain"] = _gains(years)
    return result


def _describe(saved: Saved) -> dict[str, Any]:
    stand = saved.restore()
    metamers, sites = count_metamers(stand)
    return {
        "plot_m": saved.scenario.plot.size_m[0],
        "trees": len(stand.rows.tree_id),
        "metamers": metamers,
        "metamers_with_site": sites,
    }


def _grow(saved: Saved) -> tuple[ClockedStand, dict[str, Any]]:
    """Restore the stand, grow it, and give the times and the memory of the timed years."""
    before = machine.resident_bytes()
    stand = saved.restore()
    stand.step()
    stand.forget_times()
    machine.forget_peak()
    metamer_years = site_years = 0
    for _ in range(_TIMED_YEARS):
        stand.step()
        metamers, sites = count_metamers(stand)
        metamer_years += metamers
        site_years += sites
    timed = {
        "metamer_years": metamer_years,
        "site_years": site_years,
        "voxel_years": near_voxels(stand) * _TIMED_YEARS,
        "wall": dict(stand.seconds),
        "cpu": dict(stand.cpu_seconds),
        "memory": _memory(stand, before, metamers),
    }
    return stand, timed


def _memory(stand: ClockedStand, before: int, metamers: int) -> dict[str, float]:
    """Bytes per metamer: what the arena reserves, and what the process grew by."""
    arena = sum(field.nbytes for field in stand.arena.metamers)
    extents = arena / stand.arena.capacity * stand.arena.used
    return {
        "arena_bytes": arena / metamers,
        "extents_bytes": extents / metamers,
        "process_bytes": (machine.resident_bytes() - before) / metamers,
        "peak_bytes": (machine.peak_bytes() - before) / metamers,
        "process_peak_gb": machine.peak_bytes() / 1e9,
    }


def _medians(timed: Sequence[dict[str, Any]], bandwidth: float) -> dict[str, Any]:
    """Medians over the rounds: ns per metamer-year of each phase and of the year."""
    first = timed[0]
    per_metamer = 1e9 / first["metamer_years"]
    phases = {}
    for phase in first["wall"]:
        wall = statistics.median(t["wall"][phase] for t in timed)
        entry = {
            "wall_ns": wall * per_metamer,
            "cpu_ns": statistics.median(t["cpu"][phase] for t in timed) * per_metamer,
        }
        if phase in PHASES:
            entry["times_touching"] = wall / touch_seconds(
                phase, first["metamer_years"], first["voxel_years"], bandwidth
            )
        phases[phase] = entry
    wall = statistics.median(sum(t["wall"].values()) for t in timed)
    cpu = statistics.median(sum(t["cpu"].values()) for t in timed)
    return {
        "bandwidth_gb_s": bandwidth / 1e9,
        "phases": phases,
        "year": {
            "seconds": wall / _TIMED_YEARS,
            "wall_ns": wall * per_metamer,
            "cpu_ns": cpu * per_metamer,
            "wall_ns_per_site_metamer": 1e9 * wall / first["site_years"],
        },
    }


def _gains(years: dict[int, list[dict[str, Any]]]) -> dict[str, float]:
    """Time on one thread over that on two, medians of neighbouring runs."""
    pairs = list(zip(years[1], years[2], strict=True))
    gains = {
        phase: statistics.median(one["wall"][phase] / two["wall"][phase] for one, two in pairs)
        for phase in pairs[0][0]["wall"]
    }
    gains["year"] = statistics.median(
        sum(one["wall"].values()) / sum(two["wall"].values()) for one, two in pairs
    )
    return gains


def exponent(stands: Sequence[dict[str, Any]], threads: str) -> float:
    """Slope of log(time of a year) over log(metamers), on so many threads."""
    metamers = [stand["metamers"] for stand in stands]
    seconds = [stand["threads"][threads]["year"]["wall_ns"] * stand["metamers"] for stand in stands]
    return float(np.polyfit(np.log(metamers), np.log(seconds), 1)[0])
