"""A table in the file: one long one-dimensional dataset per column, appended to in step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
from h5py import h5s
from numpy.typing import NDArray

from forest.record.definition import Column, Table

_FASTEST = 1  # gzip level: higher ones save a few per cent of size for several times the time


def _create(group: h5py.Group, column: Column, chunk: int) -> h5py.Dataset:
    dataset = group.create_dataset(
        column.name,
        shape=(0,),
        maxshape=(None,),
        dtype=column.dtype,
        chunks=(chunk,),
        compression="gzip",
        compression_opts=_FASTEST,
        shuffle=True,
    )
    dataset.attrs["units"] = column.unit
    dataset.attrs["description"] = column.description
    if column.missing:
        dataset.attrs["missing"] = column.missing
    if column.levels:
        dataset.attrs["levels"] = list(column.levels)
    return dataset


class ColumnGroup:
    """The datasets of one table, open for writing.

    Parameters
    ----------
    group : h5py.Group
        The table's group.
    table : Table
        Its definition.
    """

    def __init__(self, group: h5py.Group, table: Table) -> None:
        self._types = {column.name: np.dtype(column.dtype) for column in table.columns}
        self._datasets = {name: group[name] for name in self._types}
        self.rows = min((len(dataset) for dataset in self._datasets.values()), default=0)

    @classmethod
    def create(cls, parent: h5py.Group, name: str, table: Table, chunk: int) -> ColumnGroup:
        """Make the table's group and its empty datasets of `chunk` rows a chunk."""
        group = parent.create_group(name)
        group.attrs["description"] = f"one row for {table.row}"
        for column in table.columns:
            _create(group, column, chunk)
        return cls(group, table)

    def append(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Append rows; `columns` must hold the table's columns and no others, of one length."""
        if columns.keys() != self._types.keys():
            raise KeyError(f"columns {sorted(columns.keys() ^ self._types.keys())} do not match")
        (n,) = {len(column) for column in columns.values()}
        if n == 0:
            return
        memory = h5s.create_simple((n,))
        target = h5s.create_simple((self.rows + n,))
        target.select_hyperslab((self.rows,), (n,))
        # The low-level calls take a third of the time of the slicing syntax.
        for name, dtype in self._types.items():
            dataset = self._datasets[name].id
            dataset.set_extent((self.rows + n,))
            dataset.write(memory, target, np.ascontiguousarray(columns[name], dtype))
        self.rows += n

    def trim(self, rows: int) -> None:
        """Drop all rows past `rows`."""
        for dataset in self._datasets.values():
            dataset.resize((rows,))
        self.rows = rows

    def read(self, name: str) -> NDArray[Any]:
        """Read one column."""
        values: NDArray[Any] = self._datasets[name][: self.rows]
        return values
