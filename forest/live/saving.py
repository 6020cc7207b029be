"""A text file that is replaced whole or not at all."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from forest.errors import OutputError


def write_whole(path: Path, text: str) -> None:
    """Write a text beside a file, wait for the disk, and put it in the file's place.

    Raises
    ------
    OutputError
        If it cannot be written; what was there before stays.
    """
    draft = None
    try:
        mode = path.stat().st_mode & 0o777 if path.exists() else 0o644
        handle, draft = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        Path(draft).chmod(mode)
        Path(draft).replace(path)
        draft = None
    except OSError as error:
        raise OutputError.of(error, path) from error
    finally:
        if draft is not None:
            Path(draft).unlink(missing_ok=True)
