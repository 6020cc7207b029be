"""The journaled file reads, before and after each commit, like a plain sequence of bytes."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import example, given
from hypothesis import strategies as st

from forest.record.journal import JournaledFile, journal_path

_WRITE = st.tuples(st.integers(0, 60), st.binary(min_size=1, max_size=20))
_COMMIT = st.none()


@example([(2, b"\x00"), None, (2, b"\x00"), (0, b"\x00\x00\x01"), None])
@given(st.lists(st.one_of(_WRITE, _WRITE, _WRITE, _COMMIT), max_size=25))
def test_equals_plain_bytes(steps: list[tuple[int, bytes] | None]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        path.write_bytes(b"")
        file = JournaledFile(path, writable=True)
        model = bytearray()
        committed = b""
        for step in steps:
            if step is None:
                file.commit()
                committed = bytes(model)
            else:
                address, data = step
                model.extend(bytes(max(address + len(data) - len(model), 0)))
                model[address : address + len(data)] = data
                file.seek(address)
                assert file.write(memoryview(data)) == len(data)
            assert path.read_bytes() == committed
            for first in (0, 7, 30):
                found = bytearray(50)
                file.seek(first)
                size = file.readinto(memoryview(found))
                assert bytes(found[:size]) == bytes(model[first : first + 50])
        file.close()
        assert path.read_bytes() == committed
        assert not journal_path(path).exists()
