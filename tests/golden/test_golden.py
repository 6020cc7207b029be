"""Small stands against stored numbers: what changes growth must say so.

A model is `<name>.toml` with the species of `species.toml`; `<name>.txt` holds what comes of it, a
row a year. Only `pytest tests/golden --update-goldens "why"` writes the latter, with the reason.
"""

from __future__ import annotations

import hashlib
import platform
import tomllib
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from llvmlite import binding

from forest._threads import using_threads
from forest.scenario import Scenario
from forest.species.model import SECTIONS
from forest.stand import Stand
from forest.yearbook import YearRecord

HERE = Path(__file__).parent
SPECIES = tomllib.loads((HERE / "species.toml").read_text())
MODELS = sorted(path.stem for path in HERE.glob("*.toml") if path.stem != "species")

#: Stored expectations span no more, since trees are chaotic.
MOST_YEARS = 15
# Where another processor's mathematical library rounds otherwise: angles changed by 1e-12 of
# themselves changed no number of any model, by 1e-7 the first count in year 9, by less than 1e-4.
ALIKE_YEARS = 8
ALIKE, SIMILAR = 1e-6, 1e-3


#: Tables that tell what grew; others tell what made it grow.
GROWN = ("trees", "stand", "events", "rings", "carbon", "stability")


class Row(NamedTuple):
    """A year of the stand: sums over its living trees, and a hash of the tables of what grew."""

    year: int
    trees: int
    metamers: int
    height_m: float
    dbh_cm: float
    biomass_kg: float
    income_kg_ha: float
    tables_sha256: str

    @classmethod
    def of(cls, record: YearRecord) -> Row:
        """Sum up a year; NaN, the dbh of a small tree, counts nothing."""
        trees = record.tables["trees"]
        return cls(
            record.year,
            len(trees["tree_id"]),
            int(trees["metamers"].sum()),
            *(float(np.nansum(trees[k])) for k in ("height_m", "dbh_cm", "biomass_kg")),
            float(record.tables["carbon"]["income"][-1]),
            _hash(record),
        )

    @classmethod
    def read(cls, line: str) -> Row:
        """Read a row as `write` wrote it."""
        words = line.split()
        counts, sums = map(int, words[:3]), map(float, words[3:7])
        return cls(*counts, *sums, words[7])

    def write(self) -> str:
        """Write the row, sums to nine digits."""
        words = (f"{v:.9g}" if isinstance(v, float) else f"{v}" for v in self)
        return " ".join(f"{word:>12}" for word in words)


class Golden(NamedTuple):
    """A file of expected rows."""

    reason: str
    date: str
    platform: str
    rows: list[Row]

    @classmethod
    def read(cls, path: Path) -> Golden:
        """Read a file."""
        lines = path.read_text().splitlines()
        said = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))
        _names, *rows = (line for line in lines if not line.startswith("# "))
        return cls(said["reason"], said["date"], said["platform"], [Row.read(row) for row in rows])

    def text(self) -> str:
        """Write the file: why and when it was made and on which platform, then the rows."""
        names = " ".join(f"{name:>12}" for name in Row._fields)
        said = [f"# {k}: {getattr(self, k)}" for k in ("reason", "date", "platform")]
        return "\n".join([*said, names, *(row.write() for row in self.rows)]) + "\n"


def _hash(record: YearRecord) -> str:
    """Hash every column of the tables of what grew; 16 digits of the SHA-256."""
    digest = hashlib.sha256()
    for table, columns in sorted(record.tables.items()):
        if table not in GROWN:
            continue
        for name, column in sorted(columns.items()):
            digest.update(f"{table}.{name} {column.dtype} {len(column)} ".encode())
            digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()[:16]


def _platform() -> str:
    """Name what may round numbers otherwise: processor and mathematical libraries."""
    libc = " ".join(platform.libc_ver()) or platform.platform()
    libraries = (f"{name} {metadata.version(name)}" for name in ("numpy", "numba", "scipy"))
    return ", ".join((platform.machine(), binding.get_host_cpu_name(), libc, *libraries))


def _scenario(model: str) -> Scenario:
    data: dict[str, Any] = tomllib.loads((HERE / f"{model}.toml").read_text())
    data["species"] = {name: SPECIES[name] for name in data["species"]}
    return Scenario(**data)


def _grow(model: str, threads: int) -> list[Row]:
    scenario = _scenario(model)
    stand = Stand(scenario)
    with using_threads(threads):
        return [Row.of(stand.step()) for _ in range(scenario.years)]


@pytest.mark.parametrize("model", MODELS)
def test_stand_grows_as_before(model: str, request: pytest.FixtureRequest) -> None:
    rows = _grow(model, threads=1)
    assert rows == _grow(model, threads=2)
    path = HERE / f"{model}.txt"
    reason: str | None = request.config.getoption("--update-goldens")
    if reason:
        _update(path, rows, reason)
    golden = Golden.read(path)
    assert len(golden.rows) == len(rows) <= MOST_YEARS
    for k, (row, expected) in enumerate(zip(rows, golden.rows, strict=True), start=1):
        alike = k <= ALIKE_YEARS
        exact = 3 if alike else 1  # year, trees and metamers, or the year alone
        assert row[:exact] == expected[:exact]
        rtol = ALIKE if alike else SIMILAR
        assert row[exact:-1] == pytest.approx(expected[exact:-1], rel=rtol), row.year
        if golden.platform == _platform():
            assert row.tables_sha256 == expected.tables_sha256, row.year


def _update(path: Path, rows: list[Row], reason: str) -> None:
    """Write the file if its numbers or the platform have changed."""
    new = Golden(reason, f"{datetime.now(UTC):%Y-%m-%d}", _platform(), rows)
    old = Golden.read(path) if path.exists() else None
    if old is None or old.text().splitlines()[2:] != new.text().splitlines()[2:]:
        path.write_text(new.text())


@pytest.mark.parametrize("name", SPECIES)
def test_species_leave_nothing_to_shipped_ones(name: str) -> None:
    given = {section: set(SPECIES[name].get(section, ())) for section in SECTIONS}
    assert given == {
        section: {key for key, field in model.model_fields.items() if field.default is not None}
        for section, model in SECTIONS.items()
    }
