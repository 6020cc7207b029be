"""A file that changes in whole steps: what HDF5 writes reaches the disk at `commit`, or not at all.

HDF5 rewrites its own structures in place and in no promised order, so a process killed while it
flushes, or a disk that fills up, can leave a file that no longer opens. Here HDF5 writes into
memory. `commit` appends the new bytes behind the end of the file, where nothing points to them
yet; writes the bytes to be changed in place into a journal beside the file; only then changes
them, and removes the journal. A journal that is whole is applied again when the file is next
opened; one cut short is ignored, because then nothing had been changed in place.
"""

from __future__ import annotations

import errno
import fcntl
import io
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from forest.errors import InputError, OutputError

_MAGIC = b"forest-journal-1"
_HEADER = struct.Struct("<16sQII")  # magic, length of the file, number of changes, checksum
_CHANGE = struct.Struct("<QQ")  # address, bytes

#: What to write where, in order; a change of the same bytes replaces the one before.
Changes = dict[tuple[int, int], bytes]  # (address, size)


def journal_path(path: Path) -> Path:
    """Name the journal that belongs to a file."""
    return path.with_name(path.name + ".journal")


def read_journal(path: Path) -> Changes:
    """Read the changes that a killed writer had decided on; none if its journal is not whole."""
    try:
        data = journal_path(path).read_bytes()
    except OSError:
        return {}
    if len(data) < _HEADER.size:
        return {}
    magic, length, count, checksum = _HEADER.unpack_from(data)
    body = memoryview(data)[_HEADER.size :]
    if magic != _MAGIC or zlib.crc32(body) != checksum or length != path.stat().st_size:
        return {}
    changes: Changes = {}
    at = 0
    for _ in range(count):
        address, size = _CHANGE.unpack_from(body, at)
        at += _CHANGE.size
        changes[address, size] = bytes(body[at : at + size])
        at += size
    return changes


def _encode(changes: Changes, length: int) -> bytes:
    body = b"".join(
        part
        for (address, size), change in changes.items()
        for part in (_CHANGE.pack(address, size), change)
    )
    return _HEADER.pack(_MAGIC, length, len(changes), zlib.crc32(body)) + body


def _write_all(fd: int, data: bytes | bytearray, address: int) -> None:
    view = memoryview(data)
    while view:
        written = os.pwrite(fd, view, address)
        view = view[written:]
        address += written


class JournaledFile(io.RawIOBase):
    """The file object that h5py writes to.

    Parameters
    ----------
    path : Path
        The file; it must exist.
    writable : bool
        Whether to lock it and allow `commit`. A reader sees the file as `commit` would have left
        it, without touching it.

    Raises
    ------
    InputError
        If another process is writing to the file.
    """

    def __init__(self, path: Path, *, writable: bool) -> None:
        self._path = path
        self._fd = os.open(path, os.O_RDWR if writable else os.O_RDONLY)
        self._at = 0
        self._tail = bytearray()
        if writable:
            try:
                fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(self._fd)
                self._fd = -1
                raise InputError("is being written by another run", where=str(path)) from error
        self._changes = read_journal(path)
        self._committed = os.fstat(self._fd).st_size
        if writable and self._changes:
            self._apply()

    def commit(self) -> None:
        """Make everything written since the last commit part of the file.

        Raises
        ------
        OutputError
            If the disk is full or fails; the file then stands as after the last commit.
        """
        journal = journal_path(self._path)
        try:
            if self._tail:
                if hasattr(os, "posix_fallocate"):
                    os.posix_fallocate(self._fd, self._committed, len(self._tail))
                _write_all(self._fd, self._tail, self._committed)
            length = self._committed + len(self._tail)
            journal.write_bytes(_encode(self._changes, length))
        except OSError as error:
            journal.unlink(missing_ok=True)
            os.ftruncate(self._fd, self._committed)
            raise OutputError.of(error, self._path) from error
        self._committed = length
        self._tail = bytearray()
        self._apply()

    def _apply(self) -> None:
        """Change bytes in place: no new room is needed, so a full disk cannot stop this."""
        # The superblock goes first: until it tells of the new length, addresses behind the old
        # end count as errors, while a superblock ahead of the rest does no harm. It is written as
        # all changes leave it, since another change may overlap it.
        head = max((size for address, size in self._changes if address == 0), default=0)
        if head:
            top = bytearray(os.pread(self._fd, head, 0))
            for first, last, change, address in self._overlaps(0, head):
                top[first:last] = change[first - address : last - address]
            _write_all(self._fd, top, 0)
        for (address, size), change in self._changes.items():
            skip = min(max(head - address, 0), size)
            if skip < size:
                _write_all(self._fd, change[skip:], address + skip)
        self._changes = {}
        journal_path(self._path).unlink(missing_ok=True)

    def sync(self) -> None:
        """Wait until what is committed is on the disk."""
        os.fsync(self._fd)

    def close(self) -> None:
        """Close the file; what was not committed is forgotten."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
        super().close()

    # What h5py asks of a file object.

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to an address."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._length()}[whence]
        self._at = start + offset
        return self._at

    def tell(self) -> int:
        """Tell the address."""
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read as if everything written so far were in the file."""
        target = memoryview(buffer).cast("B")
        size = min(len(target), max(self._length() - self._at, 0))
        in_file = min(size, max(self._committed - self._at, 0))
        if in_file:
            found = os.preadv(self._fd, [target[:in_file]], self._at)
            if found < in_file:
                raise OSError(errno.EIO, "the file is shorter than it was")
        if in_file < size:
            start = self._at + in_file - self._committed
            target[in_file:size] = self._tail[start : start + size - in_file]
        for first, last, change, address in self._overlaps(self._at, self._at + in_file):
            target[first - self._at : last - self._at] = change[first - address : last - address]
        self._at += size
        return size

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        """Keep bytes for the next commit."""
        view = memoryview(data).cast("B")
        size = len(view)
        in_file = min(size, max(self._committed - self._at, 0))
        if in_file:
            self._changes.pop((self._at, in_file), None)  # so that the later change stands last
            self._changes[self._at, in_file] = bytes(view[:in_file])
        if in_file < size:
            start = self._at + in_file - self._committed
            if start > len(self._tail):
                self._tail.extend(bytes(start - len(self._tail)))
            self._tail[start : start + size - in_file] = view[in_file:]
        self._at += size
        return size

    def truncate(self, size: int | None = None) -> int:
        """Set the length; bytes already committed stay until they are overwritten."""
        wanted = self._at if size is None else size
        keep = max(wanted - self._committed, 0)
        del self._tail[keep:]
        self._tail.extend(bytes(keep - len(self._tail)))
        return wanted

    def flush(self) -> None:
        """Do nothing: `commit` does."""

    def readable(self) -> bool:
        """Allow reading."""
        return True

    def writable(self) -> bool:
        """Allow writing."""
        return True

    def seekable(self) -> bool:
        """Allow seeking."""
        return True

    def _length(self) -> int:
        return self._committed + len(self._tail)

    def _overlaps(self, first: int, last: int) -> Iterator[tuple[int, int, bytes, int]]:
        for (address, size), change in self._changes.items():
            a, b = max(first, address), min(last, address + size)
            if a < b:
                yield a, b, change, address
