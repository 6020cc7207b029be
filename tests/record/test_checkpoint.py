"""A checkpoint comes back as it was, and a broken one gives way to the one before."""

from __future__ import annotations

import resource
import signal
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from forest.errors import OutputError
from forest.record.checkpoint import (
    checkpoint_paths,
    latest_checkpoint,
    remove_checkpoints,
    write_checkpoint,
)
from tests.record.years import create

ARRAYS: dict[str, NDArray[np.generic]] = {
    "tip": np.arange(30, dtype=np.float32).reshape(10, 3),
    "serial": np.arange(10, dtype=np.int32),
    "state": np.array([1, 0, 1], bool),
    "reserve": np.array([np.nan, -0.0, np.inf]),
    "none": np.empty((0, 4), np.int16),
    "scalar": np.array(3, np.uint64),
    "names": np.array(["oak", "pine"]),
}


def test_comes_back_bit_by_bit(tmp_path: Path) -> None:
    run = tmp_path / "run.h5"
    meta = {"rows": {"trees": 12}, "year": 2010, "fired": [], "who": "é"}
    path = write_checkpoint(run, ARRAYS, meta, step=10)
    assert path.name == "run.h5.checkpoint-000010.npz"
    found = latest_checkpoint(run)
    assert found is not None
    arrays, back = found
    assert back == meta
    assert arrays.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert arrays[name].dtype == array.dtype
        assert arrays[name].shape == array.shape
        assert arrays[name].tobytes() == array.tobytes()


def test_keeps_two_and_those_of_other_runs(tmp_path: Path) -> None:
    write_checkpoint(tmp_path / "other.h5", ARRAYS, {}, step=10)
    for step in (10, 20, 30):
        write_checkpoint(tmp_path / "run.h5", ARRAYS, {"step": step}, step=step)
    names = [path.name for path in checkpoint_paths(tmp_path / "run.h5")]
    assert names == ["run.h5.checkpoint-000020.npz", "run.h5.checkpoint-000030.npz"]
    remove_checkpoints(tmp_path / "run.h5")
    assert [path.name for path in tmp_path.iterdir()] == ["other.h5.checkpoint-000010.npz"]


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped", "noise"])
def test_broken_one_gives_way_to_the_one_before(tmp_path: Path, damage: str) -> None:
    run = tmp_path / "run.h5"
    for step in (10, 20):
        write_checkpoint(run, ARRAYS, {"step": step}, step=step)
    newest = checkpoint_paths(run)[-1]
    data = bytearray(newest.read_bytes())
    flipped = data.copy()
    flipped[data.index(ARRAYS["tip"].tobytes()) + 7] ^= 1
    broken = {"empty": b"", "cut": data[:-100], "flipped": flipped, "noise": b"x" * len(data)}
    newest.write_bytes(broken[damage])
    found = latest_checkpoint(run)
    assert found is not None
    assert found[1] == {"step": 10}
    checkpoint_paths(run)[0].write_bytes(b"")
    assert latest_checkpoint(run) is None


def test_full_disk_leaves_the_older_ones(tmp_path: Path) -> None:
    run = tmp_path / "run.h5"
    write_checkpoint(run, ARRAYS, {"step": 10}, step=10)
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, old[1]))
    try:
        with pytest.raises(OutputError, match="no room left on the disk"):
            write_checkpoint(run, ARRAYS, {"step": 20}, step=20)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)
        signal.signal(signal.SIGXFSZ, handler)
    found = latest_checkpoint(run)
    assert found is not None
    assert found[1] == {"step": 10}
    assert len(list(tmp_path.iterdir())) == 1


def test_a_new_run_forgets_the_old_ones_checkpoints(tmp_path: Path) -> None:
    run = tmp_path / "run.h5"
    write_checkpoint(run, ARRAYS, {}, step=10)
    create(run).close()
    assert latest_checkpoint(run) is None
