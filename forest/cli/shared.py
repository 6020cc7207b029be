"""What several commands share: arguments, and what they check, load and print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

ScenarioFile = Annotated[Path, typer.Argument(metavar="SCENARIO.toml", help="The scenario.")]
RunFile = Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run file, finished or not.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Change a key; may be given often."),
]


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
    from forest.errors import InputError, OutputError

    if path.suffix.lower() != ".png":
        raise InputError(
            f"unknown format '{path.suffix}'", where=str(path), expected="a name that ends in .png"
        )
    if path.is_dir() or not path.parent.is_dir():
        raise OutputError("cannot be written", where=str(path), expected="a file in a folder")
    if path.exists() and not force:
        raise InputError("exists already", where=str(path), expected="a new path, or --force")
