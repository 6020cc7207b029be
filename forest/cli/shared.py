"""What several commands share: arguments, and what they check, load and print."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from forest.scenario import Scenario
    from forest.trees.skeleton import Skeleton

ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="The scenario.")]
RunFile = Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run file, finished or not.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Change a key; may be given often."),
]

#: Suffixes of what commands write.
PICTURE, FRAME = (".png",), (".csv", ".parquet")

#: The exit code of what was stopped, as shells report a process that SIGINT ended.
STOPPED = 130


class Stopped(Exception):
    """A run was stopped; typer would not let KeyboardInterrupt keep its message."""


def print_pairs(pairs: Sequence[tuple[str, str]]) -> None:
    width = max(len(label) for label, _ in pairs)
    for label, text in pairs:
        typer.echo(f"{label:<{width}}  {text}")


def print_stand_table(run: Any) -> None:
    from rich.console import Console

    from forest.errors import InputError
    from forest.view.table import stand_table

    if "stand" not in run.tables:
        raise InputError("holds no stand table", where=str(run.path))
    Console().print(stand_table(run))


def check_picture(path: Path, force: bool) -> None:
    """Refuse a picture's path before anything is drawn."""
    check_targets((path, PICTURE), force=force)


def check_targets(*targets: tuple[Path | None, tuple[str, ...]], force: bool) -> None:
    """Refuse files of which one cannot be written, or two are one, before any is written.

    Parameters
    ----------
    *targets : (path or None, tuple of str)
        A file that is asked for, and the suffixes of which it must have one.
    force : bool
        Whether to replace what is there.
    """
    from forest.errors import InputError
    from forest.record.export import check_target

    seen: set[Path] = set()
    for path, suffixes in targets:
        if path is None:
            continue
        if path.suffix.lower() not in suffixes:
            what = f"unknown format '{path.suffix}'" if path.suffix else "has no suffix"
            raise InputError(what, where=str(path), expected=endings(suffixes))
        check_target(path, overwrite=force, or_else=", or --force")
        if path.resolve() in seen:
            raise InputError("is asked for twice", where=str(path), expected="a path for each")
        seen.add(path.resolve())


def endings(suffixes: Sequence[str]) -> str:
    """Say how a name may end."""
    *others, last = suffixes
    return "a name that ends in " + (f"{', '.join(others)} or {last}" if others else last)


def given_options(context: typer.Context) -> list[str]:
    """Name the options that stand on the command line, as `--time-scale`."""
    return [
        option.opts[0]
        for option in context.command.params
        if option.opts[0].startswith("-")
        and getattr(context.get_parameter_source(str(option.name)), "name", "") == "COMMANDLINE"
    ]


@contextmanager
def options_named(**options: str) -> Iterator[None]:
    """Let refusals speak of options as they are typed, not of the arguments behind them.

    Parameters
    ----------
    **options : str
        The option for each argument, e.g. ``cell_m="--cell"``.
    """
    from forest.errors import InputError

    try:
        yield
    except InputError as error:
        words = "|".join(options)
        said = re.sub(rf"\b({words})\b", lambda name: options[name[0]], str(error))
        raise type(error)(said) from None


def last_shapes(run_file: Path, scenario: Scenario) -> tuple[int, list[Skeleton]]:
    """Bring back all trees as they were at the last checkpoint: calendar year and shapes.

    Residual trees that stand come last, with numbers below 0.
    """
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
    grown = [stand.skeleton(int(tree_id)) for tree_id in stand.rows.tree_id]
    return stand.year, grown + [stand.residual.skeleton(tree.name) for tree in stand.residual]
