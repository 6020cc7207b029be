"""Whole runs: the paper's tree, a stand with all its writing, and the start of the program."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

from forest import simulation
from forest.record.writer import RunWriter
from forest.scenario import Scenario
from forest.stand import Stand
from tests.benchmarks import machine
from tests.benchmarks.stands import SCENARIOS, count_metamers

#: Table 1 of Palubicki et al. 2009: their largest tree, and its steps.
PAPER_INTERNODES = 700_000
PAPER_STEPS = 106
_WARM_STEPS = 8


def grow_paper_tree(rounds: int) -> dict[str, Any]:
    """Grow one tree in paper mode to 700,000 internodes; median time, with kernels loaded."""
    scenario = Scenario.load(SCENARIOS / "paper_tree.toml")
    warm = Stand(scenario)
    for _ in range(_WARM_STEPS):
        warm.step()
    seconds = []
    cpu = []
    for _ in range(rounds):
        start, cpu_start = time.perf_counter(), time.process_time()
        tree = Stand(scenario)
        internodes = 0
        while internodes < PAPER_INTERNODES and tree.steps < PAPER_STEPS:
            tree.step()
            internodes = int(tree.rows.size.sum())
        seconds.append(time.perf_counter() - start)
        cpu.append(time.process_time() - cpu_start)
    return {
        "internodes": internodes,
        "steps": tree.steps,
        "seconds": statistics.median(seconds),
        "cpu_seconds": statistics.median(cpu),
        "peak_gb": machine.peak_bytes() / 1e9,
    }


class _Clock:
    """Sums the time spent in functions."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        def timed(*arguments: Any, **options: Any) -> Any:
            start = time.perf_counter()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds += time.perf_counter() - start

        return timed


class _Census:
    """Counts a run's metamers, year by year."""

    def __init__(self) -> None:
        self.metamer_years = 0

    def say(self, message: str) -> None:
        """Take no notice."""

    def begin(self, years: int, done: int) -> None:
        """Take no notice."""

    def year_done(self, stand: Stand) -> None:
        """Count the metamers of a year."""
        self.metamer_years += int(stand.rows.size.sum())
        self.stand = stand

    def end(self) -> None:
        """Take no notice."""


def run_hectare(overrides: Sequence[str]) -> dict[str, Any]:
    """Run the hectare, or a part of it, as a user would; tell what share of the time is writing.

    Writing is appending each year to the tables, the checkpoints, and closing the file.
    """
    scenario = Scenario.load(SCENARIOS / "hectare.toml").with_overrides(overrides)
    writing = _Clock()
    census = _Census()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run.h5"
        with (
            patch.object(RunWriter, "append_year", writing.around(RunWriter.append_year)),
            patch.object(RunWriter, "finish", writing.around(RunWriter.finish)),
            patch.object(simulation, "_checkpoint", writing.around(simulation._checkpoint)),
        ):
            start, cpu_start = time.perf_counter(), time.process_time()
            simulation.simulate(scenario, out, progress=census).close()
            seconds = time.perf_counter() - start
            cpu = time.process_time() - cpu_start
        size = out.stat().st_size
    metamers, sites = count_metamers(census.stand)
    phases = sum(census.stand.seconds.values())
    return {
        "plot_m": scenario.plot.size_m[0],
        "years": scenario.years,
        "trees": len(census.stand.rows.tree_id),
        "metamers": metamers,
        "metamers_with_site": sites,
        "metamer_years": census.metamer_years,
        "seconds": seconds,
        "cpu_seconds": cpu,
        "wall_ns": 1e9 * seconds / census.metamer_years,
        "writing_share": writing.seconds / seconds,
        "phase_shares": {name: s / phases for name, s in census.stand.seconds.items()},
        "peak_gb": machine.peak_bytes() / 1e9,
        "file_mb": size / 1e6,
    }


def time_starts(warm_rounds: int) -> dict[str, float]:
    """Time the program from its start to the end of the demo's first year, and its help.

    Cold is with an empty cache of compiled kernels, warm with that which the cold start left.
    """
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "FOREST_CACHE": str(Path(folder) / "cache")}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # nobody parses the sources at each start
        out = str(Path(folder) / "run.h5")
        scenario = str(SCENARIOS / "saxony_spruce.toml")
        first_year = ["run", scenario, "--years", "1", "--out", out, "--force"]

        def start(words: Sequence[str]) -> float:
            program = "from forest.cli import main; main()"
            begun = time.perf_counter()
            subprocess.run(
                [sys.executable, "-c", program, *words],
                env=environment,
                check=True,
                capture_output=True,
            )
            return time.perf_counter() - begun

        cpu_before = _cpu_of_children()
        cold = start(first_year)
        return {
            "cold_s": cold,
            "cold_cpu_s": _cpu_of_children() - cpu_before,
            "warm_s": statistics.median(start(first_year) for _ in range(warm_rounds)),
            "help_s": statistics.median(start(["--help"]) for _ in range(warm_rounds)),
        }


def _cpu_of_children() -> float:
    times = os.times()
    return times.children_user + times.children_system
