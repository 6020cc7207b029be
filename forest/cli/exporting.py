"""The command that writes a run's tables and trees for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from forest.cli.shared import FRAME, RunFile, check_targets

# What --as may name: the function of forest.interop that makes it.
_TABLES = {
    ("trees", "iland"): "iland_trees",
    ("stand", "iland"): "iland_stand",
    ("trees", "fvs"): "fvs_treelist",
    ("stand", "fvs"): "fvs_summary",
}
_TREES = {"simpleforest": "write_simpleforest", "treeqsm": "write_treeqsm"}


def export(
    run_file: RunFile,
    to: Annotated[Path, typer.Option(metavar="FILE", help="File; a table's: .csv or .parquet.")],
    table: Annotated[
        str | None,
        typer.Option(help="trees, stand, events, rings, carbon, stability, residual or another."),
    ] = None,
    tree: Annotated[int | None, typer.Option(metavar="ID", help="A sample tree's shape.")] = None,
    residual: Annotated[
        str | None, typer.Option(metavar="NAME", help="A residual tree's shape.")
    ] = None,
    year: Annotated[
        int | None, typer.Option(help="The shape's year; default: the run's last.")
    ] = None,
    form: Annotated[
        str | None,
        typer.Option(
            "--as", help="Of table trees or stand: iland, fvs. Of a tree: simpleforest, treeqsm."
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing file.")] = False,
) -> None:
    """Write a table of a run as CSV or Parquet, or a tree's shape as a cylinder model.

    The shape is that of a sample tree or of a residual one.

    Examples:

        forest export run.h5 --table trees --to trees.csv

        forest export run.h5 --table rings --to rings.parquet

        forest export run.h5 --table stand --as fvs --to FVS_Summary2.csv

        forest export run.h5 --tree 12 --year 2060 --as treeqsm --to cylinder_12.txt
    """
    from forest.errors import InputError
    from forest.record.export import check_target
    from forest.record.run import open_run

    asked = {"--table": table, "--tree": tree, "--residual": residual}
    given = [name for name, value in asked.items() if value is not None]
    if len(given) != 1:
        what = " and ".join(given) + " exclude each other" if given else "nothing to export"
        raise InputError(what, expected="--table NAME, --tree ID or --residual NAME")
    if tree is None and year is not None:
        expected = "a table with all its years" if table else "a shape that stays as it is"
        raise InputError("--year goes with --tree", expected=expected)
    if table is not None and form is None:
        check_targets((to, FRAME), force=force)
    else:
        check_target(to, overwrite=force, or_else=", or --force")
    with open_run(run_file) as run:
        if tree is not None:
            _export_tree(run, tree, year, form, to, force)
        elif residual is not None:
            _export_residual(run, residual, form, to, force)
        elif table is not None:
            _export_table(run, table, form, to, force)


def _export_table(run: Any, table: str, form: str | None, to: Path, force: bool) -> None:
    from forest import interop
    from forest.record.export import export as export_table
    from forest.record.export import write_frame

    if form is None:
        written = export_table(run, table, to, overwrite=force)
        typer.echo(f"{written}: {run.count(table):,} rows")
        return
    forms = {name: maker for (known, name), maker in _TABLES.items() if known == table}
    make: Callable[[Any], Any] = getattr(interop, _named(form, forms, f"a table of {table}"))
    rows = write_frame(lambda: make(run), to, overwrite=force)
    typer.echo(f"{to}: {rows:,} rows")


def _export_tree(
    run: Any, tree: int, year: int | None, form: str | None, to: Path, force: bool
) -> None:
    from forest import interop
    from forest.errors import InputError

    write = getattr(interop, _named(form, _TREES, "a tree"))
    if year is None and not len(run.years):
        raise InputError("holds no years yet", where=str(run.path))
    at = int(run.years[-1]) if year is None else year
    skeleton = run.skeleton(tree, at)
    written = write(skeleton, to, overwrite=force)
    typer.echo(f"{written}: {len(skeleton):,} cylinders, tree {tree} in {at}")


def _export_residual(run: Any, name: str, form: str | None, to: Path, force: bool) -> None:
    from forest import interop
    from forest.errors import InputError, nearest
    from forest.residual import grow_residual

    write = getattr(interop, _named(form, _TREES, "a tree"))
    known = {tree.name: k + 1 for k, tree in enumerate(run.scenario.residual_trees)}
    if name not in known:
        hint = nearest(name, known) if known else "the run has none"
        raise InputError(f"no residual tree '{name}', {hint}", where=str(run.path))
    tree = grow_residual(run.scenario.residual_trees[known[name] - 1], known[name])
    written = write(tree.skeleton, to, overwrite=force)
    typer.echo(f"{written}: {len(tree.skeleton):,} cylinders, residual tree '{name}'")


def _named(form: str | None, forms: dict[str, str], what: str) -> str:
    from forest.errors import InputError, nearest

    if form is None or form not in forms:
        if not forms:
            raise InputError(f"no --as for {what}", expected="table trees or stand")
        asked = "no --as" if form is None else f"no form '{form}'"
        raise InputError(f"{asked} for {what}; {nearest(form or '', forms)}")
    return forms[form]
