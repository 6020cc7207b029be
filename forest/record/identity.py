"""Telling run files from other files, and damaged ones from whole ones."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import h5py

from forest.errors import InputError
from forest.record.schema import FILE_TYPE, SCHEMA_VERSION

_SIGNATURE = b"\x89HDF\r\n\x1a\n"

# What h5py raises on a file whose bytes are not what they were.
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError)


def check_run_file(path: Path) -> None:
    """Refuse what is not a run file, in one line.

    Raises
    ------
    InputError
        If the file is missing, empty, not HDF5, or cannot be read.
    """
    try:
        with path.open("rb") as file:
            head = file.read(8)
    except FileNotFoundError as error:
        raise InputError("no such file", where=str(path)) from error
    except OSError as error:
        reason = error.strerror or "failed"
        raise InputError(f"cannot be read: {reason.lower()}", where=str(path)) from error
    if not head:
        raise InputError("is empty", where=str(path), expected="a run file")
    if head != _SIGNATURE:
        raise InputError("is not a run file", where=str(path), expected="a file made by forest run")


def check_identity(file: h5py.File, path: Path) -> None:
    """Refuse HDF5 files of other programs, and run files of a later schema.

    Raises
    ------
    InputError
        If it is one.
    """
    if file.attrs.get("file_type") != FILE_TYPE:
        raise InputError("is HDF5, but not a run file", where=str(path), expected="a run file")
    version = int(file.attrs["schema_version"])
    if version > SCHEMA_VERSION:
        raise InputError(
            f"is of schema version {version}",
            where=str(path),
            expected=f"a version up to {SCHEMA_VERSION}",
        )


@contextlib.contextmanager
def damage_reported(path: Path) -> Iterator[None]:
    """Turn what h5py raises on a damaged file into one line."""
    try:
        yield
    except InputError:
        raise
    except _DAMAGE as error:
        raise InputError("is cut short or damaged", where=str(path)) from error
