"""The commands that grow: a scenario, many scenarios; and what checks one before."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from forest.cli.shared import (
    Overrides,
    ScenarioFile,
    Stopped,
    check_picture,
    print_pairs,
    print_stand_table,
)

_SOME_FAILED = 1


def run(
    context: typer.Context,
    scenario: ScenarioFile,
    out: Annotated[
        Path | None,
        typer.Option(metavar="RUN.h5", help="Run file to write; default: the scenario's name.h5."),
    ] = None,
    years: Annotated[int | None, typer.Option(min=1, help="Years to grow.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of all random numbers.")] = None,
    threads: Annotated[
        int | None,
        typer.Option(min=1, help="Threads; default: all cores. Results do not depend on it."),
    ] = None,
    overrides: Overrides = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a run that was stopped, or add years.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing run file.")] = False,
    no_progress: Annotated[
        bool, typer.Option("--no-progress", help="Do not show how the run goes on.")
    ] = False,
) -> None:
    """Grow a scenario, write its run file and print the stand table.

    Ctrl-C finishes the year, writes a checkpoint and stops. After that, or after a crash,
    the same command with --resume goes on to the same bits.

    Examples:

        forest run scenarios/saxony_spruce.toml --out run.h5

        forest run scenarios/saxony_spruce.toml --out run.h5 --years 80 --resume

        forest run scenarios/mixed_stand.toml --out wet.h5 --set site.productivity=1.4 --seed 7
    """
    from forest.errors import InputError, years_of

    to = out or Path(f"{scenario.stem}.h5")
    if resume and force:
        raise InputError("--resume and --force exclude each other", expected="one of them")
    if to.is_file() and not (resume or force):
        raise InputError(
            "exists already",
            where=str(to),
            expected="a new path, --resume to go on with it, or --force to replace it",
        )
    from forest.progress import Bar
    from forest.scenario import Scenario
    from forest.simulation import simulate

    asked = Scenario.load(scenario, overrides or (), years=years, seed=seed)

    try:
        finished = simulate(
            asked,
            to,
            threads=threads,
            resume=resume,
            overwrite=force,
            progress=Bar(years=not no_progress),
            command=["forest", *context.obj],
        )
    except KeyboardInterrupt as stop:
        raise Stopped(str(stop)) from None
    with finished:
        if "stand" in finished.tables:
            print_stand_table(finished)
        typer.echo(f"{finished.path} holds {years_of(len(finished.years))}")


def sweep(
    scenarios: Annotated[
        list[Path], typer.Argument(metavar="SCENARIO.toml...", help="The scenarios.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the run files.")],
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY.PATH=VALUE,VALUE...", help="Vary a key; may be given often."
        ),
    ] = None,
    replicates: Annotated[
        int, typer.Option(min=1, help="Runs of each combination, each with a seed of its own.")
    ] = 1,
    years: Annotated[int | None, typer.Option(min=1, help="Years to grow.")] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; default: as many as cores.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Use the cluster of a dask scheduler.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the means over the years.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the sweep in the folder, or add to it.")
    ] = False,
    no_progress: Annotated[
        bool, typer.Option("--no-progress", help="Do not show how the runs go on.")
    ] = False,
) -> None:
    """Grow scenarios under all combinations of settings, over processes; print their means.

    Each run writes one file; manifest.csv and manifest.parquet list them all. Runs that fail are
    listed and the others go on; the exit code is then 1.

    Examples:

        forest sweep scenarios/saxony_spruce.toml --out spruce --replicates 10

        forest sweep a.toml b.toml --out ab --set site.productivity=0.8,1,1.2 --replicates 5
    """
    from forest.ensemble.design import read_settings
    from forest.ensemble.sweep import sweep as grow_all

    if plot is not None:
        check_picture(plot, force=resume)
    changes = list(settings or [])
    if years is not None:
        changes.append(f"years={years}")
    try:
        done = grow_all(
            scenarios,
            settings=read_settings(changes),
            replicates=replicates,
            out=out,
            workers=workers,
            scheduler=scheduler,
            resume=resume,
            progress=not no_progress,
        )
    except KeyboardInterrupt:
        raise Stopped("stopped; go on with the same command and --resume") from None
    if (done.manifest["status"] == "done").any():
        _print_means(done, plot)
    for _, run in done.failed.iterrows():
        typer.echo(f"forest: failed: {run['run']}: {run['error']}", err=True)
    if len(done.failed):
        raise typer.Exit(_SOME_FAILED)


def check(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Check a scenario and say in a few lines what it would grow.

    Where it starts from an inventory, the measured trees are built to tell how near they come,
    which takes some seconds.

    Examples:

        forest check my_stand.toml

        forest check my_stand.toml --set plot.boundary=open
    """
    from forest.scenario import Scenario
    from forest.scenario.summary import summary

    asked = Scenario.load(scenario, overrides or ())
    lines = summary(asked)
    if asked.obstacles or any(act.kind == "obstacle" for act in asked.acts):
        from forest.management.places import check_places

        check_places(asked)
    if asked.planting.kind == "inventory":
        from forest.stand import Stand

        built = Stand(asked).built
        assert built is not None
        lines.append(("inventory", built.report()))
    print_pairs(lines)


def _print_means(sweep: Any, plot: Path | None) -> None:
    from rich.console import Console

    from forest.view.sweep_picture import draw_sweep
    from forest.view.sweep_table import sweep_table

    Console().print(sweep_table(sweep))
    if plot is not None:
        draw_sweep(sweep, plot)
        typer.echo(f"{plot}: means over the years")
