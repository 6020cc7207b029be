"""A stand of ten young trees that grows in moments, and exact comparison of what came of it."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pandas.testing import assert_frame_equal

from forest.cli import main
from forest.record.run import Run
from forest.scenario import Scenario
from forest.stand import Stand
from forest.yearbook import YearRecord

YEARS = 8

TOML = f"""
title = "ten young trees"
years = {YEARS}
start_year = 2001
plot = {{ size_m = [10, 10], boundary = "periodic" }}
climate = {{ noise_sd = 0.15 }}
environment = {{ shadow = {{}}, canopy = {{}} }}
species = {{ pinus_sylvestris = {{}}, fagus_sylvatica = {{}} }}
planting = {{ kind = "random", density_ha = 1000 }}
output = {{ checkpoint_every_years = 3, sample_trees = {{ ids = [1, 4], dbh_quantiles = [0.5] }} }}
"""


def tiny(*overrides: str) -> Scenario:
    """Give the scenario, changed as `--set` would."""
    return Scenario.from_toml(TOML).with_overrides(overrides)


def write_tiny(folder: Path) -> Path:
    """Write the scenario's file."""
    path = folder / "tiny.toml"
    path.write_text(TOML)
    return path


def steps(stand: Stand, years: int) -> list[YearRecord]:
    """Grow a stand for some years and keep their records."""
    return [stand.step() for _ in range(years)]


def assert_same_years(some: Sequence[YearRecord], others: Sequence[YearRecord]) -> None:
    """Compare records of years: every column and every sample tree, exactly."""
    assert [record.year for record in some] == [record.year for record in others]
    for one, other in zip(some, others, strict=True):
        assert one.tables.keys() == other.tables.keys()
        for table, columns in one.tables.items():
            for name, column in columns.items():
                np.testing.assert_array_equal(
                    column, other.tables[table][name], f"{one.year} {table}.{name}"
                )
        assert one.samples.keys() == other.samples.keys()
        for tree_id, sample in one.samples.items():
            _assert_equal_tuples(sample, other.samples[tree_id])


def assert_same_state(one: Stand, other: Stand) -> None:
    """Compare all that the next year needs, exactly."""
    (arrays, meta), (other_arrays, other_meta) = one.state(), other.state()
    assert meta == other_meta
    assert arrays.keys() == other_arrays.keys()
    for name in arrays.keys() - {"tree_start", "tree_room"}:  # where in memory a tree lies
        np.testing.assert_array_equal(arrays[name], other_arrays[name], name)


def assert_same_runs(one: Run, other: Run) -> None:
    """Compare all tables and sample trees of two runs, exactly."""
    assert one.tables == other.tables
    for table in one.tables:
        assert_frame_equal(one.read(table), other.read(table), check_exact=True)
    assert one.samples == other.samples
    for tree_id in one.samples:
        year = int(one.sample_years(tree_id)[-1])  # the last one that it lived
        _assert_equal_tuples(
            vars(one.skeleton(tree_id, year)).values(),
            vars(other.skeleton(tree_id, year)).values(),
        )


def _assert_equal_tuples(one: Any, other: Any) -> None:
    for a, b in zip(one, other, strict=True):
        if isinstance(a, tuple):
            _assert_equal_tuples(a, b)
        else:
            np.testing.assert_array_equal(a, b)


def forest(*words: str | Path) -> tuple[int, str, str]:
    """Call the command line in this process: exit code, standard output, standard error."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(word) for word in words])
        except SystemExit as end:
            return int(end.code or 0), out.getvalue(), err.getvalue()
    raise AssertionError("the command line did not exit")
