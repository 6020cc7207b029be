"""The threads that kernels run in.

Work is cut into a fixed number of chunks; with T threads, thread t works on every T-th chunk from
t on. Nothing that is computed depends on T.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager


class _Threads:
    """The threads that kernels run in: the caller's own, and helpers that wait for work."""

    def __init__(self) -> None:
        self.count = _cores()
        self._pool: ThreadPoolExecutor | None = None

    def run(self, kernel: Callable[..., object], args: tuple[object, ...]) -> None:
        if self.count == 1:
            kernel(0, 1, *args)
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(_cores(), thread_name_prefix="forest")
        others = [self._pool.submit(kernel, t, self.count, *args) for t in range(1, self.count)]
        try:
            kernel(0, self.count, *args)
        finally:
            for other in others:
                other.result()

    def forget(self) -> None:
        """Start anew: a forked process has none of its parent's threads."""
        self._pool = None


def _cores() -> int:
    """How many threads may run at once: FOREST_THREADS, or the cores this process may use."""
    wanted = os.environ.get("FOREST_THREADS")
    if wanted and wanted.isdigit() and int(wanted) > 0:
        return int(wanted)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_threads = _Threads()
os.register_at_fork(after_in_child=_threads.forget)


def thread_count() -> int:
    """How many threads kernels run in."""
    return _threads.count


def most_threads() -> int:
    """How many threads kernels run in unless told otherwise."""
    return _cores()


@contextmanager
def using_threads(count: int) -> Iterator[None]:
    """Let kernels run in `count` threads. No result depends on it."""
    before = _threads.count
    _threads.count = count
    try:
        yield
    finally:
        _threads.count = before


def in_threads(kernel: Callable[..., object], *args: object) -> None:
    """Run a kernel over its fixed chunks in all threads.

    The kernel's first two arguments are `first` and `step`: it works on the chunks
    `range(first, CHUNKS, step)`. A chunk writes where no other does, so that nothing depends on
    the number of threads. This compiles three times faster than numba's own `parallel`, and a
    small stand does not pay for waking a team of threads.
    """
    _threads.run(kernel, args)
