"""The command line: `forest run`, and what reads its files.

Every command imports what it needs when it is called, so that help and refusals come at once.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import typer

from forest.cli.barking import bark
from forest.cli.describing import species, version
from forest.cli.exporting import export
from forest.cli.filming import movie, report
from forest.cli.growing import check, run, sweep
from forest.cli.measuring import bucking, measure
from forest.cli.planting import tree
from forest.cli.reading import info, landscape, picture, stability, table
from forest.cli.ringing import rings
from forest.cli.scenery import scene
from forest.cli.shared import STOPPED, Stopped
from forest.cli.showing import view
from forest.cli.surfacing import mesh
from forest.cli.viewing import stand_view

# The class of all wrong usage; which module holds it depends on typer's version.
_UsageError: Any = typer.BadParameter.__base__

_REFUSED = 2
_UNHEARD = 1  # as typer and rich do

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
for _command in (
    run,
    sweep,
    landscape,
    check,
    table,
    stability,
    rings,
    measure,
    bucking,
    info,
    export,
    mesh,
    bark,
    species,
    picture,
    view,
    stand_view,
    movie,
    report,
    scene,
    tree,
    version,
):
    app.command()(_command)


@app.callback(invoke_without_command=True)
def _forest(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 runs failed, 2 refused, 130 stopped.

    Parameters
    ----------
    arguments : sequence of str, optional
        The words after `forest`; those of this process if not given.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    sys.exit(_answer(lambda: app(args=words, prog_name="forest", standalone_mode=False, obj=words)))


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
    except (Stopped, KeyboardInterrupt, typer.Abort) as stop:
        typer.echo(f"forest: {str(stop) or 'stopped'}", err=True)
        return STOPPED
    except BrokenPipeError:
        # The reader (head, less) has gone; nothing is left to say, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _UNHEARD
    return code if isinstance(code, int) else 0


def _refuse(message: str) -> int:
    typer.echo(f"forest: error: {' '.join(message.split())}", err=True)
    return _REFUSED
