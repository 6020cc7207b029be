"""The commands that say what the program itself brings: species, version."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from forest.species import Species


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


def version() -> None:
    """Print the program's version."""
    from forest import __version__

    typer.echo(f"forest {__version__}")


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
