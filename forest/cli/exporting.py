"""The command that writes a run's tables for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forest.cli.shared import RunFile


def export(
    run_file: RunFile,
    table: Annotated[str, typer.Option(help="trees, stand, events, rings, carbon or population.")],
    to: Annotated[Path, typer.Option(metavar="FILE", help="File that ends in .csv or .parquet.")],
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a table of a run as CSV or Parquet.

    Examples:

        forest export run.h5 --table trees --to trees.csv

        forest export run.h5 --table rings --to rings.parquet
    """
    from forest.record.export import export as export_table
    from forest.record.run import open_run

    with open_run(run_file) as run:
        written = export_table(run, table, to, overwrite=force)
        typer.echo(f"{written}: {run.count(table):,} rows")
