"""The writer of run files: whole years, appended or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from forest.errors import InputError, OutputError
from forest.record import ledger
from forest.record.checkpoint import remove_checkpoints
from forest.record.columns import ColumnGroup
from forest.record.identity import check_identity, check_run_file, damage_reported
from forest.record.journal import JournaledFile, journal_path
from forest.record.provenance import Provenance, Stopwatch, begin_session, end_session
from forest.record.samples import SampleStore, SampleYear
from forest.record.schema import (
    ALL_TABLES,
    FILE_TYPE,
    SCHEMA_VERSION,
    TABLES,
    steps_table,
)

Tables = Mapping[str, Mapping[str, NDArray[Any]]]

#: Bytes of a run's name; file systems take 255, and those of its checkpoints are longer.
_LONGEST_NAME = 220
_SMALL_CHUNK = 256
_LARGEST_CHUNK = 1 << 16
# Files of this format open in every HDF5 since 1.8, and again after a process was killed: newer
# ones carry an open-for-writing flag that then locks them.
_FORMAT = ("v108", "v108")


class RunWriter:
    """A run file, open for writing.

    Use `create` for a new one, `reopen` to go on with an old one. HDF5 writes into memory; each
    `append_year` ends with one commit of the file (see `forest.record.journal`).
    """

    def __init__(self, path: Path, storage: JournaledFile, file: h5py.File) -> None:
        self._path = path
        self._storage = storage
        self._file = file
        self._clock = Stopwatch()
        names = [name for name in ALL_TABLES if name in file]
        self._tables = {name: ColumnGroup(file[name], ALL_TABLES[name]) for name in names}
        self._steps = ColumnGroup(file["steps"], steps_table(names))
        self._samples = SampleStore(file["samples"])

    @classmethod
    def create(
        cls,
        path: str | Path,
        *,
        scenario_toml: str,
        digest: str,
        seed: int,
        species_names: Sequence[str],
        threads: int,
        residual: Sequence[tuple[str, str]] = (),
        tables: Sequence[str] = tuple(TABLES),
        trees_per_year: int = 1024,
        command: Sequence[str] = (),
        overwrite: bool = False,
    ) -> RunWriter:
        """Make a new run file.

        Parameters
        ----------
        path : path
            Where; it must not exist unless `overwrite`.
        scenario_toml, digest : str
            The complete scenario and its hash.
        seed : int
            The run's seed.
        species_names : sequence of str
            The names that species codes 0, 1, 2... stand for.
        threads : int
            Number of threads; on record only.
        residual : sequence of (str, str)
            Names and species of the residual trees, in their order.
        tables : sequence of str
            The tables to store, of `TABLES`; the population ledger is always stored.
        trees_per_year : int
            About how many rows a year brings to the largest tables; sets the size of chunks.
        command : sequence of str
            The command line, for the record; this process's own if empty.
        overwrite : bool
            Whether to replace a file at `path`, and remove its checkpoints.

        Raises
        ------
        InputError
            If `path` exists and may not be replaced, or is a folder.
        OutputError
            If it cannot be written. Nothing is left behind.
        """
        path = Path(path)
        check_target(path, overwrite=overwrite)
        stored = [name for name in ALL_TABLES if name in tables or name not in TABLES]
        try:
            handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        except OSError as error:
            raise OutputError.of(error, path) from error
        os.close(handle)
        draft = Path(name)
        try:
            storage = JournaledFile(draft, writable=True)
            with h5py.File(storage, "w", libver=_FORMAT) as file:
                session = begin_session(threads, command=command)
                provenance = Provenance(scenario_sha256=digest, seed=seed, sessions=(session,))
                file.attrs.update(
                    {
                        "file_type": FILE_TYPE,
                        "schema_version": SCHEMA_VERSION,
                        "forest_version": session.software["forest"],
                        "scenario_toml": scenario_toml,
                        "scenario_sha256": digest,
                        "seed": np.uint64(seed),
                        "platform": session.environment.platform,
                        "threads": threads,
                        "created": session.started.isoformat(timespec="seconds"),
                        "finished": "",
                        "species": list(species_names),
                        "provenance": provenance.model_dump_json(),
                    }
                )
                names = [name for name, _ in residual]
                kinds = list(dict.fromkeys(kind for _, kind in residual))
                large = _chunk(trees_per_year)
                for name in stored:
                    table = ALL_TABLES[name].with_species(species_names)
                    table = table.with_residual(names, kinds)
                    chunk = large if name in ("trees", "rings") else _SMALL_CHUNK
                    ColumnGroup.create(file, name, table, chunk)
                ColumnGroup.create(file, "steps", steps_table(stored), _SMALL_CHUNK)
                file.create_group("samples")
            storage.commit()
            storage.close()
            draft.chmod(0o666 & ~_umask())
            if path.exists():
                JournaledFile(path, writable=True).close()  # refused while another run writes it
            journal_path(path).unlink(missing_ok=True)
            remove_checkpoints(path)
            draft.replace(path)
        except OSError as error:
            raise OutputError.of(error, path) from error
        finally:
            draft.unlink(missing_ok=True)
        return cls._open(path)

    @classmethod
    def reopen(
        cls,
        path: str | Path,
        *,
        rows: Mapping[str, int],
        years_done: int,
        scenario_toml: str = "",
        digest: str = "",
        threads: int = 1,
        command: Sequence[str] = (),
    ) -> RunWriter:
        """Go on with a run file from a checkpoint; everything written after that is dropped.

        Parameters
        ----------
        path : path
            The run file.
        rows : mapping of str to int
            `row_counts()` at the checkpoint.
        years_done : int
            Whole years at the checkpoint.
        scenario_toml, digest : str
            The scenario that it goes on with, if it is for more years than the one on file.
        threads, command
            As for `create`, for the record.

        Raises
        ------
        InputError
            If it is not a run file, is being written by another process, or does not hold the
            checkpoint's years.
        """
        path = Path(path)
        check_run_file(path)
        writer = cls._open(path)
        try:
            writer._trim(rows, years_done)
            session = begin_session(threads, years_before=years_done, command=command)
            old = writer._provenance()
            changes: dict[str, Any] = {"sessions": (*old.sessions, session)}
            if scenario_toml:
                changes["scenario_sha256"] = digest
                writer._file.attrs.update(
                    {"scenario_toml": scenario_toml, "scenario_sha256": digest}
                )
            writer._set_provenance(old.model_copy(update=changes))
            writer._file.attrs["finished"] = ""
            writer._commit()
        except BaseException:
            writer.close()
            raise
        return writer

    @classmethod
    def _open(cls, path: Path) -> RunWriter:
        try:
            storage = JournaledFile(path, writable=True)
        except OSError as error:
            raise OutputError.of(error, path) from error
        try:
            with damage_reported(path):
                file = h5py.File(storage, "r+", libver=_FORMAT)
                check_identity(file, path)
                return cls(path, storage, file)
        except InputError:
            storage.close()
            raise

    @property
    def path(self) -> Path:
        """The file."""
        return self._path

    @property
    def living(self) -> int:
        """Living trees at the end of the last year on file."""
        values = self._tables["population"].read("living")
        return int(values[-1]) if len(values) else 0

    @property
    def years_done(self) -> int:
        """Whole years on file."""
        return self._steps.rows

    def row_counts(self) -> dict[str, int]:
        """Count the rows of each table; part of a checkpoint."""
        return {name: table.rows for name, table in self._tables.items()}

    def append_year(
        self, year: int, tables: Tables, samples: Mapping[int, SampleYear] | None = None
    ) -> None:
        """Append one year to all tables, whole or not at all.

        Parameters
        ----------
        year : int
            Calendar year, later than the last one on file.
        tables : mapping of table to column to array
            All columns of each table's rows of the year; codes for columns of levels. `trees` and
            `events` must be there, for the ledger; a table that the run does not store is checked
            and left out; a stored one that is not there gets no rows.
        samples : mapping of tree id to SampleYear, optional
            The year in the life of each sample tree that is alive.

        Raises
        ------
        LedgerError
            If the population or carbon ledger does not balance.
        OutputError
            If the disk is full or fails. The file then ends with the year before.
        """
        population = ledger.population_row(year, self.living, tables["trees"], tables["events"])
        if "carbon" in tables:
            ledger.check_carbon(year, tables["carbon"])
        rows = {**tables, "population": population}
        try:
            for name, table in self._tables.items():
                if name in rows:
                    table.append(rows[name])
            self._samples.append(year, samples or {})
            step = {"year": year, **self.row_counts()}
            self._steps.append({name: np.array([value]) for name, value in step.items()})
            self._commit()
        except BaseException:
            self.close()  # some columns may be ahead of others: nothing more may be written
            raise

    def finish(self) -> None:
        """Mark the run as complete, with the time and memory that it took, and close the file."""
        self._file.attrs["finished"] = datetime.now(UTC).isoformat(timespec="seconds")
        self.interrupt()

    def interrupt(self) -> None:
        """Close a run that will be resumed, with the time and memory that it took so far."""
        self._end_session()
        try:
            self._commit()
        finally:
            self.close()

    def sync(self) -> None:
        """Wait until all years are on the disk; call it before writing a checkpoint."""
        self._storage.sync()

    def close(self) -> None:
        """Close the file. What belongs to no whole year is forgotten."""
        if self._file:
            self._file.close()
            self._storage.close()

    def __enter__(self) -> Self:
        """Give the writer."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    def _commit(self) -> None:
        self._file.flush()
        self._storage.commit()

    def _trim(self, rows: Mapping[str, int], years_done: int) -> None:
        known = self.years_done
        if years_done > known or any(
            rows.get(name) != (self._steps.read(name)[years_done - 1] if years_done else 0)
            for name in self._tables
        ):
            raise InputError(
                f"does not hold the checkpoint's {years_done} years", where=str(self._path)
            )
        for name, table in self._tables.items():
            table.trim(rows[name])
        self._samples.trim(self._steps.read("year")[:years_done])
        self._steps.trim(years_done)

    def _end_session(self) -> None:
        old = self._provenance()
        last = end_session(old.sessions[-1], self._clock.elapsed_s)
        self._set_provenance(old.model_copy(update={"sessions": (*old.sessions[:-1], last)}))

    def _provenance(self) -> Provenance:
        return Provenance.model_validate_json(self._file.attrs["provenance"])

    def _set_provenance(self, provenance: Provenance) -> None:
        self._file.attrs["provenance"] = provenance.model_dump_json()


def check_target(path: Path, *, overwrite: bool) -> None:
    """Refuse a path that a run cannot be written to, before any work is done.

    Raises
    ------
    InputError, OutputError
        If it exists and may not be replaced, is a folder, or lies in none, or its name is so long
        that checkpoints beside it have no name.
    """
    if len(os.fsencode(path.name)) > _LONGEST_NAME:
        raise InputError(
            f"a name of {len(os.fsencode(path.name))} bytes",
            where=str(path),
            expected=f"at most {_LONGEST_NAME}, which leaves room for its checkpoints' names",
        )
    if path.exists() and not path.is_file():
        raise InputError("is not a file", where=str(path), expected="the path of a file")
    if path.exists() and not overwrite:
        raise InputError(
            "exists already",
            where=str(path),
            expected="a new path",
        )
    if not path.parent.is_dir():
        raise OutputError(f"there is no folder '{path.parent}'", where=str(path))


def _chunk(rows: int) -> int:
    """Give the power of two at or below half of `rows`, within limits."""
    return min(max(1 << (max(rows // 2, 1).bit_length() - 1), _SMALL_CHUNK), _LARGEST_CHUNK)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
