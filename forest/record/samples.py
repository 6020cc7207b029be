"""The lives of sample trees: each metamer once, with its birth and death, and yearly radii."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from forest.record.columns import ColumnGroup
from forest.record.schema import SAMPLE_TABLES

_CHUNK = 4096
_CHUNKS = {"steps": 128}
_GROWING = ("metamers", "dead", "radii", "shapes")


class SampleShape(NamedTuple):
    """Where a sample tree's metamers stand in a year, and how its rings lie."""

    end: NDArray[np.float32]  # (n, 3) upper ends, m, from the plot's corner
    eccentricity: NDArray[np.float64]  # (n,)
    thick_side_deg: NDArray[np.float64]  # (n,) azimuth; NaN where the ring is round


class SampleYear(NamedTuple):
    """What a year brought to one sample tree. All metamers stand parents before children.

    In the tree's first year on record, all its living metamers are new.
    """

    species: int  # index into the run's species
    base: NDArray[np.float64]  # (3,) its stem base, m, from the plot's corner
    new_serial: NDArray[np.int32]  # (k,)
    new_parent_serial: NDArray[np.int32]  # (k,) -1 at the base
    new_end: NDArray[np.float32]  # (k, 3) upper ends, m, from the plot's corner
    new_order: NDArray[np.uint8]  # (k,)
    new_main: NDArray[np.bool_]  # (k,) whether it continues its parent's axis
    new_birth_year: NDArray[np.int32]  # (k,)
    dead_serial: NDArray[np.int32]  # (d,) metamers lost in the year
    serial: NDArray[np.int32]  # (n,) all living metamers, new ones included
    radius: NDArray[np.float32]  # (n,) under bark, m
    leafy: NDArray[np.bool_]  # (n,)
    shape: SampleShape | None = None  # of the same metamers; None where nothing bends


class SampleStore:
    """`/samples`, open for writing."""

    def __init__(self, samples: h5py.Group) -> None:
        self._group = samples
        self._trees = {
            int(tree_id): {
                name: ColumnGroup(group[name], table) for name, table in SAMPLE_TABLES.items()
            }
            for tree_id, group in samples.items()
        }

    def append(self, year: int, samples: Mapping[int, SampleYear]) -> None:
        """Append a year of each tree's life; a tree not seen before begins one."""
        for tree_id, sample in samples.items():
            if tree_id not in self._trees:
                self._trees[tree_id] = self._create(tree_id, sample)
            tables = self._trees[tree_id]
            for name, columns in _columns(year, sample).items():
                tables[name].append(columns)
            rows = {name: tables[name].rows for name in _GROWING}
            step = {"year": year, **rows}
            tables["steps"].append({name: np.array([value]) for name, value in step.items()})

    def trim(self, years: NDArray[np.int32]) -> None:
        """Forget what was written in other years than these."""
        for tree_id, tables in list(self._trees.items()):
            steps = tables["steps"]
            known = int(np.isin(steps.read("year"), years).sum())
            if known == 0:
                del self._group[str(tree_id)], self._trees[tree_id]
                continue
            for name in _GROWING:
                tables[name].trim(int(steps.read(name)[known - 1]))
            steps.trim(known)

    def _create(self, tree_id: int, sample: SampleYear) -> dict[str, ColumnGroup]:
        group = self._group.create_group(str(tree_id))
        group.attrs["species"] = sample.species
        group.attrs["base_m"] = np.asarray(sample.base, np.float64)
        return {
            name: ColumnGroup.create(group, name, table, _CHUNKS.get(name, _CHUNK))
            for name, table in SAMPLE_TABLES.items()
        }


def _columns(year: int, sample: SampleYear) -> dict[str, dict[str, NDArray[Any]]]:
    """Sort a year of a tree's life into the sample tables."""
    columns: dict[str, dict[str, NDArray[Any]]] = {
        "metamers": {
            "serial": sample.new_serial,
            "parent_serial": sample.new_parent_serial,
            "end_x_m": sample.new_end[:, 0],
            "end_y_m": sample.new_end[:, 1],
            "end_z_m": sample.new_end[:, 2],
            "order": sample.new_order,
            "main": sample.new_main,
            "birth_year": sample.new_birth_year,
        },
        "dead": {
            "serial": sample.dead_serial,
            "year": np.full(len(sample.dead_serial), year),
        },
        "radii": {"serial": sample.serial, "radius_m": sample.radius, "leafy": sample.leafy},
    }
    if sample.shape is not None:
        columns["shapes"] = {
            "end_x_m": sample.shape.end[:, 0],
            "end_y_m": sample.shape.end[:, 1],
            "end_z_m": sample.shape.end[:, 2],
            "eccentricity": sample.shape.eccentricity,
            "thick_side_deg": sample.shape.thick_side_deg,
        }
    return columns
