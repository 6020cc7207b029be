"""The command that shows a stand in the browser: `forest view`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def view(
    file: Annotated[Path, typer.Argument(metavar="RUN.h5", help="A run file, finished or not.")],
    port: Annotated[
        int | None,
        typer.Option(help="Default: 8765, or the next one that is free. 0: any free one."),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Name of this machine that is listened on: loopback names only.")
    ] = "127.0.0.1",
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Only say where the page is.")
    ] = False,
) -> None:
    """Show a stand in 3D in the browser: its years, its trees, their rings.

    The page is served on this machine and to this machine alone. Ctrl-C ends it.

    Examples:

        forest view run.h5

        forest view run.h5 --port 9000 --no-browser
    """
    from forest.viewer.server import free_port, import_trame, serve

    import_trame()
    free = free_port(host, port)
    from forest.record.run import open_run
    from forest.viewer.app import App
    from forest.viewer.source import RunSource

    with open_run(file) as run:
        app = App(RunSource(run))

        def ready(address: str) -> None:
            typer.echo(f"{file.name} is shown at {address} (Ctrl-C ends it)")
            if not no_browser:
                import webbrowser

                webbrowser.open(address)

        serve(app.server, host=host, port=free, ready=ready)
    typer.echo("forest view: closed")
