"""Where a run comes from: a small JSON document, checked when it is written and when it is read."""

from __future__ import annotations

import os
import platform
import resource
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib import metadata

from pydantic import BaseModel, ConfigDict, Field

_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "h5py")


class Environment(BaseModel):
    """The machine."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    platform: str
    processor: str
    python: str
    cpu_count: int = Field(ge=1)
    threads: int = Field(ge=1)


class Session(BaseModel):
    """One stretch of computing; a resumed run has several."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    command: tuple[str, ...]
    environment: Environment
    software: dict[str, str]
    years_before: int = Field(ge=0, description="whole years on file when it began")
    started: datetime
    finished: datetime | None = None
    elapsed_s: float | None = Field(default=None, ge=0)
    peak_memory_bytes: int | None = Field(default=None, ge=0)


class Provenance(BaseModel):
    """What made a run file."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    scenario_sha256: str
    seed: int = Field(ge=0)
    sessions: tuple[Session, ...] = Field(min_length=1)


def begin_session(threads: int, *, years_before: int = 0, command: Sequence[str] = ()) -> Session:
    """Describe this process, on this machine, now."""
    versions = {"forest": metadata.version("forest-stand")}
    versions.update({name: metadata.version(name) for name in _LIBRARIES})
    return Session(
        command=tuple(command or sys.argv),
        environment=Environment(
            platform=platform.platform(),
            processor=platform.machine(),
            python=platform.python_version(),
            cpu_count=os.cpu_count() or 1,
            threads=threads,
        ),
        software=versions,
        years_before=years_before,
        started=datetime.now(UTC),
    )


def end_session(session: Session, elapsed_s: float) -> Session:
    """Add the time and the memory that it took."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    if sys.platform != "darwin":  # the one system that counts bytes, not KiB
        peak *= 1024
    return session.model_copy(
        update={
            "finished": datetime.now(UTC),
            "elapsed_s": round(elapsed_s, 3),
            "peak_memory_bytes": peak,
        }
    )


class Stopwatch:
    """Time since it was made, by a clock that is never set back."""

    def __init__(self) -> None:
        self._start = time.monotonic()

    @property
    def elapsed_s(self) -> float:
        """Seconds."""
        return time.monotonic() - self._start
