"""Who may talk to the viewer: its user, through a page that the viewer itself has served.

The server listens on the loopback interface alone. That does not keep out a web page from
elsewhere, which the user's own browser has open: it may point a name of its own at 127.0.0.1 (DNS
rebinding, which shows in the Host header) or open a websocket across origins (which shows in the
Origin header). Both headers are therefore checked on each request, that of the websocket included.
Nor does it keep out other users of the machine: whose a connection is, the kernel is asked.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any
from urllib.parse import urlsplit

from forest.viewer.peers import is_own_user

#: Names of this machine's loopback interface.
LOOPBACK = ("localhost", "127.0.0.1", "::1")
#: Where the websocket is.
SOCKET = "/ws"

# The client compiles its templates (eval) and shows pictures from memory; all else is our own.
_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws://localhost:{port} ws://127.0.0.1:{port} data: blob:; "
    "worker-src 'self' blob:; "
    "frame-ancestors 'none'; form-action 'none'; base-uri 'self'"
)


def is_own_host(host: str, port: int) -> bool:
    """Tell whether a Host header names this server: a loopback name with its port."""
    try:
        parts = urlsplit(f"//{host}")
        return parts.hostname in LOOPBACK and (parts.port or 80) == port and "@" not in host
    except ValueError:
        return False


def is_own_origin(origin: str | None, port: int) -> bool:
    """Tell whether an Origin header is that of a page of this server; programs send none."""
    if origin is None:
        return True
    scheme, _, host = origin.partition("://")
    return scheme == "http" and is_own_host(host, port)


def guard(port_of: Callable[[], int]) -> Any:
    """Make the middleware of aiohttp that answers 403 to whom the viewer is not for.

    What is no websocket gets 426 where the websocket is.

    Parameters
    ----------
    port_of : callable
        Gives the port on which the server listens.
    """
    from aiohttp import web

    async def refuse_strangers(
        request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
    ) -> web.StreamResponse:
        port = port_of()
        ends = [request.get_extra_info(name) for name in ("peername", "sockname")]
        if not all(ends) or not is_own_user(*(end[:2] for end in ends)):
            return web.Response(
                status=403,
                text="This viewer answers to the user who started it alone.\n"
                "Start one of your own: forest view RUN.h5\n",
            )
        if not is_own_host(request.headers.get("Host", ""), port):
            return web.Response(status=403, text="This viewer answers to its own address alone.\n")
        if not is_own_origin(request.headers.get("Origin"), port):
            return web.Response(status=403, text="This viewer answers to its own pages alone.\n")
        if request.path == SOCKET and request.headers.get("Upgrade", "").lower() != "websocket":
            return web.Response(
                status=426,
                headers={"Upgrade": "websocket", "Connection": "Upgrade"},
                text="This is where the page's websocket is; open / in a browser.\n",
            )
        response = await handler(request)
        if not response.prepared:
            response.headers["Content-Security-Policy"] = _POLICY.format(port=port)
            response.headers["X-Content-Type-Options"] = "nosniff"
            response.headers["Referrer-Policy"] = "no-referrer"
        return response

    return web.middleware(refuse_strangers)
