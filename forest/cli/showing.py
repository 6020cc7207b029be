"""The command that shows a stand in the browser: `forest view`."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from forest.cli.shared import STOPPED

if TYPE_CHECKING:
    from forest.viewer.app import App


def view(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="RUN.h5|SCENARIO.toml",
            help="A run file, finished or not; or a scenario, to grow it and work on it live.",
        ),
    ],
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
    session: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml",
            help="Of a scenario: where the session is kept, and taken up again; "
            "default: the scenario's name.session.toml.",
        ),
    ] = None,
) -> None:
    """Show a stand in 3D in the browser: its years, its trees, their rings.

    A scenario is grown live: run, pause, step; fell, prune, bend, plant, draw with the brush.
    All that is done is kept in the session's file, a scenario that replays it to the same bits.

    The page is served on this machine and to its user alone. Ctrl-C ends it.

    Examples:

        forest view run.h5

        forest view run.h5 --port 9000 --no-browser

        forest view scenarios/shaped_tree.toml
    """
    from forest.errors import InputError
    from forest.viewer.server import free_port, import_trame

    live = file.suffix.lower() == ".toml"
    if session is not None and not live:
        raise InputError(f"--session is given with {file.name}", expected="a scenario (.toml)")
    import_trame()
    free = free_port(host, port)
    if live:
        _view_live(file, session or Path(f"{file.stem}.session.toml"), host, free, not no_browser)
    else:
        _view_run(file, host, free, not no_browser)
    typer.echo("forest view: closed")


def _view_run(file: Path, host: str, port: int, browser: bool) -> None:
    from forest.record.run import open_run
    from forest.viewer.app import App
    from forest.viewer.server import serve
    from forest.viewer.source import RunSource

    with open_run(file) as run:
        app = App(RunSource(run))
        serve(
            app.server,
            host=host,
            port=port,
            ready=_ready(file.name, browser),
            stopping=lambda: _say_what_ends(app),
            at_once=lambda: _stop_at_once(""),
        )


def _view_live(file: Path, session_file: Path, host: str, port: int, browser: bool) -> None:
    from forest.errors import InputError, years_of
    from forest.live import take_up
    from forest.scenario import Scenario
    from forest.viewer.app import App
    from forest.viewer.live import LivePart
    from forest.viewer.live_source import LiveSource
    from forest.viewer.server import serve

    if session_file.resolve() == file.resolve():
        raise InputError(
            f"--session is {file.name} itself", expected="another file, or none for a new one"
        )
    scenario = Scenario.load(file)
    session = take_up(scenario, session_file, say=lambda line: typer.echo(line, err=True))
    part, source = LivePart(), LiveSource(session, str(session_file))
    app = App(source, panels=(part.panel,))
    done = f", {years_of(len(session.records))} grown" if session.records else ""
    replay = shlex.join(["forest", "run", str(session_file), "--out", f"{session_file.stem}.h5"])

    def stop_at_once() -> None:
        within = f" within {app.state.live_next}, which is lost" if source.growing else ""
        source.close()
        _stop_at_once(f"{within}; all before it is kept in {session_file}")

    try:
        serve(
            app.server,
            host=host,
            port=port,
            ready=_ready(f"{file.name}{done}", browser),
            stopping=lambda: _say_what_ends(app),
            at_once=stop_at_once,
        )
    finally:
        part.desk.finish()
    typer.echo(f"the session is kept in {session_file}; it is grown again by: {replay}")


def _ready(what: str, browser: bool) -> Callable[[str], None]:
    def ready(address: str) -> None:
        typer.echo(f"{what} is shown at {address} (Ctrl-C ends it)")
        if browser:
            import webbrowser

            webbrowser.open(address)

    return ready


def _say_what_ends(app: App) -> None:
    """Say for what the program waits before it ends."""
    if app.state.live_growing:
        what = f"year {app.state.live_next}"
    elif app.state.shape_busy or app.state.light_busy:
        what = "what is being made"
    else:
        return
    typer.echo(f"forest view: finishing {what}; again to stop at once", err=True)


def _stop_at_once(where: str) -> None:
    """End the program, whatever its threads do: they cannot be ended otherwise."""
    typer.echo(f"forest view: stopped{where}", err=True)
    os._exit(STOPPED)
