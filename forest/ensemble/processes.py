"""The processes that the runs of a sweep are dealt to, by dask.distributed."""

from __future__ import annotations

import contextlib
import logging
import signal
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from forest.errors import InputError

if TYPE_CHECKING:
    from distributed import Client

_PATIENCE_S = 20  # with a scheduler that does not answer


def check_dask() -> None:
    """Refuse to start where dask is not installed.

    Raises
    ------
    InputError
        If it is not.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "dask is not installed, and it deals the runs to processes",
            where="forest sweep",
            expected="pip install 'forest-stand[cluster]'",
        ) from None


@contextlib.contextmanager
def processes(workers: int | None, scheduler: str | None, runs: int) -> Iterator[Client]:
    """Start processes on this machine, or connect to a cluster that runs already.

    Parameters
    ----------
    workers : int, optional
        Processes to start; by default as many as there are cores, but no more than runs.
    scheduler : str, optional
        Address of the scheduler of a cluster.
    runs : int
        Runs to deal.

    Raises
    ------
    InputError
        If no scheduler answers, or its workers have several threads each.
    """
    from dask.system import CPU_COUNT
    from distributed import Client

    if scheduler is not None:
        with _connected(scheduler) as client:
            yield client
        return
    count = min(CPU_COUNT, runs) if workers is None else workers
    with _local_cluster(count) as cluster, Client(cluster) as client:
        yield client


@contextlib.contextmanager
def _local_cluster(count: int) -> Iterator[Any]:
    import dask
    from distributed import LocalCluster

    # A run that crashes its worker must not bring down another one that waits behind it.
    with dask.config.set({"distributed.scheduler.worker-saturation": 1.0}):
        with _interrupts_ignored():
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
                memory_limit=0,  # shares would stop a large run while others are small
                silence_logs=logging.CRITICAL,
            )
        with cluster:
            yield cluster


@contextlib.contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Let processes be started that ignore Ctrl-C: this one decides what becomes of them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    from distributed import Client

    try:
        client = Client(scheduler, timeout=_PATIENCE_S)
    except (OSError, ValueError) as error:
        raise InputError(
            "no scheduler answers",
            where=f"--scheduler {scheduler}",
            expected="the address that `dask scheduler` prints, as tcp://host:8786",
        ) from error
    with client:
        threads = {w["nthreads"] for w in client.scheduler_info(n_workers=-1)["workers"].values()}
        if threads - {1}:
            raise InputError(
                f"has workers of {max(threads)} threads",
                where=f"--scheduler {scheduler}",
                expected="one thread each: dask worker --nthreads 1 --nworkers N",
            )
        yield client
