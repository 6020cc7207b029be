"""What several commands share: arguments, and what they check, load and print."""

from __future__ import annotations

from collections.abc import Sequence
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
    from forest.errors import InputError, OutputError

    seen: set[Path] = set()
    for path, suffixes in targets:
        if path is None:
            continue
        if path.suffix.lower() not in suffixes:
            expected = f"a name that ends in {' or '.join(suffixes)}"
            raise InputError(f"unknown format '{path.suffix}'", where=str(path), expected=expected)
        if path.is_dir() or not path.parent.is_dir():
            raise OutputError("cannot be written", where=str(path), expected="a file in a folder")
        if path.exists() and not force:
            raise InputError("exists already", where=str(path), expected="a new path, or --force")
        if path.resolve() in seen:
            raise InputError("is asked for twice", where=str(path), expected="a path for each")
        seen.add(path.resolve())


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
