"""The commands that read a run file for people: tables on the screen, pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from forest.cli.shared import (
    FRAME,
    PICTURE,
    RunFile,
    check_targets,
    last_shapes,
    print_pairs,
    print_stand_table,
)


def table(run_file: RunFile) -> None:
    """Print the stand table: the first, every tenth and the last year.

    Example:

        forest table run.h5
    """
    from forest.record.run import open_run

    with open_run(run_file) as run:
        print_stand_table(run)


def info(run_file: RunFile) -> None:
    """Say what a run file holds and what made it.

    Example:

        forest info run.h5
    """
    from forest.record.export import info as describe_run
    from forest.record.run import open_run

    with open_run(run_file) as run:
        print_pairs(describe_run(run))


def stability(
    run_file: RunFile,
    year: Annotated[int | None, typer.Option(help="Default: the run's last year.")] = None,
    to: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The table as .csv or .parquet, or a picture, .png."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Say how safely the trees of a run stand, by species and size class.

    Examples:

        forest stability run.h5

        forest stability run.h5 --year 2040 --to stability.png
    """
    from forest.record.export import write_frame
    from forest.record.run import open_run
    from forest.view.stability_table import classes, stability_of_year, stability_table

    check_targets((to, (*FRAME, *PICTURE)), force=force)
    drawn = to is not None and to.suffix.lower() in PICTURE
    with open_run(run_file) as run:
        trees = stability_of_year(run, year)
    if to is None:
        from rich.console import Console

        Console().print(stability_table(trees))
    elif drawn:
        from forest.view.stability_picture import draw_stability

        draw_stability(trees, to)
        typer.echo(f"{to}: {len(trees)} trees")
    else:
        rows = write_frame(lambda: classes(trees), to, overwrite=force)
        typer.echo(f"{to}: {rows} classes")


def landscape(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a sweep.")],
    year: Annotated[int | None, typer.Option(help="Default: the last year of any plot.")] = None,
    least_basal_area: Annotated[
        float,
        typer.Option(metavar="M2HA", help="Below this basal area no species dominates a plot."),
    ] = 1.0,
    to: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="The plots as a mosaic, and over time.")
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option("--csv", metavar="FILE", help="A row per plot and year: .csv or .parquet."),
    ] = None,
    totals: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A row per year of the whole: .csv or .parquet."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
) -> None:
    """Read the runs of a sweep as the plots of a landscape, and print a year of it.

    Says which share of the area each dominant species and each development stage holds.

    Examples:

        forest landscape spruce

        forest landscape spruce --year 2060 --to landscape.png --csv plots.csv --totals years.csv
    """
    from rich.console import Console

    from forest.ensemble.landscape import landscape as read_landscape
    from forest.record.export import write_frame
    from forest.view.landscape_picture import draw_landscape
    from forest.view.landscape_table import landscape_table

    check_targets((to, PICTURE), (csv, FRAME), (totals, FRAME), force=force)
    found = read_landscape(folder, least_basal_area_m2ha=least_basal_area)
    Console().print(landscape_table(found, year))
    if csv is not None:
        rows = write_frame(lambda: found.plots, csv, overwrite=force)
        typer.echo(f"{csv}: {rows:,} plots and years")
    if totals is not None:
        rows = write_frame(lambda: found.totals, totals, overwrite=force)
        typer.echo(f"{totals}: {rows:,} years")
    if to is not None:
        draw_landscape(found, to, year=year)
        typer.echo(f"{to}: {found.plots['run'].nunique()} plots")


def picture(
    run_file: RunFile,
    to: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="The stand in 3D, in its last year.")
    ] = None,
    development: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="The stand's development over time.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
) -> None:
    """Draw the stand of a run, its development, or both.

    The 3D picture shows every tree with all its branches, from the checkpoint beside the run.

    Example:

        forest picture run.h5 --to stand.png --development development.png
    """
    from forest.errors import InputError
    from forest.record.run import open_run

    if to is None and development is None:
        raise InputError("nothing to draw", expected="--to FILE.png or --development FILE.png")
    check_targets((to, PICTURE), (development, PICTURE), force=force)
    with open_run(run_file) as run:
        if development is not None:
            from forest.view.development import draw_development

            if not len(run.years) or "stand" not in run.tables:
                raise InputError("holds no stand table to draw", where=str(run_file))
            draw_development(run, development)
            typer.echo(f"{development}: stand development")
        if to is not None:
            from forest.view.stand_picture import draw_stand

            year, skeletons = last_shapes(run_file, run.scenario)
            draw_stand(skeletons, run.scenario.plot.size_m, to)
            typer.echo(f"{to}: {len(skeletons)} trees in {year}")
