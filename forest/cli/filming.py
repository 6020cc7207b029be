"""The commands that show a whole run to people: `forest movie`, `forest report`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forest.cli.shared import RunFile, check_targets, given_options, options_named

if TYPE_CHECKING:
    from forest.view.film import FilmSettings

_USUAL_FPS = {".mp4": 20.0, ".gif": 10.0}
_STAND_SIZE, _TREE_SIZE = "960x600", "600x720"


_OF_A_TREE = ("--year", "--grow", "--shape", "--leaves")
_OF_A_STAND = ("--from-year", "--to-year", "--colour", "--view")


def movie(
    context: typer.Context,
    run_file: RunFile,
    to: Annotated[Path, typer.Option("--to", metavar="FILE.mp4|.gif", help="The film.")],
    tree: Annotated[
        int | None, typer.Option(metavar="ID", help="A sample tree, instead of the stand.")
    ] = None,
    year: Annotated[
        int | None, typer.Option(help="Of a tree: the calendar year. Default: its last.")
    ] = None,
    grow: Annotated[bool, typer.Option("--grow", help="A tree in all its years.")] = False,
    shape: Annotated[
        str, typer.Option(help="Of a tree: skeleton, or mesh for its surface.")
    ] = "skeleton",
    leaves: Annotated[bool, typer.Option(help="Whether a tree has its leaves.")] = True,
    from_year: Annotated[int | None, typer.Option(help="Of a stand: the first year.")] = None,
    to_year: Annotated[int | None, typer.Option(help="Of a stand: the last year.")] = None,
    colour: Annotated[
        str, typer.Option(help="Of crowns: species, dbh, height, light or age.")
    ] = "species",
    view: Annotated[str, typer.Option(help="Of a stand: side, above or turning.")] = "side",
    fps: Annotated[
        float | None, typer.Option(help="Frames per second. Default: .mp4 20, .gif 10.")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="Length. Default: by the number of years.")
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help=f"Pixels. Default: {_STAND_SIZE}, a tree {_TREE_SIZE}."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Make a film of a run: the stand through its years, or once around a sample tree.

    Trees of a stand are stem cones and crown shapes; those that die, are felled or thrown in a
    year have a colour of their own in it.

    Examples:

        forest movie run.h5 --to stand.mp4

        forest movie run.h5 --to map.gif --view above --colour dbh --seconds 8

        forest movie run.h5 --to tree.mp4 --tree 12 --grow

        forest movie run.h5 --to bark.gif --tree 12 --shape mesh --year 2040
    """
    from forest.errors import InputError
    from forest.record.run import open_run
    from forest.view.film import SUFFIXES

    check_targets((to, SUFFIXES), force=force)
    settings = _settings(to, fps, seconds, size or (_STAND_SIZE if tree is None else _TREE_SIZE))
    refused, what = (_OF_A_STAND, "a stand") if tree is not None else (_OF_A_TREE, "a tree")
    for option in given_options(context):
        if option in refused:
            instead = "no --tree" if tree is not None else "--tree ID"
            raise InputError(f"{option} is for films of {what}", expected=instead)
    options = {"from_year": "--from-year", "to_year": "--to-year"}
    with open_run(run_file) as run, options_named(**options), _frames_shown() as (begin, done):
        if tree is None:
            from forest.view.movie import film_stand

            count = film_stand(
                run,
                to,
                settings=settings,
                from_year=from_year,
                to_year=to_year,
                colour=colour,
                view=view,
                overwrite=force,
                begin=begin,
                done=done,
            )
        else:
            from forest.cli.surfacing import check_sample
            from forest.view.tree_movie import film_tree

            check_sample(run, tree)
            count = film_tree(
                run,
                tree,
                to,
                settings=settings,
                year=year,
                grow=grow,
                shape=shape,
                leaves=leaves,
                overwrite=force,
                begin=begin,
                done=done,
            )
    typer.echo(f"{to}: {count} frames, {count / settings.fps:.1f} s")


def report(
    run_file: RunFile,
    to: Annotated[Path, typer.Option("--to", metavar="FILE.html", help="The page.")],
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a run as one page of pictures, charts and tables, which opens from disk.

    The page holds all it shows, and asks no other place for anything.

    Example:

        forest report run.h5 --to report.html
    """
    from rich.console import Console

    from forest.record.run import open_run
    from forest.view.report import write_report

    check_targets((to, (".html",)), force=force)
    with open_run(run_file) as run, Console(stderr=True).status("the report") as status:
        warnings = write_report(
            run, to, overwrite=force, say=lambda name: status.update(f"the report: {name}")
        )
    for warning in warnings:
        typer.echo(warning, err=True)
    typer.echo(f"{to}: {to.stat().st_size / 1e6:.1f} MB")


def _settings(to: Path, fps: float | None, seconds: float | None, size: str) -> FilmSettings:
    from forest.cli.viewing import pixels_of
    from forest.errors import InputError
    from forest.view.film import FilmSettings

    fps = _USUAL_FPS[to.suffix.lower()] if fps is None else fps
    if not 0.5 <= fps <= 60.0:
        raise InputError(f"--fps is {fps:g}", expected="0.5 to 60")
    if seconds is not None and not 0.1 <= seconds <= 3600.0:
        raise InputError(f"--seconds is {seconds:g}", expected="0.1 to 3600")
    return FilmSettings(fps, seconds, pixels_of(size))


@contextmanager
def _frames_shown() -> Iterator[tuple[Callable[[int], object], Callable[[], object]]]:
    """Show on a terminal how many frames are done; gives what begins the bar and what moves it."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining

    from forest._jit import announce_compiling

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), Remaining())
    console = Console(stderr=True)
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("frames", total=None)
        compiling = "compiling kernels that this machine has not run yet (up to a minute)"
        with announce_compiling(lambda: progress.update(task, description=compiling)):
            yield (
                lambda count: progress.update(task, total=count),
                lambda: progress.update(task, advance=1, description="frames"),
            )
