"""Tables of a run for other programs, and a run in a few lines."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from forest.errors import InputError, OutputError
from forest.record.run import Run

if TYPE_CHECKING:
    import pandas as pd

_SUFFIXES = (".csv", ".parquet")


def export(run: Run, table: str, to: str | Path, *, overwrite: bool = False) -> Path:
    """Write a table of a run to a file of its own.

    Parameters
    ----------
    run : Run
        The run.
    table : str
        One of its tables.
    to : path
        The file; its suffix, ``.csv`` or ``.parquet``, names the format.
    overwrite : bool
        Whether to replace a file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If there is no such table, the suffix is another one, or the file exists.
    OutputError
        If it cannot be written. Nothing half-written is left behind.
    """
    write_frame(lambda: run.read(table), to, overwrite=overwrite)
    return Path(to)


def write_frame(
    make: Callable[[], pd.DataFrame], to: str | Path, *, overwrite: bool = False
) -> int:
    """Write a frame as `export` does; it is made when the path is known to be good.

    Returns
    -------
    int
        Number of its rows.
    """
    suffix = Path(to).suffix.lower()
    if suffix not in _SUFFIXES:
        expected = f"a name that ends in {' or '.join(_SUFFIXES)}"
        raise InputError(f"unknown format '{suffix}'", where=str(to), expected=expected)
    with whole_file(to, overwrite=overwrite) as draft:
        frame = make()
        if suffix == ".csv":
            frame.to_csv(draft, index=False)
        else:
            frame.to_parquet(draft, index=False)
    return len(frame)


def check_target(to: Path, *, overwrite: bool, or_else: str = "") -> None:
    """Refuse a path to which no file can be written. Writes nothing.

    Parameters
    ----------
    to : path
        The file; with an .obj goes its .mtl, with a .vtm the folder of its blocks.
    overwrite : bool
        Whether to replace what is there.
    or_else : str
        How the user could ask for that.

    Raises
    ------
    InputError
        If the file exists and must not be replaced, or is a folder.
    OutputError
        If there is no folder for it, or none that can be written.
    """
    try:
        if to.is_dir():
            raise InputError("is a folder", where=str(to), expected="the path of a file")
        check_folder(to.parent, where=to)
        blocks = to.with_suffix("") if to.suffix.lower() == ".vtm" else None
        beside = to.with_suffix(".mtl") if to.suffix.lower() == ".obj" else blocks
        for path in filter(None, (to, beside)):
            if path.exists() and not overwrite:
                raise InputError("exists already", where=str(path), expected=f"a new path{or_else}")
        if blocks is not None and blocks.exists() and not _holds_blocks(blocks):
            raise InputError(
                "exists already and holds other things",
                where=str(blocks),
                expected="room for the blocks",
            )
    except OSError as error:
        raise OutputError.of(error, to) from error


def check_folder(folder: Path, *, where: Path) -> None:
    """Refuse a folder that is not there, or into which nothing can be written.

    Raises
    ------
    OutputError
        If nothing can be written.
    """
    if folder.exists() and not folder.is_dir():
        what, expected = f"cannot be written: '{folder}' is a file", "a path in a folder"
        raise OutputError(what, where=str(where), expected=expected)
    if not folder.is_dir():
        what, expected = (
            f"cannot be written: there is no folder '{folder}'",
            "a folder that is there already",
        )
        raise OutputError(what, where=str(where), expected=expected)
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise OutputError.of(error, where) from error


def draft_prefix(to: Path) -> str:
    """Begin the name of a draft: hidden, and so short that a long name of a file leaves room."""
    return f".{to.name[:40]}."


def _holds_blocks(folder: Path) -> bool:
    return folder.is_dir() and all(path.suffix == ".vtp" for path in folder.iterdir())


@contextmanager
def whole_file(to: str | Path, *, overwrite: bool) -> Iterator[Path]:
    """Give the path of a draft that becomes the file when it is done, whole or not at all.

    What is written beside the draft, in its folder, goes with it.

    Raises
    ------
    InputError
        If the file exists and must not be replaced, or is a folder.
    OutputError
        If it cannot be written.
    """
    to = Path(to)
    check_target(to, overwrite=overwrite)
    try:
        # A folder of its own: the draft keeps the suffix, and the rights are the usual ones.
        with tempfile.TemporaryDirectory(prefix=draft_prefix(to), dir=to.parent) as folder:
            draft = Path(folder) / to.name
            yield draft
            beside = [path for path in sorted(draft.parent.iterdir()) if path != draft]
            places = [to.with_name(path.name) for path in beside]
            for place in places:
                if place.exists() and not overwrite:
                    raise InputError("exists already", where=str(place), expected="a new path")
            for path, place in zip(beside, places, strict=True):
                if path.is_dir() and place.is_dir():
                    shutil.rmtree(place)
                path.replace(place)
            draft.replace(to)
    except OSError as error:
        raise OutputError.of(error, to) from error
    except OutputError as error:  # of the draft, whose name says nothing
        if isinstance(error.__cause__, OSError):
            raise OutputError.of(error.__cause__, to) from error.__cause__
        raise


@contextmanager
def whole_folder(to: Path) -> Iterator[Path]:
    """Give a draft of a folder, whose files come into the folder when all of them are done.

    Files of the same names are replaced, others stay.

    Raises
    ------
    OutputError
        If they cannot be written.
    """
    check_folder(to.parent, where=to)
    try:
        with tempfile.TemporaryDirectory(prefix=draft_prefix(to), dir=to.parent) as folder:
            yield Path(folder)
            for path in sorted(Path(folder).rglob("*")):
                place = to / path.relative_to(folder)
                if path.is_dir():
                    continue
                place.parent.mkdir(parents=True, exist_ok=True)
                path.replace(place)
    except OSError as error:
        raise OutputError.of(error, to) from error


def info(run: Run) -> list[tuple[str, str]]:
    """Describe a run in a few lines.

    Returns
    -------
    list of (label, text)
    """
    provenance = run.provenance
    sessions = provenance["sessions"]
    last = sessions[-1]
    seconds = sum(session["elapsed_s"] or 0.0 for session in sessions)
    lines = [
        ("file", f"{run.path} ({_size(run.path.stat().st_size)})"),
        ("state", "complete" if run.complete else "not complete: forest run --resume goes on"),
        ("years", _span(run)),
        ("species", ", ".join(run.species_names)),
        ("tables", ", ".join(f"{name} ({run.count(name):,})" for name in run.tables)),
        ("trees", _fates(run)),
        ("sample trees", ", ".join(map(str, run.samples)) or "none"),
        ("scenario", f"sha256 {provenance['scenario_sha256']}"),
        ("seed", str(provenance["seed"])),
        ("made by", f"forest {last['software']['forest']}, started {sessions[0]['started'][:19]}"),
        (
            "made on",
            f"{last['environment']['platform']}, {last['environment']['threads']} threads"
            f" of {last['environment']['cpu_count']} processors",
        ),
        ("time", f"{seconds:.1f} s in {len(sessions)} session(s)"),
    ]
    if last["peak_memory_bytes"]:
        lines.append(("memory", f"{_size(last['peak_memory_bytes'])} at most"))
    return lines


def _fates(run: Run) -> str:
    """Sum up what became of the trees, by cause where the events are on file."""
    if not len(run.years):
        return "none yet"
    if "events" in run.tables:
        ledger = run.ledger
        totals = ledger.drop(columns=["living_before", "living"]).sum()
    else:
        ledger = run.population
        totals = ledger.drop(columns=["year", "living_before", "living"]).sum()
    parts = [f"{n:,} {_words(str(name))}" for name, n in totals.items() if n]
    return ", ".join([*parts, f"{int(ledger['living'].iloc[-1]):,} living"])


def _words(column: str) -> str:
    """Write a column of the ledger as words: died_no_buds is died (no buds)."""
    kind, _, cause = column.partition("_")
    return f"{kind} ({cause.replace('_', ' ')})" if cause else kind


def _span(run: Run) -> str:
    if not len(run.years):
        return "none yet"
    return f"{run.years[0]} to {run.years[-1]} ({len(run.years)})"


def _size(n_bytes: float) -> str:
    for unit in ("B", "kB", "MB"):
        if n_bytes < 1000:
            return f"{n_bytes:.3g} {unit}"
        n_bytes /= 1000
    return f"{n_bytes:.3g} GB"
