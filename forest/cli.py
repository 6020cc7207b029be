"""The command line: `forest run`, and what reads its files.

Every command imports what it needs when it is called, so that help and refusals come at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from forest.scenario import Scenario
    from forest.species import Species
    from forest.trees.skeleton import Skeleton

# The class of all wrong usage; which module holds it depends on typer's version.
_UsageError: Any = typer.BadParameter.__base__

_REFUSED = 2
_STOPPED = 130  # as shells report a process that SIGINT ended
_UNHEARD = 1  # as typer and rich do
_SOME_FAILED = 1

app = typer.Typer(
    name="forest",
    help="Grow stands of bud-level trees and read what they became.\n\n"
    "A scenario is a TOML file; a run writes one HDF5 file, which the other commands read.\n\n"
    "    forest run scenarios/saxony_spruce.toml --out run.h5\n\n"
    "    forest table run.h5",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)

ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="The scenario.")]
RunFile = Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run file, finished or not.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Change a key; may be given often."),
]


@app.callback(invoke_without_command=True)
def _forest(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command()
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
    from forest.errors import InputError

    to = out or Path(f"{scenario.stem}.h5")
    if resume and force:
        raise InputError("--resume and --force exclude each other", expected="one of them")
    if to.is_file() and not (resume or force):
        raise InputError(
            "exists already",
            where=str(to),
            expected="a new path, --resume to go on with it, or --force to replace it",
        )
    changes = list(overrides or [])
    if years is not None:
        changes.append(f"years={years}")
    if seed is not None:
        changes.append(f"seed={seed}")
    asked = _load(scenario, changes)

    from forest.progress import Bar
    from forest.simulation import simulate

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
        raise _Stopped(str(stop)) from None
    with finished:
        if "stand" in finished.tables:
            _print_stand_table(finished)
        typer.echo(f"{finished.path} holds {len(finished.years)} years")


@app.command()
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
        _check_picture(plot, force=resume)
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
        raise _Stopped("stopped; go on with the same command and --resume") from None
    if (done.manifest["status"] == "done").any():
        _print_means(done, plot)
    for _, run in done.failed.iterrows():
        typer.echo(f"forest: failed: {run['run']}: {run['error']}", err=True)
    if len(done.failed):
        raise typer.Exit(_SOME_FAILED)


@app.command()
def check(scenario: ScenarioFile, overrides: Overrides = None) -> None:
    """Check a scenario and say in a few lines what it would grow.

    Examples:

        forest check my_stand.toml

        forest check my_stand.toml --set plot.boundary=open
    """
    from forest.scenario.summary import summary

    _print_pairs(summary(_load(scenario, overrides or [])))


@app.command()
def table(run_file: RunFile) -> None:
    """Print the stand table: the first, every tenth and the last year.

    Example:

        forest table run.h5
    """
    from forest.record.run import open_run

    with open_run(run_file) as run:
        _print_stand_table(run)


@app.command()
def info(run_file: RunFile) -> None:
    """Say what a run file holds and what made it.

    Example:

        forest info run.h5
    """
    from forest.record.export import info as describe_run
    from forest.record.run import open_run

    with open_run(run_file) as run:
        _print_pairs(describe_run(run))


@app.command()
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


@app.command()
def species(
    name: Annotated[str | None, typer.Argument(help="A species; all are listed if none.")] = None,
) -> None:
    """List the species that come with the program, or all parameters of one.

    Examples:

        forest species

        forest species picea_abies
    """
    from forest.species import load_species, species_names

    if name is None:
        for known in species_names():
            one = load_species(known)
            typer.echo(f"{known:<20} {one.common_name} ({one.group})")
    else:
        _print_species(load_species(name))


@app.command()
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

    wanted = [path for path in (to, development) if path is not None]
    if not wanted:
        raise InputError("nothing to draw", expected="--to FILE.png or --development FILE.png")
    for path in wanted:
        _check_picture(path, force)
    with open_run(run_file) as run:
        if development is not None:
            from forest.view.development import draw_development

            if not len(run.years) or "stand" not in run.tables:
                raise InputError("holds no stand table to draw", where=str(run_file))
            draw_development(run, development)
            typer.echo(f"{development}: stand development")
        if to is not None:
            from forest.view.stand_picture import draw_stand

            year, skeletons = _last_shapes(run_file, run.scenario)
            draw_stand(skeletons, run.scenario.plot.size_m, to)
            typer.echo(f"{to}: {len(skeletons)} trees in {year}")


@app.command()
def version() -> None:
    """Print the program's version."""
    from forest import __version__

    typer.echo(f"forest {__version__}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 runs failed, 2 refused, 130 stopped.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after `forest`; those of this process if not given.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    sys.exit(_answer(lambda: app(args=words, prog_name="forest", standalone_mode=False, obj=words)))


class _Stopped(Exception):
    """A run was stopped; typer would not let KeyboardInterrupt keep its message."""


def _answer(command: Callable[[], Any]) -> int:
    """Carry out a command; turn what users cause into one line and an exit code."""
    from forest.errors import InputError, libraries_silenced

    try:
        with libraries_silenced():
            code = command()
        sys.stdout.flush()
    except _UsageError as error:
        return _refuse(error.format_message())
    except InputError as error:
        return _refuse(str(error))
    except (_Stopped, KeyboardInterrupt, typer.Abort) as stop:
        typer.echo(f"forest: {str(stop) or 'stopped'}", err=True)
        return _STOPPED
    except BrokenPipeError:
        # The reader (head, less) has gone; nothing is left to say, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _UNHEARD
    return code if isinstance(code, int) else 0


def _refuse(message: str) -> int:
    typer.echo(f"forest: error: {' '.join(message.split())}", err=True)
    return _REFUSED


def _load(path: Path, overrides: Sequence[str]) -> Scenario:
    from forest.scenario import Scenario

    scenario = Scenario.load(path)
    return scenario.with_overrides(overrides) if overrides else scenario


def _print_pairs(pairs: Sequence[tuple[str, str]]) -> None:
    width = max(len(label) for label, _ in pairs)
    for label, text in pairs:
        typer.echo(f"{label:<{width}}  {text}")


def _print_stand_table(run: Any) -> None:
    from rich.console import Console

    from forest.errors import InputError
    from forest.view.table import stand_table

    if "stand" not in run.tables:
        raise InputError("holds no stand table", where=str(run.path))
    Console().print(stand_table(run))


def _print_means(sweep: Any, plot: Path | None) -> None:
    from rich.console import Console

    from forest.view.sweep_picture import draw_sweep
    from forest.view.sweep_table import sweep_table

    Console().print(sweep_table(sweep))
    if plot is not None:
        draw_sweep(sweep, plot)
        typer.echo(f"{plot}: means over the years")


def _print_species(one: Species) -> None:
    """Print each section's parameters with value, unit, meaning and source."""
    from itertools import groupby

    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from forest.species import describe

    console = Console()
    console.print(f"[bold]{one.name}[/]: {one.common_name} ({one.group})", highlight=False)
    rows = [row for row in describe(type(one)) if "." in row.key]
    for section, group in groupby(rows, lambda row: row.key.partition(".")[0]):
        sheet = Table(title=section, title_justify="left", title_style="bold", box=None)
        sheet.add_column("parameter", no_wrap=True)
        for heading in ("value", "unit", "what it is", "source"):
            sheet.add_column(heading, overflow="fold")
        for row in group:
            key = row.key.partition(".")[2]
            value = getattr(getattr(one, section), key)
            source = one.sources.get(section, {}).get(key, "")
            sheet.add_row(key, escape(str(value)), row.unit, row.description, source)
        console.print(sheet)


def _check_picture(path: Path, force: bool) -> None:
    """Refuse a picture's path before anything is drawn."""
    from forest.errors import InputError, OutputError

    if path.suffix.lower() != ".png":
        raise InputError(
            f"unknown format '{path.suffix}'", where=str(path), expected="a name that ends in .png"
        )
    if path.is_dir() or not path.parent.is_dir():
        raise OutputError("cannot be written", where=str(path), expected="a file in a folder")
    if path.exists() and not force:
        raise InputError("exists already", where=str(path), expected="a new path, or --force")


def _last_shapes(run_file: Path, scenario: Scenario) -> tuple[int, list[Skeleton]]:
    """Bring back all trees as they were at the last checkpoint: calendar year and shapes."""
    from forest.errors import InputError
    from forest.record.checkpoint import latest_checkpoint

    found = latest_checkpoint(run_file)
    if found is None:
        raise InputError(
            "has no checkpoint beside it, and only checkpoints hold the shapes of all trees",
            where=str(run_file),
            expected=f"{run_file.name}.checkpoint-*.npz in the same folder",
        )
    from forest.stand import Stand

    stand = Stand.restore(scenario, *found)
    return stand.year, [stand.skeleton(int(tree_id)) for tree_id in stand.rows.tree_id]
