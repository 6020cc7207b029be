"""Every file and path that cannot be right is refused in one line, and nothing is lost."""

from __future__ import annotations

import os
import random
from pathlib import Path

import h5py
import pytest

from forest.errors import InputError, OutputError
from forest.record.run import open_run
from forest.record.writer import RunWriter
from tests.record.years import FIRST_YEAR, append, create


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("good") / "run.h5"
    with create(path) as writer:
        append(writer, FIRST_YEAR, FIRST_YEAR + 2)
    return path.read_bytes()


def refuse(path: Path, message: str) -> None:
    """Expect one line from the reader and from the writer."""
    for opener in (open_run, lambda p: RunWriter.reopen(p, rows={}, years_done=0)):
        with pytest.raises(InputError, match=message) as caught:
            opener(path)
        assert "\n" not in str(caught.value)
        assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty; expected a run file"),
        (b"year,tree\n2000,1\n", "is not a run file"),
        (random.Random(1).randbytes(30_000), "is not a run file"),
        (b"\x89HDF\r\n\x1a\n", "is cut short or damaged"),
        (b"\x89HDF\r\n\x1a\n" + random.Random(2).randbytes(30_000), "is cut short or damaged"),
    ],
)
def test_files_that_are_not_runs(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(content)
    refuse(path, message)
    assert path.read_bytes() == content


@pytest.mark.parametrize("kept", [9, 100, 1000, 20_000, -1, -2, -1000])
def test_files_cut_short(tmp_path: Path, good: bytes, kept: int) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(good[:kept])
    refuse(path, "is cut short or damaged")


def test_files_with_noise_in_them_are_refused_or_read(tmp_path: Path, good: bytes) -> None:
    path = tmp_path / "run.h5"
    draw = random.Random(3)
    refused = 0
    for _ in range(30):
        noise = bytearray(good)
        at = draw.randrange(len(noise) - 4000)
        noise[at : at + 4000] = draw.randbytes(4000)
        path.write_bytes(noise)
        try:
            with open_run(path) as run:
                for table in run.tables:
                    run.read(table)
        except InputError as error:
            assert "\n" not in str(error)
            refused += 1
    assert refused > 3


def test_missing_file_and_folder(tmp_path: Path) -> None:
    refuse(tmp_path / "run.h5", "no such file")
    refuse(tmp_path, "cannot be read: is a directory")


def test_hdf5_of_another_program(tmp_path: Path) -> None:
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["trees"] = [1, 2, 3]
    refuse(path, "is HDF5, but not a run file")


def test_later_schema(tmp_path: Path, good: bytes) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(good)
    with h5py.File(path, "r+") as file:
        file.attrs["schema_version"] = 99
    refuse(path, "is of schema version 99; expected a version up to 2")


def test_existing_path_needs_overwrite(tmp_path: Path, good: bytes) -> None:
    path = tmp_path / "run.h5"
    path.write_bytes(good)
    with pytest.raises(InputError, match="exists already"):
        create(path)
    assert path.read_bytes() == good
    create(path, overwrite=True).close()
    with open_run(path) as run:
        assert len(run.years) == 0
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("overwrite", [False, True])
def test_paths_that_cannot_be_written(tmp_path: Path, overwrite: bool) -> None:
    with pytest.raises(InputError, match="is not a file"):
        create(tmp_path, overwrite=overwrite)
    with pytest.raises(OutputError, match="there is no folder"):
        create(tmp_path / "missing" / "run.h5", overwrite=overwrite)
    with pytest.raises(InputError, match="a name of 230 bytes"):
        create(tmp_path / f"{'n' * 227}.h5", overwrite=overwrite)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_folder_without_the_right_to_write(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="cannot be written: permission denied"):
            create(tmp_path / "run.h5")
    finally:
        tmp_path.chmod(0o700)
