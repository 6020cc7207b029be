"""How kernels are compiled, and where the compiled code is kept.

Numba's own cache misses changes in functions and constants that a kernel takes from another file.
The cache folder is therefore named by a hash of all such files and of numba's version.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite import ir
from numba.core import cgutils, config, types
from numba.core.event import Event, Listener, install_listener
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., object])

_KEPT_CACHES = 3


def _kernel_hash() -> str:
    """Hash all sources on which compiled code hangs.

    These are the modules with kernels (they import this one) and their neighbours in the same
    room and in `trees`, since a constant of another module is compiled in as well.
    """
    root = Path(__file__).parent
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    sources = {path: path.read_bytes() for path in sorted(root.rglob("*.py"))}
    kernels = [path for path, text in sources.items() if b"forest._jit import" in text]
    rooms = {path.parent for path in kernels if path.parent != root} | {root / "trees"}
    for path, text in sources.items():
        if path in kernels or path.parent in rooms or path.name == "_jit.py":
            digest.update(path.relative_to(root).as_posix().encode())
            digest.update(text)
    return digest.hexdigest()[:16]


def _choose_cache() -> Path:
    """Choose this version's cache folder and drop the oldest of the others."""
    base = os.environ.get("FOREST_CACHE") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    root = Path(base).expanduser() / "forest-kernels"
    folder = root / _kernel_hash()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        others = sorted(root.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)
        for old in others[_KEPT_CACHES:]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:
        pass
    return folder


CACHE = _choose_cache()
config.CACHE_DIR = str(CACHE)


class _Announcer(Listener):  # type: ignore[misc]
    """Tells once that something is being compiled."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell: Callable[[], None] | None = tell

    def on_start(self, event: Event) -> None:
        """Take the start of a compilation; what comes from the cache does not start one."""
        if self._tell is not None:
            tell, self._tell = self._tell, None
            tell()

    def on_end(self, event: Event) -> None:
        """Take no notice."""


def announce_compiling(tell: Callable[[], None]) -> AbstractContextManager[None]:
    """Call `tell` once if a kernel has to be compiled while the context is open."""
    context: AbstractContextManager[None] = install_listener("numba:compile", _Announcer(tell))
    return context


_OPTIONS: dict[str, Any] = {
    "cache": True,
    "error_model": "numpy",
    "nogil": True,
    "no_cfunc_wrapper": True,
}


def njit(function: F) -> F:
    """Compile a kernel: cached, no fastmath, division as in C, run without Python's lock.

    No kernel uses numba's own threads (see `forest._threads`), nor is called from C.
    """
    return numba.njit(**_OPTIONS, _nrt=True)(function)  # type: ignore[no-any-return]


def inlined(function: F) -> F:
    """Compile a small kernel that becomes part of each kernel that calls it.

    Handing a NamedTuple of arrays to a function can cost more than what that function does.
    """
    return numba.njit(**_OPTIONS, _nrt=True, forceinline=True)(function)  # type: ignore[no-any-return]


def driver(function: F) -> F:
    """Compile a kernel that `forest._threads.in_threads` runs over its chunks.

    Its arrays belong to the caller, so references to them need not be counted: counting took up
    to half of a kernel's time. A driver must not make arrays itself; what it calls may.
    """
    return numba.njit(**_OPTIONS, _nrt=False)(function)  # type: ignore[no-any-return]


@intrinsic  # type: ignore[untyped-decorator]
def move_bytes(typing_context: Any, to: Any, source: Any, count: Any) -> Any:
    """Copy `count` bytes from one address to another, which may overlap (C's memmove)."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        target, origin = (builder.inttoptr(address, byte) for address in arguments[:2])
        cgutils.raw_memmove(builder, target, origin, arguments[2], 1)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), emit
