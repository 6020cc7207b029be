"""Who may talk to the viewer, and how it starts and ends."""

from __future__ import annotations

import base64
import http.client
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from forest.errors import InputError
from forest.viewer.guard import is_own_host, is_own_origin
from forest.viewer.peers import is_own_user
from forest.viewer.server import DEFAULT_PORT, free_port
from tests.tiny import forest
from tests.viewer.browser import Viewing


def _asked(port: int, path: str, **headers: str) -> int:
    """Send a request with these headers, `Host` among them; give the status."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    try:
        return connection.getresponse().status
    finally:
        connection.close()


def _upgrade(port: int, origin: str, host: str | None = None) -> int:
    headers = {
        "Host": host or f"127.0.0.1:{port}",
        "Origin": origin,
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": base64.b64encode(os.urandom(16)).decode(),
    }
    return _asked(port, "/ws", **headers)


def test_only_its_own_name_and_pages_are_answered(viewing: Viewing) -> None:
    port = viewing.port
    for name in ("127.0.0.1", "localhost", "[::1]"):
        assert _asked(port, "/", Host=f"{name}:{port}") == 200
    for host in ("evil.example", f"evil.example:{port}", "127.0.0.1", f"127.0.0.1:{port + 1}", ""):
        assert _asked(port, "/", Host=host) == 403
        assert _upgrade(port, f"http://{host}", host=host) == 403
    assert _upgrade(port, f"http://127.0.0.1:{port}") == 101
    for origin in ("http://evil.example", f"https://127.0.0.1:{port}", "null", "http://localhost"):
        assert _upgrade(port, origin) == 403
    assert _asked(port, "/../../etc/passwd") in (403, 404)


def test_where_the_websocket_is_nothing_else_is_answered(viewing: Viewing) -> None:
    assert _asked(viewing.port, "/ws") == 426


_AS_NOBODY = """
import encodings.idna, os, socket
os.setgroups([]), os.setgid(65534), os.setuid(65534)
with socket.create_connection(("127.0.0.1", {port}), timeout=20) as line:
    line.sendall(b"GET {path} HTTP/1.1\\r\\nHost: 127.0.0.1:{port}\\r\\n\\r\\n")
    print(line.recv(4000).decode())
"""


@pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root can be another user")
@pytest.mark.parametrize("path", ["/", "/ws"])
def test_other_users_of_the_machine_are_refused(viewing: Viewing, path: str) -> None:
    code = _AS_NOBODY.format(port=viewing.port, path=path)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.startswith("HTTP/1.1 403"), done
    assert "user who started it" in done.stdout


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="this system does not tell")
@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_the_kernel_tells_whose_a_connection_is(host: str) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as server, socket.socket(family) as client:
        try:
            server.bind((host, 0))
        except OSError:
            pytest.skip("no such interface")
        server.listen()
        client.connect(server.getsockname()[:2])
        line, peer = server.accept()
        with line:
            here = line.getsockname()[:2]
            assert is_own_user(peer[:2], here)
            assert not is_own_user((host, 1), here)
            client.close()  # its process holds it no longer
            assert not is_own_user(peer[:2], here)


_HELD = """
import asyncio, os, time
from types import SimpleNamespace
from forest.viewer.server import serve

class Server:
    controller = SimpleNamespace(on_server_bind=set(), on_server_ready=set())
    async def start(self, **_):
        asyncio.get_running_loop().run_in_executor(None, time.sleep, 600)  # as a year does
        print("ready", flush=True)
        await asyncio.Event().wait()
    async def stop(self):
        pass

serve(Server(), host="127.0.0.1", port=1, ready=print,
      stopping=lambda: print("finishing", flush=True), at_once=lambda: os._exit(130))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_must_end_first_is_said_and_a_second_signal_does_not_wait(number: int) -> None:
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", _HELD], stdout=pipe, text=True) as held:
        assert held.stdout is not None
        try:
            assert held.stdout.readline() == "ready\n"
            held.send_signal(number)
            assert held.stdout.readline() == "finishing\n"
            assert held.poll() is None
            held.send_signal(number)
            assert held.wait(60) == 130
        finally:
            held.kill()


def test_it_listens_on_loopback_alone(viewing: Viewing) -> None:
    with socket.socket() as line:
        line.bind(("127.0.0.2", 0))  # another address of this machine is not listened on
        with pytest.raises(OSError):
            socket.create_connection(("127.0.0.2", viewing.port), timeout=5)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_cleanly(run_path: Path, number: int) -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    code, out, err = Viewing(run_path, "--port", "0").stop(number)
    assert (code, out.strip(), err) == (0, "forest view: closed", "")


def test_headers_are_told_apart() -> None:
    assert is_own_host("LocalHost:8765", 8765)
    assert not is_own_host("localhost.evil.example:8765", 8765)
    assert not is_own_host("user@localhost:8765", 8765)
    assert not is_own_host("localhost:port", 8765)
    assert is_own_origin(None, 8765)
    assert is_own_origin("http://[::1]:8765", 8765)
    assert not is_own_origin("file://", 8765)


def test_a_port_that_is_taken_is_refused_or_passed_by() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(InputError, match="cannot be listened on"):
            free_port("127.0.0.1", taken.getsockname()[1])
    assert free_port("127.0.0.1", None) >= DEFAULT_PORT
    assert free_port("localhost", 0) > 0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nothing.h5",), "nothing.h5"),
        (("RUN", "--host", "0.0.0.0"), "--host is '0.0.0.0'"),
        (("RUN", "--port", "99999"), "--port is 99999"),
        (("NOT_A_RUN",), "text.h5"),
    ],
)
def test_bad_input_is_one_line(
    run_path: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    pytest.importorskip("trame_vtk", reason="the extra 'view' is not installed")
    text = tmp_path / "text.h5"
    text.write_text("no run")
    named = {"RUN": str(run_path), "NOT_A_RUN": str(text)}
    code, out, err = forest("view", *(named.get(word, word) for word in words), "--no-browser")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and said in err
