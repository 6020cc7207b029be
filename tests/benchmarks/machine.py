"""The machine: what it is, how fast it copies, and how much memory a process holds (Linux)."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

_STATUS = Path("/proc/self/status")
#: Length of the arrays that are copied: far beyond any cache.
_COPIED_BYTES = 512 * 2**20
_COPIES = 5


def describe() -> dict[str, Any]:
    """Name the processor, the memory and the versions that the figures depend on."""
    import numba

    import forest

    model = platform.processor()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "memory_gb": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9,
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "forest": forest.__version__,
    }


def copy_bandwidth(threads: int) -> float:
    """Read and written bytes per second of copying a large array, with so many threads."""
    source = np.ones(_COPIED_BYTES // 8)
    target = np.zeros_like(source)
    parts = np.array_split(np.arange(len(source)), threads)
    slices = [slice(int(part[0]), int(part[-1]) + 1) for part in parts]

    def copy(part: slice) -> None:
        np.copyto(target[part], source[part])

    times = []
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(_COPIES + 1):
            start = time.perf_counter()
            list(pool.map(copy, slices))
            times.append(time.perf_counter() - start)
    return 2 * source.nbytes / statistics.median(times[1:])


def resident_bytes() -> int:
    """Memory that this process holds now."""
    return _status("VmRSS")


def peak_bytes() -> int:
    """Most memory that this process held since its start or the last `forget_peak`."""
    return _status("VmHWM")


def forget_peak() -> None:
    """Count the peak from now on."""
    Path("/proc/self/clear_refs").write_text("5")


def _status(key: str) -> int:
    for line in _STATUS.read_text().splitlines():
        if line.startswith(key + ":"):
            return int(line.split()[1]) * 1024
    raise KeyError(key)


class Others:
    """How much processor time other programs take while this one measures."""

    def __init__(self) -> None:
        self._begun = self._read()

    def share(self) -> float:
        """Share of all cores' time since the start that went to others; children are not others."""
        total, busy, own = (b - a for a, b in zip(self._begun, self._read(), strict=True))
        return max(busy - own, 0.0) / total

    def _read(self) -> tuple[float, float, float]:
        fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:9]
        ticks = [int(field) for field in fields]
        per_second = os.sysconf("SC_CLK_TCK")
        idle = ticks[3] + ticks[4]
        return sum(ticks) / per_second, (sum(ticks) - idle) / per_second, sum(os.times()[:4])


def alone(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a fresh process, so that its memory and its kernels are its own."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(function, *arguments).result()
