"""The years of a live session as tables, and as the run file that a headless run would write."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from forest._threads import thread_count
from forest.record import ledger
from forest.record.checkpoint import remove_checkpoints
from forest.record.export import whole_file
from forest.record.run import open_run
from forest.record.schema import ALL_TABLES
from forest.simulation import stored_tables, with_meshes, writer_of

if TYPE_CHECKING:
    import pandas as pd

    from forest.scenario import Scenario
    from forest.yearbook import YearRecord


def tables_of(scenario: Scenario, records: Sequence[YearRecord]) -> dict[str, pd.DataFrame]:
    """Give all tables of some years, each as `forest.Run.read` gives it of their run file."""
    import pandas as pd

    residual = [(tree.name, tree.species) for tree in scenario.residual_trees]
    names = [name for name, _ in residual]
    kinds = list(dict.fromkeys(kind for _, kind in residual))
    species = [s.name for s in scenario.species_list]
    years = _with_population(records)
    frames = {}
    for name in ALL_TABLES:
        if name not in (*stored_tables(scenario), "population"):
            continue
        table = ALL_TABLES[name].with_species(species).with_residual(names, kinds)
        parts = [year[name] for year in years if year.get(name)]
        data: dict[str, Any] = {}
        for column in table.columns:
            values = [np.asarray(part[column.name], column.dtype) for part in parts]
            joined = np.concatenate(values) if values else np.empty(0, column.dtype)
            if column.levels:
                data[column.name] = pd.Categorical.from_codes(joined, list(column.levels))
            else:
                data[column.name] = joined
        frames[name] = pd.DataFrame(data)
    return frames


def _with_population(records: Sequence[YearRecord]) -> list[dict[str, Mapping[str, Any]]]:
    living = 0
    years: list[dict[str, Mapping[str, Any]]] = []
    for record in records:
        tables = record.tables
        row = ledger.population_row(record.year, living, tables["trees"], tables["events"])
        living = int(row["living"][0])
        years.append({**tables, "population": row})
    return years


def write_run(
    scenario: Scenario,
    records: Sequence[YearRecord],
    path: Path,
    *,
    overwrite: bool,
    say: Callable[[str], None],
) -> None:
    """Write the run file of some years, whole or not at all; then the surfaces of sample trees."""
    with (
        whole_file(path, overwrite=overwrite) as draft,
        writer_of(scenario, draft, threads=thread_count()) as writer,
    ):
        for record in records:
            writer.append_year(record.year, record.tables, record.samples)
        writer.finish()
    remove_checkpoints(path)  # of what was replaced
    with_meshes(open_run(path), say).close()
