"""Small years of a made-up stand, the same each time, for the tests of the run file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forest.record.samples import SampleYear
from forest.record.schema import EVENT_KINDS, TABLES
from forest.record.writer import RunWriter

Columns = dict[str, NDArray[Any]]

SPECIES = ("pinus_sylvestris", "fagus_sylvatica")
FIRST_YEAR = 2000
PLANTED = 30
SCENARIO = 'title = "a test"\nyears = 50\n'


def rows(table: str, year: int, n: int) -> Columns:
    """Make `n` rows of a table, of numbers that depend on the year alone."""
    rng = np.random.default_rng([year, len(table)])
    columns: Columns = {}
    for column in TABLES[table].columns:
        if column.dtype.startswith("float"):
            columns[column.name] = rng.random(n).astype(column.dtype)
        else:
            columns[column.name] = rng.integers(0, 2, n).astype(column.dtype)
    columns["year"] = np.full(n, year, np.int32)
    return columns


def make_year(year: int) -> dict[str, Columns]:
    """Make all tables of a year: all trees are planted in the first, and one dies in each later."""
    age = year - FIRST_YEAR
    trees = rows("trees", year, PLANTED - age)
    trees["status"][:] = 0
    trees["tree_id"] = np.arange(1 + age, 1 + PLANTED, dtype=np.int32)
    events = rows("events", year, 1 if age else PLANTED)
    events["kind"][:] = EVENT_KINDS.index("died" if age else "planted")
    carbon = rows("carbon", year, 3)
    carbon["income"] = sum(
        carbon[name] for name in ("leaves", "upkeep", "extension", "ring", "reserve_change")
    )
    stand = rows("stand", year, 3)
    stand["species"] = carbon["species"] = np.arange(3, dtype=np.int16)
    return {
        "trees": trees,
        "stand": stand,
        "events": events,
        "rings": rows("rings", year, PLANTED - age),
        "carbon": carbon,
    }


def make_sample(year: int) -> SampleYear:
    """Grow a pole by one metamer a year, with a twig in its second year that is lost in the fifth.

    Serials are 0, then 1 (trunk) and 2 (twig), then 3, 4, 5... (trunk).
    """
    age = year - FIRST_YEAR
    trunk = [0, 1, *range(3, age + 2)][: age + 1]
    living = trunk[:2] + ([2] if 1 <= age < 4 else []) + trunk[2:]
    new = [serial for serial in living if serial >= (trunk[-1] if age != 1 else 1)]
    parent = {0: -1, 1: 0, 2: 0, 3: 1}
    base = np.array([5.0, 7.0, 0.0])
    heights = {serial: i + 1 for i, serial in enumerate(trunk)} | {2: 1}
    end = [[5.0 + 0.5 * (serial == 2), 7.0, heights[serial]] for serial in new]
    return SampleYear(
        species=1,
        base=base,
        new_serial=np.array(new, np.int32),
        new_parent_serial=np.array([parent.get(s, s - 1) for s in new], np.int32),
        new_end=np.array(end, np.float32).reshape(-1, 3),
        new_order=np.array([s == 2 for s in new], np.uint8),
        new_main=np.array([s not in (0, 2) for s in new]),
        new_birth_year=np.full(len(new), year, np.int32),
        dead_serial=np.array([2] if age == 4 else [], np.int32),
        serial=np.array(living, np.int32),
        radius=np.array([0.01 * (age + 1)] * len(living), np.float32),
        leafy=np.array([s in (2, trunk[-1]) for s in living]),
    )


def create(path: Path, **options: Any) -> RunWriter:
    """Make a run file for these years."""
    return RunWriter.create(
        path,
        scenario_toml=SCENARIO,
        digest="5ca1ab1e",
        seed=7,
        species_names=SPECIES,
        threads=1,
        **options,
    )


def append(writer: RunWriter, first: int, last: int) -> None:
    """Append the years from `first` to `last`."""
    for year in range(first, last + 1):
        writer.append_year(year, make_year(year), {12: make_sample(year)})


def write_until_killed(path: Path) -> None:
    """Write year after year, starting again when the trees are all dead."""
    while True:
        with create(path, overwrite=True) as writer:
            for year in range(FIRST_YEAR, FIRST_YEAR + PLANTED):
                append(writer, year, year)
                print(year, flush=True)
