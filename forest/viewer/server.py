"""The viewer's server: a page and a websocket on the loopback interface, until Ctrl-C."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from forest.errors import InputError
from forest.viewer.guard import LOOPBACK, SOCKET, guard

DEFAULT_PORT = 8765
_PORTS_TRIED = 50


def import_trame() -> Any:
    """Import trame; say how to install it if it is not there."""
    try:
        import trame.app
        import trame_vtk  # noqa: F401
        import trame_vuetify  # noqa: F401
    except ImportError as missing:
        raise InputError(
            f"the viewer needs {missing.name}, which is not installed",
            expected="pip install 'forest-stand[view]'",
        ) from None
    return trame.app


def free_port(host: str, port: int | None) -> int:
    """Find the port to listen on.

    Parameters
    ----------
    host : str
        One of `LOOPBACK`.
    port : int, optional
        The port that is asked for, 0 for any; if not given, the first free one from
        `DEFAULT_PORT` on.

    Raises
    ------
    InputError
        If the host is not this machine's own, or the port that is asked for cannot be had.
    """
    if host not in LOOPBACK:
        raise InputError(f"--host is {host!r}", expected="localhost, 127.0.0.1 or ::1")
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"--port is {port}", expected="0 to 65535")
    if port is not None:
        wanted: Any = (port,)
    else:
        wanted = range(DEFAULT_PORT, DEFAULT_PORT + _PORTS_TRIED)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for candidate in wanted:
        with socket.socket(family) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            with contextlib.suppress(OSError):
                trial.bind((host, candidate))
                return int(trial.getsockname()[1])
    raise InputError(
        f"port {wanted[0]} cannot be listened on; another program may use it",
        expected="another --port, or none",
    )


def serve(
    trame_server: Any,
    *,
    host: str,
    port: int,
    ready: Callable[[str], None],
    stopping: Callable[[], None] = lambda: None,
    at_once: Callable[[], None] = lambda: None,
) -> None:
    """Answer browsers until SIGINT or SIGTERM, and then until what goes on in threads has ended.

    Parameters
    ----------
    trame_server : trame_server.Server
        With its page.
    host : str
        One of `LOOPBACK`.
    port : int
        Free port.
    ready : callable
        Is given the page's address once it can be opened.
    stopping : callable, optional
        Called at the first signal, to say what must end first.
    at_once : callable, optional
        Called at any later signal.
    """
    os.environ["TRAME_ARGS"] = "--server"  # so that trame does not read this process's arguments
    name = f"[{host}]" if ":" in host else host
    trame_server.controller.on_server_bind.add(lambda server: _protect(server, port))
    trame_server.controller.on_server_ready.add(lambda **_: ready(f"http://{name}:{port}/"))
    asyncio.run(_until_stopped(trame_server, host, port, stopping, at_once))


async def _until_stopped(
    trame_server: Any,
    host: str,
    port: int,
    stopping: Callable[[], None],
    at_once: Callable[[], None],
) -> None:
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()

    def asked() -> None:
        told = stop.is_set()
        stop.set()
        (at_once if told else stopping)()

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, asked)
    serving = asyncio.ensure_future(
        trame_server.start(
            port=port,
            host=host,
            thread=True,  # it leaves signals to us
            open_browser=False,
            show_connection_info=False,
            disable_logging=True,
            timeout=0,
            exec_mode="coroutine",
        )
    )
    stopped = asyncio.ensure_future(stop.wait())
    await asyncio.wait((serving, stopped), return_when=asyncio.FIRST_COMPLETED)
    if serving.done():
        stopped.cancel()
        serving.result()  # raises what kept it from listening
        return
    with contextlib.suppress(Exception):
        await asyncio.wait_for(trame_server.stop(), 3.0)
    serving.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await serving


def _protect(server: Any, port: int) -> None:
    """Put the guard before all routes, and what the client asks for first behind it.

    The client posts to a launcher of sessions before it opens its websocket; there is one session,
    and it is told where.
    """
    from aiohttp import web

    page = Path(server.config["static"]["/"]) / "index.html"

    async def root(
        request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        if request.path == "/" and request.method in ("GET", "HEAD"):
            return web.FileResponse(page, headers={"Cache-Control": "no-cache"})
        if request.path == "/paraview/" and request.method == "POST":
            return web.json_response({"sessionURL": f"ws://{request.host}{SOCKET}"})
        return await handler(request)

    server.app.middlewares.extend([guard(lambda: port), web.middleware(root)])
