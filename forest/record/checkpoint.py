"""Checkpoints: all that the next year needs, each a file of its own beside the run file."""

from __future__ import annotations

import json
import os
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, OutputError

_KEPT = 2
_META = "meta_json"
_BROKEN = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)

Arrays = dict[str, NDArray[Any]]


def checkpoint_paths(run_path: str | Path) -> list[Path]:
    """List the checkpoints of a run, the oldest first."""
    run_path = Path(run_path)
    pattern = re.compile(re.escape(run_path.name) + r"\.checkpoint-(\d{6})\.npz")
    found = (path for path in run_path.parent.glob("*.npz") if pattern.fullmatch(path.name))
    return sorted(found)


def write_checkpoint(
    run_path: str | Path, arrays: Mapping[str, NDArray[Any]], meta: Mapping[str, Any], *, step: int
) -> Path:
    """Write a checkpoint, check it, and drop all but the last two.

    Parameters
    ----------
    run_path : path
        The run file that it belongs to.
    arrays : mapping of str to array
        Any dtype but object, any shape.
    meta : mapping
        What JSON can hold; among it the rows of the run file.
    step : int
        Whole years done; part of the name.

    Returns
    -------
    Path
        Its file, e.g. ``run.h5.checkpoint-000010.npz``.

    Raises
    ------
    OutputError
        If the disk is full or fails; the older checkpoints stay.
    """
    run_path = Path(run_path)
    path = run_path.with_name(f"{run_path.name}.checkpoint-{step:06d}.npz")
    draft = path.with_suffix(".npz.part")
    text = np.frombuffer(json.dumps(meta, allow_nan=False).encode(), np.uint8)
    try:
        with draft.open("wb") as file:
            np.savez(file, allow_pickle=False, **{_META: text}, **arrays)
            file.flush()
            os.fsync(file.fileno())
        _verify(draft)
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise OutputError.of(error, path) from error
    for old in checkpoint_paths(run_path)[:-_KEPT]:
        old.unlink(missing_ok=True)
    return path


def latest_checkpoint(run_path: str | Path) -> tuple[Arrays, dict[str, Any]] | None:
    """Read the newest checkpoint that is whole; None if there is none.

    Returns
    -------
    arrays : dict of str to array
    meta : dict
    """
    for path in reversed(checkpoint_paths(run_path)):
        try:
            return read_checkpoint(path)
        except InputError:
            continue
    return None


def read_checkpoint(path: Path) -> tuple[Arrays, dict[str, Any]]:
    """Read one checkpoint.

    Returns
    -------
    arrays : dict of str to array
    meta : dict

    Raises
    ------
    InputError
        If it is not whole.
    """
    try:
        _verify(path)
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        meta = json.loads(arrays.pop(_META).tobytes())
    except _BROKEN:
        raise InputError("is broken", where=path.name) from None
    return arrays, meta


def step_of(path: Path) -> int:
    """Give the whole years done, which a checkpoint's name ends in."""
    return int(path.stem[-6:])


def remove_checkpoints(run_path: str | Path) -> None:
    """Remove all checkpoints of a run."""
    for path in checkpoint_paths(run_path):
        path.unlink(missing_ok=True)


def _verify(path: Path) -> None:
    """Read a checkpoint again and compare the checksums of all its arrays."""
    with zipfile.ZipFile(path) as archive:
        broken = archive.testzip()
    if broken is not None:
        raise OSError(None, f"the array {broken} was not written as it was meant", str(path))
