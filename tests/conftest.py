"""What every test relies on: two threads, pictures off screen, reproducible properties.

The environment is set before numba, matplotlib or VTK are imported.
"""

from __future__ import annotations

import argparse
import os
import shutil
from pathlib import Path

import pytest
from hypothesis import settings

os.environ.setdefault("FOREST_THREADS", "2")
# Threads of linear algebra wait for each other where workers share cores: seconds a solution.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.setdefault("PYVISTA_OFF_SCREEN", "true")
os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

settings.register_profile("here", deadline=None, max_examples=30)
settings.register_profile("ci", settings.get_profile("here"), derandomize=True, database=None)
settings.load_profile("ci" if os.environ.get("CI") else "here")


@pytest.fixture
def three_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a test ask for up to three threads, on however few the other tests run."""
    monkeypatch.setenv("FOREST_THREADS", "3")


#: Files that take longest are begun first, so that no worker is left alone with one in the end;
#: those that wait for a browser or for processes stand beside others that compute.
_FIRST = ("viewer/test_live.py", "test_sweep.py", "viewer/test_page.py", "scenario/test_trials.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of long files first (see the Makefile: files are dealt in this order)."""
    here = Path(__file__).parent
    rank = {here / name: k for k, name in enumerate(_FIRST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let the expectations of tests/golden be rewritten, for a reason that they keep."""
    parser.addoption(
        "--update-goldens",
        metavar="REASON",
        type=_reason,
        help="rewrite the expected numbers in tests/golden; the reason is kept beside them",
    )


def _reason(text: str) -> str:
    words = " ".join(text.split())
    if len(words) < 8:
        raise argparse.ArgumentTypeError("say in some words why the numbers may change")
    return words


def _take_own_cache(worker: str) -> None:
    """Give a test worker its own copy of the kernel cache.

    Two processes that add different signatures to one cache can leave an index that names the
    other's code. A worker therefore writes only to its own folder, which starts as a copy of the
    cache that `forest.warm` filled.
    """
    base = os.environ.get("FOREST_CACHE") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    shared = Path(base).expanduser() / "forest-kernels"
    os.environ["FOREST_CACHE"] = str(shared.parent / "forest-kernels-tests" / worker)
    from forest._jit import CACHE

    warm = shared / CACHE.name
    if not any(CACHE.rglob("*.nbi")) and warm.is_dir():
        shutil.copytree(warm, CACHE, dirs_exist_ok=True)


if "PYTEST_XDIST_WORKER" in os.environ:
    _take_own_cache(os.environ["PYTEST_XDIST_WORKER"])
