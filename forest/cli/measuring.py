"""The commands that measure: all trees of a year, and the logs that can be cut from them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forest.cli.shared import FRAME, RunFile, check_targets

if TYPE_CHECKING:
    from forest.record.run import Run

Year = Annotated[int | None, typer.Option(help="Calendar year; default: the run's last.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing file.")]


def measure(
    run_file: RunFile,
    year: Year = None,
    to: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A row per tree: .csv or .parquet.")
    ] = None,
    force: Force = False,
) -> None:
    """Measure all trees of a year: diameters, stem, crown, biomass, competition.

    Without --to a short table by species is printed, and how much of the plot lies in gaps.

    Examples:

        forest measure run.h5

        forest measure run.h5 --year 2060 --to table.csv
    """
    from forest.measure.tables import measure_run, plot_of
    from forest.record.export import write_frame
    from forest.record.run import open_run

    check_targets((to, FRAME), force=force)
    with open_run(run_file) as run:
        at = _year(run, year)
        if to is not None:
            rows = write_frame(lambda: measure_run(run, at), to, overwrite=force)
            typer.echo(f"{to}: {rows:,} trees of {at}")
            return
        from rich.console import Console

        from forest.measure.gaps import gaps
        from forest.view.measured_table import gaps_line, residual_lines, species_table

        plot, trees = plot_of(run.scenario), measure_run(run, at)
        Console().print(species_table(trees, plot.hectares))
        typer.echo(gaps_line(gaps(trees, plot)))
        if "residual" in run.tables:
            for line in residual_lines(run.read("residual", years=(at, at))):
                typer.echo(line)


def bucking(
    run_file: RunFile,
    year: Year = None,
    products: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="What can be sold: .toml or .csv; a plain list if none."),
    ] = None,
    to: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A row per log: .csv or .parquet.")
    ] = None,
    force: Force = False,
) -> None:
    """Cut all trees of a year, on paper, into the logs that together bring the most.

    Prints the sums by product. Sample trees are cut along their own stems, all others along
    stems drawn through their discs.

    Examples:

        forest bucking run.h5

        forest bucking run.h5 --year 2060 --products products.toml --to logs.csv
    """
    from rich.console import Console

    from forest.measure.bucking import assortments
    from forest.measure.products import DEFAULT_PRODUCTS, read_products
    from forest.measure.tables import buck_run
    from forest.record.export import write_frame
    from forest.record.run import open_run
    from forest.view.measured_table import assortment_table

    check_targets((to, FRAME), force=force)
    asked = DEFAULT_PRODUCTS if products is None else read_products(products)
    with open_run(run_file) as run:
        at = _year(run, year)
        if to is None:
            logs = buck_run(run, at, asked)
            Console().print(assortment_table(assortments(logs)))
            return
        rows = write_frame(lambda: buck_run(run, at, asked), to, overwrite=force)
        typer.echo(f"{to}: {rows:,} logs of {at}")


def _year(run: Run, year: int | None) -> int:
    """Give the year asked for, or the run's last."""
    from forest.measure.tables import check_year

    at = year if year is not None else int(run.years[-1]) if len(run.years) else 0
    check_year(run, at)
    return at
