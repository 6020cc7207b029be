"""After a kill, a crash at any write, or a full disk, the file holds exactly its whole years."""

from __future__ import annotations

import os
import random
import resource
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from forest.errors import InputError, OutputError
from forest.record import journal
from forest.record.run import Run, open_run
from forest.record.schema import TABLES
from forest.record.writer import RunWriter
from tests.forks import start
from tests.record.years import (
    FIRST_YEAR,
    PLANTED,
    append,
    create,
    make_year,
    write_until_killed,
)


def assert_whole(run: Run, last: int) -> None:
    """Compare everything on file with what was meant to be written up to year `last`."""
    assert run.years.tolist() == list(range(FIRST_YEAR, last + 1))
    rows = [make_year(year) for year in run.years]
    for table in TABLES:
        frame = run.read(table)
        for name in frame:
            years = [row[table][name] if table in row else np.empty(0) for row in rows]
            values = frame[name].cat.codes if frame[name].dtype == "category" else frame[name]
            assert np.array_equal(values, np.concatenate(years)), (table, name)
    for year in run.years:
        age = year - FIRST_YEAR
        assert len(run.skeleton(12, year)) == age + 1 + (1 <= age < 4)


class Crash(BaseException):
    """The moment at which the process would have ended."""


def crash_at(monkeypatch: pytest.MonkeyPatch, write: int) -> None:
    """Let the given write of the file, counted from 0, put down half its bytes and stop."""
    plain, count = os.pwrite, iter(range(10_000))

    def pwrite(fd: int, data: memoryview, address: int) -> int:
        if next(count) == write:
            plain(fd, data[: len(data) // 2], address)
            raise Crash
        return plain(fd, data, address)

    monkeypatch.setattr(os, "pwrite", pwrite)


@pytest.mark.parametrize("when", [0, 1, 2, 3, 10, 40, 80, 120])
def test_crash_at_any_write_leaves_whole_years(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, when: int
) -> None:
    path = tmp_path / "run.h5"
    writer = create(path)
    append(writer, FIRST_YEAR, FIRST_YEAR + 2)
    crash_at(monkeypatch, when)
    with pytest.raises(Crash):
        append(writer, FIRST_YEAR + 3, FIRST_YEAR + 3)
    monkeypatch.undo()
    # The first write appends; once the journal is whole, the year counts.
    last = FIRST_YEAR + (2 if when == 0 else 3)
    with open_run(path) as run:
        assert_whole(run, last)
    counts = {name: run.count(name) for name in run.tables}
    with RunWriter.reopen(path, rows=counts, years_done=last - FIRST_YEAR + 1) as writer:
        append(writer, last + 1, FIRST_YEAR + 6)
        assert not journal.journal_path(path).exists()
    with open_run(path) as run:
        assert_whole(run, FIRST_YEAR + 6)


def test_only_a_whole_journal_of_this_file_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.h5"
    writer = create(path)
    append(writer, FIRST_YEAR, FIRST_YEAR)
    before = path.read_bytes()
    crash_at(monkeypatch, 1)
    with pytest.raises(Crash):
        append(writer, FIRST_YEAR + 1, FIRST_YEAR + 1)
    beside = journal.journal_path(path)
    whole = beside.read_bytes()
    path.write_bytes(before + path.read_bytes()[len(before) :])  # appended, not yet changed
    for cut in (0, 10, 40, len(whole) // 2, len(whole) - 1):
        beside.write_bytes(whole[:cut])
        with open_run(path) as run:
            assert_whole(run, FIRST_YEAR)
    beside.write_bytes(whole)
    with open_run(path) as run:
        assert_whole(run, FIRST_YEAR + 1)
    path.write_bytes(before)  # an older copy of the file: the journal is not its own
    with open_run(path) as run:
        assert_whole(run, FIRST_YEAR)


@pytest.mark.parametrize("trial", range(8))
def test_killed_at_a_random_moment(tmp_path: Path, trial: int) -> None:
    path = tmp_path / "run.h5"
    output = tmp_path / "told.txt"
    process = start(write_until_killed, path, output=output)
    while not (output.exists() and output.stat().st_size) and process.is_alive():
        time.sleep(0.002)
    time.sleep(random.Random(trial).uniform(0.0, 0.25))
    process.kill()
    process.join()
    assert process.exitcode == -signal.SIGKILL, output.read_text()
    told = output.read_text().split("\n")[:-1]
    with open_run(path) as run:
        last = int(run.years[-1]) if len(run.years) else FIRST_YEAR - 1
        if last >= FIRST_YEAR:
            assert_whole(run, last)
    # A year that the writer had told of is on file, unless it had begun anew since.
    assert not told or last >= int(told[-1]) or int(told[-1]) == FIRST_YEAR + PLANTED - 1


def _write_in(path: Path, more: int) -> None:
    """Write years into a file that may become so many bytes longer."""
    writer = create(path)
    append(writer, FIRST_YEAR, FIRST_YEAR)
    room = path.stat().st_size + more
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
    try:
        for year in range(FIRST_YEAR + 1, FIRST_YEAR + 25):
            append(writer, year, year)
            print(year, flush=True)
    except OutputError as error:
        print(error)


@pytest.mark.parametrize("room", [0, 100, 5_000, 60_000])
def test_full_disk_keeps_the_whole_years(tmp_path: Path, room: int) -> None:
    path = tmp_path / "run.h5"
    output = tmp_path / "told.txt"
    process = start(_write_in, path, room, output=output)
    process.join()
    *years, message = output.read_text().splitlines()
    output.unlink()
    assert message == f"{path}: no room left on the disk"
    with open_run(path) as run:
        assert_whole(run, int(years[-1]) if years else FIRST_YEAR)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.h5"]


def test_no_room_at_all_leaves_nothing(tmp_path: Path) -> None:
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, old[1]))
    try:
        with pytest.raises(OutputError, match="no room left on the disk"):
            create(tmp_path / "run.h5")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)
        signal.signal(signal.SIGXFSZ, handler)
    assert list(tmp_path.iterdir()) == []


def test_resume_drops_later_years_and_writes_the_same_again(tmp_path: Path) -> None:
    whole, resumed = tmp_path / "whole.h5", tmp_path / "resumed.h5"
    with create(whole) as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR + 12)
    with create(resumed) as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR + 4)
        counts, done = writer.row_counts(), writer.years_done
        append(writer, FIRST_YEAR + 5, FIRST_YEAR + 8)
    with RunWriter.reopen(resumed, rows=counts, years_done=done) as writer:
        assert writer.living == PLANTED - 4
        append(writer, FIRST_YEAR + 5, FIRST_YEAR + 12)
        writer.finish()
    with open_run(whole) as a, open_run(resumed) as b:
        assert_whole(b, FIRST_YEAR + 12)
        for table in a.tables:
            assert a.read(table).equals(b.read(table))
        assert [s["years_before"] for s in b.provenance["sessions"]] == [0, 5]


def test_resume_from_a_checkpoint_the_file_does_not_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with create(path) as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR + 1)
        counts = writer.row_counts()
    for rows, done in ((counts, 3), ({**counts, "trees": 5}, 2)):
        with pytest.raises(InputError, match="does not hold the checkpoint's"):
            RunWriter.reopen(path, rows=rows, years_done=done)
    with open_run(path) as run:
        assert_whole(run, FIRST_YEAR + 1)


def test_a_running_file_can_be_read_but_not_written_twice(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    with create(path) as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR + 1)
        with open_run(path) as run:
            assert_whole(run, FIRST_YEAR + 1)
        for again in (
            lambda: create(path, overwrite=True),
            lambda: RunWriter.reopen(path, rows={}, years_done=0),
        ):
            with pytest.raises(InputError, match="is being written by another run"):
                again()
        append(writer, FIRST_YEAR + 2, FIRST_YEAR + 2)
    with open_run(path) as run:
        assert_whole(run, FIRST_YEAR + 2)
