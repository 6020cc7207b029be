"""What the trials share: many plots of one scenario, several seeds each, over processes."""

from __future__ import annotations

import argparse
from collections.abc import Mapping

import forest
from scenarios.common import command_line


def trial_line(document: str | None, name: str) -> argparse.ArgumentParser:
    """Give the parser of a trial: that of all scripts; years, plot and replicates."""
    parser = command_line(document, name)
    parser.add_argument("--years", type=int, help="years to grow; default: the scenario's")
    parser.add_argument("--plot", type=float, help="width of the plots, m; default: the scenario's")
    parser.add_argument("--replicates", type=int, default=3, help="seeds of each plot; default: 3")
    return parser


def as_asked(base: forest.Scenario, asked: argparse.Namespace) -> forest.Scenario:
    """Change a trial's scenario as the command line says; sample trees are those of its end."""
    given = {"years": asked.years, "seed": asked.seed}
    changes = [f"{key}={value}" for key, value in given.items() if value is not None]
    if asked.plot is not None:
        changes.append(f"plot.size_m=[{asked.plot}, {asked.plot}]")
    if asked.years is not None and base.output.sample_trees.at_year is not None:
        changes.append(f"output.sample_trees.at_year={base.start_year + asked.years - 1}")
    return base.with_overrides(changes)


def grow_all(scenarios: Mapping[str, forest.Scenario], asked: argparse.Namespace) -> forest.Sweep:
    """Grow scenarios with `asked.replicates` seeds each into `asked.out`, a process per thread.

    Files of the same scenarios that are there already are kept.

    Raises
    ------
    InputError
        If one could not be grown, with the first one's reason.
    """
    runs = forest.sweep(
        scenarios,
        replicates=asked.replicates,
        out=asked.out / "runs",
        workers=asked.threads,
        resume=True,
        progress=True,
    )
    for _, row in runs.failed.iterrows():
        raise forest.InputError(str(row["error"]), where=str(row["run"]))
    return runs
